#pragma once

#include <cstddef>
#include <cstdint>

namespace prehensile {

/// Which points lie inside or on a box: mask[i] = 1 or 0. A point that is not finite is outside.
///
/// @param points n rows of x, y, z, in frame W.
/// @param X_BW pose of W in the box's frame B, whose origin is the box's centre; 4 × 4, row-major.
/// @param size the box's edge lengths along B's axes.
/// @param mask room for n.
template <typename Scalar>
void InsideBox(const Scalar* points, std::size_t n, const double* X_BW, const double* size,
               std::uint8_t* mask);

/// Which points p have normal · p ≥ offset: mask[i] = 1 or 0. A point that is not finite has not.
template <typename Scalar>
void InsideHalfSpace(const Scalar* points, std::size_t n, const double* normal, double offset,
                     std::uint8_t* mask);

extern template void InsideBox(const float*, std::size_t, const double*, const double*,
                               std::uint8_t*);
extern template void InsideBox(const double*, std::size_t, const double*, const double*,
                               std::uint8_t*);
extern template void InsideHalfSpace(const float*, std::size_t, const double*, double,
                                     std::uint8_t*);
extern template void InsideHalfSpace(const double*, std::size_t, const double*, double,
                                     std::uint8_t*);

}  // namespace prehensile
