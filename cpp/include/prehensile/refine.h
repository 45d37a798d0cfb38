#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "prehensile/distance_field.h"
#include "prehensile/robust_loss.h"

namespace prehensile {

/// How a pose is refined; see RefinePoses().
struct RefineOptions {
  RobustLoss loss = RobustLoss::kGemanMcClure;
  /// Scale of the loss, at the end [m].
  double scale = 0.003;
  /// Scale of the loss in the first iteration [m]; from one to the next it is multiplied by
  /// `cooling`.
  double initial_scale = 0.03;
  double cooling = 0.7;
  /// Points further from the model than this many scales do not count.
  double max_distance = std::numeric_limits<double>::infinity();
  /// Part of the points that counts: those nearest to the model, in (0, 1].
  double kept_fraction = 1;
  /// Least cosine between a scene point's normal and the field's gradient; only with normals.
  double min_normal_cosine = -1;
  /// Points of the scene that the first iterations look at.
  std::size_t num_coarse_points = 500;
  /// Of all starts, how many of the best go on to all points.
  int num_finalists = 1;
  int max_coarse_iterations = 40;
  int max_iterations = 20;
  /// An iteration that moves the points by less than this ends it [m].
  double tolerance = 1e-5;
  /// A point no further from the model is an inlier [m].
  double inlier_distance = 0.009;
};

/// One refined pose.
struct RefinedPose {
  Eigen::Isometry3d X_WO;
  /// Mean loss of the points (of the coarse ones, unless it was a finalist) [m²].
  double cost = 0;
  /// Iterations on few points, and on all.
  int coarse_iterations = 0, iterations = 0;
  bool converged = false;
  bool is_finalist = false;
  // Of a finalist:
  /// Gauss-Newton matrix Σ w J Jᵀ by a motion of the object [rotation; translation at `centre`],
  /// expressed in W, and Σ w r², Σ w.
  Eigen::Matrix<double, 6, 6> information;
  double sum_squares = 0, sum_weights = 0;
  /// Mean of the scene's points in W, and their root mean square distance from it [m].
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double length = 0;
  /// For each point of the scene 1 if it is an inlier, else 0; one whose normal disagrees is none.
  std::vector<std::uint8_t> is_inlier;
  std::size_t num_inliers = 0;
  /// Root mean square distance of the inliers from the model [m]; NaN without any.
  double inlier_rms = 0;
};

/// Poses X_WO of a known object that lay the points of a scene onto its surface, from many starts.
///
/// Minimizes Σ ρ(f(X_OWᵢ pᵢ)) over the pose by Gauss-Newton steps on the field's distance
/// (Fitzgibbon, "Robust registration of 2D and 3D point sets", 2003), damped where a step would
/// make things worse. The loss ρ starts wide and is narrowed (graduated non-convexity); the first
/// iterations look at few points, evenly strewn over the scene. Deterministic; results do not
/// depend on num_threads.
///
/// @param points n rows of x, y, z in W.
/// @param normals of the points, n rows, or nullptr.
/// @param X_WO starts.
/// @return one for each start, in order.
/// @throws std::invalid_argument naming the argument.
std::vector<RefinedPose> RefinePoses(const double* points, const double* normals, std::size_t n,
                                     const DistanceField& field,
                                     const std::vector<Eigen::Isometry3d>& X_WO,
                                     const RefineOptions& options, int num_threads);

}  // namespace prehensile
