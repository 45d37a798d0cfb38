#pragma once

#include "prehensile/robust_loss.h"

// Robust losses and their surrogates for graduated non-convexity. `static`, so that kernels that
// are compiled once per SIMD level have their own. r2 is the square of a residual, c its scale.

namespace prehensile::internal {

/// The loss of a residual; see RobustLoss.
template <typename Scalar>
[[gnu::always_inline]] static inline Scalar Loss(RobustLoss kind, Scalar r2, Scalar c) {
  const Scalar c2 = c * c;
  switch (kind) {
    case RobustLoss::kHuber:
      return r2 <= c2 ? r2 : 2 * c * static_cast<Scalar>(__builtin_sqrt(r2)) - c2;
    case RobustLoss::kTukey: {
      // c² / 3 (1 - (1 - x)³) without the cancellation.
      const Scalar x = r2 < c2 ? r2 / c2 : Scalar{1};
      return c2 / 3 * (x * (3 - x * (3 - x)));
    }
    case RobustLoss::kGemanMcClure:
      return r2 * (c2 / (c2 + r2));
    case RobustLoss::kTruncated:
      return r2 < c2 ? r2 : c2;
    case RobustLoss::kLeastSquares:
      break;
  }
  return r2;
}

/// The derivative of the loss by r²: the weight of the residual in reweighted least squares.
template <typename Scalar>
[[gnu::always_inline]] static inline Scalar Weight(RobustLoss kind, Scalar r2, Scalar c) {
  const Scalar c2 = c * c;
  switch (kind) {
    case RobustLoss::kHuber:
      return r2 <= c2 ? Scalar{1} : c / static_cast<Scalar>(__builtin_sqrt(r2));
    case RobustLoss::kTukey: {
      const Scalar t = r2 < c2 ? 1 - r2 / c2 : Scalar{0};
      return t * t;
    }
    case RobustLoss::kGemanMcClure: {
      const Scalar t = c2 / (c2 + r2);
      return t * t;
    }
    case RobustLoss::kTruncated:
      return r2 <= c2 ? Scalar{1} : Scalar{0};
    case RobustLoss::kLeastSquares:
      break;
  }
  return Scalar{1};
}

// Graduated non-convexity (Yang, Antonante, Tzoumas and Carlone, "Graduated Non-Convexity for
// Robust Spatial Perception: From Non-Minimal Solvers to Global Outlier Rejection", RA-L 2020):
// weighted least squares, the weights of a surrogate that starts convex and becomes the loss.

/// By what the control parameter changes from one weighted least squares to the next.
inline constexpr double kGncStep = 1.4;

/// The control parameter to start from, for which the surrogate is convex over the residuals.
///
/// @param kind kGemanMcClure (falls to 1) or kTruncated (grows without bound).
/// @param max_r2 the largest of them.
/// @return for kTruncated 0 or less if all residuals are within the scale: there is nothing to do.
[[gnu::always_inline]] static inline double GncStart(RobustLoss kind, double max_r2, double c) {
  const double c2 = c * c;
  if (kind == RobustLoss::kGemanMcClure) return 2 * max_r2 / c2 > 1 ? 2 * max_r2 / c2 : 1.0;
  return max_r2 <= c2 ? 0.0 : c2 / (2 * max_r2 - c2);
}

[[gnu::always_inline]] static inline double GncNext(RobustLoss kind, double mu) {
  if (kind == RobustLoss::kGemanMcClure) return mu / kGncStep > 1 ? mu / kGncStep : 1.0;
  return mu * kGncStep;
}

/// The weight of a residual for the surrogate of that control parameter (theirs, (12) and (14)).
[[gnu::always_inline]] static inline double GncWeight(RobustLoss kind, double r2, double c,
                                                      double mu) {
  const double c2 = c * c;
  if (kind == RobustLoss::kGemanMcClure) {
    const double t = mu * c2 / (r2 + mu * c2);
    return t * t;
  }
  if (r2 <= mu / (mu + 1) * c2) return 1.0;
  if (r2 >= (mu + 1) / mu * c2) return 0.0;
  return c * __builtin_sqrt(mu * (mu + 1) / r2) - mu;
}

/// The surrogate itself (theirs, (6) and (8)), whose derivative by r² is the weight.
[[gnu::always_inline]] static inline double GncLoss(RobustLoss kind, double r2, double c,
                                                    double mu) {
  const double c2 = c * c;
  if (kind == RobustLoss::kGemanMcClure) return mu * c2 * r2 / (mu * c2 + r2);
  if (r2 <= mu / (mu + 1) * c2) return r2;
  if (r2 >= (mu + 1) / mu * c2) return c2;
  return 2 * c * __builtin_sqrt(r2 * mu * (mu + 1)) - mu * (c2 + r2);
}

}  // namespace prehensile::internal
