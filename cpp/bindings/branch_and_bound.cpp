#include "prehensile/branch_and_bound.h"

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

nb::tuple Run(nb::handle scene_points, nb::handle model_points, double max_distance, double max_gap,
              bool planar, std::int64_t max_nodes, double time_limit) {
  const ArrayArgument scene(scene_points, "scene_points"), model(model_points, "model_points");
  scene.RequireShape({-1, 3});
  model.RequireShape({-1, 3});
  BranchAndBoundPose pose;
  {
    const nb::gil_scoped_release release;
    pose = BranchAndBound({scene.data(), static_cast<Eigen::Index>(scene.shape(0)), 3},
                          {model.data(), static_cast<Eigen::Index>(model.shape(0)), 3},
                          {max_distance, max_gap, planar, max_nodes, time_limit});
  }
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> X = Eigen::Matrix4d::Identity();
  X.topLeftCorner<3, 3>() = pose.R;
  X.topRightCorner<3, 1>() = pose.p;
  return nb::make_tuple(ArrayResult<>({4, 4}, X.data()).Take(), pose.cost, pose.lower_bound,
                        pose.closed, pose.nodes);
}

}  // namespace

void BindBranchAndBound(nb::module_& m) {
  m.def("branch_and_bound", &Run, "scene_points"_a, "model_points"_a, "max_distance"_a, "max_gap"_a,
        "planar"_a, "max_nodes"_a, "time_limit"_a);
}

}  // namespace prehensile
