#pragma once

#include "field_lookup.h"
#include "prehensile/distance_field.h"

namespace prehensile::internal {

static_assert(sizeof(FieldNode) == 4 * sizeof(float));

/// The view of a field for points of that scalar type, given relative to a point in O.
template <typename Scalar>
FieldView<Scalar> ViewField(const DistanceField& field, const double* reference) {
  const FieldGrid& grid = field.grid();
  FieldView<Scalar> view{.nodes = &field.nodes().data()->distance,
                         .spacing = static_cast<Scalar>(grid.spacing),
                         .inverse_spacing = static_cast<Scalar>(1 / grid.spacing),
                         .is_signed = field.is_signed()};
  for (int k = 0; k < 3; ++k) {
    view.origin[k] = static_cast<Scalar>(grid.origin[k] - reference[k]);
    view.sizes[k] = grid.sizes[k];
  }
  return view;
}

}  // namespace prehensile::internal
