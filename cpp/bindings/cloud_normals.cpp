#include "prehensile/cloud_normals.h"

#include <cstddef>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

/// Calls estimate(points, n, normals, variation) and hands both over.
template <typename Estimate>
nb::tuple Estimated(nb::handle points_argument, const Estimate& estimate) {
  const ArrayArgument points(points_argument, "points");
  points.RequireShape({-1, 3});
  const std::size_t n = points.shape(0);
  ArrayResult<> normals{n, 3}, variation{n};
  double *const normals_data = normals.data(), *const variation_data = variation.data();
  {
    const nb::gil_scoped_release release;
    estimate(points.data(), n, normals_data, variation_data);
  }
  return nb::make_tuple(normals.Take(), variation.Take());
}

}  // namespace

void BindCloudNormals(nb::module_& m) {
  m.def(
      "normals_within_radius",
      [](nb::handle points, double radius, int num_threads) {
        return Estimated(points,
                         [&](const double* p, std::size_t n, double* normals, double* variation) {
                           NormalsWithinRadius(p, n, radius, num_threads, normals, variation);
                         });
      },
      "points"_a, "radius"_a, "num_threads"_a);
  m.def(
      "normals_of_nearest",
      [](nb::handle points, int neighbors, int num_threads) {
        return Estimated(points,
                         [&](const double* p, std::size_t n, double* normals, double* variation) {
                           NormalsOfNearest(p, n, neighbors, num_threads, normals, variation);
                         });
      },
      "points"_a, "neighbors"_a, "num_threads"_a);
  m.def(
      "normals_of_voxels",
      [](nb::handle points, double voxel_size, int num_threads) {
        return Estimated(points,
                         [&](const double* p, std::size_t n, double* normals, double* variation) {
                           NormalsOfVoxels(p, n, voxel_size, num_threads, normals, variation);
                         });
      },
      "points"_a, "voxel_size"_a, "num_threads"_a);
}

}  // namespace prehensile
