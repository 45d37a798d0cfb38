#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "analytic_ik_kernel.h"
#include "parallel.h"
#include "prehensile/analytic_ik.h"

namespace prehensile {

/// θ = sign q + offset of all joints and branches; those that are not `valid` are left at 0.
struct AnalyticArm::Pattern {
  alignas(64) double c[IkSolutions::kMaxJoints][internal::kLanes] = {};
  alignas(64) double s[IkSolutions::kMaxJoints][internal::kLanes] = {};
  bool valid[internal::kLanes] = {};
  IkStatus failure = IkStatus::kTooFar;  // If none is valid.

  void Set(int joint, int lane, const internal::Turn& turn) {
    c[joint][lane] = turn.c;
    s[joint][lane] = turn.s;
  }
};

namespace internal {

/// Sines and lengths below this (rad, m) count as zero: what the pose then leaves free is chosen.
inline constexpr double kSingular = 1e-11;
/// A target that is out of reach by no more than this (m) is taken as on the boundary.
inline constexpr double kReach = 1e-10;
/// Squares of sines below this are rounding.
inline constexpr double kRounding = 2e-14;

/// Bits of a branch.
inline constexpr int kShoulder = 4, kElbow = 2, kWrist = 1;

inline Turn TurnBy(double angle) { return {std::cos(angle), std::sin(angle)}; }
inline Turn operator+(const Turn& a, const Turn& b) {
  return {a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s};
}
inline Turn operator-(const Turn& a) { return {a.c, -a.s}; }
inline Turn operator-(const Turn& a, const Turn& b) { return a + -b; }
inline Turn Normalized(const Turn& a) {
  const double length = std::sqrt(a.c * a.c + a.s * a.s);
  return {a.c / length, a.s / length};
}
inline Turn Opposite(const Turn& a) { return {-a.c, -a.s}; }

/// Ry(turn)ᵀ M.
inline Eigen::Matrix3d BackAboutY(const Turn& turn, const Eigen::Matrix3d& M) {
  Eigen::Matrix3d out;
  out.row(0) = turn.c * M.row(0) - turn.s * M.row(2);
  out.row(1) = M.row(1);
  out.row(2) = turn.s * M.row(0) + turn.c * M.row(2);
  return out;
}

inline bool IsNegative(double sign, double offset, double q) {
  return std::sin(sign * q + offset) < 0;
}

/// Z = Rz(first) Ry(middle) Rz(last) with the sine of the middle angle >= 0. The other solution has
/// the opposite first and last turn and the negative middle one.
struct Zyz {
  Turn first, middle, last;
  bool singular;  // Only the sum or difference of first and last is given, there is one solution.
};

inline Turn LastFromFirst(const Eigen::Matrix3d& Z, const Turn& first) {
  return {-first.s * Z(0, 1) + first.c * Z(1, 1), -first.s * Z(0, 0) + first.c * Z(1, 0)};
}

inline Turn MiddleOf(const Eigen::Matrix3d& Z, double sine) {
  if (sine > kSingular) return {Z(2, 2), sine};
  return {Z(2, 2) > 0 ? 1.0 : -1.0, 0};
}

/// @param free gives the angle of the first turn where it is free.
template <typename Free>
inline Zyz SolveZyzFirst(const Eigen::Matrix3d& Z, const Free& free) {
  const double sine = std::sqrt(Z(0, 2) * Z(0, 2) + Z(1, 2) * Z(1, 2));
  Zyz zyz{.middle = MiddleOf(Z, sine), .singular = sine <= kSingular};
  zyz.first = zyz.singular ? TurnBy(free()) : Turn{Z(0, 2) / sine, Z(1, 2) / sine};
  zyz.last = LastFromFirst(Z, zyz.first);
  return zyz;
}

/// The same with the last turn free.
template <typename Free>
inline Zyz SolveZyzLast(const Eigen::Matrix3d& Z, const Free& free) {
  const double sine = std::sqrt(Z(2, 0) * Z(2, 0) + Z(2, 1) * Z(2, 1));
  Zyz zyz{.middle = MiddleOf(Z, sine), .singular = sine <= kSingular};
  zyz.last = zyz.singular ? TurnBy(free()) : Turn{-Z(2, 0) / sine, Z(2, 1) / sine};
  zyz.first = {Z(1, 0) * zyz.last.s + Z(1, 1) * zyz.last.c,
               -(Z(0, 0) * zyz.last.s + Z(0, 1) * zyz.last.c)};
  return zyz;
}

/// The kernel for this processor.
JointAngles BestJointAngles();

/// Right-handed frame with axis y, and z made perpendicular to it.
Eigen::Matrix3d FrameYZ(const Eigen::Vector3d& y, const Eigen::Vector3d& z);

/// Angle from a to b about the unit vector h.
double AngleAbout(const Eigen::Vector3d& h, const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Checks of geometry; they throw std::invalid_argument. Joints are counted from 1.
void RequirePerpendicular(const ArmLines& lines, int i, int j, double tolerance);
Eigen::Vector3d RequireMeeting(const ArmLines& lines, int i, int j, double tolerance);
void RequireThrough(const ArmLines& lines, int i, const Eigen::Vector3d& point,
                    const std::string& name, double tolerance);
bool AreParallel(const ArmLines& lines, int i, int j, double tolerance);

/// Axis 4 ⊥ axis 5 ⊥ axis 6.
void RequireWrist(const ArmLines& lines, double tolerance);

/// The shoulder that carries a point P; the angles of joints 2 and 3 are upper_angle and bend_angle
/// at q = 0. Checks the axes of joints 1 to 3.
ParallelShoulder MakeParallelShoulder(const ArmLines& lines, const Eigen::Vector3d& wrist,
                                      const Eigen::Vector3d& P, double tolerance);

/// Reads a row-major 4×4; throws std::invalid_argument if it is not a rigid transform.
void ReadPose(const double* X_WG, Eigen::Matrix3d* R_WG, Eigen::Vector3d* p_WG);

/// Calls solve(i, options, &solutions) for each pose and writes the results.
template <typename Solve>
void RunBatch(const IkBatch& batch, int n, const Solve& solve) {
  RunShares(batch.num_poses, 64, batch.num_threads, [&](std::size_t begin, std::size_t end) {
    IkSolutions solutions;
    IkOptions options{.limits = batch.limits};
    for (std::size_t i = begin; i < end; ++i) {
      if (batch.q_near != nullptr) options.q_near = batch.q_near + (batch.near_each ? i * n : 0);
      try {
        solve(i, options, &solutions);
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument("pose " + std::to_string(i) + ": " + error.what());
      }
      double* const q = batch.q + i * kLanes * n;
      std::fill_n(q, kLanes * n, std::numeric_limits<double>::quiet_NaN());
      for (int k = 0; k < solutions.count; ++k) {
        std::copy_n(solutions.q.data() + k * n, n, q + solutions.branch[k] * n);
      }
      batch.status[i] = static_cast<std::uint8_t>(solutions.status);
    }
  });
}

}  // namespace internal
}  // namespace prehensile
