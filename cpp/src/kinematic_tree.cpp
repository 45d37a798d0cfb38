#include "prehensile/kinematic_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "chain_walk.h"
#include "kinematics_lanes.h"
#include "parallel.h"
#include "sincos.h"

namespace prehensile {
namespace {

using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// Room for `size` values: on the stack if they are few.
template <typename T, std::size_t kFew>
class Scratch {
 public:
  explicit Scratch(std::size_t size) {
    if (size > kFew) many_.resize(size);
  }
  T* data() { return many_.empty() ? few_.data() : many_.data(); }

 private:
  std::array<T, kFew> few_;
  std::vector<T> many_;
};

constexpr std::size_t kFewJoints = 32;

void CheckPose(const Eigen::Matrix4d& X, const std::string& name) {
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  const bool is_rotation =
      (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-6 && R.determinant() > 0;
  if (!X.allFinite() || !is_rotation || X.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    throw std::invalid_argument(name + ": not a pose");
  }
}

void CheckParent(int parent, int num_joints, const std::string& name) {
  if (parent < -1 || parent >= num_joints) {
    throw std::invalid_argument(name + ": no joint has number " + std::to_string(parent));
  }
}

/// A rotation that takes z to the axis, the identity for z itself.
Eigen::Matrix3d RotationToAxis(const Eigen::Vector3d& axis, const std::string& name) {
  if (!axis.allFinite() || axis.norm() < 1e-6) {
    throw std::invalid_argument(name + ": an axis must have a length");
  }
  const Eigen::Vector3d z = axis.normalized();
  if (z == Eigen::Vector3d::UnitZ()) return Eigen::Matrix3d::Identity();
  Eigen::Index smallest = 0;
  z.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix3d R;
  R.col(2) = z;
  R.col(0) = z.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  R.col(1) = z.cross(R.col(0));
  return R;
}

}  // namespace

KinematicTree::KinematicTree(const std::vector<TreeJoint>& joints,
                             const std::vector<TreeFrame>& frames)
    : num_joints_(static_cast<int>(joints.size())) {
  // Each joint's frame L: at J's origin, fixed to what the joint moves, z along the axis.
  std::vector<Eigen::Matrix3d> R_JL;
  for (int i = 0; i < num_joints_; ++i) {
    const std::string name = "joints[" + std::to_string(i) + "]";
    CheckParent(joints[i].parent, num_joints_, name);
    CheckPose(joints[i].X_PJ, name);
    R_JL.push_back(RotationToAxis(joints[i].axis, name));
  }
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const std::string name = "frames[" + std::to_string(k) + "]";
    CheckParent(frames[k].parent, num_joints_, name);
    CheckPose(frames[k].X_PF, name);

    std::vector<int> way;
    for (int i = frames[k].parent; i >= 0; i = joints[i].parent) {
      if (way.size() == joints.size()) {
        throw std::invalid_argument("joints: " + std::to_string(i) + " is its own ancestor");
      }
      way.push_back(i);
    }
    std::reverse(way.begin(), way.end());

    Chain chain;
    Eigen::Matrix3d R_LJ = Eigen::Matrix3d::Identity();
    for (const int i : way) {
      const Eigen::Matrix4d& X_PJ = joints[i].X_PJ;
      internal::ChainStep step;
      Eigen::Map<RowMatrix3>(step.R_PL) = R_LJ * X_PJ.topLeftCorner<3, 3>() * R_JL[i];
      Eigen::Map<Eigen::Vector3d>(step.p_PL) = R_LJ * X_PJ.topRightCorner<3, 1>();
      step.joint = i;
      step.prismatic = joints[i].type == JointType::kPrismatic;
      chain.steps.push_back(step);
      R_LJ = R_JL[i].transpose();
    }
    const Eigen::Matrix4d& X_PF = frames[k].X_PF;
    Eigen::Map<RowMatrix3>(chain.view.R_LF) = R_LJ * X_PF.topLeftCorner<3, 3>();
    Eigen::Map<Eigen::Vector3d>(chain.view.p_LF) = R_LJ * X_PF.topRightCorner<3, 1>();
    chain.view.num_steps = static_cast<int>(chain.steps.size());
    frames_.push_back(std::move(chain));
  }
}

void KinematicTree::PoseAndJacobian(const double* q, int frame, double* X_WF, double* J_WF) const {
  const internal::ChainView way = chain(frame);
  const int num_steps = way.num_steps;
  Scratch<double, 3 * kFewJoints> angles(3 * num_steps);
  Scratch<internal::WorldAxis<double>, kFewJoints> axes(num_steps);
  double* const sine = angles.data();
  double* const cosine = sine + num_steps;
  double* const position = cosine + num_steps;
  for (int i = 0; i < num_steps; ++i) {
    position[i] = q[way.steps[i].joint];
    if (!way.steps[i].prismatic) {
      internal::SinCosReduced(internal::WithinRange(position[i]), &sine[i], &cosine[i]);
    }
  }
  double R[9], p[3];
  internal::WalkChain(way, sine, cosine, position, R, p, axes.data());
  if (X_WF) {
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) X_WF[4 * k + j] = R[3 * k + j];
      X_WF[4 * k + 3] = p[k];
      X_WF[12 + k] = 0;
    }
    X_WF[15] = 1;
  }
  if (J_WF) {
    const int n = num_joints_;
    if (num_steps != n) std::fill_n(J_WF, 6 * n, 0.0);
    for (int i = 0; i < num_steps; ++i) {
      double column[6];
      internal::JacobianColumn(axes.data()[i], way.steps[i].prismatic, p, column);
      for (int k = 0; k < 6; ++k) J_WF[k * n + way.steps[i].joint] = column[k];
    }
  }
}

void KinematicTree::RelativeJacobian(const double* q, int frame, int A, int E, double* J) const {
  const int n = num_joints_;
  using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor>;
  using Pose = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  Scratch<double, 6 * kFewJoints> room(6 * static_cast<std::size_t>(n));
  Pose X_WF, X_W;
  PoseAndJacobian(q, frame, X_WF.data(), J);
  Eigen::Map<Jacobian> J_F(J, 6, n);
  if (A >= 0) {
    // V_AF = V_WF less the velocity of the point of A that is at F's origin.
    PoseAndJacobian(q, A, X_W.data(), room.data());
    const Eigen::Map<const Jacobian> J_A(room.data(), 6, n);
    const Eigen::Vector3d p_AF_W = X_WF.topRightCorner<3, 1>() - X_W.topRightCorner<3, 1>();
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d w_WA = J_A.col(i).head<3>();
      J_F.col(i).head<3>() -= w_WA;
      J_F.col(i).tail<3>() -= J_A.col(i).tail<3>() + w_WA.cross(p_AF_W);
    }
  }
  if (E >= 0) {
    PoseAndJacobian(q, E, X_W.data(), nullptr);
    const Eigen::Matrix3d R_EW = X_W.topLeftCorner<3, 3>().transpose();
    for (int i = 0; i < n; ++i) {
      const Eigen::Vector3d w = J_F.col(i).head<3>(), v = J_F.col(i).tail<3>();
      J_F.col(i).head<3>() = R_EW * w;
      J_F.col(i).tail<3>() = R_EW * v;
    }
  }
}

void KinematicTree::PosesAndJacobians(const double* Q, std::size_t N, int frame, double* X,
                                      double* J, int num_threads) const {
  const auto n = static_cast<std::size_t>(num_joints_);
  const internal::ChainView way = chain(frame);
  internal::RunShares(N, 512, num_threads, [&](std::size_t begin, std::size_t end) {
    if (way.num_steps > internal::kMostSteps) {
      for (std::size_t i = begin; i < end; ++i) {
        PoseAndJacobian(Q + n * i, frame, X ? X + 16 * i : nullptr, J ? J + 6 * n * i : nullptr);
      }
      return;
    }
    internal::LaneRoom room;
    for (std::size_t i = begin; i < end; i += internal::kLanes) {
      const auto count = static_cast<int>(std::min<std::size_t>(end - i, internal::kLanes));
      room.Walk(way, Q + n * i, num_joints_, count, J != nullptr);
      for (int lane = 0; X && lane < count; ++lane) room.Pose(lane, X + 16 * (i + lane));
      for (int lane = 0; J && lane < count; ++lane) {
        double* const rows = J + 6 * n * (i + lane);
        if (static_cast<std::size_t>(way.num_steps) != n) std::fill_n(rows, 6 * n, 0.0);
        for (int step = 0; step < way.num_steps; ++step) {
          double* const column = rows + way.steps[step].joint;
          for (int k = 0; k < 6; ++k) column[k * n] = room.columns[step][k][lane];
        }
      }
    }
  });
}

KinematicTree::Ball KinematicTree::ReachOf(int frame, const double* lower,
                                           const double* upper) const {
  const internal::ChainView way = chain(frame);
  const auto length = [](const double* p) { return std::hypot(p[0], p[1], p[2]); };
  const auto& p_LF = way.p_LF;
  if (way.num_steps == 0) return {{p_LF[0], p_LF[1], p_LF[2]}, 0};
  // About the first joint's origin, by the lengths of everything that follows.
  const double* const first = way.steps[0].p_PL;
  Ball ball{{first[0], first[1], first[2]}, length(p_LF) - length(first)};
  for (int i = 0; i < way.num_steps; ++i) {
    const internal::ChainStep& step = way.steps[i];
    ball.radius += length(step.p_PL);
    if (step.prismatic) {
      ball.radius += std::max(std::abs(lower[step.joint]), std::abs(upper[step.joint]));
    }
  }
  return ball;
}

}  // namespace prehensile
