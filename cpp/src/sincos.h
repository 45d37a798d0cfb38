#pragma once

#include <cmath>

namespace prehensile::internal {

/// Largest |x| that SinCosReduced() may be given.
inline constexpr double kSinCosRange = 1e5;

/// Sine and cosine of |x| ≤ kSinCosRange to about one unit in the last place, without a branch, so
/// that loops over it vectorize. The same on every machine, which those of the C library are not.
///
/// Reduction to |r| ≤ π/4 by three parts of π/2 (Cody and Waite), then the Taylor series, whose
/// first term left out is below 1e-19.
inline void SinCosReduced(double x, double* sine, double* cosine) {
  // Adding 1.5 · 2⁵² rounds to the nearest integer; the first two parts of π/2 have 33 bits, so
  // that their products with it are exact.
  constexpr double kRound = 6755399441055744.0;
  const double turns = (x * 0.63661977236758134308 + kRound) - kRound;
  const double r = ((x - turns * 0x1.921fb54400000p+0) - turns * 0x1.0b4611a600000p-34) -
                   turns * 0x1.3198a2e037073p-69;
  const double z = r * r;
  const double s =
      r + r * z *
              (-1.0 / 6 +
               z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 +
                                                        z * (-1.0 / 39916800 +
                                                             z * (1.0 / 6227020800.0 +
                                                                  z * (-1.0 / 1307674368000.0 +
                                                                       z / 355687428096000.0)))))));
  const double c =
      1.0 -
      z * (0.5 - z * (1.0 / 24 - z * (1.0 / 720 -
                                      z * (1.0 / 40320 - z * (1.0 / 3628800 -
                                                              z * (1.0 / 479001600 -
                                                                   z * (1.0 / 87178291200.0 -
                                                                        z / 20922789888000.0)))))));
  // turns mod 4 as 0, 1, 2 or -1 (or -2, which is 2).
  const double fours = (turns * 0.25 + kRound) - kRound;
  const double quarter = turns - 4.0 * fours;
  const bool odd = quarter == 1.0 || quarter == -1.0;
  const double a = odd ? c : s;
  const double b = odd ? s : c;
  *sine = quarter == 2.0 || quarter == -2.0 || quarter == -1.0 ? -a : a;
  *cosine = quarter == 2.0 || quarter == -2.0 || quarter == 1.0 ? -b : b;
}

/// Sine and cosine of any x.
inline void SinCos(double x, double* sine, double* cosine) {
  if (std::abs(x) <= kSinCosRange) {
    SinCosReduced(x, sine, cosine);
  } else {
    *sine = std::sin(x);
    *cosine = std::cos(x);
  }
}

}  // namespace prehensile::internal
