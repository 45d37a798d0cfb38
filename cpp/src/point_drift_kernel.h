#pragma once

#include <cstdint>

namespace prehensile::internal {

/// Points per block: the lanes of the sums at every SIMD level.
inline constexpr int kDriftLanes = 16;

/// Sixteen points, coordinate by coordinate; those that fill up the last block lie far away.
struct alignas(64) DriftBlock {
  float x[kDriftLanes], y[kDriftLanes], z[kDriftLanes];
};

struct DriftKernel {
  /// Sums over the points of the blocks with the given numbers, d = point - query and
  /// k = 2^(-(|d|² - shift) rate): k, k d, k |d|². Below 2^-126, k is 0.
  void (*sums)(const float* query, const DriftBlock* blocks, const std::int32_t* numbers, int count,
               float rate, float shift, double* sums);
  /// The least |d|² over all of so many blocks.
  float (*nearest)(const float* query, const DriftBlock* blocks, int count);
};

#define PREHENSILE_DECLARE_DRIFT_KERNEL(level) \
  namespace level {                            \
  extern const DriftKernel kDrift;             \
  }
PREHENSILE_DECLARE_DRIFT_KERNEL(baseline)
PREHENSILE_DECLARE_DRIFT_KERNEL(avx2)
PREHENSILE_DECLARE_DRIFT_KERNEL(avx512)
#undef PREHENSILE_DECLARE_DRIFT_KERNEL

}  // namespace prehensile::internal
