#include "prehensile/crop.h"

#include <nanobind/ndarray.h>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

template <typename Scalar>
using Rows = nb::ndarray<const Scalar, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <typename Scalar>
nb::object InsideBoxRows(const Rows<Scalar>& points, nb::handle X_BW, nb::handle size) {
  const PoseArgument pose(X_BW, "X_BW");
  pose.RequireFinite();
  const VectorArgument edges(size, "size", 3);
  ArrayResult<std::uint8_t> mask({points.shape(0)});
  {
    const nb::gil_scoped_release release;
    InsideBox(points.data(), points.shape(0), pose.data(), edges.data(), mask.data());
  }
  return mask.Take();
}

template <typename Scalar>
nb::object InsideHalfSpaceRows(const Rows<Scalar>& points, nb::handle normal, double offset) {
  const VectorArgument n(normal, "normal", 3);
  if (!std::isfinite(offset)) throw std::invalid_argument("offset: must be finite");
  ArrayResult<std::uint8_t> mask({points.shape(0)});
  {
    const nb::gil_scoped_release release;
    InsideHalfSpace(points.data(), points.shape(0), n.data(), offset, mask.data());
  }
  return mask.Take();
}

template <typename Scalar>
void Bind(nb::module_& m) {
  m.def("inside_box", &InsideBoxRows<Scalar>, "points"_a.noconvert(), "X_BW"_a, "size"_a);
  m.def("inside_half_space", &InsideHalfSpaceRows<Scalar>, "points"_a.noconvert(), "normal"_a,
        "offset"_a);
}

}  // namespace

void BindCrop(nb::module_& m) {
  Bind<float>(m);
  Bind<double>(m);
}

}  // namespace prehensile
