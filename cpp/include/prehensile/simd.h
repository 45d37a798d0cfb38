#pragma once

#include <string_view>
#include <vector>

namespace prehensile {

/// Instruction sets that the kernels are compiled for. The results are the same on each.
enum class SimdLevel {
  /// x86-64-v2 (SSE4.2) on x86-64; whatever the compiler takes for granted elsewhere.
  kBaseline,
  /// x86-64-v3 (AVX2, FMA, BMI2).
  kAvx2,
  /// x86-64-v4 (AVX-512 F, BW, CD, DQ, VL).
  kAvx512,
};

/// The levels that were compiled and that this processor can run, slowest first.
std::vector<SimdLevel> AvailableSimdLevels();

/// The last of AvailableSimdLevels(): what a kernel uses when it is not told otherwise.
SimdLevel BestSimdLevel();

/// "baseline", "avx2" or "avx512".
std::string_view Name(SimdLevel level);

/// Whether AvailableSimdLevels() contains `level`.
bool IsAvailable(SimdLevel level);

}  // namespace prehensile
