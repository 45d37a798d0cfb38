#pragma once

#include <cstddef>
#include <cstdint>

namespace prehensile::internal {

inline constexpr int kFeatureSize = 33;
/// Features lie side by side in blocks of so many: number k of all of them, then number k + 1.
inline constexpr int kFeatureBlock = 16;

/// Looks for the nearest and the second nearest of some blocks of features to each of n features,
/// given row by row. What the arrays hold already counts, too (at the start -1 and infinity).
///
/// @param first number of the first feature of the blocks.
using NearestFeaturesKernel = void (*)(const float* queries, std::size_t n, const float* blocks,
                                       std::size_t num_blocks, std::int32_t first,
                                       std::int32_t* nearest, float* squared_distances,
                                       float* second_squared_distances);

#define PREHENSILE_DECLARE_FEATURES_KERNEL(level)      \
  namespace level {                                    \
  extern const NearestFeaturesKernel kNearestFeatures; \
  }
PREHENSILE_DECLARE_FEATURES_KERNEL(baseline)
PREHENSILE_DECLARE_FEATURES_KERNEL(avx2)
PREHENSILE_DECLARE_FEATURES_KERNEL(avx512)
#undef PREHENSILE_DECLARE_FEATURES_KERNEL

}  // namespace prehensile::internal
