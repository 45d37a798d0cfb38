#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

/// A plane normal · p = offset.
struct Plane {
  double normal[3];
  double offset;
};

/// What RansacPlane found.
struct PlaneResult {
  /// Whether three points that span a plane were found at all.
  bool found = false;
  Plane plane{};
  /// For each point 1 if it is no further from the plane than max_distance, else 0.
  std::vector<std::uint8_t> inliers;
  /// Number of samples drawn.
  int iterations = 0;
};

struct RansacPlaneOptions {
  /// Largest distance of an inlier from the plane.
  double max_distance = 0.005;
  /// Sampling stops when a better plane has been missed with at most this probability left.
  double confidence = 0.999;
  int max_iterations = 10000;
  std::uint64_t seed = 0;
};

/// The plane with the most points near it, by random samples of three (Fischler and Bolles, 1981),
/// then fitted to its inliers by least squares.
///
/// @param points n rows of x, y, z, finite.
/// @throws std::invalid_argument naming the argument.
PlaneResult RansacPlane(const double* points, std::size_t n, const RansacPlaneOptions& options);

/// Pieces of a cloud whose points are connected by steps no longer than the tolerance.
///
/// @return for each point its piece, 0, 1, ... by decreasing number of points (equal ones in the
///   order of their first points), or -1 where the piece has fewer than min_points.
/// @throws std::invalid_argument naming the argument: points that are not finite or lie more than
///   2²⁰ cells from the origin, a tolerance that is not positive and finite.
std::vector<std::int64_t> EuclideanClusters(const double* points, std::size_t n, double tolerance,
                                            std::size_t min_points);

struct PlaneRegionsOptions {
  /// Points no further apart than this are neighbours.
  double radius = 0.01;
  /// Largest angle between a point's normal and its region's plane [rad].
  double max_angle = 0.17;
  /// Largest distance of a point from its region's plane.
  double max_distance = 0.005;
  /// Smaller regions are given up.
  std::size_t min_points = 50;
};

/// Planar pieces of a cloud, grown from the flattest points; the plane of a region is fitted anew
/// whenever the region has grown by half.
///
/// @param points, normals n rows each, finite.
/// @param planes receives the plane of each region, its normal toward the points' normals.
/// @return labels as EuclideanClusters gives them; -1 for points of no plane.
std::vector<std::int64_t> GrowPlanes(const double* points, const double* normals, std::size_t n,
                                     const PlaneRegionsOptions& options,
                                     std::vector<Plane>* planes);

struct ConvexSegmentsOptions {
  /// Points in cells of this edge that share a face, an edge or a corner are neighbours.
  double voxel_size = 0.005;
  /// Two neighbours are apart if their normals turn toward each other by more than this within a
  /// cell's length [rad].
  double max_concavity = 0.17;
  /// Two neighbours with like normals are apart if they lie further from each other along the
  /// normal than this [cells].
  double max_step = 0.6;
  std::size_t min_points = 12;
};

/// Pieces that are connected without a concave edge or a step. Labels as EuclideanClusters.
std::vector<std::int64_t> ConvexSegments(const double* points, const double* normals, std::size_t n,
                                         const ConvexSegmentsOptions& options);

/// How many neighbours (as in ConvexSegments) show segment b resting on segment a, in row a and
/// column b of a matrix: a patch of `a` that faces upward meets one of b, above it, that does not.
std::vector<std::int64_t> RestingPairs(const double* points, const double* normals,
                                       const std::int64_t* labels, std::size_t n, double voxel_size,
                                       std::size_t num_labels);

}  // namespace prehensile
