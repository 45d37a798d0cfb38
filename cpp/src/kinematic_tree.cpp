#include "prehensile/kinematic_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

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

/// The axis of a joint in W, and where it is.
struct WorldAxis {
  double z[3];
  double p[3];
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
      Step step;
      Eigen::Map<RowMatrix3>(step.R_PL.data()) = R_LJ * X_PJ.topLeftCorner<3, 3>() * R_JL[i];
      Eigen::Map<Eigen::Vector3d>(step.p_PL.data()) = R_LJ * X_PJ.topRightCorner<3, 1>();
      step.joint = i;
      step.prismatic = joints[i].type == JointType::kPrismatic;
      chain.steps.push_back(step);
      R_LJ = R_JL[i].transpose();
    }
    const Eigen::Matrix4d& X_PF = frames[k].X_PF;
    Eigen::Map<RowMatrix3>(chain.R_LF.data()) = R_LJ * X_PF.topLeftCorner<3, 3>();
    Eigen::Map<Eigen::Vector3d>(chain.p_LF.data()) = R_LJ * X_PF.topRightCorner<3, 1>();
    frames_.push_back(std::move(chain));
  }
}

void KinematicTree::PoseAndJacobian(const double* q, int frame, double* X_WF, double* J_WF) const {
  const Chain& chain = frames_[frame];
  const std::size_t num_steps = chain.steps.size();
  Scratch<double, kFewJoints> sines(num_steps), cosines(num_steps);
  Scratch<WorldAxis, kFewJoints> axes(num_steps);
  double* const sine = sines.data();
  double* const cosine = cosines.data();
  WorldAxis* const axis = axes.data();
  for (std::size_t i = 0; i < num_steps; ++i) {
    const Step& step = chain.steps[i];
    if (!step.prismatic) internal::SinCos(q[step.joint], &sine[i], &cosine[i]);
  }

  // The columns of R_WL, and p_WL.
  double x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, z[3] = {0, 0, 1}, p[3] = {0, 0, 0};
  for (std::size_t i = 0; i < num_steps; ++i) {
    const Step& step = chain.steps[i];
    const double* const R = step.R_PL.data();
    const double* const t = step.p_PL.data();
    if (step.prismatic) {
      const double d = q[step.joint];
      for (int k = 0; k < 3; ++k) {
        const double xk = x[k], yk = y[k], zk = z[k];
        p[k] += xk * t[0] + yk * t[1] + zk * t[2];
        x[k] = xk * R[0] + yk * R[3] + zk * R[6];
        y[k] = xk * R[1] + yk * R[4] + zk * R[7];
        z[k] = xk * R[2] + yk * R[5] + zk * R[8];
        p[k] += z[k] * d;
        axis[i].z[k] = z[k];
        axis[i].p[k] = p[k];
      }
    } else {
      const double s = sine[i], c = cosine[i];
      for (int k = 0; k < 3; ++k) {
        const double xk = x[k], yk = y[k], zk = z[k];
        p[k] += xk * t[0] + yk * t[1] + zk * t[2];
        const double x0 = xk * R[0] + yk * R[3] + zk * R[6];
        const double y0 = xk * R[1] + yk * R[4] + zk * R[7];
        z[k] = xk * R[2] + yk * R[5] + zk * R[8];
        x[k] = x0 * c + y0 * s;
        y[k] = y0 * c - x0 * s;
        axis[i].z[k] = z[k];
        axis[i].p[k] = p[k];
      }
    }
  }
  const double* const R = chain.R_LF.data();
  const double* const t = chain.p_LF.data();
  for (int k = 0; k < 3; ++k) p[k] += x[k] * t[0] + y[k] * t[1] + z[k] * t[2];

  if (X_WF) {
    for (int k = 0; k < 3; ++k) {
      X_WF[4 * k] = x[k] * R[0] + y[k] * R[3] + z[k] * R[6];
      X_WF[4 * k + 1] = x[k] * R[1] + y[k] * R[4] + z[k] * R[7];
      X_WF[4 * k + 2] = x[k] * R[2] + y[k] * R[5] + z[k] * R[8];
      X_WF[4 * k + 3] = p[k];
      X_WF[12 + k] = 0;
    }
    X_WF[15] = 1;
  }
  if (J_WF) {
    const int n = num_joints_;
    if (num_steps != static_cast<std::size_t>(n)) std::fill_n(J_WF, 6 * n, 0.0);
    for (std::size_t i = 0; i < num_steps; ++i) {
      const double* const a = axis[i].z;
      double* const column = J_WF + chain.steps[i].joint;
      if (chain.steps[i].prismatic) {
        for (int k = 0; k < 3; ++k) {
          column[k * n] = 0;
          column[(3 + k) * n] = a[k];
        }
      } else {
        const double* const o = axis[i].p;
        const double r[3] = {p[0] - o[0], p[1] - o[1], p[2] - o[2]};
        for (int k = 0; k < 3; ++k) column[k * n] = a[k];
        column[3 * n] = a[1] * r[2] - a[2] * r[1];
        column[4 * n] = a[2] * r[0] - a[0] * r[2];
        column[5 * n] = a[0] * r[1] - a[1] * r[0];
      }
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
  if (num_threads < 1) {
    throw std::invalid_argument("num_threads: must be at least 1, not " +
                                std::to_string(num_threads));
  }
  constexpr std::size_t kRowsPerThread = 512;
  const auto num_shares =
      static_cast<int>(std::clamp<std::size_t>(N / kRowsPerThread, 1, num_threads));
  const auto n = static_cast<std::size_t>(num_joints_);
  internal::RunParallel(num_shares, [&](int share) {
    const std::size_t begin = N * share / num_shares, end = N * (share + 1) / num_shares;
    for (std::size_t i = begin; i < end; ++i) {
      PoseAndJacobian(Q + n * i, frame, X ? X + 16 * i : nullptr, J ? J + 6 * n * i : nullptr);
    }
  });
}

KinematicTree::Ball KinematicTree::ReachOf(int frame, const double* lower,
                                           const double* upper) const {
  const Chain& chain = frames_[frame];
  const auto length = [](const std::array<double, 3>& p) { return std::hypot(p[0], p[1], p[2]); };
  if (chain.steps.empty()) return {chain.p_LF, 0};
  // About the first joint's origin, by the lengths of everything that follows.
  Ball ball{chain.steps.front().p_PL, length(chain.p_LF) - length(chain.steps.front().p_PL)};
  for (const Step& step : chain.steps) {
    ball.radius += length(step.p_PL);
    if (step.prismatic) {
      ball.radius += std::max(std::abs(lower[step.joint]), std::abs(upper[step.joint]));
    }
  }
  return ball;
}

}  // namespace prehensile
