#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "consensus_detail.h"
#include "split_mix.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::Pose;

/// The frame of a triangle: its first edge, its normal; false if its corners are nearly in line.
bool Frame(const PointRows& points, const int rows[3], Eigen::Matrix3d* frame) {
  const Eigen::Vector3d u = (points.row(rows[1]) - points.row(rows[0])).transpose();
  const Eigen::Vector3d v = (points.row(rows[2]) - points.row(rows[0])).transpose();
  const Eigen::Vector3d normal = u.cross(v);
  if (normal.norm() <= 1e-2 * u.norm() * v.norm()) return false;
  frame->col(0) = u.normalized();
  frame->col(2) = normal.normalized();
  frame->col(1) = frame->col(2).cross(frame->col(0));
  return true;
}

/// Samples after which one of right correspondences was drawn with the confidence.
double SamplesNeeded(int inliers, int n, double confidence) {
  double all_right = 1;
  for (int k = 0; k < 3; ++k) all_right *= double(std::max(inliers - k, 0)) / (n - k);
  if (all_right <= 0) return internal::kInfinity;
  return all_right >= 1 ? 1 : std::log(1 - confidence) / std::log1p(-all_right);
}

}  // namespace

RansacPose RansacRegistration(const PointRows& a, const PointRows& b, double max_distance,
                              const RansacOptions& options) {
  internal::Require(max_distance > 0 && std::isfinite(max_distance),
                    "max_distance: must be positive and finite");
  internal::RequireCorrespondences(a, b, max_distance);
  internal::Require(options.max_samples >= 1, "max_samples: must be at least 1");
  internal::Require(options.confidence > 0 && options.confidence < 1,
                    "confidence: must lie in (0, 1)");
  const int n = static_cast<int>(a.rows());
  RansacPose result;
  result.inliers.assign(n, 0);
  if (n < 3) return result;
  internal::SplitMix random(options.seed);
  const auto length = [](const PointRows& points, int i, int j) {
    return (points.row(i) - points.row(j)).norm();
  };
  std::vector<std::uint8_t> inliers;
  double needed = internal::kInfinity;
  while (result.samples < options.max_samples && result.samples < needed) {
    ++result.samples;
    int rows[3];
    rows[0] = random.Below(n);
    rows[1] = (rows[0] + 1 + random.Below(n - 1)) % n;
    do rows[2] = random.Below(n);
    while (rows[2] == rows[0] || rows[2] == rows[1]);
    bool rigid = true;
    for (int k = 0; k < 3 && rigid; ++k) {
      const int i = rows[k], j = rows[(k + 1) % 3];
      rigid = std::abs(length(a, i, j) - length(b, i, j)) <= 2 * max_distance;
    }
    Eigen::Matrix3d frame_a, frame_b;
    if (!rigid || !Frame(a, rows, &frame_a) || !Frame(b, rows, &frame_b)) continue;
    ++result.poses;
    Pose pose = internal::FitPose(a, b, rows, 3);
    const int count = internal::FindInliers(a, b, pose, max_distance, &inliers);
    if (count <= result.num_inliers || count < 3) continue;
    // A better pose is made as good as it gets at once (locally optimized RANSAC, Chum, Matas and
    // Kittler, DAGM 2003).
    int turns = 0;
    result.num_inliers =
        std::max(count, internal::RefineOnInliers(a, b, max_distance, &pose, &inliers, &turns));
    result.R = pose.R;
    result.p = pose.p;
    needed = SamplesNeeded(result.num_inliers, n, options.confidence);
  }
  result.confident = result.samples >= needed;
  if (result.num_inliers < 3) return result;
  result.num_inliers =
      internal::FindInliers(a, b, {result.R, result.p}, max_distance, &result.inliers);
  result.log_false_alarms = LogFalseAlarms(
      result.poses, n, result.num_inliers,
      internal::ChanceOfAgreement(a, b, {result.R, result.p}, max_distance, result.inliers));
  return result;
}

}  // namespace prehensile
