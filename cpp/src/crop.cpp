#include "prehensile/crop.h"

#include <cmath>

namespace prehensile {

template <typename Scalar>
void InsideBox(const Scalar* points, std::size_t n, const double* X_BW, const double* size,
               std::uint8_t* mask) {
  const double hx = 0.5 * size[0], hy = 0.5 * size[1], hz = 0.5 * size[2];
  const double* const X = X_BW;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = points[3 * i], y = points[3 * i + 1], z = points[3 * i + 2];
    // A comparison with NaN is false. Integers, so that nothing branches.
    const int in_x = std::abs(X[0] * x + X[1] * y + X[2] * z + X[3]) <= hx;
    const int in_y = std::abs(X[4] * x + X[5] * y + X[6] * z + X[7]) <= hy;
    const int in_z = std::abs(X[8] * x + X[9] * y + X[10] * z + X[11]) <= hz;
    mask[i] = static_cast<std::uint8_t>(in_x & in_y & in_z);
  }
}

template <typename Scalar>
void InsideHalfSpace(const Scalar* points, std::size_t n, const double* normal, double offset,
                     std::uint8_t* mask) {
  for (std::size_t i = 0; i < n; ++i) {
    const double height =
        normal[0] * points[3 * i] + normal[1] * points[3 * i + 1] + normal[2] * points[3 * i + 2];
    mask[i] = static_cast<std::uint8_t>(height >= offset && std::isfinite(height));
  }
}

template void InsideBox(const float*, std::size_t, const double*, const double*, std::uint8_t*);
template void InsideBox(const double*, std::size_t, const double*, const double*, std::uint8_t*);
template void InsideHalfSpace(const float*, std::size_t, const double*, double, std::uint8_t*);
template void InsideHalfSpace(const double*, std::size_t, const double*, double, std::uint8_t*);

}  // namespace prehensile
