#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "prehensile/kd_tree.h"
#include "prehensile/robust_loss.h"

namespace prehensile {

/// What is made small between a scene point and its partner on the model.
enum class IcpKind {
  /// Their distance (Besl and McKay 1992).
  kPointToPoint,
  /// The scene point's distance from the model's tangent plane (Chen and Medioni 1992).
  kPointToPlane,
  /// The distance between two patches of surface (Segal, Haehnel and Thrun 2009).
  kGeneralized,
};

/// For the points of which side a partner is looked for.
enum class IcpDirection { kSceneToModel, kModelToScene, kBoth };

/// What a registration needs to know of a cloud beyond its points.
struct IcpNeeds {
  bool tree = true;
  /// Estimated from neighbours where the cloud has none.
  bool normals = true;
};

/// A cloud made ready for registrations. Nothing in it changes, so that threads may share it.
class IcpCloud {
 public:
  /// @param points n rows.
  /// @param normals n rows of unit normals, zero where one is not known; or null.
  /// @param intensities n grey values in [0, 1]; or null.
  /// @throws std::invalid_argument if n = 0 or a number is not finite.
  IcpCloud(const double* points, std::size_t n, const double* normals, const double* intensities,
           const IcpNeeds& needs);

  std::size_t size() const { return points_.size(); }
  const std::vector<Eigen::Vector3d>& points() const { return points_; }
  /// Empty if there are none.
  const std::vector<Eigen::Vector3d>& normals() const { return normals_; }
  const std::vector<double>& intensities() const { return intensities_; }
  /// Of the intensity, in the tangent plane [1/m]; empty unless intensities and normals are there.
  const std::vector<Eigen::Vector3d>& gradients() const { return gradients_; }
  const KdTree* tree() const { return tree_ ? &*tree_ : nullptr; }

 private:
  void EstimateNormals();
  void FitGradients();

  std::vector<Eigen::Vector3d> points_, normals_, gradients_;
  std::vector<double> intensities_;
  std::optional<KdTree> tree_;
};

struct IcpOptions {
  IcpKind kind = IcpKind::kPointToPlane;
  IcpDirection direction = IcpDirection::kSceneToModel;
  /// Pairs further apart are left out [m].
  double max_distance = std::numeric_limits<double>::infinity();
  /// So are pairs whose normals enclose an angle of a smaller cosine; below -1: not looked at.
  double min_normal_cosine = -2;
  /// The part of the pairs that counts, the nearest ones (trimmed ICP, Chetverikov et al. 2002).
  double kept_fraction = 1;
  RobustLoss loss = RobustLoss::kLeastSquares;
  double loss_scale = 0.01;  // [m]
  /// Whether kGemanMcClure or kTruncated starts convex and is approached step by step.
  bool graduated = false;
  /// The part of the colour in the sum (Park, Zhou and Koltun 2017); 0: colours do not matter.
  double color_weight = 0;
  /// The first steps are made with about so many points, until they become small; 0: with all.
  int coarse_points = 500;
  int max_iterations = 100;
  /// Done when a step moves the points by less than this, root mean square [m].
  double tolerance = 1e-5;
  bool keep_history = false;
};

enum class IcpOutcome { kConverged, kOutOfIterations, kTooFewPairs };

/// Frames: O the model's, W the scene's.
struct IcpResult {
  IcpOutcome outcome = IcpOutcome::kTooFewPairs;
  Eigen::Matrix4d X_WO = Eigen::Matrix4d::Identity();
  int iterations = 0;
  /// Root mean square of the inliers' residuals [m].
  double residual = std::numeric_limits<double>::quiet_NaN();
  /// For every scene point.
  std::vector<std::uint8_t> inliers;
  /// Mean over the scene of the squared distance to the partner, which counts no more than for a
  /// pair left out [m²]: compares poses.
  double score = std::numeric_limits<double>::infinity();
  /// Sum of Jᵀ J of the inliers' distances from tangent planes by [turn; motion of the point at the
  /// centroid], in W.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  /// Mean square of those distances [m²].
  double plane_variance = 0;
  /// Of the inliers, in W [m].
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  /// Root mean square distance of the inliers from their centroid [m].
  double length_scale = 0;
  /// The pose before every step and the last one.
  std::vector<Eigen::Matrix4d> history;
};

/// Aligns a model to a scene from a first guess.
///
/// @param scene needs a tree unless the direction is kSceneToModel; normals for kGeneralized and
///     min_normal_cosine.
/// @param model needs a tree and normals.
/// @throws std::invalid_argument if something needed is missing, an option is out of range or the
///     guess is no rigid transform.
IcpResult Icp(const IcpCloud& scene, const IcpCloud& model, const Eigen::Matrix4d& X_WO_guess,
              const IcpOptions& options);

/// The same from several guesses, in parallel.
std::vector<IcpResult> IcpManyStarts(const IcpCloud& scene, const IcpCloud& model,
                                     const std::vector<Eigen::Matrix4d>& guesses,
                                     const IcpOptions& options, int num_threads);

}  // namespace prehensile
