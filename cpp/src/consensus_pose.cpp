#include <Eigen/SVD>
#include <cmath>

#include "consensus_detail.h"
#include "vectors.h"

namespace prehensile {
namespace internal {

void RequireCorrespondences(const PointRows& a, const PointRows& b, double bound) {
  Require(a.rows() == b.rows(), "scene_points: as many as model_points are needed");
  Require(a.rows() <= ConsistencyGraph::kMaxVertices, "model_points: more than 2^15");
  Require(a.allFinite(), "model_points: must be finite");
  Require(b.allFinite(), "scene_points: must be finite");
  Require(bound > 0 && std::isfinite(bound), "noise_bound: must be positive and finite");
}

int FindInliers(const PointRows& a, const PointRows& b, const Pose& pose, double bound,
                std::vector<std::uint8_t>* inliers) {
  const auto n = static_cast<std::size_t>(a.rows());
  inliers->resize(n);
  const double *const p = a.data(), *const q = b.data();
  const Eigen::Matrix3d& R = pose.R;
  const Eigen::Vector3d& t = pose.p;
  int count = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double x = p[3 * i], y = p[3 * i + 1], z = p[3 * i + 2];
    const double dx = R(0, 0) * x + R(0, 1) * y + R(0, 2) * z + t[0] - q[3 * i];
    const double dy = R(1, 0) * x + R(1, 1) * y + R(1, 2) * z + t[1] - q[3 * i + 1];
    const double dz = R(2, 0) * x + R(2, 1) * y + R(2, 2) * z + t[2] - q[3 * i + 2];
    const bool inlier = dx * dx + dy * dy + dz * dz <= bound * bound;
    (*inliers)[i] = inlier;
    count += inlier;
  }
  return count;
}

Pose FitPose(const PointRows& a, const PointRows& b, const int* rows, int count) {
  Eigen::RowVector3d mean_a = Eigen::RowVector3d::Zero(), mean_b = mean_a;
  for (int k = 0; k < count; ++k) {
    mean_a += a.row(rows[k]);
    mean_b += b.row(rows[k]);
  }
  mean_a /= count;
  mean_b /= count;
  OwnedRows from(count, 3), to(count, 3);
  for (int k = 0; k < count; ++k) {
    from.row(k) = a.row(rows[k]) - mean_a;
    to.row(k) = b.row(rows[k]) - mean_b;
  }
  const std::vector<double> weights(count, 1.0);
  Pose pose;
  pose.R = FitRotation(View(from), View(to), weights.data());
  pose.p = mean_b.transpose() - pose.R * mean_a.transpose();
  return pose;
}

int RefineOnInliers(const PointRows& a, const PointRows& b, double bound, Pose* pose,
                    std::vector<std::uint8_t>* inliers, int* iterations) {
  int count = FindInliers(a, b, *pose, bound, inliers);
  std::vector<int> rows;
  std::vector<std::uint8_t> next;
  for (int turn = 0; turn < 30 && count >= 3; ++turn) {
    ++*iterations;
    rows.clear();
    for (std::size_t i = 0; i < inliers->size(); ++i) {
      if ((*inliers)[i]) rows.push_back(static_cast<int>(i));
    }
    const Pose fitted = FitPose(a, b, rows.data(), count);
    const int fitted_count = FindInliers(a, b, fitted, bound, &next);
    if (fitted_count < 3) break;
    *pose = fitted;
    count = fitted_count;
    inliers->swap(next);
    if (*inliers == next) break;
  }
  return count;
}

double ChanceOfConsistency(const PointRows& a, const PointRows& b, double tolerance) {
  constexpr int kSamples = 2048;
  const int n = static_cast<int>(a.rows());
  if (n < 2) return 1;
  SplitMix random(0);
  const auto distance = [&](const PointRows& points) {
    const int i = random.Below(n);
    const int j = (i + 1 + random.Below(n - 1)) % n;
    return (points.row(i) - points.row(j)).norm();
  };
  int hits = 3;
  for (int k = 0; k < kSamples; ++k) {
    const double length_a = distance(a), length_b = distance(b);
    hits += std::abs(length_a - length_b) <= tolerance;
  }
  return std::min(1.0, static_cast<double>(hits) / kSamples);
}

}  // namespace internal

double LogChanceSets(int n, int k, double p) {
  internal::Require(0 <= k && k <= n, "k: must lie in [0, n]");
  internal::Require(p >= 0 && p <= 1, "p: must be a probability");
  double log_sets = 0;  // n choose k. (std::lgamma differs between libraries.)
  for (int i = 0; i < k; ++i) log_sets += std::log10(double(n - i) / double(k - i));
  const int distances = k < 3 ? k * (k - 1) / 2 : 3 * k - 6;
  return distances ? log_sets + distances * std::log10(p) : log_sets;
}

Vote VoteForScale(const PointRows& a, const PointRows& b, double noise_bound) {
  internal::RequireCorrespondences(a, b, noise_bound);
  const int n = static_cast<int>(a.rows());
  internal::Require(n >= 2, "model_points: two are needed for a scale");
  // Each with those that follow it at some distances in the list, 500 000 pairs at most.
  const int strides = std::min(n / 2, std::max(1, 500'000 / n));
  std::vector<double> ratios, bounds;
  for (int s = 0; s < strides; ++s) {
    const int stride = 1 + static_cast<int>(std::int64_t(n / 2) * s / strides);
    const int end = 2 * stride == n ? n / 2 : n;  // Opposite ones once.
    for (int i = 0; i < end; ++i) {
      const int j = (i + stride) % n;
      const double length = (a.row(i) - a.row(j)).norm();
      // Pairs that noise could turn around say nothing.
      if (length <= 2 * noise_bound) continue;
      ratios.push_back((b.row(i) - b.row(j)).norm() / length);
      bounds.push_back(2 * noise_bound / length);
    }
  }
  internal::Require(!ratios.empty(), "model_points: all within the noise of each other");
  return VoteForScalar(ratios.data(), bounds.data(), ratios.size(), false);
}

}  // namespace prehensile
