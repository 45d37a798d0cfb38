#include "prehensile/quadratic_program.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "vectors.h"

namespace prehensile {
namespace {

constexpr int kLeading = LeastSquaresCost::kMaxRows + kMaxQpVariables;
using internal::Clamped;
using internal::Dot;
using internal::kInfinity;

// Violation of a constraint, relative to its size, that counts as none.
constexpr double kTolerance = 1e-12;

// The reflection I − beta h h^T that takes x to (mu, 0, ..., 0); h replaces x.
double Householder(double* x, int n, double* mu) {
  const double tail = Dot(x + 1, x + 1, n - 1);
  if (tail == 0.0) {
    *mu = x[0];
    return 0.0;
  }
  const double norm = std::sqrt(x[0] * x[0] + tail);
  // Without cancellation: h0 = x0 − mu, of the sign of x0.
  *mu = x[0] > 0.0 ? -norm : norm;
  x[0] -= *mu;
  return 2.0 / (x[0] * x[0] + tail);
}

}  // namespace

void LeastSquaresCost::AddRow(const double* a, double b, double w) {
  for (int j = 0; j < n_; ++j) E_[j * kLeading + num_rows_] = w * a[j];
  f_[num_rows_++] = w * b;
}

// Makes x the unconstrained optimum without c, and J the inverse of the triangular factor of E.
void QpSolver::Factorize(LeastSquaresCost& cost, double* x) {
  const int n = n_, rows = cost.num_rows_;
  double* const E = cost.E_;
  double* const f = cost.f_;
  // The regularizing rows stand below the others. When column j is eliminated, only its own one of
  // them is not zero yet or has been touched: each reflection takes rows + 1 numbers.
  double diagonal[kMaxQpVariables];
  double x_f[kMaxQpVariables];
  // Row j of the triangular factor is kept in R_ (as a scratch place), row-major.
  double* const U = R_;
  // Eliminating column j mixes the dense rows with row j of the diagonal block: what results is row
  // j of U and dense rows without column j.
  for (int j = 0; j < n; ++j) {
    double* const column = E + j * kLeading;
    const double d = cost.d_[j];
    const double tail = Dot(column, column, rows);
    const double norm = std::sqrt(d * d + tail);
    // d > 0, so mu = −norm; h = (d + norm, column).
    const double mu = -norm, h0 = d + norm;
    const double beta = 2.0 / (h0 * h0 + tail);
    U[j * n + j] = mu;
    for (int k = j + 1; k < n; ++k) {
      double* const other = E + k * kLeading;
      const double s = beta * Dot(column, other, rows);  // Row j of column k is zero.
      U[j * n + k] = -s * h0;
      for (int i = 0; i < rows; ++i) other[i] -= s * column[i];
    }
    const double dr = d * cost.r_[j];
    const double s = beta * (h0 * dr + Dot(column, f, rows));
    x_f[j] = dr - s * h0;
    for (int i = 0; i < rows; ++i) f[i] -= s * column[i];
    diagonal[j] = 1.0 / mu;
  }
  // x = U⁻¹ x_f, J = U⁻¹.
  for (int i = n - 1; i >= 0; --i) {
    double sum = x_f[i];
    for (int k = i + 1; k < n; ++k) sum -= U[i * n + k] * x[k];
    x[i] = sum * diagonal[i];
  }
  std::memset(J_, 0, sizeof(double) * n * n);
  for (int i = n - 1; i >= 0; --i) {
    double* const row = J_ + i * n;
    for (int k = i + 1; k < n; ++k) {
      const double factor = -U[i * n + k] * diagonal[i];
      const double* const below = J_ + k * n;
      for (int j = k; j < n; ++j) row[j] += factor * below[j];
    }
    row[i] = diagonal[i];
  }
}

// d = J^T np, where np is sign times a row or a unit vector.
void QpSolver::Direction(const double* np, int variable, double sign) {
  const int n = n_;
  if (np == nullptr) {
    for (int j = 0; j < n; ++j) d_[j] = sign * J_[variable * n + j];
    return;
  }
  for (int j = 0; j < n; ++j) d_[j] = 0.0;
  for (int i = 0; i < n; ++i) {
    const double factor = sign * np[i];
    if (factor == 0.0) continue;
    for (int j = 0; j < n; ++j) d_[j] += factor * J_[i * n + j];
  }
}

// Takes constraint p with J^T n_p = d_ into the active set.
void QpSolver::Add(int p, int side, double u) {
  const int n = n_, q = num_active_;
  double mu;
  const double beta = Householder(d_ + q, n - q, &mu);
  if (beta != 0.0) {
    for (int i = 0; i < n; ++i) {
      double* const row = J_ + i * n + q;
      const double s = beta * Dot(row, d_ + q, n - q);
      for (int j = 0; j < n - q; ++j) row[j] -= s * d_[q + j];
    }
  }
  double* const column = R_ + q * n;
  for (int i = 0; i < q; ++i) column[i] = d_[i];
  column[q] = mu;
  active_[q] = p;
  side_[q] = side;
  u_[q] = u;
  ++num_active_;
}

// Lets the k-th active constraint go.
void QpSolver::Drop(int k) {
  const int n = n_;
  for (int c = k; c + 1 < num_active_; ++c) {
    std::memcpy(R_ + c * n, R_ + (c + 1) * n, sizeof(double) * (c + 2));
    active_[c] = active_[c + 1];
    side_[c] = side_[c + 1];
    u_[c] = u_[c + 1];
  }
  --num_active_;
  for (int c = k; c < num_active_; ++c) {
    // A rotation of rows c and c + 1 takes away what stands below the diagonal of column c.
    const double a = R_[c * n + c], b = R_[c * n + c + 1];
    const double norm = std::sqrt(a * a + b * b);
    if (norm == 0.0) continue;
    const double cosine = a / norm, sine = b / norm;
    for (int j = c; j < num_active_; ++j) {
      double* const r = R_ + j * n + c;
      const double top = r[0], bottom = r[1];
      r[0] = cosine * top + sine * bottom;
      r[1] = cosine * bottom - sine * top;
    }
    for (int i = 0; i < n; ++i) {
      double* const r = J_ + i * n + c;
      const double left = r[0], right = r[1];
      r[0] = cosine * left + sine * right;
      r[1] = cosine * right - sine * left;
    }
  }
}

// Puts x back on the active constraints by the step that costs least.
void QpSolver::Correct(const double* lower, const double* upper, const LinearRows& rows,
                       double* x) const {
  const int n = n_, q = num_active_;
  double y[kMaxQpVariables];
  for (int k = 0; k < q; ++k) {
    // R^T y = side (bound − value), row by row.
    const int p = active_[k];
    double bound, value;
    if (p < n) {
      bound = side_[k] > 0 ? lower[p] : upper[p];
      value = x[p];
    } else {
      bound = side_[k] > 0 ? rows.lower[p - n] : rows.upper[p - n];
      value = Dot(rows.C + (p - n) * n, x, n);
    }
    double sum = side_[k] * (bound - value);
    for (int j = 0; j < k; ++j) sum -= R_[k * n + j] * y[j];
    y[k] = sum / R_[k * n + k];
  }
  for (int i = 0; i < n; ++i) x[i] += Dot(J_ + i * n, y, q);
}

QpStatus QpSolver::Solve(LeastSquaresCost& cost, const double* c, const double* lower,
                         const double* upper, const LinearRows& rows, double* x) {
  const int n = n_ = cost.n_;
  num_active_ = iterations_ = 0;
  Factorize(cost, x);
  if (c != nullptr) {
    double y[kMaxQpVariables] = {};
    for (int i = 0; i < n; ++i) {
      for (int j = i; j < n; ++j) y[j] += J_[i * n + j] * c[i];
    }
    for (int i = 0; i < n; ++i) x[i] -= Dot(J_ + i * n + i, y + i, n - i);
  }
  const auto clamp = [&] {
    if (lower == nullptr) return;
    for (int i = 0; i < n; ++i) x[i] = Clamped(x[i], lower[i], upper[i]);
  };
  const int num_bounds = lower != nullptr ? n : 0;
  const int max_iterations = 10 * (n + rows.num) + 20;
  double r[kMaxQpVariables];
  int corrections = 0;
  for (;;) {
    // The constraint that is violated most; equalities before all others.
    int p = -1, side = 0;
    double worst = 0.0;
    bool equality = false;
    for (int i = 0; i < num_bounds; ++i) {
      const double low = lower[i] - x[i], high = x[i] - upper[i];
      const double violation = std::max(low, high);
      if (violation > worst && violation > kTolerance * (1.0 + std::abs(x[i]))) {
        worst = violation;
        p = i;
        side = low > high ? 1 : -1;
      }
    }
    for (int k = 0; k < rows.num; ++k) {
      const bool equal = rows.lower[k] == rows.upper[k];
      if (equality && !equal) continue;
      const double* const row = rows.C + k * n;
      double value = 0.0, size = 1.0;
      for (int i = 0; i < n; ++i) {
        const double term = row[i] * x[i];
        value += term;
        size = std::max(size, std::abs(term));
      }
      const double low = rows.lower[k] - value, high = value - rows.upper[k];
      const double violation = std::max(low, high);
      if (violation > kTolerance * size && (violation > worst || (equal && !equality))) {
        worst = violation;
        equality = equal;
        p = n + k;
        side = low > high ? 1 : -1;
      }
    }
    if (p < 0) break;
    if (std::find(active_, active_ + num_active_, p) != active_ + num_active_) {
      // Already active, and yet violated: x has come from far and brought rounding errors along.
      if (++corrections > 3) {
        clamp();
        return QpStatus::kNoProgress;
      }
      Correct(lower, upper, rows, x);
      continue;
    }
    const double* const np = p < n ? nullptr : rows.C + (p - n) * n;
    double u = 0.0;
    for (bool taken = false; !taken;) {
      if (++iterations_ > max_iterations) {
        clamp();
        return QpStatus::kNoProgress;
      }
      const int q = num_active_;
      Direction(np, p, side);
      for (int i = q - 1; i >= 0; --i) {
        double sum = d_[i];
        for (int j = i + 1; j < q; ++j) sum -= R_[j * n + i] * r[j];
        r[i] = sum / R_[i * n + i];
      }
      // The longest step for which no multiplier of an inequality becomes negative.
      double t1 = kInfinity;
      int leaving = -1;
      for (int k = 0; k < q; ++k) {
        const int a = active_[k] - n;
        if (r[k] <= 0.0 || (a >= 0 && rows.lower[a] == rows.upper[a])) continue;
        const double t = u_[k] / r[k];
        if (t < t1) {
          t1 = t;
          leaving = k;
        }
      }
      const double free_part = Dot(d_ + q, d_ + q, n - q);
      const double all = free_part + Dot(d_, d_, q);
      // Normals that depend on the active ones leave but rounding errors in the free part.
      const bool independent = free_part > 1e-26 * all;
      const double value = np == nullptr ? x[p] : Dot(np, x, n);
      const double bound = np == nullptr ? (side > 0 ? lower[p] : upper[p])
                                         : (side > 0 ? rows.lower[p - n] : rows.upper[p - n]);
      const double short_of = side * (bound - value);
      const double t2 = independent ? std::max(short_of, 0.0) / free_part : kInfinity;
      if (t1 == kInfinity && t2 == kInfinity) {
        clamp();
        return QpStatus::kInfeasible;
      }
      const double t = std::min(t1, t2);
      for (int k = 0; k < q; ++k) u_[k] -= t * r[k];
      u += t;
      if (independent) {
        for (int i = 0; i < n; ++i) x[i] += t * Dot(J_ + i * n + q, d_ + q, n - q);
      }
      if (t2 <= t1) {
        Add(p, side, u);
        corrections = 0;
        taken = true;
      } else {
        Drop(leaving);
      }
    }
  }
  // Where squares overflow, NaN violates nothing.
  const bool finite = std::all_of(x, x + n, [](double value) { return std::isfinite(value); });
  clamp();
  return finite ? QpStatus::kOptimal : QpStatus::kNoProgress;
}

int KernelBasis(int num, int n, const double* A, double tolerance, double* Z) {
  // QR with column pivoting of A^T: what is beyond the rank in Q spans the kernel.
  constexpr int kMaxRows = LeastSquaresCost::kMaxRows;
  double W[kMaxRows * kMaxQpVariables];
  double beta[kMaxQpVariables];
  double* column[kMaxRows];
  double norm[kMaxRows];
  std::memcpy(W, A, sizeof(double) * num * n);
  double longest = 0.0;
  for (int k = 0; k < num; ++k) {
    column[k] = W + k * n;
    norm[k] = Dot(column[k], column[k], n);
    longest = std::max(longest, norm[k]);
  }
  const double zero = tolerance * tolerance * longest;
  int rank = 0;
  for (; rank < std::min(num, n); ++rank) {
    int pivot = rank;
    for (int k = rank + 1; k < num; ++k) {
      if (norm[k] > norm[pivot]) pivot = k;
    }
    if (!(norm[pivot] > zero)) break;
    std::swap(column[pivot], column[rank]);
    std::swap(norm[pivot], norm[rank]);
    double* const h = column[rank] + rank;
    const int m = n - rank;
    double mu;
    beta[rank] = Householder(h, m, &mu);
    for (int k = rank + 1; k < num; ++k) {
      double* const other = column[k] + rank;
      const double s = beta[rank] * Dot(h, other, m);
      for (int i = 0; i < m; ++i) other[i] -= s * h[i];
      norm[k] = Dot(other + 1, other + 1, m - 1);
    }
  }
  for (int b = rank; b < n; ++b) {
    double* const z = Z + (b - rank) * n;
    for (int i = 0; i < n; ++i) z[i] = i == b ? 1.0 : 0.0;
    for (int k = rank - 1; k >= 0; --k) {
      const double* const h = column[k] + k;
      const double s = beta[k] * Dot(h, z + k, n - k);
      for (int i = 0; i < n - k; ++i) z[k + i] -= s * h[i];
    }
  }
  return rank;
}

}  // namespace prehensile
