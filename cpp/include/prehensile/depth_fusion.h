#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "prehensile/simd.h"

namespace prehensile {

/// A depth image and the camera that took it. The camera frame C is optical: z forward, x right,
/// y down. Nothing is owned; images are row-major.
struct DepthImageView {
  int width = 0;
  int height = 0;
  /// Depth along the optical axis, width · height numbers: exactly one of the two is given.
  const float* depth = nullptr;
  const std::uint16_t* raw_depth = nullptr;
  /// What a unit of the depth is [m].
  double scale = 1.0;
  /// The pinhole: pixel (u, v) sees along x/z = (u - cx) / fx and y/z = (v - cy) / fy.
  double fx = 1.0, fy = 1.0, cx = 0.0, cy = 0.0;
  /// For a lens that distorts: x/z of each pixel (width · height numbers), then y/z of each,
  /// instead of the pinhole. fx, fy, cx and cy are not used then.
  const float* rays = nullptr;
  /// Pose of C in the world W.
  Eigen::Matrix4d X_WC = Eigen::Matrix4d::Identity();
  /// Red, green, blue of each pixel, 3 · width · height numbers; null if not known.
  const std::uint8_t* colors = nullptr;
};

/// How normals are made from the pixel grid, and what counts as a measurement.
struct DepthOptions {
  /// Depths outside are no measurement [m]; 0 < min_depth < max_depth.
  double min_depth = 0.05;
  double max_depth = 10.0;
  /// Edge of the windows that planes are fitted to [pixels]: odd, 3 to 17.
  int window = 5;
  /// Largest root mean square distance of a window's pixels to its plane, and of the pixel itself,
  /// along the optical axis [m]; above 0. What the noise explains is allowed in addition.
  double max_residual = 0.002;
  /// Largest angle between normal and line of sight [rad]; above 0, below π/2.
  double max_incidence = 1.4486;
  /// The depth's standard deviation is this [m], ...
  double noise_constant = 0.0;
  /// ... plus this times the square of the depth [1/m]. With any noise, a point is put where its
  /// line of sight meets its window's plane.
  double noise_quadratic = 0.0;
  /// Number of threads, at least 1.
  int num_threads = 1;
  /// The SIMD level; BestSimdLevel() if not given.
  std::optional<SimdLevel> simd;
};

/// Points with normals in W, one per occupied voxel.
struct FusedCloud {
  /// x, y, z of the mean of each voxel's points, 3 V numbers.
  std::vector<double> points;
  /// x, y, z of the unit mean of their normals.
  std::vector<double> normals;
  /// x, y, z of the camera that saw most of them.
  std::vector<double> sensor_origins;
  /// The mean of their colours; empty if a view has none.
  std::vector<std::uint8_t> colors;
};

/// One cloud of what several depth images show inside a box.
///
/// Each pixel's normal comes from its own image: under a pinhole the inverse depth of a plane is an
/// affine function of the pixel, so the plane of a window of pixels is a least-squares fit of three
/// numbers. A pixel takes the plane of one of nine windows that hold it (centred on it, or with it
/// on the rim): its own, unless another fits several times better, as happens near an edge
/// (Kuwahara's choice). What lies outside the box does not count. A pixel that no window fits, such
/// as one between two surfaces, is left out. Normals point toward the camera. The points are then
/// averaged in the voxels of the grid through W's origin. A voxel whose normals disagree (the two
/// sides of a sheet) is left out.
///
/// Arithmetic on pixels is in single precision, relative to the box; sums over voxels are in double
/// precision. Voxels come in the order in which the views' pixels, row by row, first meet them. The
/// result is the same, bit for bit, for every number of threads and SIMD level.
///
/// @param X_WB pose of the box's frame, whose origin is its centre.
/// @param size full edge lengths [m], positive.
/// @param voxel_size edge of a voxel [m].
/// @throws std::invalid_argument naming the argument.
FusedCloud FuseDepthViews(std::span<const DepthImageView> views, const Eigen::Matrix4d& X_WB,
                          const Eigen::Vector3d& size, double voxel_size,
                          const DepthOptions& options = {});

/// Points of one image in C: 3 · width · height numbers, NaN where there is no measurement.
///
/// @throws std::invalid_argument naming the argument.
void UnprojectDepth(const DepthImageView& view, const DepthOptions& options, double* points);

/// Unit normals of one image in C, as FuseDepthViews makes them: 3 · width · height numbers, NaN
/// where there is none.
///
/// @throws std::invalid_argument naming the argument.
void DepthNormals(const DepthImageView& view, const DepthOptions& options, double* normals);

}  // namespace prehensile
