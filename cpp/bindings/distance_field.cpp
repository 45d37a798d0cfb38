#include "prehensile/distance_field.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "bindings.h"
#include "numpy_arrays.h"
#include "prehensile/refine.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

using Array3 = std::array<double, 3>;
using Sizes = std::array<std::int32_t, 3>;
using NodeArray = nb::ndarray<const float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using TriangleArray =
    nb::ndarray<const std::int32_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

void FromNodes(DistanceField* field, const Array3& origin, double spacing, const Sizes& sizes,
               const NodeArray& nodes, bool is_signed) {
  std::vector<FieldNode> copy(nodes.shape(0));
  if (!copy.empty())
    std::memcpy(static_cast<void*>(copy.data()), nodes.data(), copy.size() * sizeof(FieldNode));
  new (field) DistanceField({origin, spacing, sizes}, std::move(copy), is_signed);
}

DistanceField FromMesh(nb::handle vertices, const TriangleArray& triangles, const Array3& origin,
                       double spacing, const Sizes& sizes, bool is_signed, int num_threads) {
  const RowsArgument v(vertices, "vertices");
  const nb::gil_scoped_release release;
  return MeshDistanceField(v.data(), v.shape(0), triangles.data(), triangles.shape(0),
                           {origin, spacing, sizes}, is_signed, num_threads);
}

DistanceField FromCloud(nb::handle points, nb::handle normals, double radius, const Array3& origin,
                        double spacing, const Sizes& sizes, int num_threads) {
  const RowsArgument p(points, "points");
  const RowsArgument n(normals, "normals", static_cast<std::ptrdiff_t>(p.shape(0)));
  const nb::gil_scoped_release release;
  return CloudDistanceField(p.data(), n.data(), p.shape(0), radius, {origin, spacing, sizes},
                            num_threads);
}

nb::tuple At(const DistanceField& field, nb::handle points, int num_threads) {
  const RowsArgument p(points, "points");
  const std::size_t n = p.shape(0);
  ArrayResult<> distances{n}, gradients{n, 3};
  double *const d = distances.data(), *const g = gradients.data();
  {
    const nb::gil_scoped_release release;
    field.AtRows(p.data(), n, num_threads, d, g);
  }
  return nb::make_tuple(distances.Take(), gradients.Take());
}

nb::tuple Closest(const DistanceField& field, nb::handle points) {
  const RowsArgument p(points, "points");
  const std::size_t n = p.shape(0);
  ArrayResult<> at{n, 3}, normals{n, 3};
  double *const to_point = at.data(), *const to_normal = normals.data();
  {
    const nb::gil_scoped_release release;
    for (std::size_t i = 0; i < n; ++i) {
      const auto found = field.Closest(Eigen::Map<const Eigen::Vector3d>(p.data() + 3 * i));
      for (int k = 0; k < 3; ++k) {
        to_point[3 * i + k] = found.point[k];
        to_normal[3 * i + k] = found.normal[k];
      }
    }
  }
  return nb::make_tuple(at.Take(), normals.Take());
}

/// Poses (S, 4, 4).
std::vector<Eigen::Isometry3d> Poses(nb::handle values, const char* name) {
  const ArrayArgument X(values, name);
  X.RequireShape({-1, 4, 4});
  X.RequireFinite();
  std::vector<Eigen::Isometry3d> poses(X.shape(0));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].matrix() =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(X.data() + 16 * i);
  }
  return poses;
}

nb::tuple NearestBody(const std::vector<const DistanceField*>& fields, nb::handle X_WL,
                      nb::handle points, int num_threads) {
  const std::vector<Eigen::Isometry3d> poses = Poses(X_WL, "X_WL");
  const RowsArgument p(points, "points");
  const std::size_t n = p.shape(0);
  ArrayResult<> distances{n}, gradients{n, 3};
  ArrayResult<std::int32_t> bodies{n};
  double *const d = distances.data(), *const g = gradients.data();
  std::int32_t* const b = bodies.data();
  {
    const nb::gil_scoped_release release;
    NearestBodyAtRows(fields, poses, p.data(), n, num_threads, d, g, b);
  }
  return nb::make_tuple(distances.Take(), gradients.Take(), bodies.Take());
}

nb::object Nodes(const DistanceField& field) {
  const std::vector<FieldNode>& nodes = field.nodes();
  nb::object owner = nb::find(field);
  return nb::cast(
      nb::ndarray<nb::numpy, const float>(&nodes.data()->distance, {nodes.size(), 4}, owner));
}

/// What came of one start, as (pose, cost, iterations on few points, on all, converged, finalist,
/// information, sum of squares, sum of weights; of a finalist mean and size of the scene, inliers,
/// their number and root mean square distance).
nb::tuple Answer(const RefinedPose& pose) {
  ArrayResult<> X{4, 4}, information{6, 6}, centre{3};
  ArrayResult<std::uint8_t> inliers{pose.is_inlier.size()};
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(X.data()) = pose.X_WO.matrix();
  Eigen::Map<Eigen::Matrix<double, 6, 6>>(information.data()) = pose.information;
  Eigen::Map<Eigen::Vector3d>(centre.data()) = pose.centre;
  std::copy(pose.is_inlier.begin(), pose.is_inlier.end(), inliers.data());
  return nb::make_tuple(X.Take(), pose.cost, pose.coarse_iterations, pose.iterations,
                        pose.converged, pose.is_finalist, information.Take(), pose.sum_squares,
                        pose.sum_weights, centre.Take(), pose.length, inliers.Take(),
                        pose.num_inliers, pose.inlier_rms);
}

nb::list Refine(const DistanceField& field, nb::handle points, nb::handle normals, nb::handle X_WO,
                const std::string& loss, double scale, double initial_scale, double cooling,
                double max_distance, double kept_fraction, double min_normal_cosine,
                std::size_t num_coarse_points, int num_finalists, int max_coarse_iterations,
                int max_iterations, double tolerance, double inlier_distance, int num_threads) {
  const RowsArgument p(points, "points");
  std::optional<RowsArgument> n;
  if (!normals.is_none()) n.emplace(normals, "normals", static_cast<std::ptrdiff_t>(p.shape(0)));
  const std::vector<Eigen::Isometry3d> starts = Poses(X_WO, "X_WO");
  const RefineOptions options{.loss = ParseRobustLoss(loss),
                              .scale = scale,
                              .initial_scale = initial_scale,
                              .cooling = cooling,
                              .max_distance = max_distance,
                              .kept_fraction = kept_fraction,
                              .min_normal_cosine = min_normal_cosine,
                              .num_coarse_points = num_coarse_points,
                              .num_finalists = num_finalists,
                              .max_coarse_iterations = max_coarse_iterations,
                              .max_iterations = max_iterations,
                              .tolerance = tolerance,
                              .inlier_distance = inlier_distance};
  std::vector<RefinedPose> poses;
  {
    const nb::gil_scoped_release release;
    poses = RefinePoses(p.data(), n ? n->data() : nullptr, p.shape(0), field, starts, options,
                        num_threads);
  }
  nb::list answers;
  for (const RefinedPose& pose : poses) answers.append(Answer(pose));
  return answers;
}

}  // namespace

void BindDistanceField(nb::module_& m) {
  nb::class_<DistanceField>(m, "DistanceField")
      .def("__init__", &FromNodes, "origin"_a, "spacing"_a, "sizes"_a, "nodes"_a, "is_signed"_a)
      .def_static("from_mesh", &FromMesh, "vertices"_a, "triangles"_a, "origin"_a, "spacing"_a,
                  "sizes"_a, "is_signed"_a, "num_threads"_a)
      .def_static("from_cloud", &FromCloud, "points"_a, "normals"_a, "radius"_a, "origin"_a,
                  "spacing"_a, "sizes"_a, "num_threads"_a)
      .def_prop_ro("origin", [](const DistanceField& field) { return field.grid().origin; })
      .def_prop_ro("spacing", [](const DistanceField& field) { return field.grid().spacing; })
      .def_prop_ro("sizes", [](const DistanceField& field) { return field.grid().sizes; })
      .def_prop_ro("is_signed", &DistanceField::is_signed)
      .def_prop_ro("nodes", &Nodes)
      .def("at", &At, "points"_a, "num_threads"_a)
      .def("closest", &Closest, "points"_a);
  m.def("nearest_body", &NearestBody, "fields"_a, "X_WL"_a, "points"_a, "num_threads"_a);
  m.attr("MOST_FIELD_NODES") = kMostFieldNodes;
  m.def("refine_poses", &Refine, "field"_a, "points"_a, "normals"_a.none(), "X_WO"_a, "loss"_a,
        "scale"_a, "initial_scale"_a, "cooling"_a, "max_distance"_a, "kept_fraction"_a,
        "min_normal_cosine"_a, "num_coarse_points"_a, "num_finalists"_a, "max_coarse_iterations"_a,
        "max_iterations"_a, "tolerance"_a, "inlier_distance"_a, "num_threads"_a);
}

}  // namespace prehensile
