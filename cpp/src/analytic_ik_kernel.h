#pragma once

namespace prehensile::internal {

/// Lanes per joint: one for each branch.
inline constexpr int kLanes = 8;

/// Joint angles of kLanes branches: q = sign (atan2(sine, cosine) - offset), brought by whole turns
/// to within half a turn of `near`. Arrays are [num_joints][kLanes], the others [num_joints].
/// atan2(0, 0) counts as 0.
using JointAngles = void (*)(const double* sine, const double* cosine, const double* sign,
                             const double* offset, const double* near, int num_joints, double* q);

#define PREHENSILE_DECLARE_ANALYTIC_IK_KERNEL(level) \
  namespace level {                                  \
  extern const JointAngles kJointAngles;             \
  }
PREHENSILE_DECLARE_ANALYTIC_IK_KERNEL(baseline)
PREHENSILE_DECLARE_ANALYTIC_IK_KERNEL(avx2)
PREHENSILE_DECLARE_ANALYTIC_IK_KERNEL(avx512)
#undef PREHENSILE_DECLARE_ANALYTIC_IK_KERNEL

}  // namespace prehensile::internal
