#include "prehensile/point_drift.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using internal::Require;
using Rows = Eigen::Matrix<double, 3, Eigen::Dynamic>;

/// Gaussians narrower than this part of the model's spread are below what the sums resolve.
constexpr double kNarrowest = 1e-5;
/// With less of the scene explained than this many points there is no pose.
constexpr double kFewest = 1e-6;

/// The rotation that makes tr(Rᵀ A) largest, and the second derivative at it.
struct BestRotation {
  Matrix3d R, information;
};

BestRotation RotationOf(const Matrix3d& A, int dimension) {
  if (dimension == 2) {
    const double c = A(0, 0) + A(1, 1), s = A(1, 0) - A(0, 1), length = std::hypot(c, s);
    Matrix3d R = Matrix3d::Identity(), information = Matrix3d::Zero();
    if (length > 0) R.topLeftCorner<2, 2>() << c / length, -s / length, s / length, c / length;
    information(2, 2) = length;
    return {R, information};
  }
  const Eigen::JacobiSVD<Matrix3d> svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3d signs(1, 1,
                       svd.matrixU().determinant() * svd.matrixV().determinant() > 0 ? 1 : -1);
  const Vector3d values = svd.singularValues().cwiseProduct(signs);
  const Vector3d turns = Vector3d::Constant(values.sum()) - values;
  return {svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose(),
          svd.matrixU() * turns.asDiagonal() * svd.matrixU().transpose()};
}

void Check(const Rows& scene, const Rows& model, const Matrix4d& X,
           const PointDriftOptions& options) {
  Require(scene.cols() > 0, "scene: there is no point");
  Require(model.cols() > 0, "model: there is no point");
  Require(scene.allFinite(), "scene: must be finite");
  Require(model.allFinite(), "model: must be finite");
  const Matrix3d R = X.topLeftCorner<3, 3>();
  Require(X.allFinite() && R.determinant() > 0 &&
              (R * R.transpose() - Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6,
          "X_WO_guess: is no rigid transform");
  Require(options.dimension == 2 || options.dimension == 3, "dimension: must be 2 or 3");
  Require(options.outlier_weight >= 0 && options.outlier_weight < 1,
          "outlier_weight: must be at least 0 and below 1");
  Require(options.outlier_volume > 0 && std::isfinite(options.outlier_volume),
          "outlier_volume: must be positive and finite");
  Require(options.sigma >= 0 && std::isfinite(options.sigma),
          "sigma: must be at least 0 and finite");
  Require(options.max_iterations >= 1, "max_iterations: must be at least 1");
  Require(options.tolerance >= 0, "tolerance: must be at least 0");
}

double MeanSquare(const Rows& points, const Vector3d& center) {
  return (points.colwise() - center).squaredNorm() / static_cast<double>(points.cols());
}

}  // namespace

PointDriftResult CoherentPointDrift(const double* scene_rows, std::size_t num_scene,
                                    const double* model_rows, std::size_t num_model,
                                    const Matrix4d& X_WO_guess, const PointDriftOptions& options,
                                    bool keep_history) {
  const Eigen::Map<const Rows> given(scene_rows, 3, static_cast<Eigen::Index>(num_scene));
  const Rows model = Eigen::Map<const Rows>(model_rows, 3, static_cast<Eigen::Index>(num_model));
  Check(given, model, X_WO_guess, options);
  const std::vector<std::int32_t> order = SpatialOrder(scene_rows, num_scene);
  Rows scene(3, num_scene);
  for (std::size_t i = 0; i < num_scene; ++i) scene.col(i) = given.col(order[i]);

  // Everything happens in O: the scene moves, and the Gaussians around the model stay.
  Matrix3d R_WO = X_WO_guess.topLeftCorner<3, 3>();
  Vector3d p_WO = X_WO_guess.topRightCorner<3, 1>();
  const GaussianSums gaussians(model.data(), num_model);
  const Vector3d model_mean = model.rowwise().mean();
  const double spread = MeanSquare(model, model_mean);
  const int D = options.dimension;
  double variance = options.sigma * options.sigma;
  if (variance == 0) {
    const Vector3d mean = scene.rowwise().mean();
    variance =
        (MeanSquare(scene, mean) + spread + (mean - R_WO * model_mean - p_WO).squaredNorm()) / D;
  }
  const double narrowest = std::max(kNarrowest * kNarrowest * spread, 1e-24);
  variance = std::max(variance, narrowest);
  const double w = options.outlier_weight;

  PointDriftResult result;
  std::vector<double> sums(6 * num_scene), probabilities(num_scene);
  Rows local(3, num_scene), partners(3, num_scene);
  const auto keep = [&] {
    Matrix4d X = Matrix4d::Identity();
    X.topLeftCorner<3, 3>() = R_WO;
    X.topRightCorner<3, 1>() = p_WO;
    result.X_WO = X;
    if (keep_history) result.history.push_back(X);
  };
  keep();
  while (result.iterations < options.max_iterations) {
    ++result.iterations;
    const Matrix3d R_OW = R_WO.transpose();
    local = R_OW * (scene.colwise() - p_WO);
    const double uniform = std::pow(2 * M_PI * variance, 0.5 * D) * w / (1 - w) *
                           static_cast<double>(num_model) / options.outlier_volume;
    gaussians.At(local.data(), num_scene, std::sqrt(variance), uniform, internal::kInfinity,
                 sums.data(), options.num_threads);

    // Which part of each point the model explains, p, and the sum of its partners, weighted: p
    // times the point plus an offset e.
    double explained = 0, current = 0;
    Vector3d mean_x = Vector3d::Zero(), mean_y = Vector3d::Zero();
    for (std::size_t i = 0; i < num_scene; ++i) {
      const double* const row = &sums[6 * i];
      const double others = uniform > 0 ? uniform * std::exp(row[0] / (2 * variance)) : 0.0;
      const double total = row[1] + others;
      const double inverse = total > 0 ? 1 / total : 0.0;
      const double p = row[1] * inverse;
      partners.col(i) = p * local.col(i) + Vector3d(row[2], row[3], row[4]) * inverse;
      probabilities[i] = p;
      explained += p;
      current += row[5] * inverse;
      mean_x += p * local.col(i);
      mean_y += partners.col(i);
    }
    result.num_explained = explained;
    if (!(explained > kFewest)) break;
    mean_x /= explained;
    mean_y /= explained;
    Matrix3d A = Matrix3d::Zero();
    double squares_x = 0;
    for (std::size_t i = 0; i < num_scene; ++i) {
      const Vector3d x = local.col(i) - mean_x;
      A.noalias() += x * partners.col(i).transpose();
      squares_x += probabilities[i] * x.squaredNorm();
    }
    // sum P |x - y|² is known from the sums; from it follows that of the partners about their mean.
    const double squares_y =
        current - squares_x - explained * (mean_x - mean_y).squaredNorm() + 2 * A.trace();
    const BestRotation best = RotationOf(A, D);
    const double after =
        (squares_x + squares_y - 2 * best.R.cwiseProduct(A).sum()) / (explained * D);

    // The model moves by R y + t in O.
    const Vector3d t = mean_x - best.R * mean_y;
    const double turn = (best.R - Matrix3d::Identity()).norm();
    const double way = std::sqrt((mean_x - mean_y).squaredNorm() + 0.5 * turn * turn * spread);
    result.centroid = R_WO * mean_x + p_WO;
    result.rotation_information = R_WO * best.information * R_WO.transpose();
    result.length_scale = std::sqrt(std::max(squares_y, 0.0) / explained);
    p_WO += R_WO * t;
    R_WO = Eigen::Quaterniond(R_WO * best.R).normalized().toRotationMatrix();
    const double before = std::sqrt(variance);
    variance = std::max(after, narrowest);
    keep();
    if (way <= options.tolerance && std::abs(std::sqrt(variance) - before) <= options.tolerance) {
      result.converged = true;
      break;
    }
  }
  result.sigma = std::sqrt(variance);
  result.probabilities.resize(num_scene);
  for (std::size_t i = 0; i < num_scene; ++i) result.probabilities[order[i]] = probabilities[i];
  return result;
}

}  // namespace prehensile
