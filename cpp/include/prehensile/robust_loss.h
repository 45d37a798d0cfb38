#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace prehensile {

/// How the square r² of a residual counts in a sum that is made small. With a scale c > 0 [unit of
/// r]; every loss is r² near zero, and its weight is its derivative by r², 1 at zero.
enum class RobustLoss {
  /// r².
  kLeastSquares,
  /// r² up to c, 2 c r - c² beyond: convex, an outlier pulls with a constant force.
  kHuber,
  /// c²/3 (1 - (1 - (r/c)²)³) up to c, constant beyond (Beaton and Tukey 1974).
  kTukey,
  /// c² r² / (c² + r²) (Geman and McClure 1985).
  kGemanMcClure,
  /// min(r², c²): truncated least squares.
  kTruncated,
};

/// @param name as in Python: least_squares, huber, tukey, geman_mcclure, truncated.
/// @throws std::invalid_argument if there is none of that name.
inline RobustLoss ParseRobustLoss(std::string_view name) {
  if (name == "least_squares") return RobustLoss::kLeastSquares;
  if (name == "huber") return RobustLoss::kHuber;
  if (name == "tukey") return RobustLoss::kTukey;
  if (name == "geman_mcclure") return RobustLoss::kGemanMcClure;
  if (name == "truncated") return RobustLoss::kTruncated;
  throw std::invalid_argument("loss: there is no '" + std::string(name) + "'");
}

}  // namespace prehensile
