#include "prehensile/surface.h"

#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

nb::tuple Nearest(const MeshSurface& surface, nb::handle queries_argument, double max_distance,
                  int num_threads) {
  const RowsArgument queries(queries_argument, "queries");
  if (!(max_distance >= 0)) {
    throw std::invalid_argument("max_distance: must be zero or more");
  }
  const std::size_t m = queries.shape(0);
  std::vector<SurfacePoint> nearest(m);
  {
    const nb::gil_scoped_release release;
    surface.NearestBatch(queries.data(), m, max_distance * max_distance, num_threads,
                         nearest.data());
  }
  ArrayResult<> points{m, 3}, normals{m, 3}, barycentric{m, 3}, distances{m};
  ArrayResult<std::int32_t> triangles{m};
  for (std::size_t i = 0; i < m; ++i) {
    for (int k = 0; k < 3; ++k) {
      points.data()[3 * i + k] = nearest[i].p[k];
      normals.data()[3 * i + k] = nearest[i].normal[k];
      barycentric.data()[3 * i + k] = nearest[i].barycentric[k];
    }
    triangles.data()[i] = nearest[i].triangle;
    distances.data()[i] = std::sqrt(nearest[i].squared_distance);
  }
  return nb::make_tuple(points.Take(), normals.Take(), triangles.Take(), barycentric.Take(),
                        distances.Take());
}

nb::object SignedDistance(const MeshSurface& surface, nb::handle queries_argument,
                          int num_threads) {
  const RowsArgument queries(queries_argument, "queries");
  ArrayResult<> distances{queries.shape(0)};
  double* const data = distances.data();
  {
    const nb::gil_scoped_release release;
    surface.SignedDistanceBatch(queries.data(), queries.shape(0), num_threads, data);
  }
  return distances.Take();
}

nb::object WindingNumber(const MeshSurface& surface, nb::handle queries_argument) {
  const RowsArgument queries(queries_argument, "queries");
  ArrayResult<> numbers{queries.shape(0)};
  double* const data = numbers.data();
  {
    const nb::gil_scoped_release release;
    for (std::size_t i = 0; i < queries.shape(0); ++i) {
      data[i] = surface.WindingNumber(Eigen::Map<const Eigen::Vector3d>(queries.data() + 3 * i));
    }
  }
  return numbers.Take();
}

}  // namespace

void BindSurface(nb::module_& m) {
  nb::class_<MeshSurface>(m, "MeshSurface")
      .def(
          "__init__",
          [](MeshSurface* self, nb::handle vertices_argument, nb::handle triangles_argument) {
            const ArrayArgument vertices(vertices_argument, "vertices");
            const ArrayArgument triangles(triangles_argument, "triangles");
            vertices.RequireShape({-1, 3});
            triangles.RequireShape({-1, 3});
            const std::vector<int> indices = triangles.Integers();
            const nb::gil_scoped_release release;
            new (self)
                MeshSurface(vertices.data(), vertices.shape(0), indices.data(), triangles.shape(0));
          },
          "vertices"_a, "triangles"_a)
      .def_prop_ro("is_closed", &MeshSurface::is_closed)
      .def_prop_ro("num_pieces", &MeshSurface::num_pieces)
      .def("nearest", &Nearest, "queries"_a, "max_distance"_a, "num_threads"_a)
      .def("signed_distance", &SignedDistance, "queries"_a, "num_threads"_a)
      .def("winding_number", &WindingNumber, "queries"_a);
}

}  // namespace prehensile
