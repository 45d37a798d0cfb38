#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "prehensile/kinematic_chain.h"

namespace prehensile {

enum class JointType { kRevolute, kPrismatic };

/// A joint of one degree of freedom. It moves its frame J: J is fixed in the parent's frame P
/// while q = 0, turns about the axis by q rad (revolute) or slides along it by q m (prismatic).
struct TreeJoint {
  /// Index of the joint that moves P; -1 for the world.
  int parent = -1;
  /// Pose of J in P at q = 0.
  Eigen::Matrix4d X_PJ = Eigen::Matrix4d::Identity();
  /// Axis in J (and in P's orientation of it), of any length but zero.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  JointType type = JointType::kRevolute;
};

/// A frame F fixed to what a joint moves, or to the world.
struct TreeFrame {
  /// Index of the joint that moves F; -1 for the world.
  int parent = -1;
  Eigen::Matrix4d X_PF = Eigen::Matrix4d::Identity();
};

/// Forward kinematics of a tree of revolute and prismatic joints: poses of frames in the world W,
/// and their geometric Jacobians.
///
/// Matrices are row-major in the caller's memory. A pose X_WF is 4×4, a Jacobian J is 6×n with
/// V_WF = J q̇, rotational rows first, both expressed in W, V_WF that of F's origin.
/// All methods are const and may be called from many threads. They do not look for NaN, and do
/// not allocate for up to 32 joints between W and a frame.
class KinematicTree {
 public:
  /// @param joints in the order of q; a parent may come after its children.
  /// @param frames numbered 0, 1, ... in this order.
  /// @throws std::invalid_argument naming the argument: a parent that does not exist or is its own
  ///   ancestor; a pose that is none; an axis of no length.
  KinematicTree(const std::vector<TreeJoint>& joints, const std::vector<TreeFrame>& frames);

  int num_joints() const { return num_joints_; }
  int num_frames() const { return static_cast<int>(frames_.size()); }

  /// Pose and Jacobian of one frame.
  ///
  /// @param q n joint positions.
  /// @param frame its number, 0 .. num_frames() - 1 (not checked).
  /// @param X_WF room for 16 numbers, or nullptr.
  /// @param J_WF room for 6 n numbers, or nullptr. Columns of joints that do not move F are zero.
  void PoseAndJacobian(const double* q, int frame, double* X_WF, double* J_WF) const;

  /// Jacobian of the spatial velocity V_AF_E of F measured in frame A and expressed in frame E.
  ///
  /// @param A, E numbers of frames; -1 for the world.
  /// @param J room for 6 n numbers.
  void RelativeJacobian(const double* q, int frame, int A, int E, double* J) const;

  /// The same as PoseAndJacobian() for each of N rows of Q.
  ///
  /// @param X room for 16 N numbers, or nullptr.
  /// @param J room for 6 n N numbers, or nullptr.
  /// @param num_threads at least 1; it does not change the result.
  void PosesAndJacobians(const double* Q, std::size_t N, int frame, double* X, double* J,
                         int num_threads) const;

  /// A ball that a frame's origin never leaves while all joints are within their limits.
  struct Ball {
    std::array<double, 3> center;  // In W.
    double radius;
  };

  /// @param lower, upper n joint limits each; only those of prismatic joints matter.
  Ball ReachOf(int frame, const double* lower, const double* upper) const;

  /// The steps on the way to a frame, for the kernels; it lives as long as the tree.
  internal::ChainView chain(int frame) const {
    internal::ChainView view = frames_[frame].view;
    view.steps = frames_[frame].steps.data();
    return view;
  }

 private:
  struct Chain {
    std::vector<internal::ChainStep> steps;
    internal::ChainView view;  // Its steps are set by chain().
  };

  int num_joints_;
  std::vector<Chain> frames_;
};

}  // namespace prehensile
