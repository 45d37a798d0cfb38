#include <Eigen/SVD>
#include <cmath>

#include "consensus_detail.h"
#include "split_mix.h"
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

double ExpectedTriples(const PointRows& a, const PointRows& b, double tolerance) {
  constexpr int kSamples = 2048;
  const int n = static_cast<int>(a.rows());
  if (n <= 3) return n == 3 ? 1 : 0;
  // How often pairs {i, j} != {k, l} have |a_i - a_j| and |b_k - b_l| within the tolerance.
  SplitMix random(0);
  int hits = 3;  // None in so many samples leaves 3 in as many possible, at 95 % confidence.
  for (int sample = 0; sample < kSamples; ++sample) {
    const int i = random.Below(n), j = (i + 1 + random.Below(n - 1)) % n;
    int k, l;
    do {
      k = random.Below(n);
      l = (k + 1 + random.Below(n - 1)) % n;
    } while ((k == i && l == j) || (k == j && l == i));
    const double length_a = (a.row(i) - a.row(j)).norm();
    const double length_b = (b.row(k) - b.row(l)).norm();
    hits += std::abs(length_a - length_b) <= tolerance;
  }
  const double p = std::min(1.0, static_cast<double>(hits) / kSamples);
  return double(n) * (n - 1) * (n - 2) / 6 * p * p;
}

double ChanceOfAgreement(const PointRows& a, const PointRows& b, const Pose& pose, double bound,
                         const std::vector<std::uint8_t>& inliers) {
  constexpr int kPairs = 12'000;
  const int n = static_cast<int>(a.rows());
  Eigen::Matrix<double, Eigen::Dynamic, 3> moved =
      (a * pose.R.transpose()).rowwise() + pose.p.transpose();
  const Eigen::Matrix<double, Eigen::Dynamic, 3> scene = b;
  Eigen::RowVector3d center = Eigen::RowVector3d::Zero();
  int count = 0;
  for (int i = 0; i < n; ++i) {
    if (!inliers[i]) continue;
    center += moved.row(i);
    ++count;
  }
  center /= std::max(count, 1);
  moved.rowwise() -= center;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (int i = 0; i < n; ++i) {
    if (inliers[i]) scatter += moved.row(i).transpose() * moved.row(i);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(scatter, Eigen::ComputeFullU);
  const int shifts = std::min(n - 1, (kPairs + n - 1) / n);
  Eigen::Index hits = 3;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d u = svd.matrixU().col(axis);
    const Eigen::Matrix3d half_turn = 2 * u * u.transpose() - Eigen::Matrix3d::Identity();
    const Eigen::Matrix<double, Eigen::Dynamic, 3> turned = (moved * half_turn).rowwise() + center;
    for (int s = 0; s < shifts; ++s) {
      const int shift = 1 + static_cast<int>(std::int64_t(n - 1) * s / shifts);
      const auto agreeing = [&](int from, int to, int rows) {
        return ((turned.middleRows(from, rows) - scene.middleRows(to, rows))
                    .rowwise()
                    .squaredNorm()
                    .array() <= bound * bound)
            .count();
      };
      hits += agreeing(0, shift, n - shift) + agreeing(n - shift, 0, shift);
    }
  }
  return std::min(1.0, static_cast<double>(hits) / (3.0 * shifts * n + 3));
}

}  // namespace internal

double LogFalseAlarms(double num_tests, int n, int k, double chance) {
  internal::Require(3 <= k && k <= n, "k: must lie in [3, n]");
  internal::Require(num_tests >= 0, "num_tests: must not be negative");
  internal::Require(chance > 0 && chance <= 1, "chance: must lie in (0, 1]");
  const double log_tests = std::log10(std::max(num_tests, 1.0));
  const int others = n - 3, hits = k - 3;
  if (hits <= others * chance || chance == 1) return log_tests;
  double log_tail = hits * std::log10(chance) + (others - hits) * std::log10(1 - chance);
  for (int i = 0; i < hits; ++i) log_tail += std::log10(double(others - i) / (hits - i));
  // The terms that follow fall at least by this ratio.
  const double ratio = (others - hits) * chance / ((hits + 1) * (1 - chance));
  return log_tests + std::min(0.0, log_tail - std::log10(1 - ratio));
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
