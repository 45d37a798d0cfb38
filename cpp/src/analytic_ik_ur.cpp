// Arms of six joints like Universal Robots'; see UrArm.

#include "analytic_ik_detail.h"

namespace prehensile {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using internal::AngleAbout;
using internal::FrameYZ;
using internal::kElbow;
using internal::kShoulder;
using internal::kWrist;
using internal::Turn;

UrArm::UrArm(const ArmLines& lines, double tolerance) : AnalyticArm(lines, 6) {
  for (const int i : {3, 4}) {
    if (!internal::AreParallel(lines, 2, i, tolerance)) {
      throw std::invalid_argument("lines: axes 2 and " + std::to_string(i) + " are not parallel");
    }
  }
  internal::RequireWrist(lines, tolerance);
  const std::vector<Vector3d>& h = lines.axes;
  P0_ = internal::RequireMeeting(lines, 5, 6, tolerance);
  shoulder_ = internal::MakeParallelShoulder(lines, lines.points[3], P0_, tolerance);
  p_GP_ = InTool(P0_);
  R_GF6_ = InTool(FrameYZ(h[4], h[5]));
  const Vector3d y = shoulder_.B.transpose() * h[4];
  const double wrist_angle = std::atan2(-y.x(), y.y());
  const Vector3d v = shoulder_.B.transpose() * (P0_ - lines.points[3]);
  const Turn back = internal::TurnBy(-wrist_angle);
  wrist_x_ = back.c * v.x() - back.s * v.y();
  wrist_y_ = back.s * v.x() + back.c * v.y();
  wrist_length_ = std::hypot(wrist_x_, wrist_y_);
  sign_[2] = h[2].dot(h[1]) > 0 ? 1 : -1;
  sign_[3] = h[3].dot(h[1]) > 0 ? 1 : -1;
  offset_[1] = shoulder_.upper_angle;
  offset_[2] = shoulder_.bend_angle;
  offset_[3] = wrist_angle - shoulder_.upper_angle - shoulder_.bend_angle;
  offset_[4] = AngleAbout(h[4], h[1], h[5]);
}

void UrArm::Solve(const double* X_WG, const IkOptions& options, IkSolutions* out) const {
  Matrix3d R;
  Vector3d p;
  internal::ReadPose(X_WG, &R, &p);
  Pattern pattern;
  Turn turns[2];
  Vector3d P_1[2];
  int bases = 0;
  const auto free = [&](int joint) { return FreeAngle(joint, options); };
  pattern.failure = shoulder_.Base(p + R * p_GP_, free(0), turns, P_1, &bases);
  const Matrix3d K = shoulder_.B.transpose() * (R * R_GF6_);
  for (int base = 0; base < bases; ++base) {
    const Matrix3d Z = internal::BackAboutY(turns[base], K);
    internal::Zyz zyz = internal::SolveZyzLast(Z, [&] { return free(5); });
    const double x = P_1[base].x() - shoulder_.x2, y = P_1[base].y() - shoulder_.y2;
    for (const int wrist : {0, kWrist}) {
      if (wrist != 0 && zyz.singular) continue;
      Turn first = wrist == 0 ? zyz.first : Opposite(zyz.first);
      Turn last = wrist == 0 ? zyz.last : Opposite(zyz.last);
      const auto fore_end = [&] {
        return Eigen::Vector2d(x - (first.c * wrist_x_ - first.s * wrist_y_),
                               y - (first.s * wrist_x_ + first.c * wrist_y_));
      };
      Eigen::Vector2d end = fore_end();
      Turn bend;
      IkStatus status = shoulder_.elbow.Bend(end.norm(), &bend);
      if (status != IkStatus::kSolved && zyz.singular && wrist_length_ > internal::kReach) {
        // Axes 4 and 6 are parallel: joint 6 is free, so take the nearest turn at which axis 4 is
        // within reach.
        const double reach = status == IkStatus::kTooFar
                                 ? shoulder_.elbow.upper + shoulder_.elbow.fore
                                 : std::abs(shoulder_.elbow.upper - shoulder_.elbow.fore);
        const double distance = std::hypot(x, y);
        if (distance > internal::kReach) {
          const double c = (distance * distance + wrist_length_ * wrist_length_ - reach * reach) /
                           (2 * distance * wrist_length_);
          const double middle = std::atan2(y, x) - std::atan2(wrist_y_, wrist_x_);
          const double now = std::atan2(first.s, first.c);
          const double side = std::sin(now - middle) < 0 ? -1 : 1;
          first = internal::TurnBy(middle + side * std::acos(std::clamp(c, -1.0, 1.0)));
          last = internal::LastFromFirst(Z, first);
          end = fore_end();
          status = shoulder_.elbow.Bend(end.norm(), &bend);
        }
      }
      if (status != IkStatus::kSolved) {
        pattern.failure = status;
        continue;
      }
      for (const int elbow : {0, kElbow}) {
        if (elbow != 0 && bend.s == 0) continue;
        const Turn theta3 = elbow == 0 ? bend : -bend;
        const Turn theta2 = shoulder_.Upper(end.x(), end.y(), theta3, free(1));
        const int lane = (base == 0 ? 0 : kShoulder) | elbow | wrist;
        pattern.Set(0, lane, turns[base]);
        pattern.Set(1, lane, theta2);
        pattern.Set(2, lane, theta3);
        pattern.Set(3, lane, first - theta2 - theta3);
        pattern.Set(4, lane, wrist == 0 ? zyz.middle : -zyz.middle);
        pattern.Set(5, lane, last);
        pattern.valid[lane] = true;
      }
    }
  }
  Finish(pattern, options, out);
}

void UrArm::SolveBatch(const IkBatch& batch) const {
  internal::RunBatch(batch, n_, [&](std::size_t i, const IkOptions& options, IkSolutions* out) {
    Solve(batch.X_WG + 16 * i, options, out);
  });
}

int UrArm::Branch(const double* q) const {
  const double rest[6] = {0, q[1], q[2], q[3], q[4], q[5]};
  const Vector3d P = MovePoint(rest, 6, P0_);
  const bool behind = shoulder_.B.col(0).dot(P - shoulder_.point) < 0;
  return (behind ? kShoulder : 0) |
         (internal::IsNegative(sign_[2], offset_[2], q[2]) ? kElbow : 0) |
         (internal::IsNegative(1, offset_[4], q[4]) ? kWrist : 0);
}

}  // namespace prehensile
