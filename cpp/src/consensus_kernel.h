#pragma once

#include <cstddef>
#include <cstdint>

namespace prehensile::internal {

/// A block of 512 points, stored so that the results of comparing 16 of them at a time become
/// 32-bit words in the order of the points: point 32 w + k of the block is at place 16 k + w.
inline constexpr int kConsensusLanes = 16;
inline constexpr int kConsensusBlock = 32 * kConsensusLanes;

/// Corresponding points in single precision: six arrays of num_blocks · kConsensusBlock numbers.
struct ConsensusPoints {
  const float* a[3];
  const float* b[3];
};

/// Compares one correspondence with a block: the difference of its distances, against bounds.
///
/// @param from x, y, z of its points a and b.
/// @param block number of the block.
/// @param sure, maybe the difference is below these; one bit per point of the block.
using ConsensusCompare = void (*)(const ConsensusPoints& points, const float from[6],
                                  std::size_t block, float sure_bound, float maybe_bound,
                                  std::uint32_t sure[kConsensusLanes],
                                  std::uint32_t maybe[kConsensusLanes]);

#define PREHENSILE_DECLARE_CONSENSUS_KERNEL(level) \
  namespace level {                                \
  extern const ConsensusCompare kConsensusCompare; \
  }
PREHENSILE_DECLARE_CONSENSUS_KERNEL(baseline)
PREHENSILE_DECLARE_CONSENSUS_KERNEL(avx2)
PREHENSILE_DECLARE_CONSENSUS_KERNEL(avx512)
#undef PREHENSILE_DECLARE_CONSENSUS_KERNEL

}  // namespace prehensile::internal
