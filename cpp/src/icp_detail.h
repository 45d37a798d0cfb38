#pragma once

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <vector>

#include "prehensile/icp.h"
#include "vectors.h"

// The parts of a registration by closest points.

namespace prehensile::icp_detail {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using internal::kInfinity;
using internal::Require;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Variance of a patch across, as part of that along it (small, as surfaces are thin).
inline constexpr double kThickness = 1e-3;
/// Motions in which the sum curves less than by this part of the most are not made.
inline constexpr double kFlat = 1e-9;

/// A rotation and a translation, x_B = R x_A + p.
struct Motion {
  Matrix3d R = Matrix3d::Identity();
  Vector3d p = Vector3d::Zero();
  Vector3d operator*(const Vector3d& x) const { return R * x + p; }
  Motion Inverse() const { return {R.transpose(), -(R.transpose() * p)}; }
};

inline Matrix4d Pose(const Motion& X) {
  Matrix4d pose = Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = X.R;
  pose.topRightCorner<3, 1>() = X.p;
  return pose;
}

inline Motion Checked(const Matrix4d& pose) {
  const Motion X{pose.topLeftCorner<3, 3>(), pose.topRightCorner<3, 1>()};
  const bool rigid = pose.allFinite() &&
                     (X.R * X.R.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6 &&
                     X.R.determinant() > 0;
  Require(rigid, "X_WO_guess: is no rigid transform");
  return X;
}

/// Nearest neighbours of points that move little from one time to the next. A point that has moved
/// less than half the gap between its nearest and its second nearest neighbour still has the same
/// nearest one (Greenspan and Godin 2001), so most searches are spared, without loss.
class MovingSearch {
 public:
  MovingSearch(const IcpCloud& target, std::size_t num_queries, double max_distance)
      : target_(target), max_distance_(max_distance), last_(num_queries) {}

  /// @return the nearest point no further than max_distance, or -1.
  std::int32_t Find(std::size_t query, const Vector3d& x, double* squared_distance) {
    Last& last = last_[query];
    const double moved = (x - last.at).norm();
    if (last.index >= 0) {
      *squared_distance = (x - target_.points()[last.index]).squaredNorm();
      if (std::sqrt(*squared_distance) < last.others - moved) return Within(last, squared_distance);
    } else if (max_distance_ < last.others - moved) {
      return -1;
    }
    // A little further than needed, to know of what may come near.
    const double reach = 1.5 * max_distance_;
    std::int32_t index[2];
    double squared[2];
    const int found = target_.tree()->Nearest(x.data(), 2, reach * reach, index, squared);
    last = {x, found > 1 ? std::sqrt(squared[1]) : reach, found > 0 ? index[0] : -1};
    if (found == 0) return -1;
    *squared_distance = squared[0];
    return Within(last, squared_distance);
  }

 private:
  struct Last {
    Vector3d at = Vector3d::Zero();
    double others = -1;  // No other point was nearer than this.
    std::int32_t index = -1;
  };
  std::int32_t Within(const Last& last, const double* squared_distance) const {
    return *squared_distance <= max_distance_ * max_distance_ ? last.index : -1;
  }

  const IcpCloud& target_;
  double max_distance_;
  std::vector<Last> last_;
};

/// A scene point and its partner.
struct Pair {
  std::int32_t scene, model;
  double squared_distance;  // [m²]
};

/// Normal equations of a small turn about a centre and a motion of it.
struct NormalEquations {
  Matrix6d H = Matrix6d::Zero();
  Vector6d g = Vector6d::Zero();

  /// One residual r with its derivative.
  void Add(const Vector6d& J, double r, double weight) {
    const Vector6d wJ = weight * J;
    H.noalias() += J * wJ.transpose();
    g += r * wJ;
  }
  /// A difference d of points, x being the one that moves (from the centre), with a weight matrix.
  void Add(const Vector3d& x, const Vector3d& d, const Matrix3d& M) {
    Matrix3d cross;
    cross << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
    const Matrix3d cross_M = cross * M;
    const Vector3d Md = M * d;
    H.topLeftCorner<3, 3>().noalias() += cross_M * cross.transpose();
    H.topRightCorner<3, 3>() += cross_M;
    H.bottomLeftCorner<3, 3>() += cross_M.transpose();
    H.bottomRightCorner<3, 3>() += M;
    g.head<3>() += x.cross(Md);
    g.tail<3>() += Md;
  }
  /// The step to the minimum, without the motions that leave the sum as it is.
  Vector6d Step(double length_scale) const {
    Vector6d scale;
    scale << Vector3d::Constant(1 / length_scale), Vector3d::Ones();
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scale.asDiagonal() * H *
                                                        scale.asDiagonal());
    Vector6d along = eigen.eigenvectors().transpose() * scale.cwiseProduct(g);
    for (int k = 0; k < 6; ++k) {
      const double value = eigen.eigenvalues()[k];
      along[k] = value > kFlat * eigen.eigenvalues()[5] ? -along[k] / value : 0.0;
    }
    return scale.cwiseProduct(eigen.eigenvectors() * along);
  }
};

inline Vector6d PlaneJacobian(const Vector3d& x, const Vector3d& normal) {
  Vector6d J;
  J << x.cross(normal), normal;
  return J;
}

/// Weights of generalized ICP for normals of either side (either may be zero, for not known): the
/// inverse of the patches' summed covariances, 2 I - (1 - e)(a aᵀ + b bᵀ), so scaled that the
/// distance of parallel patches counts once.
inline Matrix3d PatchWeight(const Vector3d& a, const Vector3d& b) {
  const Matrix3d covariance =
      2 * Matrix3d::Identity() - (1 - kThickness) * (a * a.transpose() + b * b.transpose());
  return 2 * kThickness * covariance.inverse();
}

}  // namespace prehensile::icp_detail
