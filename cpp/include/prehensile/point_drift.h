#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace prehensile {

/// Sums of Gaussians around fixed points, seen from other points.
///
/// In single precision relative to the points' centroid, the same on every machine.
class GaussianSums {
 public:
  /// @param points n ≥ 1 rows of x, y, z.
  /// @throws std::invalid_argument if there is none, or one is not finite.
  GaussianSums(const double* points, std::size_t n);

  std::size_t size() const { return size_; }

  /// For every query, with d = point - query and k = exp(-(|d|² - s) / (2 sigma²)), six numbers:
  /// s, the sum of k, of k d (three) and of k |d|². The shift s is 0, except for queries so far
  /// off that their sum of k would be lost beside `floor` or in rounding: there s is the least
  /// |d|². Faster where successive queries are near each other, see SpatialOrder.
  ///
  /// @param queries n rows, finite.
  /// @param sigma positive.
  /// @param floor at least 0: what the sum of k is compared with.
  /// @param reach points further than so many sigma are left out, and s is always 0; infinity:
  /// every
  ///     point counts that can matter.
  /// @param sums room for n rows of six.
  /// @throws std::invalid_argument as above.
  void At(const double* queries, std::size_t n, double sigma, double floor, double reach,
          double* sums, int num_threads) const;

 private:
  struct Box {
    float lower[3], upper[3];
  };

  std::size_t size_;
  Eigen::Vector3d center_;
  double unit_;                // The points' median distance from their medians [m].
  std::vector<float> blocks_;  // Blocks of sixteen points.
  std::vector<Box> boxes_;
};

/// An order in which points near each other follow each other closely, in runs of sixteen.
std::vector<std::int32_t> SpatialOrder(const double* points, std::size_t n);

struct PointDriftOptions {
  /// 2 for points in the plane z = 0, or 3.
  int dimension = 3;
  /// Which part of the scene's points is expected to belong to nothing, in [0, 1).
  double outlier_weight = 0.1;
  /// Over how large a region those would be spread evenly [m^dimension].
  double outlier_volume = 1;
  /// Of the first Gaussians [m]; 0: of all pairs of points.
  double sigma = 0;
  int max_iterations = 200;
  /// Done when a step moves the points, root mean square, and changes sigma by less [m].
  double tolerance = 1e-6;
  int num_threads = 1;
};

struct PointDriftResult {
  Eigen::Matrix4d X_WO = Eigen::Matrix4d::Identity();
  bool converged = false;
  int iterations = 0;
  /// Of the last Gaussians [m].
  double sigma = std::numeric_limits<double>::quiet_NaN();
  /// For every scene point, how likely it belongs to the model.
  std::vector<double> probabilities;
  /// Their sum.
  double num_explained = 0;
  /// Second derivative (half of it) of the squared distances, times their probabilities, by a turn
  /// about the centroid, in W [m²]. In the plane its last diagonal entry counts.
  Eigen::Matrix3d rotation_information = Eigen::Matrix3d::Zero();
  /// Of the scene's points, weighted by probability, in W [m].
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  /// Root mean square distance of the partners from it [m].
  double length_scale = 0;
  /// The pose before every step and the last one, if asked for.
  std::vector<Eigen::Matrix4d> history;
};

/// Rigid coherent point drift (Myronenko and Song 2010), without a change of scale: the model's
/// points are centres of Gaussians of one common width that must explain the scene.
///
/// @param scene, model n rows of x, y, z; z = 0 if the dimension is 2.
/// @throws std::invalid_argument if a cloud is empty, a number is not finite or an option out of
///     range.
PointDriftResult CoherentPointDrift(const double* scene, std::size_t num_scene, const double* model,
                                    std::size_t num_model, const Eigen::Matrix4d& X_WO_guess,
                                    const PointDriftOptions& options, bool keep_history = false);

}  // namespace prehensile
