// The inner loop of the consistency graph, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt).

#include "consensus_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

void Compare(const ConsensusPoints& points, const float from[6], std::size_t block,
             float sure_bound, float maybe_bound, std::uint32_t sure[kConsensusLanes],
             std::uint32_t maybe[kConsensusLanes]) {
  const std::size_t begin = block * kConsensusBlock;
  const float *const ax = points.a[0] + begin, *const ay = points.a[1] + begin,
                     *const az = points.a[2] + begin;
  const float *const bx = points.b[0] + begin, *const by = points.b[1] + begin,
                     *const bz = points.b[2] + begin;
  float difference[kConsensusBlock];
  for (int i = 0; i < kConsensusBlock; ++i) {
    const float ux = ax[i] - from[0], uy = ay[i] - from[1], uz = az[i] - from[2];
    const float vx = bx[i] - from[3], vy = by[i] - from[4], vz = bz[i] - from[5];
    const float u = __builtin_sqrtf(ux * ux + uy * uy + uz * uz);
    const float v = __builtin_sqrtf(vx * vx + vy * vy + vz * vz);
    difference[i] = __builtin_fabsf(v - u);
  }
  using Words = std::uint32_t __attribute__((vector_size(4 * kConsensusLanes)));
  using Floats = float __attribute__((vector_size(4 * kConsensusLanes)));
  Words sure_words{}, maybe_words{};
  for (int k = 0; k < 32; ++k) {
    Floats d;
    __builtin_memcpy(&d, difference + k * kConsensusLanes, sizeof(d));
    const Words bit = Words{} + (std::uint32_t{1} << k);
    sure_words |= reinterpret_cast<Words>(d <= sure_bound) & bit;
    maybe_words |= reinterpret_cast<Words>(d <= maybe_bound) & bit;
  }
  __builtin_memcpy(sure, &sure_words, sizeof(sure_words));
  __builtin_memcpy(maybe, &maybe_words, sizeof(maybe_words));
}

}  // namespace

extern const ConsensusCompare kConsensusCompare = Compare;

}  // namespace prehensile::internal::PREHENSILE_SIMD
