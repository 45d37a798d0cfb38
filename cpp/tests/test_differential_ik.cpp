// Differential inverse kinematics as a C++ program uses it, at the greatest sizes there are. Meant
// to run with sanitizers as well.

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "check.h"
#include "prehensile/differential_ik.h"
#include "prehensile/quadratic_program.h"

namespace prehensile {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
void TestProgram() {
  // min ½ |x − (5, −3)|² subject to x − y <= 6: the nearest point of the half-plane is (4, −2).
  LeastSquaresCost cost(2);
  cost.Regularize(0, 1.0, 5.0);
  cost.Regularize(1, 1.0, -3.0);
  const double C[] = {1.0, -1.0}, lower[] = {-kInfinity}, upper[] = {6.0};
  double x[2];
  QpSolver solver;
  const QpStatus status =
      solver.Solve(cost, nullptr, nullptr, nullptr, LinearRows{1, C, lower, upper}, x);
  Check(status == QpStatus::kOptimal, "a half-plane is feasible");
  Check(std::abs(x[0] - 4.0) < 1e-12 && std::abs(x[1] + 2.0) < 1e-12, "nearest point");

  LeastSquaresCost again(1);
  again.Regularize(0, 1.0, 0.0);
  const double two[] = {1.0, 1.0}, least[] = {2.0, -kInfinity}, most[] = {kInfinity, 1.0};
  Check(solver.Solve(again, nullptr, nullptr, nullptr, LinearRows{2, two, least, most}, x) ==
            QpStatus::kInfeasible,
        "contradictory rows are told");
}

void TestKernel() {
  const double A[] = {1, 2, 3, 2, 4, 6, 0, 1, 1};
  double Z[9];
  Check(KernelBasis(3, 3, A, 1e-9, Z) == 2, "rank");
  for (int i = 0; i < 3; ++i) {
    const double* a = A + 3 * i;
    Check(std::abs(a[0] * Z[0] + a[1] * Z[1] + a[2] * Z[2]) < 1e-12, "kernel");
  }
}

void TestBrakeSpeed() {
  for (const double room : {1e-6, 0.01, 0.3, 2.0}) {
    const double a = 3.0, h = 0.01;
    double v = BrakeSpeed(room, a, h), way = h * v;
    Check(BrakeSpeed(-room, a, h) == -v, "odd");
    while (v > a * h) {
      v -= a * h;
      way += h * v;
    }
    Check(std::abs(way - room) < 1e-12, "stops at the end of its range");
  }
  Check(BrakeSpeed(kInfinity, 1.0, 0.01) == kInfinity, "no end");
  Check(BrakeSpeed(0.2, kInfinity, 0.01) == 0.2 / 0.01, "no limit of acceleration");
}

// The greatest numbers of joints, rows and constraints, feasible and not.
void TestGreatestSizes(IkFormulation formulation, IkCentering centering) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const int n = kMaxIkJoints, k = kMaxIkRows, m = kMaxIkRows;
  const JointLimits limits{std::vector<double>(n, -1.0), std::vector<double>(n, 1.0),
                           std::vector<double>(n, 0.5), std::vector<double>(n, 10.0)};
  DifferentialIkOptions options;
  options.formulation = formulation;
  options.centering = centering;
  options.centering_gain.assign(n, 1.0);
  options.nominal_position.assign(n, 0.1);
  const DifferentialIk ik(limits, options);
  std::vector<double> q(n), v(n), J(k * n), V(k), A(m * n), lower(m, -kInfinity), upper(m);
  const int sizes[] = {10, 10, k - 20};
  for (int trial = 0; trial < 30; ++trial) {
    for (int i = 0; i < n; ++i) {
      q[i] = 0.4 * std::tanh(normal(random));
      v[i] = 0.04 * std::tanh(normal(random));
    }
    for (double& x : J) x = normal(random);
    for (double& x : V) x = 10.0 * normal(random);
    for (double& x : A) x = normal(random);
    for (double& x : upper) x = trial % 2 == 0 ? 0.1 : 0.1 * normal(random);
    if (trial % 3 == 0) lower = upper;
    const IkTaskRows tasks{
        trial % 4 == 0 ? 20 : k, J.data(), V.data(), nullptr, trial % 4 == 0 ? nullptr : sizes,
        trial % 4 == 0 ? 1 : 3};
    const LinearRows rows{m, A.data(), lower.data(), upper.data()};
    IkStep step;
    ik.Step(q.data(), v.data(), tasks, rows, &step);
    bool kept = true;
    for (int i = 0; i < n; ++i) {
      kept = kept && step.v[i] >= step.lower[i] && step.v[i] <= step.upper[i] &&
             std::abs(step.v[i] - v[i]) <= 10.0 * options.period + 1e-12;
    }
    Check(kept, "limits at the greatest sizes");
  }
}

// Numbers from the least to the greatest that there are: whatever overflows, limits are kept.
void TestNumbersOfAllSizes() {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto any = [&] {
    const double x = uniform(random);
    const double range = random() % 2 == 0 ? 3.0 : 308.0;
    return random() % 8 == 0 ? 0.0 : std::copysign(std::pow(10.0, range * uniform(random)), x);
  };
  const int n = 4, k = 3, m = 2;
  for (int trial = 0; trial < 20000; ++trial) {
    JointLimits limits{std::vector<double>(n), std::vector<double>(n), std::vector<double>(n),
                       std::vector<double>(n)};
    for (int i = 0; i < n; ++i) {
      limits.position_lower[i] = random() % 4 == 0 ? -kInfinity : -std::abs(any());
      limits.position_upper[i] = random() % 4 == 0 ? kInfinity : std::abs(any());
      limits.velocity[i] = random() % 4 == 0 ? kInfinity : std::abs(any());
      limits.acceleration[i] = random() % 4 == 0 ? kInfinity : std::abs(any()) + 1e-300;
    }
    DifferentialIkOptions options;
    options.period = std::pow(10.0, -3.0 * std::abs(uniform(random)));
    options.formulation = static_cast<IkFormulation>(trial % 4);
    options.centering = static_cast<IkCentering>(trial % 3);
    options.damping = trial % 2 == 0 ? 0.0 : std::abs(any());
    options.centering_gain.assign(n, any());
    options.nominal_position.assign(n, any());
    const DifferentialIk ik(limits, options);
    double q[n], v[n], J[k * n], V[k], A[m * n], lower[m], upper[m];
    for (double& x : q) x = any();
    for (double& x : v) x = any();
    for (double& x : J) x = any();
    for (double& x : V) x = any();
    for (double& x : A) x = any();
    for (int i = 0; i < m; ++i) {
      const double a = any(), b = any();
      lower[i] = std::min(a, b);
      upper[i] = std::max(a, b);
    }
    const int sizes[] = {1, 2};
    IkStep step;
    ik.Step(q, v, {k, J, V, nullptr, sizes, 2}, {trial % 5 == 0 ? m : 0, A, lower, upper}, &step);
    bool kept = true;
    for (int i = 0; i < n; ++i) {
      const double change = limits.acceleration[i] * options.period;
      const double slack = 1e-12 * (std::abs(v[i]) + 1.0);
      kept = kept && std::isfinite(step.v[i]) && step.lower[i] <= step.v[i] &&
             step.v[i] <= step.upper[i] && std::abs(step.v[i] - v[i]) <= change + slack;
    }
    Check(kept, "limits are kept, trial " + std::to_string(trial));
  }
}

void TestErrors() {
  CheckThrows("limits", [] { DifferentialIk({{0.0}, {1.0}, {1.0}, {0.0}}, {}); });
  const DifferentialIk ik({{0.0}, {1.0}, {1.0}, {1.0}}, {});
  CheckThrows("num_threads",
              [&] { ik.StepBatch(0, nullptr, nullptr, {}, {}, nullptr, nullptr, 0); });
}

}  // namespace
}  // namespace prehensile

int main() {
  using namespace prehensile;
  TestProgram();
  TestKernel();
  TestBrakeSpeed();
  for (const IkFormulation formulation : {IkFormulation::kLeastSquares, IkFormulation::kDirection,
                                          IkFormulation::kPriorities, IkFormulation::kSaturated}) {
    for (const IkCentering centering :
         {IkCentering::kNone, IkCentering::kNullspace, IkCentering::kPosture}) {
      TestGreatestSizes(formulation, centering);
    }
  }
  TestNumbersOfAllSizes();
  TestErrors();
  return failures;
}
