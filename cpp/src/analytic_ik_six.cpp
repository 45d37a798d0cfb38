// Arms of six joints; see UrArm and PieperArm.

#include <numbers>

#include "analytic_ik_detail.h"

namespace prehensile {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using internal::AngleAbout;
using internal::FrameYZ;
using internal::Turn;

namespace {

constexpr int kShoulder = 4, kElbow = 2, kWrist = 1;

/// Rz(turn)ᵀ M.
Matrix3d BackAboutZ(const Turn& turn, const Matrix3d& M) {
  Matrix3d out;
  out.row(0) = turn.c * M.row(0) + turn.s * M.row(1);
  out.row(1) = turn.c * M.row(1) - turn.s * M.row(0);
  out.row(2) = M.row(2);
  return out;
}

/// Ry(turn)ᵀ M.
Matrix3d BackAboutY(const Turn& turn, const Matrix3d& M) {
  Matrix3d out;
  out.row(0) = turn.c * M.row(0) - turn.s * M.row(2);
  out.row(1) = M.row(1);
  out.row(2) = turn.s * M.row(0) + turn.c * M.row(2);
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

bool IsNegative(double sign, double offset, double q) { return std::sin(sign * q + offset) < 0; }

void RequireWrist(const ArmLines& lines, double tolerance) {
  internal::RequirePerpendicular(lines, 4, 5, tolerance);
  internal::RequirePerpendicular(lines, 5, 6, tolerance);
}

}  // namespace

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

UrArm::UrArm(const ArmLines& lines, double tolerance) : AnalyticArm(lines, 6) {
  for (const int i : {3, 4}) {
    if (!internal::AreParallel(lines, 2, i, tolerance)) {
      throw std::invalid_argument("lines: axes 2 and " + std::to_string(i) + " are not parallel");
    }
  }
  RequireWrist(lines, tolerance);
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
    const Matrix3d Z = BackAboutY(turns[base], K);
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
  return (behind ? kShoulder : 0) | (IsNegative(sign_[2], offset_[2], q[2]) ? kElbow : 0) |
         (IsNegative(1, offset_[4], q[4]) ? kWrist : 0);
}

PieperArm::PieperArm(const ArmLines& lines, double tolerance) : AnalyticArm(lines, 6) {
  RequireWrist(lines, tolerance);
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
    const Matrix3d K_1 = BackAboutY(turns[base], K);
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
  return (ahead < 0 ? kShoulder : 0) | (IsNegative(sign_[2], offset_[2], q[2]) ? kElbow : 0) |
         (IsNegative(1, offset_[4], q[4]) ? kWrist : 0);
}

}  // namespace prehensile
