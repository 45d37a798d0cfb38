#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

// What the sources of differential inverse kinematics share.

namespace prehensile::internal {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

inline double Dot(const double* a, const double* b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

inline double Norm(const double* a, int n) { return std::sqrt(Dot(a, a, n)); }

/// The number of [lower, upper] that is nearest to x; lower if x is NaN.
inline double Clamped(double x, double lower, double upper) {
  return std::min(std::max(lower, x), upper);
}

inline void Require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

}  // namespace prehensile::internal
