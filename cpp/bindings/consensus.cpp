#include "prehensile/consensus.h"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"
#include "prehensile/simd.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

PointRows View(const RowsArgument& rows) {
  return {rows.data(), static_cast<Eigen::Index>(rows.shape(0)), 3};
}

/// Two arrays of as many rows.
struct Correspondences {
  RowsArgument model, scene;
  Correspondences(nb::handle model_points, nb::handle scene_points)
      : model(model_points, "model_points"), scene(scene_points, "scene_points") {
    if (model.shape(0) != scene.shape(0)) {
      throw std::invalid_argument("scene_points: " + std::to_string(scene.shape(0)) + " rows for " +
                                  std::to_string(model.shape(0)) + " model_points");
    }
  }
};

nb::object Matrix(const Eigen::Matrix3d& R) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = R;
  return ArrayResult<>({3, 3}, rows.data()).Take();
}

nb::object Flags(const std::vector<std::uint8_t>& flags) {
  return ArrayResult<std::uint8_t>({flags.size()}, flags.data()).Take();
}

nb::object Pose(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> X = Eigen::Matrix4d::Identity();
  X.topLeftCorner<3, 3>() = R;
  X.topRightCorner<3, 1>() = p;
  return ArrayResult<>({4, 4}, X.data()).Take();
}

template <typename Call>
auto Released(const Call& call) {
  const nb::gil_scoped_release release;
  return call();
}

int Vertex(const ConsistencyGraph& graph, std::int64_t i) {
  if (i < 0 || i >= graph.size()) {
    throw std::invalid_argument("vertex: " + std::to_string(i) + " is not in [0, " +
                                std::to_string(graph.size()) + ")");
  }
  return static_cast<int>(i);
}

ConsistencyGraph FromEdges(std::int64_t num_vertices, nb::handle edges) {
  const ArrayArgument pairs(edges, "edges");
  if (num_vertices < 0) throw std::invalid_argument("num_vertices: must not be negative");
  ConsistencyGraph graph(static_cast<std::size_t>(num_vertices));
  if (pairs.size() == 0) return graph;
  pairs.RequireShape({-1, 2});
  const std::vector<int> ends = pairs.Integers();
  for (std::size_t k = 0; k < ends.size(); k += 2) {
    const int i = Vertex(graph, ends[k]), j = Vertex(graph, ends[k + 1]);
    if (i == j) throw std::invalid_argument("edges: a vertex is joined to itself");
    graph.Connect(i, j);
  }
  return graph;
}

nb::object Edges(const ConsistencyGraph& graph) {
  ArrayResult<std::int32_t> edges({graph.num_edges(), 2});
  std::int32_t* out = edges.data();
  for (int i = 0; i < graph.size(); ++i) {
    for (int j = i + 1; j < graph.size(); ++j) {
      if (!graph.adjacent(i, j)) continue;
      *out++ = i;
      *out++ = j;
    }
  }
  return edges.Take();
}

nb::object Degrees(const ConsistencyGraph& graph) {
  ArrayResult<std::int32_t> degrees({static_cast<std::size_t>(graph.size())});
  for (int i = 0; i < graph.size(); ++i) degrees.data()[i] = graph.degree(i);
  return degrees.Take();
}

ConsistencyGraph Graph(nb::handle model_points, nb::handle scene_points, double tolerance,
                       double scale, double min_length, const std::optional<std::string>& simd) {
  const Correspondences points(model_points, scene_points);
  std::optional<SimdLevel> level;
  for (const SimdLevel available : AvailableSimdLevels()) {
    if (simd && Name(available) == *simd) level = available;
  }
  if (simd && !level) throw std::invalid_argument("simd: this machine lacks '" + *simd + "'");
  return Released([&] {
    return MakeConsistencyGraph(View(points.model), View(points.scene), tolerance, scale,
                                min_length, level);
  });
}

nb::tuple CliqueOf(const ConsistencyGraph& graph, bool exact, int min_size, std::int64_t max_nodes,
                   double time_limit) {
  const Clique clique =
      Released([&] { return MaximumClique(graph, {exact, min_size, max_nodes, time_limit}); });
  ArrayResult<std::int32_t> vertices({clique.vertices.size()}, clique.vertices.data());
  return nb::make_tuple(vertices.Take(), clique.proven, clique.nodes);
}

nb::tuple AsTuple(const Vote& vote) {
  return nb::make_tuple(vote.estimate, Flags(vote.inliers), vote.cost);
}

nb::tuple VoteOf(nb::handle values, nb::handle bounds, bool most_inliers) {
  const ArrayArgument v(values, "values"), b(bounds, "bounds");
  v.RequireShape({-1});
  b.RequireShape({static_cast<std::ptrdiff_t>(v.size())});
  return AsTuple(
      Released([&] { return VoteForScalar(v.data(), b.data(), v.size(), most_inliers); }));
}

nb::tuple ScaleOf(nb::handle model_points, nb::handle scene_points, double noise_bound) {
  const Correspondences points(model_points, scene_points);
  return AsTuple(
      Released([&] { return VoteForScale(View(points.model), View(points.scene), noise_bound); }));
}

nb::tuple RotationOf(nb::handle model_vectors, nb::handle scene_vectors, double bound,
                     int max_iterations) {
  const RowsArgument a(model_vectors, "model_vectors"), b(scene_vectors, "scene_vectors");
  const RotationConsensus rotation =
      Released([&] { return GncRotation(View(a), View(b), bound, max_iterations); });
  return nb::make_tuple(Matrix(rotation.R), Flags(rotation.inliers), rotation.cost,
                        rotation.iterations, rotation.converged);
}

nb::tuple Robust(nb::handle model_points, nb::handle scene_points, double noise_bound,
                 std::int64_t max_nodes, double ambiguity_ratio, double max_false_alarms,
                 int min_inliers) {
  const Correspondences points(model_points, scene_points);
  const RobustPose pose = Released([&] {
    return RobustRegistration(View(points.model), View(points.scene), noise_bound,
                              {max_nodes, ambiguity_ratio, max_false_alarms, min_inliers});
  });
  return nb::make_tuple(static_cast<int>(pose.status), Pose(pose.R, pose.p), Flags(pose.inliers),
                        pose.num_inliers, pose.num_inliers_second, pose.clique_size,
                        pose.clique_proven, pose.iterations, pose.log_false_alarms);
}

nb::tuple Ransac(nb::handle model_points, nb::handle scene_points, double max_distance,
                 std::uint64_t seed, int max_samples, double confidence) {
  const Correspondences points(model_points, scene_points);
  const RansacPose pose = Released([&] {
    return RansacRegistration(View(points.model), View(points.scene), max_distance,
                              {seed, max_samples, confidence});
  });
  return nb::make_tuple(Pose(pose.R, pose.p), Flags(pose.inliers), pose.num_inliers, pose.samples,
                        pose.poses, pose.confident, pose.log_false_alarms);
}

}  // namespace

void BindConsensus(nb::module_& m) {
  nb::class_<ConsistencyGraph>(m, "ConsistencyGraph")
      .def_static("from_edges", &FromEdges, "num_vertices"_a, "edges"_a)
      .def_prop_ro("num_vertices", &ConsistencyGraph::size)
      .def_prop_ro("num_edges", &ConsistencyGraph::num_edges)
      .def("adjacent",
           [](const ConsistencyGraph& graph, std::int64_t i, std::int64_t j) {
             return graph.adjacent(Vertex(graph, i), Vertex(graph, j));
           })
      .def("degrees", &Degrees)
      .def("edges", &Edges);
  m.def("consistency_graph", &Graph, "model_points"_a, "scene_points"_a, "tolerance"_a, "scale"_a,
        "min_length"_a, "simd"_a = nb::none());
  m.def("maximum_clique", &CliqueOf, "graph"_a, "exact"_a, "min_size"_a, "max_nodes"_a,
        "time_limit"_a);
  m.def("vote", &VoteOf, "values"_a, "bounds"_a, "most_inliers"_a);
  m.def("vote_for_scale", &ScaleOf, "model_points"_a, "scene_points"_a, "noise_bound"_a);
  m.def("gnc_rotation", &RotationOf, "model_vectors"_a, "scene_vectors"_a, "bound"_a,
        "max_iterations"_a);
  m.def("log_false_alarms", &LogFalseAlarms, "num_tests"_a, "n"_a, "k"_a, "chance"_a);
  m.def("robust_registration", &Robust, "model_points"_a, "scene_points"_a, "noise_bound"_a,
        "max_nodes"_a, "ambiguity_ratio"_a, "max_false_alarms"_a, "min_inliers"_a);
  m.def("ransac_pose", &Ransac, "model_points"_a, "scene_points"_a, "max_distance"_a, "seed"_a,
        "max_samples"_a, "confidence"_a);
}

}  // namespace prehensile
