#pragma once

namespace prehensile {

/// Greatest number of variables of a small quadratic program.
inline constexpr int kMaxQpVariables = 40;

/// Two-sided linear constraints lower ≤ C x ≤ upper; infinite sides constrain nothing, equal ones
/// make an equality. C is num × n, row-major.
struct LinearRows {
  int num = 0;
  const double* C = nullptr;
  const double* lower = nullptr;
  const double* upper = nullptr;
};

enum class QpStatus {
  kOptimal,
  /// The constraints contradict each other.
  kInfeasible,
  /// The cap on iterations was reached, or arithmetic was lost to rounding.
  kNoProgress,
};

/// The sum of squares ½ |E x − f|² of a small program, built row by row.
///
/// Every variable has a regularizing row d_j (x_j − r_j) of its own from the start, which makes the
/// optimum unique.
class LeastSquaresCost {
 public:
  static constexpr int kMaxRows = 160;

  /// @param n number of variables, 1 .. kMaxQpVariables.
  explicit LeastSquaresCost(int n) : n_(n) {}

  int num_variables() const { return n_; }

  /// Adds ½ (w (a·x − b))².
  void AddRow(const double* a, double b, double w);

  /// Sets the regularizing row of variable j: ½ (d (x_j − r))², d > 0.
  void Regularize(int j, double d, double r) {
    d_[j] = d;
    r_[j] = r;
  }

 private:
  friend class QpSolver;
  int n_;
  int num_rows_ = 0;
  // Column-major with a leading dimension of kMaxRows + kMaxQpVariables.
  double E_[(kMaxRows + kMaxQpVariables) * kMaxQpVariables];
  double f_[kMaxRows + kMaxQpVariables];
  double d_[kMaxQpVariables];
  double r_[kMaxQpVariables];
};

/// Minimizes ½ |E x − f|² + c·x subject to bounds and linear rows.
///
/// The dual active-set method of D. Goldfarb and A. Idnani, "A numerically stable dual method for
/// solving strictly convex quadratic programs", Mathematical Programming 27 (1983). It begins at
/// the unconstrained optimum, so no feasible point is needed, and tells contradictory constraints.
/// The factor of the Hessian comes from a QR decomposition of E, so that small regularizations keep
/// their meaning (the Hessian itself is never formed). No memory is allocated; the time is bounded
/// by a cap on the iterations.
class QpSolver {
 public:
  /// @param cost is used up.
  /// @param c n numbers, or nullptr for none.
  /// @param lower, upper n bounds each, or both nullptr for none.
  /// @param rows further constraints.
  /// @param x room for n numbers. The bounds hold exactly whatever the status.
  QpStatus Solve(LeastSquaresCost& cost, const double* c, const double* lower, const double* upper,
                 const LinearRows& rows, double* x);

  /// Iterations of the last call: constraints taken up or let go.
  int iterations() const { return iterations_; }

 private:
  void Factorize(LeastSquaresCost& cost, double* x);
  void Add(int p, int side, double u);
  void Drop(int k);
  void Correct(const double* lower, const double* upper, const LinearRows& rows, double* x) const;
  void Direction(const double* np, int variable, double sign);

  int n_ = 0;
  int num_active_ = 0;
  int iterations_ = 0;
  // J J^T = H⁻¹, row-major n × n; its first num_active_ columns span the active normals.
  double J_[kMaxQpVariables * kMaxQpVariables];
  // Upper triangular factor of J^T N for the active normals N, column-major.
  double R_[kMaxQpVariables * kMaxQpVariables];
  double d_[kMaxQpVariables];
  double u_[kMaxQpVariables];
  int active_[kMaxQpVariables];
  int side_[kMaxQpVariables];
};

/// An orthonormal basis of the kernel of A.
///
/// @param A num × n, row-major.
/// @param tolerance what counts as zero, relative to the longest row.
/// @param Z room for n × n numbers; its first n − rank rows of n become the basis.
/// @returns the rank.
int KernelBasis(int num, int n, const double* A, double tolerance, double* Z);

}  // namespace prehensile
