#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "prehensile/simd.h"

namespace prehensile {

/// N rows of x, y, z, in memory that somebody else owns.
template <typename Scalar>
using RowsView = Eigen::Map<const Eigen::Matrix<Scalar, Eigen::Dynamic, 3, Eigen::RowMajor>>;

/// A cloud with one point per occupied voxel. Rows are in the order in which the voxels first
/// occur in the input.
template <typename Scalar>
struct VoxelCloud {
  /// x, y, z of each voxel's centroid, 3 V numbers.
  std::vector<Scalar> points;
  /// x, y, z of each voxel's unit mean normal, 3 V numbers; empty if there were no normals.
  /// Zero where the normals of a voxel cancel, or none of them is finite.
  std::vector<Scalar> normals;
  /// Number of input points in each voxel.
  std::vector<std::int32_t> counts;
};

struct VoxelOptions {
  /// Number of threads, at least 1. Few points are shared by fewer threads than asked for.
  int num_threads = 1;
  /// The SIMD level; BestSimdLevel() if not given.
  std::optional<SimdLevel> simd;
};

/// Replaces the points in each voxel by their centroid.
///
/// Voxel (i, j, k) holds the points with i = floor(x · (1 / voxel_size)), and so on, in double
/// precision: the grid is tied to the origin of the points' frame and not to the cloud, so equal
/// points fall into equal voxels in every cloud of that frame. Sums are taken in double precision
/// and in the order of the input; the result is the same, bit for bit, for every number of threads
/// and SIMD level.
///
/// A point with a non-finite coordinate (a pixel without return) is dropped. A non-finite normal
/// adds nothing to the mean normal of its voxel; its point still counts.
///
/// @param points N points; N < 2³¹.
/// @param voxel_size edge length of a voxel, in the unit of the points.
/// @param normals N vectors, one for each point; nullptr for none.
/// @throws std::invalid_argument naming the argument: a voxel size that is not positive and finite,
///   or so small that a point lies more than 2²⁰ voxels from the origin; normals of another number
///   than the points; fewer than one thread; a SIMD level that this machine lacks.
template <typename Scalar>
VoxelCloud<Scalar> VoxelDownsample(const RowsView<Scalar>& points, double voxel_size,
                                   const RowsView<Scalar>* normals = nullptr,
                                   const VoxelOptions& options = {});

extern template VoxelCloud<float> VoxelDownsample(const RowsView<float>&, double,
                                                  const RowsView<float>*, const VoxelOptions&);
extern template VoxelCloud<double> VoxelDownsample(const RowsView<double>&, double,
                                                   const RowsView<double>*, const VoxelOptions&);

}  // namespace prehensile
