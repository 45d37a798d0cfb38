#include "prehensile/icp.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

#include "icp_detail.h"
#include "losses.h"
#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

using namespace icp_detail;

/// The control parameter at which truncated least squares takes over from its surrogate.
constexpr double kGncEnd = 100;
/// All points take part once a step is below this part of the points' spread.
constexpr double kFine = 0.01;

/// One registration under way. Works in O: the scene moves, the model stays.
class Registration {
 public:
  Registration(const IcpCloud& scene, const IcpCloud& model, const IcpOptions& options)
      : scene_(scene),
        model_(model),
        options_(options),
        coarse_(options.coarse_points > 0),
        moved_(scene.size()),
        scene_search_(model, scene.size(), options.max_distance),
        model_search_(scene, model.size(), options.max_distance) {}

  IcpResult Run(const Motion& X_WO_guess) {
    IcpResult result;
    X_OW_ = X_WO_guess.Inverse();
    const auto keep = [&] {
      if (options_.keep_history) result.history.push_back(Pose(X_OW_.Inverse()));
    };
    result.outcome = IcpOutcome::kOutOfIterations;
    while (result.iterations < options_.max_iterations) {
      keep();
      FindPairs();
      if (coarse_ && TooFewPairs()) {
        coarse_ = false;
        FindPairs();
      }
      if (TooFewPairs()) break;
      Weigh();
      ++result.iterations;
      const auto [way, spread] = Move();
      if (coarse_) {
        coarse_ = way > kFine * spread || !GraduationDone();
      } else if (way <= options_.tolerance && GraduationDone()) {
        result.outcome = IcpOutcome::kConverged;
        break;
      }
      if (options_.graduated) mu_ = internal::GncNext(options_.loss, mu_);
    }
    keep();
    coarse_ = false;
    Judge(&result);
    return result;
  }

 private:
  bool Sliding() const { return options_.kind == IcpKind::kPointToPlane; }
  int MinPairs() const { return Sliding() ? 6 : 3; }
  bool TooFewPairs() const { return static_cast<int>(pairs_.size()) < MinPairs(); }
  Vector3d SceneNormal(std::int32_t i) const { return X_OW_.R * scene_.normals()[i]; }

  /// Every how many points one takes part.
  std::size_t Stride(std::size_t size) const {
    return coarse_ ? std::max<std::size_t>(size / options_.coarse_points, 1) : 1;
  }

  void FindPairs() {
    const std::size_t scene_stride = Stride(scene_.size()), model_stride = Stride(model_.size());
    const bool all = options_.direction != IcpDirection::kSceneToModel;
    for (std::size_t i = 0; i < scene_.size(); i += all ? 1 : scene_stride) {
      moved_[i] = X_OW_ * scene_.points()[i];
    }
    pairs_.clear();
    double squared = 0;
    if (options_.direction != IcpDirection::kModelToScene) {
      for (std::size_t i = 0; i < scene_.size(); i += scene_stride) {
        const std::int32_t j = scene_search_.Find(i, moved_[i], &squared);
        AddPair(static_cast<std::int32_t>(i), j, squared);
      }
    }
    if (options_.direction != IcpDirection::kSceneToModel) {
      const Motion X_WO = X_OW_.Inverse();
      for (std::size_t j = 0; j < model_.size(); j += model_stride) {
        const std::int32_t i = model_search_.Find(j, X_WO * model_.points()[j], &squared);
        AddPair(i, static_cast<std::int32_t>(j), squared);
      }
    }
    Trim();
  }

  void AddPair(std::int32_t i, std::int32_t j, double squared_distance) {
    if (i < 0 || j < 0) return;
    if (options_.min_normal_cosine >= -1 &&
        SceneNormal(i).dot(model_.normals()[j]) < options_.min_normal_cosine) {
      return;
    }
    if (Sliding() && model_.normals()[j].isZero()) return;
    pairs_.push_back({i, j, squared_distance});
  }

  /// Leaves the nearest pairs; of equally near ones the first.
  void Trim() {
    const auto kept = static_cast<std::size_t>(
        std::ceil(options_.kept_fraction * static_cast<double>(pairs_.size())));
    if (kept >= pairs_.size()) return;
    std::vector<double> distances;
    for (const Pair& pair : pairs_) distances.push_back(pair.squared_distance);
    const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(kept);
    std::nth_element(distances.begin(), middle, distances.end());
    const double limit = *middle;
    auto ties = kept - static_cast<std::size_t>(std::count_if(distances.begin(), middle,
                                                              [&](double d) { return d < limit; }));
    std::erase_if(pairs_, [&](const Pair& pair) {
      if (pair.squared_distance != limit) return pair.squared_distance > limit;
      if (ties == 0) return true;
      --ties;
      return false;
    });
  }

  /// The residual's square in the kind's own measure [m²].
  double SquaredResidual(const Pair& pair) const {
    const Vector3d d = moved_[pair.scene] - model_.points()[pair.model];
    switch (options_.kind) {
      case IcpKind::kPointToPlane: {
        const double r = d.dot(model_.normals()[pair.model]);
        return r * r;
      }
      case IcpKind::kGeneralized:
        return d.dot(PatchWeight(SceneNormal(pair.scene), model_.normals()[pair.model]) * d);
      case IcpKind::kPointToPoint:
        break;
    }
    return pair.squared_distance;
  }

  void Weigh() {
    weights_.assign(pairs_.size(), 1.0);
    if (options_.loss == RobustLoss::kLeastSquares) return;
    for (std::size_t k = 0; k < pairs_.size(); ++k) weights_[k] = SquaredResidual(pairs_[k]);
    const double c = options_.loss_scale;
    if (options_.graduated && mu_ < 0) {
      mu_ =
          internal::GncStart(options_.loss, *std::max_element(weights_.begin(), weights_.end()), c);
      if (mu_ <= 0) mu_ = kGncEnd;  // Nothing but inliers.
    }
    for (double& w : weights_) {
      w = GraduationDone() ? internal::Weight(options_.loss, w, c)
                           : internal::GncWeight(options_.loss, w, c, mu_);
    }
  }

  /// Whether the surrogate has become the loss.
  bool GraduationDone() const {
    if (!options_.graduated) return true;
    return options_.loss == RobustLoss::kTruncated ? mu_ >= kGncEnd : mu_ <= 1;
  }

  /// One step to the weighted pairs' minimum.
  ///
  /// @return by how much the pairs' scene points moved, and how far they lie from their centroid,
  ///     root mean squares [m].
  std::pair<double, double> Move() {
    double total = 0;
    Vector3d center = Vector3d::Zero(), partner = Vector3d::Zero();
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      total += weights_[k];
      center += weights_[k] * moved_[pairs_[k].scene];
      partner += weights_[k] * model_.points()[pairs_[k].model];
    }
    if (!(total > 0)) return {0, 0};
    center /= total;
    partner /= total;
    double spread = 0;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      spread += weights_[k] * (moved_[pairs_[k].scene] - center).squaredNorm();
    }
    const double length_scale = std::max(std::sqrt(spread / total), 1e-9);

    Motion step;  // Of the scene in O.
    const bool closed_form = options_.kind == IcpKind::kPointToPoint && options_.color_weight == 0;
    if (closed_form) {
      Matrix3d products = Matrix3d::Zero();
      for (std::size_t k = 0; k < pairs_.size(); ++k) {
        const Vector3d m = model_.points()[pairs_[k].model] - partner;
        products.noalias() += weights_[k] * m * (moved_[pairs_[k].scene] - center).transpose();
      }
      const Eigen::JacobiSVD<Matrix3d> svd(products, Eigen::ComputeFullU | Eigen::ComputeFullV);
      Vector3d signs(1, 1, svd.matrixU().determinant() * svd.matrixV().determinant());
      step.R = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
      step.p = partner - step.R * center;
    } else {
      const Vector6d delta = Equations(center).Step(length_scale);
      const Vector3d half = 0.5 * delta.head<3>();
      step.R = Eigen::Quaterniond(1, half.x(), half.y(), half.z()).normalized().toRotationMatrix();
      step.p = center + delta.tail<3>() - step.R * center;
    }
    X_OW_ = {Eigen::Quaterniond(step.R * X_OW_.R).normalized().toRotationMatrix(), step * X_OW_.p};
    const double turn = (step.R - Matrix3d::Identity()).norm();  // √2 the angle, if small.
    const double way = std::sqrt((step * center - center).squaredNorm() +
                                 0.5 * turn * turn * length_scale * length_scale);
    return {way, length_scale};
  }

  NormalEquations Equations(const Vector3d& center) const {
    NormalEquations equations;
    const double color = options_.color_weight;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (weights_[k] == 0) continue;
      const auto [i, j, squared] = pairs_[k];
      const Vector3d x = moved_[i] - center;
      const Vector3d d = moved_[i] - model_.points()[j];
      const double weight = (1 - color) * weights_[k];
      if (Sliding()) {
        const Vector3d& normal = model_.normals()[j];
        equations.Add(PlaneJacobian(x, normal), d.dot(normal), weight);
      } else if (options_.kind == IcpKind::kGeneralized) {
        equations.Add(x, d, weight * PatchWeight(SceneNormal(i), model_.normals()[j]));
      } else {
        equations.Add(x, d, weight * Matrix3d::Identity());
      }
      if (color > 0) {
        const Vector3d& gradient = model_.gradients()[j];
        const double r = model_.intensities()[j] + gradient.dot(d) - scene_.intensities()[i];
        equations.Add(PlaneJacobian(x, gradient), r, color * weights_[k]);
      }
    }
    return equations;
  }

  /// Fills in what is known of the pose reached.
  void Judge(IcpResult* result) {
    const Motion X_WO = X_OW_.Inverse();
    result->X_WO = Pose(X_WO);
    result->inliers.assign(scene_.size(), 0);
    FindPairs();
    if (TooFewPairs()) {
      result->outcome = IcpOutcome::kTooFewPairs;
      return;
    }
    const bool robust = options_.loss != RobustLoss::kLeastSquares;
    const double limit = robust ? options_.loss_scale * options_.loss_scale : kInfinity;
    const double cap = std::min(limit, options_.max_distance * options_.max_distance);
    double sum = 0, score = 0;
    Vector3d center = Vector3d::Zero();
    std::vector<std::uint8_t> in(pairs_.size());
    std::vector<double> nearest(scene_.size(), cap);
    std::size_t count = 0;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      const double r2 = SquaredResidual(pairs_[k]);
      double& least = nearest[pairs_[k].scene];
      least = std::min(least, pairs_[k].squared_distance);
      in[k] = r2 <= limit;
      if (!in[k]) continue;
      result->inliers[pairs_[k].scene] = 1;
      sum += r2;
      center += moved_[pairs_[k].scene];
      ++count;
    }
    // Points without a partner count as much as the limit lets them, those that trimming left out
    // as nothing.
    std::size_t counted = 0;
    for (const double d2 : nearest) {
      if (d2 < kInfinity) {
        score += d2;
        ++counted;
      }
    }
    if (counted > 0) result->score = score / static_cast<double>(counted);
    if (count == 0) return;
    center /= static_cast<double>(count);
    result->residual = std::sqrt(sum / static_cast<double>(count));
    double spread = 0, planes = 0;
    NormalEquations equations;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (!in[k]) continue;
      const Vector3d& normal = model_.normals()[pairs_[k].model];
      const Vector3d x = moved_[pairs_[k].scene] - center;
      const double r = (moved_[pairs_[k].scene] - model_.points()[pairs_[k].model]).dot(normal);
      spread += x.squaredNorm();
      planes += r * r;
      equations.Add(PlaneJacobian(x, normal), r, 1.0);
    }
    Matrix6d R = Matrix6d::Zero();
    R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = X_WO.R;
    result->information = R * equations.H * R.transpose();
    result->plane_variance = planes / static_cast<double>(count);
    result->centroid = X_WO * center;
    result->length_scale = std::sqrt(spread / static_cast<double>(count));
  }

  const IcpCloud& scene_;
  const IcpCloud& model_;
  const IcpOptions& options_;
  bool coarse_;
  Motion X_OW_;
  std::vector<Vector3d> moved_;  // The scene in O.
  MovingSearch scene_search_, model_search_;
  std::vector<Pair> pairs_;
  std::vector<double> weights_;
  double mu_ = -1;
};

void Check(const IcpCloud& scene, const IcpCloud& model, const IcpOptions& options) {
  Require(model.tree() && !model.normals().empty(), "model: lacks a tree or normals");
  Require(options.direction == IcpDirection::kSceneToModel || scene.tree(),
          "scene: lacks the tree that the direction needs");
  Require(!scene.normals().empty() ||
              (options.kind != IcpKind::kGeneralized && options.min_normal_cosine < -1),
          "scene: lacks normals");
  Require(options.max_distance > 0, "max_distance: must be positive");
  Require(options.kept_fraction > 0 && options.kept_fraction <= 1,
          "kept_fraction: must be above 0 and at most 1");
  Require(options.loss_scale > 0 && options.loss_scale < kInfinity,
          "loss_scale: must be positive and finite");
  Require(!options.graduated || options.loss == RobustLoss::kGemanMcClure ||
              options.loss == RobustLoss::kTruncated,
          "graduated: only for the losses geman_mcclure and truncated");
  Require(options.color_weight >= 0 && options.color_weight < 1,
          "color_weight: must be at least 0 and below 1");
  Require(options.color_weight == 0 || (!scene.intensities().empty() && !model.gradients().empty()),
          "color_weight: both clouds must have colors");
  Require(options.coarse_points >= 0, "coarse_points: must be at least 0");
  Require(options.max_iterations >= 1, "max_iterations: must be at least 1");
  Require(options.tolerance >= 0, "tolerance: must be at least 0");
}

}  // namespace

IcpResult Icp(const IcpCloud& scene, const IcpCloud& model, const Matrix4d& X_WO_guess,
              const IcpOptions& options) {
  Check(scene, model, options);
  return Registration(scene, model, options).Run(Checked(X_WO_guess));
}

std::vector<IcpResult> IcpManyStarts(const IcpCloud& scene, const IcpCloud& model,
                                     const std::vector<Matrix4d>& guesses,
                                     const IcpOptions& options, int num_threads) {
  Check(scene, model, options);
  for (const Matrix4d& guess : guesses) Checked(guess);
  std::vector<IcpResult> results(guesses.size());
  internal::RunShares(guesses.size(), 1, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) results[k] = Icp(scene, model, guesses[k], options);
  });
  return results;
}

}  // namespace prehensile
