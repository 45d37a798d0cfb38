// The programs of the formulations; see DifferentialIk::Step().

#include <algorithm>
#include <cmath>
#include <vector>

#include "prehensile/differential_ik.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::Clamped;
using internal::Dot;
using internal::kInfinity;
using internal::Norm;

// Regularization of every joint, relative to the longest row of a Jacobian: it makes the optimum
// unique where nothing else does, and moves it by about its square over that of a singular value.
constexpr double kRegularization = 1e-6;
// Square root of the weight of a constraint's violation, relative to that of the tasks.
constexpr double kRelaxation = 1e4;
// Curvature of the reward of alpha, relative to its slope.
constexpr double kAlphaCurvature = 1e-7;

// Greatest of the rows' norms, weights counted.
double Scale(const IkTaskRows& tasks, int n) {
  double scale = 1.0;
  for (int k = 0; k < tasks.num; ++k) {
    const double w = tasks.weights ? tasks.weights[k] : 1.0;
    scale = std::max(scale, w * w * Dot(tasks.J + k * n, tasks.J + k * n, n));
  }
  return std::sqrt(scale);
}

}  // namespace

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
  if ((s == 0.0 && desired > 0.0) || !std::isfinite(s)) return false;
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
      step->v[i] = Clamped(value, step->lower[i], step->upper[i]);
    } else {
      beta = value;
    }
  }
  step->alpha = shortened * Clamped(beta / unit, 0.0, 1.0);
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
        step->v[i] = Clamped(step->v[i], step->lower[i], step->upper[i]);
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

}  // namespace prehensile
