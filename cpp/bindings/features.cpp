#include "prehensile/features.h"

#include <algorithm>
#include <cmath>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

/// Points and normals, row by row.
class OrientedPoints {
 public:
  OrientedPoints(nb::handle points, nb::handle normals)
      : points_(points, "points"), normals_(normals, "normals") {
    points_.RequireShape({-1, 3});
    normals_.RequireShape({static_cast<std::ptrdiff_t>(points_.shape(0)), 3});
  }
  const double* points() const { return points_.data(); }
  const double* normals() const { return normals_.data(); }
  std::size_t size() const { return points_.shape(0); }

 private:
  ArrayArgument points_;
  ArrayArgument normals_;
};

nb::object ComputeFpfh(nb::handle points, nb::handle normals, double radius, int num_threads) {
  const OrientedPoints cloud(points, normals);
  std::vector<float> features(cloud.size() * kFpfhSize);
  {
    const nb::gil_scoped_release release;
    Fpfh(cloud.points(), cloud.normals(), cloud.size(), radius, num_threads, features.data());
  }
  ArrayResult result({cloud.size(), std::size_t{kFpfhSize}});
  std::copy(features.begin(), features.end(), result.data());
  return result.Take();
}

std::vector<float> Features(nb::handle value, const char* name) {
  const ArrayArgument features(value, name);
  features.RequireShape({-1, kFpfhSize});
  features.RequireFinite();
  return {features.data(), features.end()};
}

nb::tuple FindNearestFeatures(nb::handle a, nb::handle b, int num_threads) {
  const std::vector<float> from = Features(a, "a"), to = Features(b, "b");
  const std::size_t n = from.size() / kFpfhSize;
  ArrayResult<std::int32_t> nearest({n});
  std::vector<float> first(n), second(n);
  {
    const nb::gil_scoped_release release;
    NearestFeatures(from.data(), n, to.data(), to.size() / kFpfhSize, num_threads, nearest.data(),
                    first.data(), second.data());
  }
  ArrayResult distances({n}), second_distances({n});
  for (std::size_t i = 0; i < n; ++i) {
    distances.data()[i] = std::sqrt(first[i]);
    second_distances.data()[i] = std::sqrt(second[i]);
  }
  return nb::make_tuple(nearest.Take(), distances.Take(), second_distances.Take());
}

void BuildTable(PointPairTable* self, nb::handle points, nb::handle normals, double distance_step) {
  const OrientedPoints model(points, normals);
  const nb::gil_scoped_release release;
  new (self) PointPairTable(model.points(), model.normals(), model.size(), distance_step);
}

nb::tuple Vote(const PointPairTable& self, nb::handle points, nb::handle normals,
               int num_references, int peaks_per_reference, int max_poses, int num_threads) {
  const OrientedPoints scene(points, normals);
  std::vector<PoseVote> poses;
  {
    const nb::gil_scoped_release release;
    poses = self.Vote(scene.points(), scene.normals(), scene.size(), num_references,
                      peaks_per_reference, max_poses, num_threads);
  }
  ArrayResult X({poses.size(), 4, 4}), votes({poses.size()});
  for (std::size_t i = 0; i < poses.size(); ++i) {
    std::copy_n(poses[i].X_WO, 16, X.data() + 16 * i);
    votes.data()[i] = poses[i].votes;
  }
  return nb::make_tuple(X.Take(), votes.Take());
}

}  // namespace

void BindFeatures(nb::module_& m) {
  m.def("fpfh", &ComputeFpfh, "points"_a, "normals"_a, "radius"_a, "num_threads"_a = 1);
  m.def("nearest_features", &FindNearestFeatures, "a"_a, "b"_a, "num_threads"_a = 1);
  nb::class_<PointPairTable>(m, "PointPairTable")
      .def("__init__", &BuildTable, "points"_a, "normals"_a, "distance_step"_a)
      .def_prop_ro("num_points", &PointPairTable::num_points)
      .def_prop_ro("num_pairs", &PointPairTable::num_pairs)
      .def_prop_ro("diameter", &PointPairTable::diameter)
      .def("vote", &Vote, "points"_a, "normals"_a, "num_references"_a, "peaks_per_reference"_a,
           "max_poses"_a, "num_threads"_a = 1);
}

}  // namespace prehensile
