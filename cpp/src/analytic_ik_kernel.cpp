// Angles of all branches at once, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt).

#include "analytic_ik_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

constexpr double kPi = 0x1.921fb54442d18p+1;

/// (atan(√z) / √z - 1) / z for 0 <= z <= tan²(π/8), to 3e-17 (a Chebyshev fit).
inline double AtanSeries(double z) {
  double p = -0.01917688711906226;
  p = p * z + 0.03923165829558719;
  p = p * z - 0.0508544973794026;
  p = p * z + 0.0585814891280221;
  p = p * z - 0.06664511447381948;
  p = p * z + 0.07692183190826087;
  p = p * z - 0.09090904578123903;
  p = p * z + 0.11111111015256361;
  p = p * z - 0.14285714284666542;
  p = p * z + 0.1999999999999552;
  p = p * z - 0.3333333333333333;
  return p;
}

inline double Atan2(double y, double x) {
  const double ax = __builtin_fabs(x);
  const double ay = __builtin_fabs(y);
  const double smaller = ax < ay ? ax : ay;
  double larger = ax < ay ? ay : ax;
  larger = larger > 0 ? larger : 1;
  // Above tan(π/8): atan(t) = π/4 + atan((t - 1) / (t + 1)).
  const bool steep = smaller > 0.41421356237309503 * larger;
  const double t = (steep ? smaller - larger : smaller) / (steep ? smaller + larger : larger);
  const double z = t * t;
  double angle = t + t * (z * AtanSeries(z));
  angle = steep ? kPi / 4 + angle : angle;
  angle = ay > ax ? kPi / 2 - angle : angle;
  angle = x < 0 ? kPi - angle : angle;
  return y < 0 ? -angle : angle;
}

void Compute(const double* sine, const double* cosine, const double* sign, const double* offset,
             const double* near, int num_joints, double* q) {
  constexpr double kRound = 0x1.8p52;  // Adding and taking it away rounds to a whole number.
  for (int j = 0; j < num_joints; ++j) {
    const double joint_sign = sign[j], joint_offset = offset[j], joint_near = near[j];
    const double* const s = sine + j * kLanes;
    const double* const c = cosine + j * kLanes;
    double* const out = q + j * kLanes;
#pragma GCC ivdep
    for (int k = 0; k < kLanes; ++k) {
      const double angle = joint_sign * (Atan2(s[k], c[k]) - joint_offset);
      const double turns = ((angle - joint_near) * (0.5 / kPi) + kRound) - kRound;
      out[k] = angle - turns * (2 * kPi);
    }
  }
}

}  // namespace

extern const JointAngles kJointAngles;
const JointAngles kJointAngles = &Compute;

}  // namespace prehensile::internal::PREHENSILE_SIMD
