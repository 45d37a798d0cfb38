// Arms of six joints with a spherical wrist; see PieperArm.

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

namespace {

/// Rz(turn)ᵀ M.
Matrix3d BackAboutZ(const Turn& turn, const Matrix3d& M) {
  Matrix3d out;
  out.row(0) = turn.c * M.row(0) + turn.s * M.row(1);
  out.row(1) = turn.c * M.row(1) - turn.s * M.row(0);
  out.row(2) = M.row(2);
  return out;
}

Vector3d RotatedAbout(const Vector3d& h, const Turn& turn, const Vector3d& v) {
  return turn.c * v + turn.s * h.cross(v) + (1 - turn.c) * h.dot(v) * h;
}

/// The turn about h from a to b; nothing if one of them is along h.
bool TurnFromTo(const Vector3d& h, const Vector3d& a, const Vector3d& b, Turn* turn) {
  const double c = a.dot(b) - a.dot(h) * b.dot(h);
  const double s = h.dot(a.cross(b));
  const double length = std::hypot(c, s);  // The square of their distance from h.
  if (length < internal::kSingular * internal::kSingular) return false;
  *turn = {c / length, s / length};
  return true;
}

}  // namespace

PieperArm::PieperArm(const ArmLines& lines, double tolerance) : AnalyticArm(lines, 6) {
  internal::RequireWrist(lines, tolerance);
  const std::vector<Vector3d>& h = lines.axes;
  P0_ = internal::RequireMeeting(lines, 5, 6, tolerance);
  internal::RequireThrough(lines, 4, P0_, "the point where axes 5 and 6 meet", tolerance);
  p_GP_ = InTool(P0_);
  R_GF6_ = InTool(FrameYZ(h[4], h[5]));
  F4t_ = FrameYZ(h[4], h[3]).transpose();
  offset_[4] = AngleAbout(h[4], h[3], h[5]);
  parallel_ =
      internal::AreParallel(lines, 2, 3, tolerance) && std::abs(h[0].dot(h[1])) <= tolerance;
  if (parallel_) {
    shoulder_ = internal::MakeParallelShoulder(lines, P0_, P0_, tolerance);
    sign_[2] = h[2].dot(h[1]) > 0 ? 1 : -1;
    offset_[1] = shoulder_.upper_angle;
    offset_[2] = shoulder_.bend_angle;
    const Turn turn = internal::TurnBy(shoulder_.upper_angle + shoulder_.bend_angle);
    // Joints 2 and 3 have turned the forearm by their pattern angles less those at q = 0.
    F4t_ *= shoulder_.B * Matrix3d{{turn.c, -turn.s, 0}, {turn.s, turn.c, 0}, {0, 0, 1}};
    return;
  }
  meeting_.point = internal::RequireMeeting(lines, 1, 2, tolerance);
  meeting_.h1 = h[0];
  meeting_.h2 = h[1];
  meeting_.h3 = h[2];
  const Vector3d r = P0_ - lines.points[2];
  meeting_.along = r - h[2] * h[2].dot(r);
  meeting_.across = h[2].cross(r);
  meeting_.height = P0_ - meeting_.along - meeting_.point;
  meeting_.constant = meeting_.height.squaredNorm() + meeting_.along.squaredNorm();
  meeting_.cosine = 2 * meeting_.height.dot(meeting_.along);
  meeting_.sine = 2 * meeting_.height.dot(meeting_.across);
  if (std::hypot(meeting_.cosine, meeting_.sine) <= tolerance) {
    throw std::invalid_argument("lines: joint 3 does not change the distance of the wrist");
  }
  offset_[2] = -std::atan2(meeting_.sine, meeting_.cosine);
}

void PieperArm::Solve(const double* X_WG, const IkOptions& options, IkSolutions* out) const {
  Matrix3d R;
  Vector3d p;
  internal::ReadPose(X_WG, &R, &p);
  Pattern pattern;
  const Vector3d P = p + R * p_GP_;
  const Matrix3d R_6 = R * R_GF6_;
  if (parallel_) {
    SolveParallel(P, R_6, options, &pattern);
  } else {
    SolveMeeting(P, R_6, options, &pattern);
  }
  Finish(pattern, options, out);
}

void PieperArm::SetWrist(const Matrix3d& Z, const IkOptions& options, const Turn (&theta)[3],
                         int lane, Pattern* pattern) const {
  const auto zyz = internal::SolveZyzFirst(Z, [&] { return FreeAngle(3, options); });
  for (const int wrist : {0, kWrist}) {
    if (wrist != 0 && zyz.singular) continue;
    for (int j = 0; j < 3; ++j) pattern->Set(j, lane | wrist, theta[j]);
    pattern->Set(3, lane | wrist, wrist == 0 ? zyz.first : Opposite(zyz.first));
    pattern->Set(4, lane | wrist, wrist == 0 ? zyz.middle : -zyz.middle);
    pattern->Set(5, lane | wrist, wrist == 0 ? zyz.last : Opposite(zyz.last));
    pattern->valid[lane | wrist] = true;
  }
}

void PieperArm::SolveParallel(const Vector3d& P, const Matrix3d& R_6, const IkOptions& options,
                              Pattern* pattern) const {
  Turn turns[2];
  Vector3d P_1[2];
  int bases = 0;
  pattern->failure = shoulder_.Base(P, FreeAngle(0, options), turns, P_1, &bases);
  const Matrix3d K = shoulder_.B.transpose() * R_6;
  for (int base = 0; base < bases; ++base) {
    const double x = P_1[base].x() - shoulder_.x2, y = P_1[base].y() - shoulder_.y2;
    Turn bend;
    const IkStatus status = shoulder_.elbow.Bend(std::sqrt(x * x + y * y), &bend);
    if (status != IkStatus::kSolved) {
      pattern->failure = status;
      continue;
    }
    const Matrix3d K_1 = internal::BackAboutY(turns[base], K);
    for (const int elbow : {0, kElbow}) {
      if (elbow != 0 && bend.s == 0) continue;
      const Turn theta3 = elbow == 0 ? bend : -bend;
      const Turn theta2 =
          internal::Normalized(shoulder_.Upper(x, y, theta3, FreeAngle(1, options)));
      const Matrix3d Z = F4t_ * BackAboutZ(theta2 + theta3, K_1);
      SetWrist(Z, options, {turns[base], theta2, theta3}, (base == 0 ? 0 : kShoulder) | elbow,
               pattern);
    }
  }
}

void PieperArm::SolveMeeting(const Vector3d& P, const Matrix3d& R_6, const IkOptions& options,
                             Pattern* pattern) const {
  const auto& [point, h1, h2, h3, constant, cosine, sine, along, across, height] = meeting_;
  const Vector3d v = P - point;
  const double amplitude = std::hypot(cosine, sine);
  const double bend = (v.squaredNorm() - constant) / amplitude;
  const double slack = 2 * v.norm() * internal::kReach / amplitude;
  if (!(std::abs(bend) - slack <= 1)) {
    pattern->failure = bend > 0 ? IkStatus::kTooFar : IkStatus::kTooNear;
    return;
  }
  const double c = std::clamp(bend, -1.0, 1.0);
  const double s = std::sqrt((1 - c) * (1 + c));
  const Vector3d normal = h1.cross(h2);
  const double k = h1.dot(h2), square = normal.squaredNorm();
  pattern->failure = IkStatus::kTooNear;
  for (const int elbow : {0, kElbow}) {
    if (elbow != 0 && s == 0) continue;
    const Turn theta3{c, elbow == 0 ? s : -s};
    const Turn q3 = theta3 - internal::TurnBy(offset_[2]);
    // P, from where axes 1 and 2 meet: with joint 3 turned; then also with joint 2, where it has
    // the component along axis 2 that it had before and along axis 1 the one it has in the end.
    const Vector3d a = height + along * q3.c + across * q3.s;
    const double on1 = h1.dot(v), on2 = h2.dot(a);
    const Vector3d in_plane = (h1 * (on1 - k * on2) + h2 * (on2 - k * on1)) / square;
    const double off = (v.squaredNorm() - in_plane.squaredNorm()) / square;
    if (off * square < -internal::kReach * std::max(1.0, v.norm())) continue;
    const double height_off = std::sqrt(std::max(0.0, off));
    for (const int shoulder : {0, kShoulder}) {
      if (shoulder != 0 && height_off == 0) continue;
      const Vector3d turned = in_plane + (shoulder == 0 ? height_off : -height_off) * normal;
      Turn q1, q2;
      if (!TurnFromTo(h2, a, turned, &q2)) q2 = internal::TurnBy(FreeAngle(1, options));
      if (!TurnFromTo(h1, turned, v, &q1)) q1 = internal::TurnBy(FreeAngle(0, options));
      Matrix3d R_3;
      for (int i = 0; i < 3; ++i) {
        R_3.col(i) =
            RotatedAbout(h3, -q3, RotatedAbout(h2, -q2, RotatedAbout(h1, -q1, R_6.col(i))));
      }
      SetWrist(F4t_ * R_3, options, {q1, q2, theta3}, elbow | shoulder, pattern);
    }
  }
}

void PieperArm::SolveBatch(const IkBatch& batch) const {
  internal::RunBatch(batch, n_, [&](std::size_t i, const IkOptions& options, IkSolutions* out) {
    Solve(batch.X_WG + 16 * i, options, out);
  });
}

int PieperArm::Branch(const double* q) const {
  const double rest[3] = {0, q[1], q[2]};
  const Vector3d P = MovePoint(rest, 3, P0_);
  const double ahead = parallel_ ? shoulder_.B.col(0).dot(P - shoulder_.point)
                                 : meeting_.h1.cross(meeting_.h2).dot(P - meeting_.point);
  return (ahead < 0 ? kShoulder : 0) |
         (internal::IsNegative(sign_[2], offset_[2], q[2]) ? kElbow : 0) |
         (internal::IsNegative(1, offset_[4], q[4]) ? kWrist : 0);
}

}  // namespace prehensile
