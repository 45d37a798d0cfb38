#include "prehensile/differential_ik.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::Clamped;
using internal::Dot;
using internal::kInfinity;
using internal::Require;

// Violation of a linear constraint, relative to its row, that counts as none.
constexpr double kViolation = 1e-8;

bool AllFinite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
}

double Violation(const LinearRows& rows, const double* v, int n, double* relative) {
  double worst = 0.0;
  *relative = 0.0;
  for (int k = 0; k < rows.num; ++k) {
    const double* const row = rows.C + k * n;
    const double value = Dot(row, v, n);
    // Where the sum overflows nobody knows.
    const double violation = std::isfinite(value)
                                 ? std::max({0.0, rows.lower[k] - value, value - rows.upper[k]})
                                 : kInfinity;
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
  double speed = std::min(size / period, std::numeric_limits<double>::max());
  const double change = acceleration * period;
  if (speed > change) {
    // One period at v, then slower by `change` each, takes h ((n + 1) v − change n (n + 1) / 2)
    // with n = floor(v / change); this is the inverse of that piecewise linear function.
    // Cut off where it would overflow, far beyond any room there is.
    const double steps = std::min(speed / change, 1e300);
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
  step->status = beyond ? DifferentialIkStatus::kRecovering : DifferentialIkStatus::kOptimal;
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
    for (int i = 0; i < n_; ++i) step->v[i] = Clamped(step->v[i], lower[i], upper[i]);
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
      if (relative > kViolation) step->status = DifferentialIkStatus::kRelaxed;
    }
    if (solved && levels) {
      Priorities(tasks, constraints, center, step);
      step->violation = Violation(constraints, step->v, n_, &relative);
    }
  }
  if (!solved) {
    for (int i = 0; i < n_; ++i) step->v[i] = Clamped(0.0, step->lower[i], step->upper[i]);
    step->alpha = 0.0;
    step->violation = Violation(constraints, step->v, n_, &relative);
    step->status = DifferentialIkStatus::kBraking;
  }
}

void DifferentialIk::StepBatch(std::size_t N, const double* q, const double* v,
                               const IkTaskRows& tasks, const LinearRows& constraints,
                               double* v_next, std::int32_t* status, int num_threads) const {
  const std::size_t n = n_, k = tasks.num, m = constraints.num;
  internal::RunShares(N, 16, num_threads, [&](std::size_t begin, std::size_t end) {
    IkStep step;
    for (std::size_t i = begin; i < end; ++i) {
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
