#include "prehensile/simd.h"

#include <algorithm>

namespace prehensile {

std::vector<SimdLevel> AvailableSimdLevels() {
  std::vector<SimdLevel> levels{SimdLevel::kBaseline};
#ifdef __x86_64__
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                    __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  if (avx2) levels.push_back(SimdLevel::kAvx2);
  const bool avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                      __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
                      __builtin_cpu_supports("avx512vl");
  if (avx2 && avx512) levels.push_back(SimdLevel::kAvx512);
#endif
  return levels;
}

SimdLevel BestSimdLevel() {
  static const SimdLevel best = AvailableSimdLevels().back();
  return best;
}

std::string_view Name(SimdLevel level) {
  switch (level) {
    case SimdLevel::kBaseline:
      return "baseline";
    case SimdLevel::kAvx2:
      return "avx2";
    case SimdLevel::kAvx512:
      return "avx512";
  }
  return "unknown";
}

bool IsAvailable(SimdLevel level) {
  const std::vector<SimdLevel> levels = AvailableSimdLevels();
  return std::find(levels.begin(), levels.end(), level) != levels.end();
}

}  // namespace prehensile
