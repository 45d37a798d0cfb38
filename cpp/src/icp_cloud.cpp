#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "prehensile/icp.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// How many neighbours tell of the surface at a point.
constexpr int kNeighbors = 12;

std::vector<Vector3d> Rows(const double* rows, std::size_t n, const char* message) {
  std::vector<Vector3d> vectors(n);
  for (std::size_t i = 0; i < n; ++i) {
    vectors[i] = Vector3d(rows + 3 * i);
    internal::Require(vectors[i].allFinite(), message);
  }
  return vectors;
}

}  // namespace

IcpCloud::IcpCloud(const double* points, std::size_t n, const double* normals,
                   const double* intensities, const IcpNeeds& needs)
    : points_(Rows(points, n, "points: must be finite")) {
  internal::Require(n > 0, "points: there is no point");
  if (normals) normals_ = Rows(normals, n, "normals: must be finite");
  if (intensities) intensities_.assign(intensities, intensities + n);
  for (const double x : intensities_)
    internal::Require(std::isfinite(x), "intensities: not finite");
  const bool estimate = needs.normals && normals_.empty();
  if (needs.tree || estimate) tree_.emplace(points, n);
  if (estimate) EstimateNormals();
  if (!intensities_.empty() && !normals_.empty() && tree_) FitGradients();
}

void IcpCloud::EstimateNormals() {
  normals_.assign(size(), Vector3d::Zero());
  std::int32_t index[kNeighbors];
  double squared[kNeighbors];
  for (std::size_t i = 0; i < size(); ++i) {
    const int k =
        tree_->Nearest(points_[i].data(), kNeighbors, internal::kInfinity, index, squared);
    if (k < 3) continue;
    Vector3d mean = Vector3d::Zero();
    for (int a = 0; a < k; ++a) mean += points_[index[a]];
    mean /= k;
    Matrix3d moments = Matrix3d::Zero();
    for (int a = 0; a < k; ++a) {
      const Vector3d x = points_[index[a]] - mean;
      moments.noalias() += x * x.transpose();
    }
    const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(moments);
    // Neighbours on a line tell of no plane.
    if (eigen.eigenvalues()[1] > 1e-9 * eigen.eigenvalues()[2]) {
      normals_[i] = eigen.eigenvectors().col(0);
    }
  }
}

void IcpCloud::FitGradients() {
  gradients_.assign(size(), Vector3d::Zero());
  std::int32_t index[kNeighbors];
  double squared[kNeighbors];
  for (std::size_t i = 0; i < size(); ++i) {
    const int k =
        tree_->Nearest(points_[i].data(), kNeighbors, internal::kInfinity, index, squared);
    // Least squares over the neighbours, projected onto the tangent plane; the normal's own term
    // makes the matrix regular and keeps the gradient in the plane (theirs, (10)).
    const Vector3d& normal = normals_[i];
    if (normal.isZero() || k < 4) continue;
    Matrix3d A = Matrix3d::Zero();
    Vector3d b = Vector3d::Zero();
    for (int a = 0; a < k; ++a) {
      Vector3d x = points_[index[a]] - points_[i];
      x -= normal * normal.dot(x);
      A.noalias() += x * x.transpose();
      b += x * (intensities_[index[a]] - intensities_[i]);
    }
    const double size = A.trace();
    A += size * normal * normal.transpose();
    const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(A);
    if (!(eigen.eigenvalues()[0] > 1e-3 * size)) continue;
    const Vector3d along = eigen.eigenvectors().transpose() * b;
    gradients_[i] = eigen.eigenvectors() * along.cwiseQuotient(eigen.eigenvalues());
  }
}

}  // namespace prehensile
