// The inner loops of matching features, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt); every level adds in the same order.

#include "features_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

using Floats = float __attribute__((vector_size(4 * kFeatureBlock)));
using Ints = std::int32_t __attribute__((vector_size(4 * kFeatureBlock)));

/// Number k of the features of a block. (Not a function that returns a vector: how that is done
/// depends on the level.)
struct Row {
  explicit Row(const float* from) { __builtin_memcpy(&values, from, sizeof(values)); }
  Floats values;
};

void Nearest(const float* queries, std::size_t n, const float* blocks, std::size_t num_blocks,
             std::int32_t first, std::int32_t* nearest, float* squared_distances,
             float* second_squared_distances) {
  Ints lane;
  for (int j = 0; j < kFeatureBlock; ++j) lane[j] = j;
  for (std::size_t i = 0; i < n; ++i) {
    const float* const query = queries + kFeatureSize * i;
    Floats best = Floats{} + __builtin_inff();
    Floats second = best;
    Ints where = lane * 0 - 1;
    for (std::size_t b = 0; b < num_blocks; ++b) {
      const float* const block = blocks + b * kFeatureSize * kFeatureBlock;
      Floats even{}, odd{};  // Two sums, so that one addition need not wait for the other.
      for (int k = 0; k + 1 < kFeatureSize; k += 2) {
        const Floats x = Row(block + k * kFeatureBlock).values - query[k];
        const Floats y = Row(block + (k + 1) * kFeatureBlock).values - query[k + 1];
        even += x * x;
        odd += y * y;
      }
      const Floats z =
          Row(block + (kFeatureSize - 1) * kFeatureBlock).values - query[kFeatureSize - 1];
      const Floats distance = even + odd + z * z;
      const Ints closer = distance < best;
      const Floats runner_up = closer ? best : distance;
      second = runner_up < second ? runner_up : second;
      best = closer ? distance : best;
      where = closer ? lane + (first + static_cast<std::int32_t>(b) * kFeatureBlock) : where;
    }
    for (int j = 0; j < kFeatureBlock; ++j) {
      const bool closer =
          best[j] < squared_distances[i] ||
          (best[j] == squared_distances[i] && where[j] >= 0 && where[j] < nearest[i]);
      const float runner_up = closer ? squared_distances[i] : best[j];
      if (runner_up < second_squared_distances[i]) second_squared_distances[i] = runner_up;
      if (second[j] < second_squared_distances[i]) second_squared_distances[i] = second[j];
      if (closer) {
        squared_distances[i] = best[j];
        nearest[i] = where[j];
      }
    }
  }
}

}  // namespace

extern const NearestFeaturesKernel kNearestFeatures = Nearest;

}  // namespace prehensile::internal::PREHENSILE_SIMD
