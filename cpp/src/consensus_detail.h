#pragma once

#include <cstdint>

#include "prehensile/consensus.h"

// What the searches for a pose by consensus share.

namespace prehensile::internal {

using OwnedRows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

inline PointRows View(const OwnedRows& rows) { return {rows.data(), rows.rows(), 3}; }

struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
};

/// Throws std::invalid_argument unless there are as many finite points in a as in b and the bound
/// is positive and finite.
void RequireCorrespondences(const PointRows& a, const PointRows& b, double bound);

/// Which correspondences a pose agrees with, to within the bound; their number.
int FindInliers(const PointRows& a, const PointRows& b, const Pose& pose, double bound,
                std::vector<std::uint8_t>* inliers);

/// Least squares on the inliers, in turns with FindInliers, until they stay the same: each turn
/// lowers the truncated cost. Returns the number of inliers; below 3 the pose is left as it was.
int RefineOnInliers(const PointRows& a, const PointRows& b, double bound, Pose* pose,
                    std::vector<std::uint8_t>* inliers, int* iterations);

/// Least-squares pose of the rows named.
Pose FitPose(const PointRows& a, const PointRows& b, const int* rows, int count);

/// Expected number of triples of wrong correspondences that are consistent by their distances:
/// bounded by two of the distances, since the third depends on them.
double ExpectedTriples(const PointRows& a, const PointRows& b, double tolerance);

/// Probability that a wrong correspondence agrees with a wrong pose, from the points wrongly
/// matched, by the poses that half turns about the inliers' principal axes make of this one: they
/// keep the clouds one on the other as well as a wrong pose can.
double ChanceOfAgreement(const PointRows& a, const PointRows& b, const Pose& pose, double bound,
                         const std::vector<std::uint8_t>& inliers);

/// SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t seed) : state_(seed) {}
  std::uint64_t operator()() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return z ^ z >> 31;
  }
  /// Below n, a number under 2^32; uneven by less than n / 2^32.
  int Below(int n) { return static_cast<int>(((*this)() >> 32) * std::uint64_t(n) >> 32); }

 private:
  std::uint64_t state_;
};

}  // namespace prehensile::internal
