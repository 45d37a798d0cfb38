#include "prehensile/icp.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <new>
#include <optional>
#include <string>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

using RowMajor4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

void ConstructCloud(IcpCloud* cloud, nb::handle points, nb::handle normals, nb::handle intensities,
                    bool tree, bool estimate_normals) {
  const ArrayArgument p(points, "points");
  p.RequireShape({-1, 3});
  const auto n = static_cast<std::ptrdiff_t>(p.shape(0));
  std::optional<ArrayArgument> normal, intensity;
  if (!normals.is_none()) normal.emplace(normals, "normals").RequireShape({n, 3});
  if (!intensities.is_none()) intensity.emplace(intensities, "intensities").RequireShape({n});
  const nb::gil_scoped_release release;
  new (cloud) IcpCloud(p.data(), p.shape(0), normal ? normal->data() : nullptr,
                       intensity ? intensity->data() : nullptr, {tree, estimate_normals});
}

IcpKind ParseKind(const std::string& name) {
  if (name == "point_to_point") return IcpKind::kPointToPoint;
  if (name == "point_to_plane") return IcpKind::kPointToPlane;
  if (name == "generalized") return IcpKind::kGeneralized;
  throw std::invalid_argument("kind: there is no '" + name + "'");
}

IcpDirection ParseDirection(const std::string& name) {
  if (name == "scene_to_model") return IcpDirection::kSceneToModel;
  if (name == "model_to_scene") return IcpDirection::kModelToScene;
  if (name == "both") return IcpDirection::kBoth;
  throw std::invalid_argument("direction: there is no '" + name + "'");
}

nb::object PoseRows(const Eigen::Matrix4d& X) {
  const RowMajor4d rows = X;
  return ArrayResult<>({4, 4}, rows.data()).Take();
}

nb::dict ToDict(const IcpResult& result) {
  constexpr const char* kOutcomes[] = {"converged", "out_of_iterations", "too_few_pairs"};
  nb::dict d;
  d["outcome"] = kOutcomes[static_cast<int>(result.outcome)];
  d["X_WO"] = PoseRows(result.X_WO);
  d["iterations"] = result.iterations;
  d["residual"] = result.residual;
  d["inliers"] = ArrayResult<std::uint8_t>({result.inliers.size()}, result.inliers.data()).Take();
  d["score"] = result.score;
  d["information"] = ArrayResult<>({6, 6}, result.information.data()).Take();
  d["plane_variance"] = result.plane_variance;
  d["centroid"] = ArrayResult<>({3}, result.centroid.data()).Take();
  d["length_scale"] = result.length_scale;
  nb::list history;
  for (const Eigen::Matrix4d& X : result.history) history.append(PoseRows(X));
  d["history"] = history;
  return d;
}

nb::list IcpStarts(const IcpCloud& scene, const IcpCloud& model, nb::handle guesses,
                   const std::string& kind, const std::string& direction, double max_distance,
                   double min_normal_cosine, double kept_fraction, const std::string& loss,
                   double loss_scale, bool graduated, double color_weight, int coarse_points,
                   int max_iterations, double tolerance, bool keep_history, int num_threads) {
  const ArrayArgument poses(guesses, "guesses");
  poses.RequireShape({-1, 4, 4});
  std::vector<Eigen::Matrix4d> starts;
  for (std::size_t k = 0; k < poses.shape(0); ++k) {
    starts.emplace_back(Eigen::Map<const RowMajor4d>(poses.data() + 16 * k));
  }
  const IcpOptions options{ParseKind(kind), ParseDirection(direction),
                           max_distance,    min_normal_cosine,
                           kept_fraction,   ParseRobustLoss(loss),
                           loss_scale,      graduated,
                           color_weight,    coarse_points,
                           max_iterations,  tolerance,
                           keep_history};
  std::vector<IcpResult> results;
  {
    const nb::gil_scoped_release release;
    results = IcpManyStarts(scene, model, starts, options, num_threads);
  }
  nb::list list;
  for (const IcpResult& result : results) list.append(ToDict(result));
  return list;
}

}  // namespace

void BindIcp(nb::module_& m) {
  nb::class_<IcpCloud>(m, "IcpCloud")
      .def("__init__", &ConstructCloud, "points"_a, "normals"_a.none(), "intensities"_a.none(),
           "tree"_a, "estimate_normals"_a)
      .def("__len__", &IcpCloud::size);
  m.def("icp", &IcpStarts, "scene"_a, "model"_a, "guesses"_a, nb::kw_only(), "kind"_a,
        "direction"_a, "max_distance"_a, "min_normal_cosine"_a, "kept_fraction"_a, "loss"_a,
        "loss_scale"_a, "graduated"_a, "color_weight"_a, "coarse_points"_a, "max_iterations"_a,
        "tolerance"_a, "keep_history"_a, "num_threads"_a);
}

}  // namespace prehensile
