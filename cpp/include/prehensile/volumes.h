#pragma once

#include <Eigen/Core>

#include "prehensile/depth_fusion.h"

namespace prehensile {

/// A grid of voxels in a box frame B, whose origin is the box's centre. Voxel (i, j, k) has its
/// centre at ((i, j, k) + 1/2) · voxel_size - (nx, ny, nz) · voxel_size / 2 and its numbers at
/// place (i · ny + j) · nz + k. Nothing is owned.
struct VolumeView {
  int nx = 0, ny = 0, nz = 0;
  double voxel_size = 0.0;
  /// Mean signed distance of each voxel's centre from the surface seen, positive on the camera's
  /// side, no further than the truncation either way.
  float* distances = nullptr;
  /// How much the images had to say about it, at most 1 for each; 0 for nothing.
  float* weights = nullptr;
};

/// Adds what one depth image says of each voxel (Curless and Levoy 1996; Newcombe et al. 2011).
///
/// A voxel that projects onto a pixel with a return is compared with the return along the ray; what
/// lies between them, times the cosine of incidence, is the distance from the plane seen there.
/// In front of it, space is free and the distance is the truncation; further behind it than the
/// truncation, the image says nothing. Answers are weighed by the cosine,
/// and the more the nearer the surface: what an image sees far behind a voxel is no news to one
/// that sees a surface close before it. But what saw through a voxel outvotes what has it behind a
/// surface, where that one's shadow begins.
///
/// @param image its rays must be null (a pinhole); colours are not used.
/// @param X_WB pose of the volume's frame.
/// @param truncation largest distance that is kept [m], positive.
/// @param options its depth range and number of threads are used.
/// @throws std::invalid_argument naming the argument.
void IntegrateDepth(const DepthImageView& image, const Eigen::Matrix4d& X_WB, double truncation,
                    const DepthOptions& options, const VolumeView& volume);

}  // namespace prehensile
