#include "kinematics_lanes.h"

#include <algorithm>

#include "prehensile/simd.h"
#include "sincos.h"

namespace prehensile::internal {

const KinematicsKernel& BestKinematicsKernel() {
#ifdef __x86_64__
  const SimdLevel level = BestSimdLevel();
  if (level == SimdLevel::kAvx512) return avx512::kKinematics;
  if (level == SimdLevel::kAvx2) return avx2::kKinematics;
#endif
  return baseline::kKinematics;
}

void LaneRoom::Walk(const ChainView& chain, const double* Q, int n, int count, bool with_columns) {
  for (int i = 0; i < chain.num_steps; ++i) {
    const ChainStep& step = chain.steps[i];
    for (int lane = 0; lane < kLanes; ++lane) {
      const double x = Q[n * std::min(lane, count - 1) + step.joint];
      q[i][lane] = step.prismatic ? x : WithinRange(x);
    }
  }
  BestKinematicsKernel().walk(chain, q[0], R[0], p[0], with_columns ? columns[0][0] : nullptr);
}

void LaneRoom::Pose(int lane, double* X_WF) const {
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) X_WF[4 * k + j] = R[3 * k + j][lane];
    X_WF[4 * k + 3] = p[k][lane];
    X_WF[12 + k] = 0;
  }
  X_WF[15] = 1;
}

}  // namespace prehensile::internal
