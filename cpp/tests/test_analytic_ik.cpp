// Analytic inverse kinematics as a C++ program uses it, beside differential inverse kinematics.

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "check.h"
#include "prehensile/analytic_ik.h"
#include "prehensile/frame_ik.h"
#include "prehensile/reachability.h"

namespace prehensile {
namespace {

/// An arm by its axes and the ways between them; the tool as the last joint, at `last` from it.
ArmLines Lines(const std::vector<Eigen::Vector3d>& axes, const std::vector<Eigen::Vector3d>& ways,
               const Eigen::Vector3d& last) {
  ArmLines lines;
  lines.axes = axes;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& way : ways) lines.points.push_back(p += way);
  lines.X_WG0 = Eigen::Matrix4d::Identity();
  lines.X_WG0.topRightCorner<3, 1>() = p + last;
  lines.lower.assign(axes.size(), -3.0);
  lines.upper.assign(axes.size(), 3.0);
  return lines;
}

const Eigen::Vector3d kX(1, 0, 0), kY(0, 1, 0), kZ(0, 0, 1), kNone(0, 0, 0);

UrArm Ur() {
  return UrArm(
      Lines({kZ, kY, kY, kY, -kZ, kY},
            {0.09 * kZ, 0.14 * kY, {0.42, -0.12, 0}, 0.39 * kX, 0.09 * kY, -0.09 * kZ}, 0.08 * kY),
      1e-9);
}

PieperArm Puma() {
  return PieperArm(Lines({kZ, kY, kY, kZ, kY, kZ},
                         {kNone, 0.3 * kZ, 0.4 * kZ, 0.35 * kZ, kNone, kNone}, 0.1 * kZ),
                   1e-9);
}

/// Axes 1 and 2 meet, 2 and 3 are not parallel.
PieperArm Meeting() {
  return PieperArm(Lines({kZ, kY, kX, kZ, kY, kZ},
                         {0.3 * kZ, kNone, {0.05, 0.1, 0.4}, 0.35 * kZ, kNone, kNone}, 0.1 * kZ),
                   1e-9);
}

SrsArm Iiwa() {
  return SrsArm(Lines({kZ, kY, kZ, -kY, kZ, kY, kZ},
                      {0.36 * kZ, kNone, kNone, 0.42 * kZ, kNone, 0.4 * kZ, kNone}, 0.13 * kZ),
                1e-9);
}

/// Solve of any arm, at arm angle 0 where there is one.
template <typename Arm>
IkSolutions Solve(const Arm& arm, const double* X_WG, const IkOptions& options) {
  IkSolutions solutions;
  if constexpr (std::is_same_v<Arm, SrsArm>) {
    arm.Solve(X_WG, 0.3, options, &solutions);
  } else {
    arm.Solve(X_WG, options, &solutions);
  }
  return solutions;
}

template <typename Arm>
bool Reaches(const Arm& arm, const IkSolutions& solutions, const double* X_WG) {
  for (int k = 0; k < solutions.count; ++k) {
    double X[16];
    arm.Pose(solutions.q.data() + k * solutions.num_joints, X);
    for (int i = 0; i < 16; ++i) {
      if (!(std::abs(X[i] - X_WG[i]) < 1e-9)) return false;
    }
  }
  return true;
}

template <typename Arm>
void TestRoundTrips(const std::string& name, const Arm& arm) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> angle(-3.0, 3.0);
  int solved = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    double q[7], X[16];
    for (double& x : q) x = random() % 8 == 0 ? 0.0 : angle(random);  // Singular poses too.
    arm.Pose(q, X);
    const IkSolutions solutions = Solve(arm, X, {.q_near = q});
    solved += solutions.status == IkStatus::kSolved;
    Check(Reaches(arm, solutions, X), name + " reaches the pose");
    bool within = true;
    for (int i = 0; i < solutions.count * solutions.num_joints; ++i) {
      within = within && std::abs(solutions.q[i]) <= 3.0;
    }
    Check(within, name + " keeps the limits");
  }
  Check(solved > 1000, name + " solves most poses");
}

/// However far away, no pose has a solution that is none.
template <typename Arm>
void TestFarAway(const std::string& name, const Arm& arm) {
  for (const double far : {1e3, 1e9, 1e100, 1e160, 1e300, 1.7e308}) {
    for (const Eigen::Vector3d& direction :
         {kX, kY, kZ, Eigen::Vector3d(-1, 1, 0), Eigen::Vector3d(1, -1, 1)}) {
      double X[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
      for (int i = 0; i < 3; ++i) X[4 * i + 3] = far * direction[i];
      const IkSolutions solutions = Solve(arm, X, {.limits = false});
      // UrArm's P is too near to axis 1 if it is far above it.
      Check(solutions.count == 0 && solutions.status != IkStatus::kLimits,
            name + " is too far away");
    }
  }
}

template <typename Arm>
void TestArm(const std::string& name, const Arm& arm) {
  TestRoundTrips(name, arm);
  TestFarAway(name, arm);
  double X[16] = {1, 0, 0, std::nan(""), 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  CheckThrows("X_WG", [&] { Solve(arm, X, {}); });
}

void TestArmAngles() {
  const SrsArm arm = Iiwa();
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> angle(-2.9, 2.9);
  for (int trial = 0; trial < 200; ++trial) {
    double q[7], X[16];
    for (double& x : q) x = random() % 6 == 0 ? 0.0 : angle(random);
    arm.Pose(q, X);
    for (int branch = 0; branch < 8; ++branch) {
      IkStatus status;
      const AngleIntervals intervals = arm.Intervals(X, branch, &status);
      for (int i = 0; i < intervals.count; ++i) {
        const auto [begin, end] = intervals.bounds[i];
        Check(begin < end && end - begin <= 6.3, "an interval has a width");
        IkSolutions solutions;
        arm.Solve(X, 0.5 * (begin + end), {}, &solutions);
        Check(solutions.count > 0 && Reaches(arm, solutions, X), "its middle has a solution");
      }
    }
    const ArmAngleChoice closest = arm.Closest(X, q);
    Check(closest.status == IkStatus::kSolved, "the configuration itself is one");
    double distance = 0;
    for (int j = 0; j < 7; ++j) distance += std::pow(closest.q[j] - q[j], 2);
    Check(distance < 1e-8, "and is the closest");
  }
}

}  // namespace
}  // namespace prehensile

int main() {
  using namespace prehensile;
  TestArm("UrArm", Ur());
  TestArm("PieperArm, parallel", Puma());
  TestArm("PieperArm, meeting", Meeting());
  TestArm("SrsArm", Iiwa());
  TestArmAngles();
  return failures;
}
