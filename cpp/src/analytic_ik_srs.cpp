// Arms of seven joints with a spherical shoulder and a spherical wrist: all solutions with one arm
// angle; see SrsArm.

#include "analytic_ik_srs.h"

namespace prehensile {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using internal::AngleAbout;
using internal::FrameYZ;
using internal::kElbow;
using internal::kShoulder;
using internal::kWrist;
using internal::Turn;

SrsArm::SrsArm(const ArmLines& lines, double tolerance) : AnalyticArm(lines, 7) {
  for (const int i : {1, 2, 5, 6}) internal::RequirePerpendicular(lines, i, i + 1, tolerance);
  S_ = internal::RequireMeeting(lines, 1, 2, tolerance);
  internal::RequireThrough(lines, 3, S_, "the point where axes 1 and 2 meet", tolerance);
  const Vector3d W = internal::RequireMeeting(lines, 5, 6, tolerance);
  internal::RequireThrough(lines, 7, W, "the point where axes 5 and 6 meet", tolerance);
  const std::vector<Vector3d>& h = lines.axes;
  const double off = std::abs(h[3].dot(W - S_));
  if (off > tolerance) {
    throw std::invalid_argument(
        "lines: axis 4 is not perpendicular to a plane through shoulder and wrist (off by " +
        std::to_string(off) + " m)");
  }
  const Vector3d upper = lines.points[3] + h[3] * h[3].dot(S_ - lines.points[3]) - S_;
  Vector3d fore = W - S_ - upper;
  fore -= h[3] * h[3].dot(fore);
  if (upper.norm() <= tolerance || fore.norm() <= tolerance) {
    throw std::invalid_argument("lines: axis 4 passes through the shoulder or the wrist");
  }
  elbow_ = internal::PlanarElbow(upper.norm(), fore.norm());
  p_GW_ = InTool(W);
  F1_ = FrameYZ(h[1], h[0]);
  R_GF7_ = InTool(FrameYZ(h[5], h[6]));
  const auto link_frame = [&](const Vector3d& along) {
    Matrix3d frame;
    frame.col(2) = h[3];
    frame.col(0) = along.normalized();
    frame.col(1) = h[3].cross(frame.col(0));
    return frame;
  };
  U0tF3_ = link_frame(upper).transpose() * FrameYZ(h[1], h[2]);
  F5tL0_ = FrameYZ(h[5], h[4]).transpose() * link_frame(fore);
  offset_[1] = AngleAbout(h[1], h[0], h[2]);
  offset_[3] = AngleAbout(h[3], upper, fore);
  offset_[5] = AngleAbout(h[5], h[4], h[6]);
}

void SrsArm::Reference(const Vector3d& d, Matrix3d* D0) const {
  Vector3d x = F1_.col(2) - d * d.dot(F1_.col(2));
  double length = x.norm();
  if (length < 1e-9) {
    x = F1_.col(0) - d * d.dot(F1_.col(0));
    length = x.norm();
  }
  x /= length;
  x -= d * d.dot(x);  // Once more, for the digits that were lost where x was short.
  D0->col(0) = d;
  D0->col(1) = x.normalized();
  D0->col(2) = d.cross(D0->col(1));
}

IkStatus SrsArm::Prepare(const double* X_WG, Target* target) const {
  Matrix3d R;
  Vector3d p;
  internal::ReadPose(X_WG, &R, &p);
  const Vector3d v = p + R * p_GW_ - S_;
  const double D = v.norm();
  // Where the wrist is in the shoulder there is no arm angle.
  if (D < 1e-9) return IkStatus::kTooNear;
  const IkStatus status = elbow_.Bend(D, &target->bend);
  if (status != IkStatus::kSolved) return status;
  target->at_shoulder = internal::Normalized(elbow_.UpperAngle(D * D, target->bend));
  target->at_wrist = internal::Normalized(elbow_.ForeAngle(D * D, target->bend));
  Reference(v / D, &target->D0);
  target->R_7 = R * R_GF7_;
  return IkStatus::kSolved;
}

void SrsArm::Fill(const Target& target, double psi, const IkOptions& options,
                  Pattern* pattern) const {
  const Turn turn = internal::TurnBy(psi);
  Matrix3d D;
  D.col(0) = target.D0.col(0);
  D.col(1) = turn.c * target.D0.col(1) + turn.s * target.D0.col(2);
  D.col(2) = turn.c * target.D0.col(2) - turn.s * target.D0.col(1);
  const Matrix3d G_shoulder = F1_.transpose() * D;
  const Matrix3d G_wrist = D.transpose() * target.R_7;
  for (const int elbow : {0, kElbow}) {
    const double sign = elbow == 0 ? 1 : -1;
    const Matrix3d Z_s = G_shoulder * (target.UpperArm(sign) * U0tF3_);
    const Matrix3d Z_w = F5tL0_ * (target.Forearm(sign).transpose() * G_wrist);
    const auto shoulder = internal::SolveZyzFirst(Z_s, [&] { return FreeAngle(0, options); });
    const auto wrist = internal::SolveZyzFirst(Z_w, [&] { return FreeAngle(4, options); });
    const auto fill = [&](const internal::Zyz& zyz, int first, int lane, bool other) {
      pattern->Set(first, lane, other ? Opposite(zyz.first) : zyz.first);
      pattern->Set(first + 1, lane, other ? -zyz.middle : zyz.middle);
      pattern->Set(first + 2, lane, other ? Opposite(zyz.last) : zyz.last);
    };
    for (const int other_shoulder : {0, kShoulder}) {
      if (other_shoulder != 0 && shoulder.singular) continue;
      for (const int other_wrist : {0, kWrist}) {
        if (other_wrist != 0 && wrist.singular) continue;
        const int lane = elbow | other_shoulder | other_wrist;
        fill(shoulder, 0, lane, other_shoulder != 0);
        fill(wrist, 4, lane, other_wrist != 0);
        pattern->Set(3, lane, {target.bend.c, sign * target.bend.s});
        pattern->valid[lane] = true;
      }
    }
  }
}

void SrsArm::Solve(const double* X_WG, double psi, const IkOptions& options,
                   IkSolutions* out) const {
  if (!std::isfinite(psi)) throw std::invalid_argument("psi: not finite");
  Target target;
  Pattern pattern;
  pattern.failure = Prepare(X_WG, &target);
  if (pattern.failure == IkStatus::kSolved) Fill(target, psi, options, &pattern);
  Finish(pattern, options, out);
}

void SrsArm::SolveBatch(const IkBatch& batch, const double* psi) const {
  internal::RunBatch(batch, n_, [&](std::size_t i, const IkOptions& options, IkSolutions* out) {
    Solve(batch.X_WG + 16 * i, psi[i], options, out);
  });
}

double SrsArm::ArmAngle(const double* q, int* branch) const {
  const auto negative = [&](int joint) { return std::sin(q[joint] + offset_[joint]) < 0; };
  *branch = (negative(1) ? kShoulder : 0) | (negative(3) ? kElbow : 0) | (negative(5) ? kWrist : 0);
  const Vector3d W =
      MovePoint(q, 4, lines_.X_WG0.topLeftCorner<3, 3>() * p_GW_ + lines_.X_WG0.col(3).head<3>());
  Matrix3d D0;
  Reference((W - S_).normalized(), &D0);
  const Vector3d across = (negative(3) ? 1 : -1) * MoveDirection(q, 3, lines_.axes[3]);
  const Vector3d e = across.cross(D0.col(0));
  return std::atan2(e.dot(D0.col(2)), e.dot(D0.col(1)));
}

}  // namespace prehensile
