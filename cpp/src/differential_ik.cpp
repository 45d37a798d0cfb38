#include "prehensile/differential_ik.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "parallel.h"

namespace prehensile {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Regularization of every joint, relative to the longest row of a Jacobian: it makes the optimum
// unique where nothing else does, and moves it by about its square over that of a singular value.
constexpr double kRegularization = 1e-6;
// Square root of the weight of a constraint's violation, relative to that of the tasks.
constexpr double kRelaxation = 1e4;
// Curvature of the reward of alpha, relative to its slope.
constexpr double kAlphaCurvature = 1e-7;
// Violation of a linear constraint, relative to its row, that counts as none.
constexpr double kViolation = 1e-8;

double Dot(const double* a, const double* b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

double Norm(const double* a, int n) { return std::sqrt(Dot(a, a, n)); }

void Require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

bool AllFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

// Greatest of the rows' norms, weights counted.
double Scale(const IkTaskRows& tasks, int n) {
  double scale = 1.0;
  for (int k = 0; k < tasks.num; ++k) {
    const double w = tasks.weights ? tasks.weights[k] : 1.0;
    scale = std::max(scale, w * w * Dot(tasks.J + k * n, tasks.J + k * n, n));
  }
  return std::sqrt(scale);
}

double Violation(const LinearRows& rows, const double* v, int n, double* relative) {
  double worst = 0.0;
  *relative = 0.0;
  for (int k = 0; k < rows.num; ++k) {
    const double* const row = rows.C + k * n;
    const double value = Dot(row, v, n);
    const double violation = std::max({0.0, rows.lower[k] - value, value - rows.upper[k]});
    worst = std::max(worst, violation);
    double size = 1.0;
    for (int i = 0; i < n; ++i) size = std::max(size, std::abs(row[i]));
    *relative = std::max(*relative, violation / size);
  }
  return worst;
}

}  // namespace

double BrakeSpeed(double room, double acceleration, double period) {
  const double size = std::abs(room);
  if (size == kInfinity) return room;
  double speed = size / period;
  const double change = acceleration * period;
  if (speed > change) {
    // One period at v, then slower by `change` each, takes h ((n + 1) v − change n (n + 1) / 2)
    // with n = floor(v / change); this is the inverse of that piecewise linear function.
    const double steps = speed / change;
    const double n = std::floor(0.5 * (std::sqrt(1.0 + 8.0 * steps) - 1.0));
    speed = (steps / (n + 1.0) + 0.5 * n) * change;
  }
  return std::copysign(speed, room);
}

DifferentialIk::DifferentialIk(JointLimits limits, DifferentialIkOptions options)
    : n_(static_cast<int>(limits.velocity.size())),
      limits_(std::move(limits)),
      options_(std::move(options)) {
  const auto size = static_cast<std::size_t>(n_);
  Require(1 <= n_ && n_ <= kMaxIkJoints, "limits: expected 1 to 32 joints");
  Require(limits_.position_lower.size() == size && limits_.position_upper.size() == size &&
              limits_.acceleration.size() == size,
          "limits: of different lengths");
  for (int i = 0; i < n_; ++i) {
    Require(limits_.position_lower[i] <= limits_.position_upper[i] &&
                limits_.position_lower[i] < kInfinity && limits_.position_upper[i] > -kInfinity,
            "limits: a position range is empty");
    Require(limits_.velocity[i] >= 0.0, "limits: a velocity is negative");
    Require(limits_.acceleration[i] > 0.0, "limits: an acceleration is not positive");
  }
  Require(options_.period > 0.0 && options_.period < kInfinity, "period: expected > 0 and finite");
  Require(options_.damping >= 0.0 && options_.damping < kInfinity,
          "damping: expected >= 0 and finite");
  Require(options_.direction_weight > 0.0 && options_.direction_weight < kInfinity,
          "direction_weight: expected > 0 and finite");
  Require(options_.rank_tolerance > 0.0 && options_.rank_tolerance < 1.0,
          "rank_tolerance: expected between 0 and 1");
  if (options_.centering != IkCentering::kNone) {
    Require(options_.centering_weight > 0.0 && options_.centering_weight < kInfinity,
            "centering_weight: expected > 0 and finite");
    Require(options_.centering_gain.size() == size && AllFinite(options_.centering_gain),
            "centering_gain: expected a finite number for each joint");
    Require(options_.nominal_position.size() == size && AllFinite(options_.nominal_position),
            "nominal_position: expected a finite number for each joint");
  }
}

bool DifferentialIk::VelocityInterval(const double* q, const double* v, double* lower,
                                      double* upper) const {
  const double h = options_.period;
  bool beyond = false;
  for (int i = 0; i < n_; ++i) {
    const double speed = limits_.velocity[i], change = limits_.acceleration[i] * h;
    // What is hard whatever the state: the acceleration, and within it the velocity.
    const double low = v[i] - change, high = v[i] + change;
    const double hard_low = std::min(std::max(-speed, low), high);
    const double hard_high = std::max(std::min(speed, high), low);
    double to_lower = -BrakeSpeed(q[i] - limits_.position_lower[i], limits_.acceleration[i], h);
    double to_upper = BrakeSpeed(limits_.position_upper[i] - q[i], limits_.acceleration[i], h);
    lower[i] = std::min(std::max(to_lower, hard_low), hard_high);
    upper[i] = std::max(std::min(to_upper, hard_high), hard_low);
    // Rounding alone may make it empty.
    if (lower[i] > upper[i]) lower[i] = upper[i] = 0.5 * (lower[i] + upper[i]);
    const double slack = 1e-9;
    beyond = beyond || q[i] < limits_.position_lower[i] - slack ||
             q[i] > limits_.position_upper[i] + slack || to_upper < hard_low - slack ||
             to_lower > hard_high + slack || std::abs(v[i]) > speed + slack;
  }
  return beyond;
}

void DifferentialIk::Step(const double* q, const double* v, const IkTaskRows& tasks,
                          const LinearRows& constraints, IkStep* step) const {
  step->n = n_;
  step->alpha = 1.0;
  step->iterations = 0;
  const bool beyond = VelocityInterval(q, v, step->lower, step->upper);
  step->status = beyond ? IkStatus::kRecovering : IkStatus::kOptimal;
  double v_c[kMaxIkJoints];
  const double* center = nullptr;
  if (options_.centering != IkCentering::kNone) {
    for (int i = 0; i < n_; ++i) {
      v_c[i] = options_.centering_gain[i] * (options_.nominal_position[i] - q[i]);
    }
    center = v_c;
  }
  double relative = 0.0;
  bool solved;
  if (options_.formulation == IkFormulation::kSaturated) {
    double lower[kMaxIkJoints], upper[kMaxIkJoints];
    std::copy(step->lower, step->lower + n_, lower);
    std::copy(step->upper, step->upper + n_, upper);
    std::fill(step->lower, step->lower + n_, -kInfinity);
    std::fill(step->upper, step->upper + n_, kInfinity);
    solved = LeastSquares(tasks, {}, center, false, step);
    std::copy(lower, lower + n_, step->lower);
    std::copy(upper, upper + n_, step->upper);
    for (int i = 0; i < n_; ++i) step->v[i] = std::min(std::max(step->v[i], lower[i]), upper[i]);
    step->violation = Violation(constraints, step->v, n_, &relative);
  } else if (options_.formulation == IkFormulation::kDirection) {
    solved = Direction(tasks, constraints, center, step);
    step->violation = Violation(constraints, step->v, n_, &relative);
    solved = solved && relative <= kViolation;
  } else {
    const bool levels = options_.formulation == IkFormulation::kPriorities;
    IkTaskRows first = tasks;
    if (levels && tasks.level_sizes != nullptr) first.num = tasks.level_sizes[0];
    const double* const first_center = levels ? nullptr : center;
    solved = LeastSquares(first, constraints, first_center, false, step);
    step->violation = Violation(constraints, step->v, n_, &relative);
    if (constraints.num > 0 && (!solved || relative > kViolation)) {
      solved = LeastSquares(first, constraints, first_center, true, step);
      step->violation = Violation(constraints, step->v, n_, &relative);
      if (relative > kViolation) step->status = IkStatus::kRelaxed;
    }
    if (solved && levels) {
      Priorities(tasks, constraints, center, step);
      step->violation = Violation(constraints, step->v, n_, &relative);
    }
  }
  if (!solved) {
    for (int i = 0; i < n_; ++i)
      step->v[i] = std::min(std::max(0.0, step->lower[i]), step->upper[i]);
    step->alpha = 0.0;
    step->violation = Violation(constraints, step->v, n_, &relative);
    step->status = IkStatus::kBraking;
  }
}

// min ½ |W (J v − V)|² + ½ λ² |v|² + ½ ε |P (v − v_c)|², subject to the interval and constraints.
// A relaxed one has one variable more, by which all constraints may be violated, at a high price.
bool DifferentialIk::LeastSquares(const IkTaskRows& tasks, const LinearRows& constraints,
                                  const double* v_c, bool relaxed, IkStep* step) const {
  const int n = n_, m = relaxed ? n + 1 : n;
  const double scale = Scale(tasks, n);
  const double regularization = kRegularization * scale;
  double d2 = options_.damping * options_.damping;
  LeastSquaresCost cost(m);
  double row[kMaxQpVariables] = {};
  for (int k = 0; k < tasks.num; ++k) {
    const double* a = tasks.J + k * n;
    if (m > n) {
      std::copy(a, a + n, row);
      a = row;
    }
    cost.AddRow(a, tasks.V[k], tasks.weights ? tasks.weights[k] : 1.0);
  }
  const double epsilon = options_.centering_weight;
  const bool posture = v_c != nullptr && options_.centering == IkCentering::kPosture;
  if (v_c != nullptr && !posture) {
    double Z[kMaxIkJoints * kMaxIkJoints];
    const int rank = KernelBasis(tasks.num, n, tasks.J, options_.rank_tolerance, Z);
    const double w = std::sqrt(epsilon);
    for (int k = 0; k < n - rank; ++k) {
      std::copy(Z + k * n, Z + (k + 1) * n, row);
      cost.AddRow(row, Dot(row, v_c, n), w);
    }
  }
  if (posture) d2 += epsilon;
  d2 = std::max(d2, regularization * regularization);
  const double d = std::sqrt(d2);
  for (int i = 0; i < n; ++i) cost.Regularize(i, d, posture ? epsilon / d2 * v_c[i] : 0.0);
  QpSolver solver;
  if (m == n) {
    const QpStatus status =
        solver.Solve(cost, nullptr, step->lower, step->upper, constraints, step->v);
    step->iterations += solver.iterations();
    return status == QpStatus::kOptimal;
  }
  cost.Regularize(n, kRelaxation * scale, 0.0);
  // Each side by itself: a·v + |a| t >= lower, a·v − |a| t <= upper.
  std::vector<double> C(2 * constraints.num * m), low(2 * constraints.num, -kInfinity),
      high(2 * constraints.num, kInfinity);
  for (int k = 0; k < constraints.num; ++k) {
    const double* const a = constraints.C + k * n;
    const double norm = std::max(Norm(a, n), 1e-9);
    for (int side = 0; side < 2; ++side) {
      double* const c = C.data() + (2 * k + side) * m;
      std::copy(a, a + n, c);
      c[n] = side == 0 ? norm : -norm;
    }
    low[2 * k] = constraints.lower[k];
    high[2 * k + 1] = constraints.upper[k];
  }
  double lower[kMaxQpVariables], upper[kMaxQpVariables], x[kMaxQpVariables];
  std::copy(step->lower, step->lower + n, lower);
  std::copy(step->upper, step->upper + n, upper);
  lower[n] = 0.0;
  upper[n] = kInfinity;
  const LinearRows rows{2 * constraints.num, C.data(), low.data(), high.data()};
  const QpStatus status = solver.Solve(cost, nullptr, lower, upper, rows, x);
  step->iterations += solver.iterations();
  std::copy(x, x + n, step->v);
  return status == QpStatus::kOptimal;
}

// max w α − |P (v − v_c)|², subject to J v = α V, 0 <= α <= 1, the interval and constraints.
bool DifferentialIk::Direction(const IkTaskRows& tasks, const LinearRows& constraints,
                               const double* v_c, IkStep* step) const {
  const int n = n_;
  // No α can make |J v| longer than the joints' speeds allow: a longer V is shortened first, which
  // keeps the numbers within reason.
  double V[kMaxIkRows];
  double desired = 0.0, possible = 0.0;
  for (int k = 0; k < tasks.num; ++k) {
    double reach = 0.0;
    for (int i = 0; i < n; ++i) {
      const double a = std::abs(tasks.J[k * n + i]);
      if (a > 0.0) reach += a * limits_.velocity[i];
    }
    desired = std::max(desired, std::abs(tasks.V[k]));
    possible = std::max(possible, reach);
  }
  const double shortened = desired > possible && possible > 0.0 ? possible / desired : 1.0;
  for (int k = 0; k < tasks.num; ++k) V[k] = shortened * tasks.V[k];
  // In u = (v, β), β = s α, the vectors with J v = β V / s are the kernel of [J, −V / s].
  const double s = Norm(V, tasks.num);
  if (s == 0.0 && desired > 0.0) return false;
  const double unit = s > 0.0 ? s : 1.0;
  double G[kMaxIkRows * kMaxQpVariables], Z[kMaxQpVariables * kMaxQpVariables];
  for (int k = 0; k < tasks.num; ++k) {
    std::copy(tasks.J + k * n, tasks.J + (k + 1) * n, G + k * (n + 1));
    G[k * (n + 1) + n] = -V[k] / unit;
  }
  const int freedom = n + 1 - KernelBasis(tasks.num, n + 1, G, options_.rank_tolerance, Z);
  if (freedom == 0) return false;
  double P[kMaxIkJoints * kMaxIkJoints];
  const int rank = KernelBasis(tasks.num, n, tasks.J, options_.rank_tolerance, P);

  LeastSquaresCost cost(freedom);
  double row[kMaxQpVariables], c[kMaxQpVariables];
  const double w = options_.direction_weight;
  for (int j = 0; j < freedom; ++j) {
    const double beta = Z[j * (n + 1) + n];
    row[j] = beta / unit;
    c[j] = -w * beta / unit;
    cost.Regularize(j, 1e-9, 0.0);
  }
  cost.AddRow(row, 1.0, std::sqrt(kAlphaCurvature * w));
  for (int k = 0; k < n - rank; ++k) {
    const double* const p = P + k * n;
    for (int j = 0; j < freedom; ++j) row[j] = Dot(p, Z + j * (n + 1), n);
    cost.AddRow(row, v_c != nullptr ? Dot(p, v_c, n) : 0.0, std::sqrt(2.0));
  }
  const int m = n + 1 + constraints.num;
  double C[(kMaxQpVariables + kMaxIkRows) * kMaxQpVariables];
  double lower[kMaxQpVariables + kMaxIkRows], upper[kMaxQpVariables + kMaxIkRows];
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j < freedom; ++j) C[i * freedom + j] = Z[j * (n + 1) + i];
  }
  std::copy(step->lower, step->lower + n, lower);
  std::copy(step->upper, step->upper + n, upper);
  lower[n] = 0.0;
  upper[n] = unit;
  for (int k = 0; k < constraints.num; ++k) {
    double* const out = C + (n + 1 + k) * freedom;
    for (int j = 0; j < freedom; ++j) out[j] = Dot(constraints.C + k * n, Z + j * (n + 1), n);
    lower[n + 1 + k] = constraints.lower[k];
    upper[n + 1 + k] = constraints.upper[k];
  }
  QpSolver solver;
  double y[kMaxQpVariables];
  const QpStatus status =
      solver.Solve(cost, c, nullptr, nullptr, LinearRows{m, C, lower, upper}, y);
  step->iterations += solver.iterations();
  if (status != QpStatus::kOptimal) return false;
  double beta = 0.0;
  for (int i = 0; i <= n; ++i) {
    double value = 0.0;
    for (int j = 0; j < freedom; ++j) value += y[j] * Z[j * (n + 1) + i];
    if (i < n) {
      step->v[i] = std::min(std::max(value, step->lower[i]), step->upper[i]);
    } else {
      beta = value;
    }
  }
  step->alpha = shortened * std::min(std::max(beta / unit, 0.0), 1.0);
  return true;
}

// Goes on from the optimum of the first level: each further one is free in the kernel of those
// before it only, and the last is the centering.
void DifferentialIk::Priorities(const IkTaskRows& tasks, const LinearRows& constraints,
                                const double* v_c, IkStep* step) const {
  const int n = n_;
  double Z[kMaxIkJoints * kMaxIkJoints], K[kMaxIkJoints * kMaxIkJoints];
  double JZ[kMaxIkRows * kMaxIkJoints];
  double C[(kMaxIkJoints + kMaxIkRows) * kMaxIkJoints];
  double lower[kMaxIkJoints + kMaxIkRows], upper[kMaxIkJoints + kMaxIkRows];
  int begin = 0, size = tasks.level_sizes != nullptr ? tasks.level_sizes[0] : tasks.num;
  int freedom = n - KernelBasis(size, n, tasks.J, options_.rank_tolerance, Z);
  QpSolver solver;
  for (int level = 1; level <= tasks.num_levels && freedom > 0; ++level) {
    const bool last = level == tasks.num_levels;
    if (last && v_c == nullptr) return;
    begin += size;
    size = last ? 0 : tasks.level_sizes[level];
    LeastSquaresCost cost(freedom);
    double longest = 0.0;
    for (int k = 0; k < size; ++k) {
      const double* const row = tasks.J + (begin + k) * n;
      double* const out = JZ + k * freedom;
      for (int j = 0; j < freedom; ++j) out[j] = Dot(row, Z + j * n, n);
      const double w = tasks.weights ? tasks.weights[begin + k] : 1.0;
      cost.AddRow(out, tasks.V[begin + k] - Dot(row, step->v, n), w);
      longest = std::max(longest, w * Norm(row, n));
    }
    for (int j = 0; j < freedom; ++j) {
      if (last) {
        // |v̄ + Z^T y − v_c|² in orthonormal directions.
        cost.Regularize(j, 1.0, Dot(Z + j * n, v_c, n) - Dot(Z + j * n, step->v, n));
      } else {
        cost.Regularize(j, kRegularization * std::max(longest, 1.0), 0.0);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < freedom; ++j) C[i * freedom + j] = Z[j * n + i];
      lower[i] = step->lower[i] - step->v[i];
      upper[i] = step->upper[i] - step->v[i];
    }
    for (int k = 0; k < constraints.num; ++k) {
      const double* const row = constraints.C + k * n;
      for (int j = 0; j < freedom; ++j) C[(n + k) * freedom + j] = Dot(row, Z + j * n, n);
      const double value = Dot(row, step->v, n);
      // What is violated already may stay so, but not become worse.
      lower[n + k] = std::min(constraints.lower[k] - value, 0.0);
      upper[n + k] = std::max(constraints.upper[k] - value, 0.0);
    }
    double y[kMaxIkJoints];
    const QpStatus status = solver.Solve(cost, nullptr, nullptr, nullptr,
                                         LinearRows{n + constraints.num, C, lower, upper}, y);
    step->iterations += solver.iterations();
    if (status == QpStatus::kOptimal) {
      for (int j = 0; j < freedom; ++j) {
        for (int i = 0; i < n; ++i) step->v[i] += y[j] * Z[j * n + i];
      }
      for (int i = 0; i < n; ++i) {
        step->v[i] = std::min(std::max(step->v[i], step->lower[i]), step->upper[i]);
      }
    }
    if (last) return;
    const int rank = KernelBasis(size, freedom, JZ, options_.rank_tolerance, K);
    double next[kMaxIkJoints * kMaxIkJoints] = {};
    for (int j = 0; j < freedom - rank; ++j) {
      for (int k = 0; k < freedom; ++k) {
        for (int i = 0; i < n; ++i) next[j * n + i] += K[j * freedom + k] * Z[k * n + i];
      }
    }
    freedom -= rank;
    std::copy(next, next + freedom * n, Z);
  }
}

void DifferentialIk::StepBatch(std::size_t N, const double* q, const double* v,
                               const IkTaskRows& tasks, const LinearRows& constraints,
                               double* v_next, std::int32_t* status, int num_threads) const {
  Require(num_threads >= 1, "num_threads: expected at least 1");
  const std::size_t n = n_, k = tasks.num, m = constraints.num;
  const auto share = std::min<std::size_t>(num_threads, std::max<std::size_t>(N, 1));
  internal::RunParallel(static_cast<int>(share), [&](int task) {
    IkStep step;
    for (std::size_t i = N * task / share; i < N * (task + 1) / share; ++i) {
      IkTaskRows mine = tasks;
      mine.J = tasks.J + i * k * n;
      mine.V = tasks.V + i * k;
      LinearRows rows = constraints;
      if (m > 0) {
        rows.C = constraints.C + i * m * n;
        rows.lower = constraints.lower + i * m;
        rows.upper = constraints.upper + i * m;
      }
      Step(q + i * n, v + i * n, mine, rows, &step);
      std::copy(step.v, step.v + n, v_next + i * n);
      status[i] = static_cast<std::int32_t>(step.status);
    }
  });
}

}  // namespace prehensile
