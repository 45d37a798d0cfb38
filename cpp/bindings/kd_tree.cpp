#include "prehensile/kd_tree.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <shared_mutex>
#include <stdexcept>

#include "bindings.h"
#include "numpy_arrays.h"
#include "prehensile/voxel_hash.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

void RequireDistance(double value, const char* message) {
  if (!(value >= 0)) throw std::invalid_argument(message);
}

nb::tuple Nearest(const KdTree& tree, nb::handle queries_argument, int k, double max_distance,
                  int num_threads) {
  const RowsArgument queries(queries_argument, "queries");
  RequireDistance(max_distance, "max_distance: must be zero or more");
  if (k < 1) throw std::invalid_argument("k: must be at least 1");
  const std::size_t m = queries.shape(0), columns = static_cast<std::size_t>(k);
  ArrayResult<std::int32_t> indices{m, columns};
  ArrayResult<> distances{m, columns};
  std::int32_t* const index = indices.data();
  double* const distance = distances.data();
  {
    const nb::gil_scoped_release release;
    tree.NearestBatch(queries.data(), m, k, max_distance * max_distance, num_threads, index,
                      distance);
    std::transform(distance, distance + m * columns, distance,
                   [](double d) { return std::sqrt(d); });
  }
  return nb::make_tuple(indices.Take(), distances.Take());
}

nb::tuple WithinRadius(const KdTree& tree, nb::handle queries_argument, double radius,
                       int num_threads) {
  const RowsArgument queries(queries_argument, "queries");
  RequireDistance(radius, "radius: must be zero or more");
  const std::size_t m = queries.shape(0);
  KdTree::Neighbors found;
  {
    const nb::gil_scoped_release release;
    found = tree.WithinRadiusBatch(queries.data(), m, radius, num_threads);
    for (double& d : found.squared_distances) d = std::sqrt(d);
  }
  ArrayResult<std::int32_t> counts({m}, found.counts.data());
  ArrayResult<std::int32_t> indices({found.indices.size()}, found.indices.data());
  ArrayResult<> distances({found.indices.size()}, found.squared_distances.data());
  return nb::make_tuple(counts.Take(), indices.Take(), distances.Take());
}

/// Of Python's threads, one may insert while others, without the GIL, query.
struct SharedVoxels {
  explicit SharedVoxels(double max_distance) : voxels(max_distance) {}
  VoxelHash voxels;
  mutable std::shared_mutex mutex;
};

nb::tuple NearestInVoxels(const SharedVoxels& self, nb::handle queries_argument, int num_threads) {
  const RowsArgument queries(queries_argument, "queries");
  const std::size_t m = queries.shape(0);
  ArrayResult<std::int32_t> indices{m};
  ArrayResult<> distances{m};
  std::int32_t* const index = indices.data();
  double* const distance = distances.data();
  {
    const nb::gil_scoped_release release;
    const std::shared_lock lock(self.mutex);
    self.voxels.NearestBatch(queries.data(), m, num_threads, index, distance);
    std::transform(distance, distance + m, distance, [](double d) { return std::sqrt(d); });
  }
  return nb::make_tuple(indices.Take(), distances.Take());
}

}  // namespace

void BindKdTree(nb::module_& m) {
  nb::class_<KdTree>(m, "KdTree")
      .def(
          "__init__",
          [](KdTree* self, nb::handle points_argument) {
            const ArrayArgument points(points_argument, "points");
            points.RequireShape({-1, 3});
            const nb::gil_scoped_release release;
            new (self) KdTree(points.data(), points.shape(0));
          },
          "points"_a)
      .def("__len__", &KdTree::size)
      .def("nearest", &Nearest, "queries"_a, "k"_a, "max_distance"_a, "num_threads"_a)
      .def("within_radius", &WithinRadius, "queries"_a, "radius"_a, "num_threads"_a);
  nb::class_<SharedVoxels>(m, "VoxelHash")
      .def(nb::init<double>(), "max_distance"_a)
      .def("__len__",
           [](const SharedVoxels& self) {
             const nb::gil_scoped_release release;
             const std::shared_lock lock(self.mutex);
             return self.voxels.size();
           })
      .def(
          "insert",
          [](SharedVoxels& self, nb::handle points_argument) {
            const ArrayArgument points(points_argument, "points");
            points.RequireShape({-1, 3});
            const nb::gil_scoped_release release;
            const std::unique_lock lock(self.mutex);
            self.voxels.Insert(points.data(), points.shape(0));
          },
          "points"_a)
      .def("nearest", &NearestInVoxels, "queries"_a, "num_threads"_a);
}

}  // namespace prehensile
