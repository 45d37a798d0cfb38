#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "prehensile/consensus.h"

namespace prehensile {

struct BranchAndBoundOptions {
  /// Distances are cut off here: the cost is Σ min(distance, max_distance)².
  double max_distance = std::numeric_limits<double>::infinity();
  /// The search ends when the cost is known to within this.
  double max_gap = 0;
  /// Only turns about z and translations in x and y; the points have z = 0.
  bool planar = false;
  /// Most rotation boxes.
  std::int64_t max_nodes = 1'000'000;
  /// Most seconds; with a limit, the answer depends on the machine's speed.
  double time_limit = std::numeric_limits<double>::infinity();
};

struct BranchAndBoundPose {
  /// Takes scene points to the model: X_OW.
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double cost = 0;
  /// No pose costs less than this.
  double lower_bound = 0;
  /// Whether cost - lower_bound <= max_gap was reached within the limits.
  bool closed = false;
  std::int64_t nodes = 0;
};

/// The pose of a scene in a model that minimizes the sum of squared distances from each scene point
/// to its nearest model point, over all poses, with a bound on what is left to gain: nested branch
/// and bound over boxes of rotation vectors and of translations (Yang, Li, Campbell and Jia,
/// "Go-ICP: A Globally Optimal Solution to 3D ICP Point-Set Registration", PAMI 38(11), 2016).
/// A pose that improves on the best one is made a local minimum at once.
///
/// @throws std::invalid_argument if there are no points or numbers are out of range.
BranchAndBoundPose BranchAndBound(const PointRows& scene, const PointRows& model,
                                  const BranchAndBoundOptions& options);

}  // namespace prehensile
