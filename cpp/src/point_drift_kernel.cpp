// The inner loops of coherent point drift, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt). Sums run in sixteen lanes at every level, so that all levels round alike;
// narrower registers take the lanes in turns.

#include "point_drift_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

#if defined(__AVX512F__)
constexpr int kWidth = 16;
#elif defined(__AVX2__)
constexpr int kWidth = 8;
#else
constexpr int kWidth = 4;
#endif
using Floats = float __attribute__((vector_size(4 * kWidth)));
using Ints = std::int32_t __attribute__((vector_size(4 * kWidth)));

[[gnu::always_inline]] inline Floats Load(const float* values) {
  Floats lanes;
  __builtin_memcpy(&lanes, values, sizeof(lanes));
  return lanes;
}

/// 2^t for t ≤ 0 to about 1e-7 of it; 0 below 2^-126.
[[gnu::always_inline]] inline Floats Exp2(Floats t) {
  // Adding 1.5 · 2²³ rounds to the nearest integer, which then stands in the lowest bits.
  constexpr float kRound = 12582912.0f;
  const Ints nonzero = t > -126.0f;
  t = nonzero ? t : Floats{} - 126.0f;
  const Floats rounded = t + kRound;
  const Floats f = t - (rounded - kRound);
  // Interpolates 2^f at Chebyshev's points of [-1/2, 1/2].
  Floats p = f * 0.00015461444854736328f + 0.0013400427997112274f;
  p = p * f + 0.009618056938052177f;
  p = p * f + 0.05550327152013779f;
  p = p * f + 0.24022650718688965f;
  p = p * f + 0.6931471824645996f;
  p = p * f + 1.0f;
  return (Floats)(((Ints)p + ((Ints)rounded << 23)) & nonzero);
}

[[gnu::always_inline]] inline double Total(const float* lanes) {
  double total = 0;
  for (int k = 0; k < kDriftLanes; ++k) total += lanes[k];
  return total;
}

void Sums(const float* query, const DriftBlock* blocks, const std::int32_t* numbers, int count,
          float rate, float shift, double* sums) {
  const Floats qx = Floats{} + query[0], qy = Floats{} + query[1], qz = Floats{} + query[2];
  float lanes[5][kDriftLanes];
  for (int lane = 0; lane < kDriftLanes; lane += kWidth) {
    Floats sum{}, sum_x{}, sum_y{}, sum_z{}, sum_squares{};
    for (int b = 0; b < count; ++b) {
      const DriftBlock& block = blocks[numbers[b]];
      const Floats x = Load(block.x + lane) - qx, y = Load(block.y + lane) - qy,
                   z = Load(block.z + lane) - qz;
      const Floats squared = x * x + y * y + z * z;
      const Floats k = Exp2((shift - squared) * rate);
      sum += k;
      sum_x += k * x;
      sum_y += k * y;
      sum_z += k * z;
      sum_squares += k * squared;
    }
    const Floats all[] = {sum, sum_x, sum_y, sum_z, sum_squares};
    for (int s = 0; s < 5; ++s) __builtin_memcpy(&lanes[s][lane], &all[s], sizeof(Floats));
  }
  for (int s = 0; s < 5; ++s) sums[s] = Total(lanes[s]);
}

float Nearest(const float* query, const DriftBlock* blocks, int count) {
  const Floats qx = Floats{} + query[0], qy = Floats{} + query[1], qz = Floats{} + query[2];
  float nearest = 3e38f;
  for (int lane = 0; lane < kDriftLanes; lane += kWidth) {
    Floats least = Floats{} + 3e38f;
    for (int b = 0; b < count; ++b) {
      const Floats x = Load(blocks[b].x + lane) - qx, y = Load(blocks[b].y + lane) - qy,
                   z = Load(blocks[b].z + lane) - qz;
      const Floats squared = x * x + y * y + z * z;
      least = squared < least ? squared : least;
    }
    for (int k = 0; k < kWidth; ++k) nearest = least[k] < nearest ? least[k] : nearest;
  }
  return nearest;
}

}  // namespace

extern const DriftKernel kDrift{Sums, Nearest};

}  // namespace prehensile::internal::PREHENSILE_SIMD
