#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <string>

#include "parallel.h"
#include "prehensile/features.h"

namespace prehensile {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int kAngles = 15;    // Buckets along each angle of a feature: 12° each.
constexpr int kTurns = 32;     // Cells about the normal of a reference point.
constexpr double kRim = 0.25;  // This part of a bucket next to its edge votes beyond it, too.
constexpr int kMaxDistances = 64;

Vector3d Row(const double* rows, std::size_t i) { return Eigen::Map<const Vector3d>(rows + 3 * i); }

/// A rotation that turns a unit vector onto the x axis.
Matrix3d TurnOntoX(const Vector3d& n) {
  // Rows n, a, n × a; for a the part of that axis across n which is furthest from n.
  int least;
  n.cwiseAbs().minCoeff(&least);
  Matrix3d R;
  R.row(0) = n;
  R.row(1) = (Vector3d::Unit(least) - n[least] * n).normalized();
  R.row(2) = R.row(0).transpose().cross(R.row(1).transpose());
  return R;
}

/// Angle in 2⁻¹⁶ turns that takes q by a rotation about x into the half-plane y > 0, z = 0.
std::uint16_t AngleAboutX(const Vector3d& q) {
  const double turns = std::atan2(-q[2], q[1]) * (0.5 / std::numbers::pi);
  return static_cast<std::uint16_t>(static_cast<std::int32_t>(std::floor(turns * 65536)) & 0xFFFF);
}

/// The feature of a pair in units of the buckets. False for coincident points.
bool PairFeature(const Vector3d& d, const Vector3d& n1, const Vector3d& n2, double distance_step,
                 double feature[4]) {
  const double distance = d.norm();
  if (!(distance > 1e-3 * distance_step)) return false;
  const auto angle = [](double cosine) {
    return std::acos(std::clamp(cosine, -1.0, 1.0)) * (kAngles / std::numbers::pi);
  };
  feature[0] = distance / distance_step;
  feature[1] = angle(n1.dot(d) / distance);
  feature[2] = angle(n2.dot(d) / distance);
  feature[3] = angle(n1.dot(n2));
  return true;
}

int Bucket(int distance, int a, int b, int c) {
  return ((distance * kAngles + a) * kAngles + b) * kAngles + c;
}

int AngleBin(double angle) { return std::min(static_cast<int>(angle), kAngles - 1); }

/// The bins in which a value of a scene's pair votes: its own and perhaps a neighbour.
int Bins(double value, int num_bins, int bins[2]) {
  const int own = static_cast<int>(value);
  int count = 0;
  if (own < num_bins) bins[count++] = own;
  const double part = value - own;
  if (part < kRim && own > 0 && own <= num_bins) bins[count++] = own - 1;
  if (part > 1 - kRim && own + 1 < num_bins) bins[count++] = own + 1;
  return count;
}

/// Below 1e70, so that products of a few are finite.
void RequireFinite(const double* values, std::size_t n, const char* name) {
  for (std::size_t i = 0; i < n; ++i) {
    if (!(std::abs(values[i]) < 1e70)) {
      throw std::invalid_argument(std::string(name) + ": must be finite");
    }
  }
}

struct Peak {
  std::uint16_t votes;
  std::uint16_t point;
  int turn;
};

/// Poses near each other become one: the votes are added, the pose is that of most votes.
std::vector<PoseVote> Cluster(std::vector<PoseVote> poses, double max_distance, double max_angle,
                              const Vector3d& p_OCenter, int max_poses) {
  std::stable_sort(poses.begin(), poses.end(),
                   [](const PoseVote& a, const PoseVote& b) { return a.votes > b.votes; });
  using Rows4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  const double min_trace = 1 + 2 * std::cos(max_angle);
  std::vector<PoseVote> clusters;
  std::vector<Vector3d> centers;
  for (const PoseVote& pose : poses) {
    const Eigen::Map<const Rows4> X(pose.X_WO);
    const Vector3d center = X.topLeftCorner<3, 3>() * p_OCenter + X.topRightCorner<3, 1>();
    bool found = false;
    for (std::size_t c = 0; c < clusters.size(); ++c) {
      if ((centers[c] - center).squaredNorm() > max_distance * max_distance) continue;
      const Eigen::Map<const Rows4> Y(clusters[c].X_WO);
      const double trace = X.topLeftCorner<3, 3>().cwiseProduct(Y.topLeftCorner<3, 3>()).sum();
      if (trace < min_trace) continue;
      clusters[c].votes += pose.votes;
      found = true;
    }
    if (!found) {
      clusters.push_back(pose);
      centers.push_back(center);
    }
  }
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const PoseVote& a, const PoseVote& b) { return a.votes > b.votes; });
  if (clusters.size() > static_cast<std::size_t>(max_poses)) clusters.resize(max_poses);
  return clusters;
}

}  // namespace

PointPairTable::PointPairTable(const double* points, const double* normals, std::size_t n,
                               double distance_step)
    : distance_step_(distance_step) {
  if (n < 2 || n >= (1u << 13)) {
    throw std::invalid_argument("points: expected 2 to 8191 rows, not " + std::to_string(n));
  }
  if (!(distance_step > 0) || !std::isfinite(distance_step)) {
    throw std::invalid_argument("distance_step: must be positive and finite");
  }
  RequireFinite(points, 3 * n, "points");
  RequireFinite(normals, 3 * n, "normals");
  for (std::size_t i = 0; i < n; ++i) {
    if (Row(normals, i).isZero()) continue;
    points_.insert(points_.end(), points + 3 * i, points + 3 * i + 3);
    normals_.insert(normals_.end(), normals + 3 * i, normals + 3 * i + 3);
  }
  points = points_.data();
  normals = normals_.data();
  n = num_points();
  double squared = 0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      squared = std::max(squared, (Row(points, i) - Row(points, j)).squaredNorm());
    }
  }
  diameter_ = std::sqrt(squared);
  if (!(diameter_ < kMaxDistances * distance_step)) {
    throw std::invalid_argument("distance_step: the model spans more than 64 steps");
  }
  num_distances_ = static_cast<int>(diameter_ / distance_step) + 1;

  struct Pair {
    std::uint32_t bucket;
    Entry entry;
  };
  std::vector<Pair> pairs;
  pairs.reserve(n * (n - 1));
  for (std::size_t i = 0; i < n; ++i) {
    const Vector3d p = Row(points, i), normal = Row(normals, i);
    const Matrix3d R = TurnOntoX(normal);
    for (std::size_t j = 0; j < n; ++j) {
      const Vector3d other = Row(normals, j);
      const Vector3d d = Row(points, j) - p;
      double f[4];
      if (i == j || !PairFeature(d, normal, other, distance_step, f)) continue;
      const int bucket =
          Bucket(static_cast<int>(f[0]), AngleBin(f[1]), AngleBin(f[2]), AngleBin(f[3]));
      pairs.push_back({static_cast<std::uint32_t>(bucket),
                       {static_cast<std::uint16_t>(i), AngleAboutX(R * d)}});
    }
  }
  begin_.assign(static_cast<std::size_t>(Bucket(num_distances_, 0, 0, 0)) + 1, 0);
  for (const Pair& pair : pairs) ++begin_[pair.bucket + 1];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
  entries_.resize(pairs.size());
  for (const Pair& pair : pairs) entries_[next[pair.bucket]++] = pair.entry;
}

std::vector<PoseVote> PointPairTable::Vote(const double* points, const double* normals,
                                           std::size_t m, int num_references,
                                           int peaks_per_reference, int max_poses,
                                           int num_threads) const {
  if (num_references < 1) throw std::invalid_argument("num_references: must be at least 1");
  if (peaks_per_reference < 1) {
    throw std::invalid_argument("peaks_per_reference: must be at least 1");
  }
  if (max_poses < 1) throw std::invalid_argument("max_poses: must be at least 1");
  RequireFinite(points, 3 * m, "points");
  RequireFinite(normals, 3 * m, "normals");

  std::vector<std::size_t> rows;  // Of the points with a normal.
  for (std::size_t i = 0; i < m; ++i) {
    if (!Row(normals, i).isZero()) rows.push_back(i);
  }
  if (num_points() == 0) return {};
  const std::size_t references = std::min<std::size_t>(num_references, rows.size());
  std::vector<std::vector<PoseVote>> found(references);
  const double longest = diameter_ + 0.5 * distance_step_;
  internal::RunShares(references, 4, num_threads, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint16_t> cells(num_points() * kTurns);
    std::vector<Peak> peaks(num_points());
    for (std::size_t r = begin; r < end; ++r) {
      const std::size_t reference = rows[rows.size() * (2 * r + 1) / (2 * references)];
      const Vector3d p = Row(points, reference), normal = Row(normals, reference);
      const Matrix3d R_GW = TurnOntoX(normal);
      std::fill(cells.begin(), cells.end(), 0);
      for (const std::size_t j : rows) {
        const Vector3d other = Row(normals, j);
        const Vector3d d = Row(points, j) - p;
        double f[4];
        if (j == reference || d.squaredNorm() > longest * longest ||
            !PairFeature(d, normal, other, distance_step_, f)) {
          continue;
        }
        // Half a cell more, so that the cells' centres are whole turns.
        const auto angle = static_cast<std::uint16_t>(AngleAboutX(R_GW * d) - 65536 / kTurns / 2);
        int bins[4][2], count[4];
        for (int k = 0; k < 4; ++k) count[k] = Bins(f[k], k ? kAngles : num_distances_, bins[k]);
        for (int a = 0; a < count[0]; ++a) {
          for (int b = 0; b < count[1]; ++b) {
            for (int c = 0; c < count[2]; ++c) {
              for (int e = 0; e < count[3]; ++e) {
                const int bucket = Bucket(bins[0][a], bins[1][b], bins[2][c], bins[3][e]);
                const Entry* const last = entries_.data() + begin_[bucket + 1];
                for (const Entry* entry = entries_.data() + begin_[bucket]; entry != last;
                     ++entry) {
                  const auto turn = static_cast<std::uint16_t>(entry->angle - angle);
                  ++cells[entry->point * kTurns + turn / (65536 / kTurns)];
                }
              }
            }
          }
        }
      }
      for (std::size_t i = 0; i < num_points(); ++i) {
        const std::uint16_t* const row = &cells[i * kTurns];
        const auto* const best = std::max_element(row, row + kTurns);
        peaks[i] = {*best, static_cast<std::uint16_t>(i), static_cast<int>(best - row)};
      }
      const std::size_t kept = std::min<std::size_t>(peaks_per_reference, peaks.size());
      std::partial_sort(peaks.begin(), peaks.begin() + kept, peaks.end(),
                        [](const Peak& a, const Peak& b) {
                          return a.votes != b.votes ? a.votes > b.votes : a.point < b.point;
                        });
      for (std::size_t k = 0; k < kept && peaks[k].votes > 0; ++k) {
        const double turn = 2 * std::numbers::pi / kTurns * peaks[k].turn;
        const Matrix3d R_WO = R_GW.transpose() *
                              Eigen::AngleAxisd(turn, Vector3d::UnitX()).toRotationMatrix() *
                              TurnOntoX(Row(normals_.data(), peaks[k].point));
        const Vector3d p_WO = p - R_WO * Row(points_.data(), peaks[k].point);
        PoseVote pose;
        Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(pose.X_WO);
        X.setIdentity();
        X.topLeftCorner<3, 3>() = R_WO;
        X.topRightCorner<3, 1>() = p_WO;
        pose.votes = peaks[k].votes;
        found[r].push_back(pose);
      }
    }
  });
  std::vector<PoseVote> all;
  for (const auto& poses : found) all.insert(all.end(), poses.begin(), poses.end());
  Vector3d center = Vector3d::Zero();
  for (std::size_t i = 0; i < num_points(); ++i) center += Row(points_.data(), i);
  center /= static_cast<double>(num_points());
  return Cluster(std::move(all), 0.1 * diameter_, 20 * std::numbers::pi / 180, center, max_poses);
}

}  // namespace prehensile
