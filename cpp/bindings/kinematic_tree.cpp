#include "prehensile/kinematic_tree.h"

#include <string>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

Eigen::Matrix4d PoseOf(const double* rows) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows);
}

/// Arrays become the tree's description; a frame is checked by RequireFrame at every call.
void Construct(KinematicTree* tree, nb::handle parents, nb::handle X_PJ, nb::handle axes,
               nb::handle prismatic, nb::handle frame_parents, nb::handle X_PF) {
  const ArrayArgument parent(parents, "parents"), pose(X_PJ, "X_PJ"), axis(axes, "axes"),
      slides(prismatic, "prismatic"), frame_parent(frame_parents, "frame_parents"),
      frame_pose(X_PF, "X_PF");
  const auto n = static_cast<std::ptrdiff_t>(parent.size());
  const auto m = static_cast<std::ptrdiff_t>(frame_parent.size());
  parent.RequireShape({n});
  pose.RequireShape({n, 4, 4});
  axis.RequireShape({n, 3});
  slides.RequireShape({n});
  frame_parent.RequireShape({m});
  frame_pose.RequireShape({m, 4, 4});
  const std::vector<int> movers = parent.Integers(), frame_movers = frame_parent.Integers();
  std::vector<TreeJoint> joints;
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    joints.push_back({.parent = movers[i],
                      .X_PJ = PoseOf(pose.data() + 16 * i),
                      .axis = Eigen::Vector3d(axis.data() + 3 * i),
                      .type = slides[i] != 0 ? JointType::kPrismatic : JointType::kRevolute});
  }
  std::vector<TreeFrame> frames;
  for (std::ptrdiff_t i = 0; i < m; ++i) {
    frames.push_back({.parent = frame_movers[i], .X_PF = PoseOf(frame_pose.data() + 16 * i)});
  }
  new (tree) KinematicTree(joints, frames);
}

void RequireFrame(const KinematicTree& tree, int frame, const char* name, int lowest = 0) {
  if (frame < lowest || frame >= tree.num_frames()) {
    throw std::invalid_argument(std::string(name) + ": no frame has number " +
                                std::to_string(frame));
  }
}

std::size_t Columns(const KinematicTree& tree) {
  return static_cast<std::size_t>(tree.num_joints());
}

nb::object Pose(const KinematicTree& tree, nb::handle q, int frame) {
  const VectorArgument configuration(q, "q", tree.num_joints());
  RequireFrame(tree, frame, "frame");
  ArrayResult<> X{4, 4};
  tree.PoseAndJacobian(configuration.data(), frame, X.data(), nullptr);
  return X.Take();
}

nb::object Jacobian(const KinematicTree& tree, nb::handle q, int frame) {
  const VectorArgument configuration(q, "q", tree.num_joints());
  RequireFrame(tree, frame, "frame");
  ArrayResult<> J{6, Columns(tree)};
  tree.PoseAndJacobian(configuration.data(), frame, nullptr, J.data());
  return J.Take();
}

nb::tuple PoseAndJacobian(const KinematicTree& tree, nb::handle q, int frame) {
  const VectorArgument configuration(q, "q", tree.num_joints());
  RequireFrame(tree, frame, "frame");
  ArrayResult<> X{4, 4};
  ArrayResult<> J{6, Columns(tree)};
  tree.PoseAndJacobian(configuration.data(), frame, X.data(), J.data());
  return nb::make_tuple(X.Take(), J.Take());
}

nb::object RelativeJacobian(const KinematicTree& tree, nb::handle q, int frame, int measured_in,
                            int expressed_in) {
  const VectorArgument configuration(q, "q", tree.num_joints());
  RequireFrame(tree, frame, "frame");
  RequireFrame(tree, measured_in, "measured_in", -1);
  RequireFrame(tree, expressed_in, "expressed_in", -1);
  ArrayResult<> J{6, Columns(tree)};
  tree.RelativeJacobian(configuration.data(), frame, measured_in, expressed_in, J.data());
  return J.Take();
}

/// Poses, Jacobians or both of N configurations, the GIL released.
void Batch(const KinematicTree& tree, const ArrayArgument& Q, int frame, ArrayResult<>* X,
           ArrayResult<>* J, int num_threads) {
  const std::size_t N = Q.shape(0);
  double* const poses = X ? X->data() : nullptr;
  double* const jacobians = J ? J->data() : nullptr;
  const nb::gil_scoped_release release;
  tree.PosesAndJacobians(Q.data(), N, frame, poses, jacobians, num_threads);
}

void RequireBatch(const KinematicTree& tree, const ArrayArgument& Q, int frame) {
  Q.RequireShape({-1, tree.num_joints()});
  Q.RequireFinite();
  RequireFrame(tree, frame, "frame");
}

nb::object Poses(const KinematicTree& tree, nb::handle q, int frame, int num_threads) {
  const ArrayArgument Q(q, "Q");
  RequireBatch(tree, Q, frame);
  ArrayResult<> X{Q.shape(0), 4, 4};
  Batch(tree, Q, frame, &X, nullptr, num_threads);
  return X.Take();
}

nb::object Jacobians(const KinematicTree& tree, nb::handle q, int frame, int num_threads) {
  const ArrayArgument Q(q, "Q");
  RequireBatch(tree, Q, frame);
  ArrayResult<> J{Q.shape(0), 6, Columns(tree)};
  Batch(tree, Q, frame, nullptr, &J, num_threads);
  return J.Take();
}

nb::tuple ReachOf(const KinematicTree& tree, int frame, nb::handle lower, nb::handle upper) {
  const ArrayArgument low(lower, "lower"), high(upper, "upper");
  low.RequireShape({tree.num_joints()});
  high.RequireShape({tree.num_joints()});
  RequireFrame(tree, frame, "frame");
  const KinematicTree::Ball ball = tree.ReachOf(frame, low.data(), high.data());
  return nb::make_tuple(nb::make_tuple(ball.center[0], ball.center[1], ball.center[2]),
                        ball.radius);
}

}  // namespace

void BindKinematicTree(nb::module_& m) {
  nb::class_<KinematicTree>(m, "KinematicTree")
      .def("__init__", &Construct, "parents"_a, "X_PJ"_a, "axes"_a, "prismatic"_a,
           "frame_parents"_a, "X_PF"_a)
      .def_prop_ro("num_joints", &KinematicTree::num_joints)
      .def_prop_ro("num_frames", &KinematicTree::num_frames)
      .def("pose", &Pose, "q"_a, "frame"_a = 0)
      .def("jacobian", &Jacobian, "q"_a, "frame"_a = 0)
      .def("pose_and_jacobian", &PoseAndJacobian, "q"_a, "frame"_a = 0)
      .def("relative_jacobian", &RelativeJacobian, "q"_a, "frame"_a, "measured_in"_a,
           "expressed_in"_a)
      .def("poses", &Poses, "Q"_a, "frame"_a = 0, "num_threads"_a = 1)
      .def("jacobians", &Jacobians, "Q"_a, "frame"_a = 0, "num_threads"_a = 1)
      .def("reach", &ReachOf, "frame"_a, "lower"_a, "upper"_a);
}

}  // namespace prehensile
