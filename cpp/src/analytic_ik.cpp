// What the arms of analytic_ik_*.cpp have in common.

#include "prehensile/analytic_ik.h"

#include <numbers>

#include "analytic_ik_detail.h"
#include "prehensile/simd.h"

namespace prehensile {
namespace {

/// Angles outside a joint's limits by no more than this are brought to the limit.
constexpr double kLimitTolerance = 1e-10;

internal::JointAngles BestKernel() {
#ifdef __x86_64__
  switch (BestSimdLevel()) {
    case SimdLevel::kAvx512:
      return internal::avx512::kJointAngles;
    case SimdLevel::kAvx2:
      return internal::avx2::kJointAngles;
    case SimdLevel::kBaseline:
      break;
  }
#endif
  return internal::baseline::kJointAngles;
}

std::string Axes(int i, int j) {
  return "lines: axes " + std::to_string(i) + " and " + std::to_string(j);
}

}  // namespace

namespace internal {

JointAngles BestJointAngles() {
  static const JointAngles kernel = BestKernel();
  return kernel;
}

Eigen::Matrix3d FrameYZ(const Eigen::Vector3d& y, const Eigen::Vector3d& z) {
  Eigen::Matrix3d frame;
  frame.col(1) = y;
  frame.col(2) = (z - y * y.dot(z)).normalized();
  frame.col(0) = y.cross(frame.col(2));
  return frame;
}

double AngleAbout(const Eigen::Vector3d& h, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(h.dot(a.cross(b)), a.dot(b) - a.dot(h) * b.dot(h));
}

void RequirePerpendicular(const ArmLines& lines, int i, int j, double tolerance) {
  const double off = std::abs(lines.axes[i - 1].dot(lines.axes[j - 1]));
  if (off > tolerance) {
    throw std::invalid_argument(Axes(i, j) + " are not perpendicular (off by " +
                                std::to_string(std::asin(std::min(off, 1.0))) + " rad)");
  }
}

bool AreParallel(const ArmLines& lines, int i, int j, double tolerance) {
  return lines.axes[i - 1].cross(lines.axes[j - 1]).norm() <= tolerance;
}

Eigen::Vector3d RequireMeeting(const ArmLines& lines, int i, int j, double tolerance) {
  const Eigen::Vector3d &a = lines.axes[i - 1], &b = lines.axes[j - 1];
  const Eigen::Vector3d normal = a.cross(b);
  const double square = normal.squaredNorm();
  if (square <= tolerance * tolerance) throw std::invalid_argument(Axes(i, j) + " are parallel");
  const Eigen::Vector3d between = lines.points[j - 1] - lines.points[i - 1];
  const double gap = std::abs(between.dot(normal)) / std::sqrt(square);
  if (gap > tolerance) {
    throw std::invalid_argument(Axes(i, j) + " do not meet (" + std::to_string(gap) + " m apart)");
  }
  return lines.points[i - 1] + a * (between.cross(b).dot(normal) / square);
}

void RequireThrough(const ArmLines& lines, int i, const Eigen::Vector3d& point,
                    const std::string& name, double tolerance) {
  const double gap = lines.axes[i - 1].cross(point - lines.points[i - 1]).norm();
  if (gap > tolerance) {
    throw std::invalid_argument("lines: axis " + std::to_string(i) + " does not pass through " +
                                name + " (" + std::to_string(gap) + " m away)");
  }
}

void RequireWrist(const ArmLines& lines, double tolerance) {
  RequirePerpendicular(lines, 4, 5, tolerance);
  RequirePerpendicular(lines, 5, 6, tolerance);
}

void ReadPose(const double* X, Eigen::Matrix3d* R_WG, Eigen::Vector3d* p_WG) {
  *R_WG << X[0], X[1], X[2], X[4], X[5], X[6], X[8], X[9], X[10];
  *p_WG << X[3], X[7], X[11];
  const auto& R = *R_WG;
  const double off = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().sum();
  const double sum = p_WG->sum();
  // Written so that NaN fails.
  if (!(off < 1e-6) || !(sum - sum == 0) || R.col(0).cross(R.col(1)).dot(R.col(2)) < 0 ||
      X[12] != 0 || X[13] != 0 || X[14] != 0 || X[15] != 1) {
    throw std::invalid_argument("X_WG: not a rigid transform");
  }
}

}  // namespace internal

AnalyticArm::AnalyticArm(const ArmLines& lines, int num_joints) : n_(num_joints), lines_(lines) {
  const auto n = static_cast<std::size_t>(num_joints);
  if (lines.axes.size() != n || lines.points.size() != n || lines.lower.size() != n ||
      lines.upper.size() != n) {
    throw std::invalid_argument("lines: an arm of this type has " + std::to_string(n) +
                                " joints, not " + std::to_string(lines.axes.size()));
  }
  for (int i = 0; i < n_; ++i) {
    if (!(std::abs(lines.axes[i].norm() - 1) < 1e-9)) {
      throw std::invalid_argument("lines: axis " + std::to_string(i + 1) + " is no unit vector");
    }
    if (!lines.points[i].allFinite()) throw std::invalid_argument("lines: a point is not finite");
    if (!(lines.lower[i] <= lines.upper[i])) {
      throw std::invalid_argument("lines: lower limit of joint " + std::to_string(i + 1) +
                                  " is above the upper one");
    }
    sign_[i] = 1;
    lower_[i] = lines.lower[i];
    upper_[i] = lines.upper[i];
  }
  Eigen::Matrix3d R;
  Eigen::Vector3d p;
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> X = lines.X_WG0;
  internal::ReadPose(X.data(), &R, &p);
}

Eigen::Vector3d AnalyticArm::MoveDirection(const double* q, int count, Eigen::Vector3d v) const {
  for (int i = count - 1; i >= 0; --i) v = Eigen::AngleAxisd(q[i], lines_.axes[i]) * v;
  return v;
}

Eigen::Vector3d AnalyticArm::MovePoint(const double* q, int count, Eigen::Vector3d p) const {
  for (int i = count - 1; i >= 0; --i) {
    p = lines_.points[i] + Eigen::AngleAxisd(q[i], lines_.axes[i]) * (p - lines_.points[i]);
  }
  return p;
}

void AnalyticArm::Pose(const double* q, double* X_WG) const {
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(X_WG);
  X.row(3) << 0, 0, 0, 1;
  for (int k = 0; k < 3; ++k) {
    X.block<3, 1>(0, k) = MoveDirection(q, n_, lines_.X_WG0.block<3, 1>(0, k));
  }
  X.block<3, 1>(0, 3) = MovePoint(q, n_, lines_.X_WG0.block<3, 1>(0, 3));
}

Eigen::Vector3d AnalyticArm::InTool(const Eigen::Vector3d& point) const {
  return lines_.X_WG0.topLeftCorner<3, 3>().transpose() *
         (point - lines_.X_WG0.topRightCorner<3, 1>());
}

Eigen::Matrix3d AnalyticArm::InTool(const Eigen::Matrix3d& frame) const {
  return lines_.X_WG0.topLeftCorner<3, 3>().transpose() * frame;
}

double AnalyticArm::FreeAngle(int joint, const IkOptions& options) const {
  const double q = options.q_near == nullptr ? 0 : options.q_near[joint];
  return sign_[joint] * q + offset_[joint];
}

bool AnalyticArm::WithinLimits(int joint, double near, double* q) const {
  constexpr double kTurn = 2 * std::numbers::pi;
  const double lower = lower_[joint], upper = upper_[joint];
  double value = *q - kTurn * std::nearbyint((*q - near) / kTurn);
  if (value < lower - kLimitTolerance) {
    value += kTurn * std::ceil((lower - kLimitTolerance - value) / kTurn);
  } else if (value > upper + kLimitTolerance) {
    value -= kTurn * std::ceil((value - upper - kLimitTolerance) / kTurn);
  }
  if (value < lower - kLimitTolerance || value > upper + kLimitTolerance) return false;
  *q = std::clamp(value, lower, upper);
  return true;
}

void AnalyticArm::Finish(const Pattern& pattern, const IkOptions& options, IkSolutions* out) const {
  constexpr int kLanes = internal::kLanes;
  static constexpr double kZeros[IkSolutions::kMaxJoints] = {};
  const double* const near = options.q_near == nullptr ? kZeros : options.q_near;
  alignas(64) double q[IkSolutions::kMaxJoints * kLanes];
  internal::BestJointAngles()(&pattern.s[0][0], &pattern.c[0][0], sign_.data(), offset_.data(),
                              near, n_, q);
  out->num_joints = n_;
  out->count = 0;
  bool any = false;
  for (int lane = 0; lane < kLanes; ++lane) {
    if (!pattern.valid[lane]) continue;
    any = true;
    double* const row = out->q.data() + out->count * n_;
    bool within = true;
    for (int j = 0; j < n_; ++j) {
      row[j] = q[j * kLanes + lane];
      if (options.limits && (row[j] < lower_[j] || row[j] > upper_[j]) &&
          !WithinLimits(j, near[j], row + j)) {
        within = false;
        break;
      }
    }
    if (within) out->branch[out->count++] = static_cast<std::uint8_t>(lane);
  }
  out->status = out->count > 0 ? IkStatus::kSolved : any ? IkStatus::kLimits : pattern.failure;
}

}  // namespace prehensile
