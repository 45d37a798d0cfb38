// Parts of arms: the planar elbow, and the shoulder of most arms of six joints.

#include "analytic_ik_detail.h"

namespace prehensile {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace internal {

IkStatus PlanarElbow::Bend(double distance, Turn* bend) const {
  // Written so that NaN is too far: the squares of a pose's coordinates may be infinite.
  if (!(distance <= upper + fore + kReach)) return IkStatus::kTooFar;
  if (distance < std::abs(upper - fore) - kReach) return IkStatus::kTooNear;
  // By half the angle, which is exact to rounding at the stretched and the folded elbow, too.
  const double sum = upper + fore, difference = upper - fore;
  double c2 = (distance - difference) * (distance + difference) * scale;
  double s2 = (sum - distance) * (sum + distance) * scale;
  // Rounding of the pose must not bend a stretched elbow by its square root.
  if (c2 < kRounding) c2 = 0;
  if (s2 < kRounding) s2 = 0;
  bend->c = std::clamp(c2 - s2, -1.0, 1.0);
  bend->s = 2 * std::sqrt(c2 * s2);
  return IkStatus::kSolved;
}

Turn PlanarElbow::UpperAngle(double square, const Turn& bend) const {
  return {(square + (upper - fore) * (upper + fore)) * half_inverse_upper, fore * bend.s};
}

Turn PlanarElbow::ForeAngle(double square, const Turn& bend) const {
  return {(square - (upper - fore) * (upper + fore)) * half_inverse_fore, upper * bend.s};
}

ParallelShoulder MakeParallelShoulder(const ArmLines& lines, const Vector3d& wrist,
                                      const Vector3d& P, double tolerance) {
  RequirePerpendicular(lines, 1, 2, tolerance);
  ParallelShoulder shoulder;
  shoulder.B = FrameYZ(lines.axes[0], lines.axes[1]);
  shoulder.point = lines.points[0];
  const auto at = [&](const Vector3d& p) -> Vector3d {
    return shoulder.B.transpose() * (p - shoulder.point);
  };
  const Vector3d second = at(lines.points[1]), third = at(lines.points[2]), end = at(wrist);
  shoulder.side = at(P).z();
  shoulder.x2 = second.x();
  shoulder.y2 = second.y();
  const auto upper = (third - second).head<2>(), fore = (end - third).head<2>();
  shoulder.elbow = PlanarElbow(upper.norm(), fore.norm());
  if (shoulder.elbow.upper <= tolerance) {
    throw std::invalid_argument("lines: axes 2 and 3 are the same");
  }
  if (shoulder.elbow.fore <= tolerance) {
    throw std::invalid_argument("lines: axis 3 passes through the wrist");
  }
  shoulder.upper_angle = std::atan2(upper.y(), upper.x());
  shoulder.bend_angle = std::atan2(fore.y(), fore.x()) - shoulder.upper_angle;
  return shoulder;
}

IkStatus ParallelShoulder::Base(const Vector3d& P, double q1_free, Turn turns[2], Vector3d P_1[2],
                                int* count) const {
  const Vector3d v = B.transpose() * (P - point);
  const double square = v.x() * v.x() + v.z() * v.z();
  const double distance = std::sqrt(square);
  *count = 0;
  double ahead = 0;
  if (distance < kReach && std::abs(side) < kReach) {
    // P is on axis 1 and may be there with any turn.
    turns[0] = TurnBy(q1_free);
    turns[1] = Opposite(turns[0]);
    *count = 2;
  } else {
    if (distance < std::abs(side) - kReach) return IkStatus::kTooNear;
    const double ahead2 = (distance - std::abs(side)) * (distance + std::abs(side));
    ahead = ahead2 < kRounding * square ? 0 : std::sqrt(ahead2);
    *count = ahead == 0 ? 1 : 2;
    for (int k = 0; k < *count; ++k) {
      const double x = k == 0 ? ahead : -ahead;
      const double c = v.z() * side + v.x() * x, s = v.x() * side - v.z() * x;
      const double length = std::sqrt(c * c + s * s);
      turns[k] = {c / length, s / length};
    }
  }
  P_1[0] = {ahead, v.y(), side};
  P_1[1] = {-ahead, v.y(), side};
  return IkStatus::kSolved;
}

Turn ParallelShoulder::Upper(double x, double y, const Turn& bend, double free_angle) const {
  const double square = x * x + y * y;
  if (square < kReach * kReach) return TurnBy(free_angle);
  const auto [along, across] = elbow.UpperAngle(square, bend);
  return {along * x + across * y, along * y - across * x};
}

}  // namespace internal

}  // namespace prehensile
