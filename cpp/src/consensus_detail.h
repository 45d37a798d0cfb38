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

}  // namespace prehensile::internal
