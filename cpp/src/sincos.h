#pragma once

#include <cmath>

namespace prehensile::internal {

/// Largest |x| that SinCosReduced() may be given.
inline constexpr double kSinCosRange = 1e5;

/// Sine and cosine of |x| ≤ kSinCosRange to about one unit in the last place, without a branch; T
/// is double or a vector of them. The same on every machine, which those of the C library are not.
/// (`static`, so that each SIMD level has its own.)
///
/// Reduction to |r| ≤ π/4 by three parts of π/2 (Cody and Waite), then the Taylor series, whose
/// first term left out is below 1e-19.
template <typename T>
[[gnu::always_inline]] static inline void SinCosReduced(const T& x, T* sine, T* cosine) {
  // Adding 1.5 · 2⁵² rounds to the nearest integer; the first two parts of π/2 have 33 bits, so
  // that their products with it are exact.
  constexpr double kRound = 6755399441055744.0;
  const T turns = (x * 0.63661977236758134308 + kRound) - kRound;
  const T r = ((x - turns * 0x1.921fb54400000p+0) - turns * 0x1.0b4611a600000p-34) -
              turns * 0x1.3198a2e037073p-69;
  const T z = r * r;
  constexpr double kSine[] = {
      1.0 / 355687428096000, -1.0 / 1307674368000, 1.0 / 6227020800, -1.0 / 39916800,
      1.0 / 362880,          -1.0 / 5040,          1.0 / 120,        -1.0 / 6};
  constexpr double kCosine[] = {
      1.0 / 20922789888000, -1.0 / 87178291200, 1.0 / 479001600, -1.0 / 3628800,
      1.0 / 40320,          -1.0 / 720,         1.0 / 24,        -0.5};
  T s = z * kSine[0], c = z * kCosine[0];
  for (int i = 1; i < 7; ++i) {
    s = z * (s + kSine[i]);
    c = z * (c + kCosine[i]);
  }
  s = r + r * (z * (s + kSine[7]));
  c = 1.0 + z * (c + kCosine[7]);
  // turns mod 4 as 0, 1, 2 or -1 (or -2, which is 2).
  const T fours = (turns * 0.25 + kRound) - kRound;
  const T quarter = turns - 4.0 * fours;
  const auto odd = (quarter == 1.0) | (quarter == -1.0);
  const T a = odd ? c : s;
  const T b = odd ? s : c;
  const auto half = (quarter == 2.0) | (quarter == -2.0);
  *sine = (half | (quarter == -1.0)) ? -a : a;
  *cosine = (half | (quarter == 1.0)) ? -b : b;
}

/// The angle itself, or an equal one within kSinCosRange.
inline double WithinRange(double x) {
  return std::abs(x) <= kSinCosRange ? x : std::atan2(std::sin(x), std::cos(x));
}

}  // namespace prehensile::internal
