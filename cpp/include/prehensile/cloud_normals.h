#pragma once

#include <cstddef>

namespace prehensile {

/// Directions of least variance among the neighbours of each of n points; rows of x, y, z.
///
/// @param normals room for n rows: unit vectors whose z is not negative, or zero where there is no
///     such direction: fewer than three neighbours, or all on a line (their width is under 0.3 % of
///     the length), or spread alike in two least directions.
/// @param variation room for n: least eigenvalue of the neighbours' covariance over the sum of all
///     three, 0 for a plane to 1/3 (Pauly et al., "Efficient simplification of point-sampled
///     surfaces", 2002); 0 for coinciding points. May be null.

/// Neighbours: all points no further than the radius, the point itself included.
///
/// A point whose distance differs from the radius by less than some 1e-6 of it may be counted on
/// either side: sums are taken in single precision from each point, cell by cell.
///
/// @throws std::invalid_argument if a coordinate is not finite, n ≥ 2³¹, the radius is not positive
///     and finite, or the cloud spans more than 2¹⁹ radii.
void NormalsWithinRadius(const double* points, std::size_t n, double radius, int num_threads,
                         double* normals, double* variation);

/// Neighbours: the k nearest points, the point itself included, k ≥ 3; all in double precision.
///
/// @throws std::invalid_argument if a coordinate is not finite, n ≥ 2³¹ or k < 3.
void NormalsOfNearest(const double* points, std::size_t n, int k, int num_threads, double* normals,
                      double* variation);

/// Neighbours: the points of the voxel that a point is in and of the 26 around, by moments that are
/// summed once per voxel; all points of a voxel get the same answer. Voxels are the cells of the
/// grid through the origin.
///
/// @throws std::invalid_argument if a coordinate is not finite, n ≥ 2³¹, voxel_size is not positive
///     and finite, or a point lies more than 2²⁰ voxels from the origin.
void NormalsOfVoxels(const double* points, std::size_t n, double voxel_size, int num_threads,
                     double* normals, double* variation);

}  // namespace prehensile
