#pragma once

#include <cstddef>
#include <cstdint>

// Looking a distance up in the nodes of a field. `static`, so that kernels that are compiled once
// per SIMD level have their own; those know no Eigen, hence nodes of four plain numbers.

namespace prehensile::internal {

/// A field without its memory. Scalar is that of the points asked for.
template <typename Scalar>
struct FieldView {
  /// Distance and gradient of each; see FieldNode.
  const float* nodes;
  Scalar origin[3];
  Scalar spacing, inverse_spacing;
  std::int32_t sizes[3];
  bool is_signed;
};

template <typename Scalar>
struct FieldValue {
  Scalar distance;
  Scalar gradient[3];
};

template <typename Scalar>
struct FieldLanes;
template <>
struct FieldLanes<float> {
  using Type = float __attribute__((vector_size(16)));
};
template <>
struct FieldLanes<double> {
  using Type = double __attribute__((vector_size(32)));
};

/// Where a point is in the grid.
template <typename Scalar>
struct FieldCell {
  /// The node of the cell with the lowest indices.
  std::int32_t node;
  /// Where in the cell, 0 to 1; of a point outside, the nearest point of the grid.
  Scalar t[3];
  /// How far outside the grid, in cells.
  Scalar beyond[3];
};

/// Without branches, for the compiler to vectorize in a loop.
template <typename Scalar>
[[gnu::always_inline]] static inline FieldCell<Scalar> Locate(const FieldView<Scalar>& field,
                                                              Scalar x, Scalar y, Scalar z) {
  FieldCell<Scalar> cell;
  std::int32_t index[3];
  const Scalar p[3] = {x, y, z};
  for (int k = 0; k < 3; ++k) {
    const Scalar u = (p[k] - field.origin[k]) * field.inverse_spacing;
    const auto last = static_cast<Scalar>(field.sizes[k] - 1);
    const Scalar above = u > 0 ? u : Scalar{0};
    const Scalar inside = above < last ? above : last;
    cell.beyond[k] = u - inside;
    const auto i = static_cast<std::int32_t>(inside);
    index[k] = i < field.sizes[k] - 1 ? i : field.sizes[k] - 2;
    cell.t[k] = inside - static_cast<Scalar>(index[k]);
  }
  cell.node = (index[0] * field.sizes[1] + index[1]) * field.sizes[2] + index[2];
  return cell;
}

/// The value at a place in the grid; see DistanceField::OrientedAt.
template <typename Scalar>
[[gnu::always_inline]] static inline FieldValue<Scalar> Blend(const FieldView<Scalar>& field,
                                                              const FieldCell<Scalar>& cell) {
  using Node = typename FieldLanes<float>::Type;
  using Lanes = typename FieldLanes<Scalar>::Type;
  const Scalar* const t = cell.t;
  const Scalar* const beyond = cell.beyond;
  const std::ptrdiff_t step_y = field.sizes[2];
  const std::ptrdiff_t step_x = step_y * field.sizes[1];
  const float* const first = field.nodes + 4 * static_cast<std::ptrdiff_t>(cell.node);

  Node corners[8];
  for (int c = 0; c < 8; ++c) {
    __builtin_memcpy(&corners[c], first + 4 * ((c >> 2) * step_x + (c >> 1 & 1) * step_y + (c & 1)),
                     sizeof(Node));
  }
  if (!field.is_signed) {
    // Away from the surface, sides end somewhere. Neighbours whose distances differ by more than
    // their distance are not of one side: they take that of the corner nearest to p.
    const float side = first[4 * ((t[0] > Scalar{0.5}) * step_x + (t[1] > Scalar{0.5}) * step_y +
                                  (t[2] > Scalar{0.5}))];
    const float most = 1.8F * static_cast<float>(field.spacing);
    for (int c = 0; c < 8; ++c) {
      const float difference = corners[c][0] - side;
      const bool other = corners[c][0] * side < 0 && difference * difference > most * most;
      corners[c] *= other ? -1.0F : 1.0F;
    }
  }

  // Σ w (d, g), and Σ w g · (p - x), by way of the sums over the far half of the corners along each
  // axis: a far corner's offset along it is one cell less than a near one's.
  const Scalar one = 1;
  const Scalar near_x = one - t[0], near_y = one - t[1], near_z = one - t[2];
  const Scalar w_yz[4] = {near_y * near_z, near_y * t[2], t[1] * near_z, t[1] * t[2]};
  Lanes sum[8];
  for (int c = 0; c < 8; ++c) {
    const Scalar w = (c < 4 ? near_x : t[0]) * w_yz[c & 3];
    sum[c] = __builtin_convertvector(corners[c], Lanes) * w;
  }
  const Lanes far_y0 = sum[2] + sum[3], far_y1 = sum[6] + sum[7];
  const Lanes far_x = (sum[4] + sum[5]) + far_y1;
  const Lanes far_y = far_y0 + far_y1;
  const Lanes far_z = (sum[1] + sum[3]) + (sum[5] + sum[7]);
  const Lanes blend = ((sum[0] + sum[1]) + far_y0) + far_x;
  const Scalar slope =
      (t[0] * blend[1] - far_x[1]) + (t[1] * blend[2] - far_y[2]) + (t[2] * blend[3] - far_z[3]);
  FieldValue<Scalar> value{blend[0] + Scalar{0.5} * field.spacing * slope,
                           {blend[1], blend[2], blend[3]}};
  if (beyond[0] != 0 || beyond[1] != 0 || beyond[2] != 0) {
    // From the surface point of the nearest point q of the grid, q - d g, to p.
    Scalar* const g = value.gradient;
    const Scalar norm2 = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];
    const Scalar step = norm2 > 0 ? value.distance / __builtin_sqrt(norm2) : Scalar{0};
    const Scalar side = value.distance < 0 ? -1 : 1;
    Scalar o[3], length2 = 0;
    for (int k = 0; k < 3; ++k) {
      o[k] = beyond[k] * field.spacing + step * g[k];
      length2 += o[k] * o[k];
    }
    if (length2 > 0) {
      const Scalar length = __builtin_sqrt(length2);
      value.distance = side * length;
      for (int k = 0; k < 3; ++k) g[k] = side * o[k] / length;
    }
  }
  return value;
}

/// See DistanceField::OrientedAt.
template <typename Scalar>
[[gnu::always_inline]] static inline FieldValue<Scalar> LookUp(const FieldView<Scalar>& field,
                                                               const Scalar* p) {
  return Blend(field, Locate(field, p[0], p[1], p[2]));
}

}  // namespace prehensile::internal
