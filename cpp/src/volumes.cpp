#include "prehensile/volumes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "depth_rows.h"
#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

/// The say of an image that sees only free space at a voxel, at least.
constexpr double kSeenThrough = 0.01;

/// Of two slopes the one nearer to flat, 0 if they disagree in sign or one is not known: no slope
/// reaches across an edge of depth.
double Flatter(double a, double b) {
  if (!(a * b > 0)) return 0.0;
  return std::abs(a) < std::abs(b) ? a : b;
}

/// Cosine between the line of sight of each pixel and the normal of the surface there; 0 where
/// there is no measurement. Under a pinhole the inverse depth w of a plane is an affine function
/// of the pixel.
std::vector<float> CosinesOfIncidence(const DepthImageView& image, const std::vector<float>& w) {
  constexpr int kStep = 2;  // Over some pixels, for the noise.
  const int H = image.height, W = image.width;
  std::vector<float> cosines(w.size(), 0.0f);
  for (int v = 0; v < H; ++v) {
    for (int u = 0; u < W; ++u) {
      const std::size_t at = static_cast<std::size_t>(v) * W + u;
      if (!(w[at] > 0)) continue;
      const auto slope = [&](bool low, bool high, std::ptrdiff_t step) {
        const double back = low && w[at - step] > 0 ? w[at] - w[at - step] : 0.0;
        const double ahead = high && w[at + step] > 0 ? w[at + step] - w[at] : 0.0;
        return Flatter(back, ahead) / kStep;
      };
      const double a = image.fx * slope(u >= kStep, u + kStep < W, kStep);
      const double b =
          image.fy * slope(v >= kStep, v + kStep < H, static_cast<std::ptrdiff_t>(kStep) * W);
      const double x = (u - image.cx) / image.fx, y = (v - image.cy) / image.fy;
      const double c = w[at] - a * x - b * y;
      cosines[at] =
          static_cast<float>(w[at] / std::sqrt((a * a + b * b + c * c) * (1 + x * x + y * y)));
    }
  }
  return cosines;
}

}  // namespace

void IntegrateDepth(const DepthImageView& image, const Eigen::Matrix4d& X_WB, double truncation,
                    const DepthOptions& options, const VolumeView& volume) {
  using internal::Require;
  Require(volume.nx > 0 && volume.ny > 0 && volume.nz > 0, "volume: has no voxels");
  Require(volume.voxel_size > 0 && std::isfinite(volume.voxel_size),
          "voxel_size: must be positive and finite");
  Require(truncation > 0 && std::isfinite(truncation), "truncation: must be positive and finite");
  Require(options.min_depth > 0 && options.min_depth < options.max_depth,
          "min_depth: must lie above 0 and below max_depth");
  Require(!image.rays, "image: must be that of a pinhole; rectify it first");
  internal::CheckDepthImageView(image);
  Require(X_WB.allFinite(), "X_WB: must be finite");

  // Rigid: the inverse is the transpose.
  const Eigen::Matrix3d R_CW = image.X_WC.topLeftCorner<3, 3>().transpose();
  const Eigen::Matrix3d R_CB = R_CW * X_WB.topLeftCorner<3, 3>();
  const Eigen::Vector3d p_CB =
      R_CW * (X_WB.topRightCorner<3, 1>() - image.X_WC.topRightCorner<3, 1>());
  const double h = volume.voxel_size;
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  std::vector<float> inverse_depth(pixels, 0.0f);
  for (std::size_t i = 0; i < pixels; ++i) {
    const double depth = image.scale * (image.depth ? static_cast<double>(image.depth[i])
                                                    : static_cast<double>(image.raw_depth[i]));
    if (depth >= options.min_depth && depth <= options.max_depth) {
      inverse_depth[i] = static_cast<float>(1.0 / depth);
    }
  }
  const std::vector<float> cosines = CosinesOfIncidence(image, inverse_depth);
  internal::RunShares(volume.nx, 8, options.num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      for (int j = 0; j < volume.ny; ++j) {
        const Eigen::Vector3d first(h * (static_cast<double>(i) + 0.5 - 0.5 * volume.nx),
                                    h * (j + 0.5 - 0.5 * volume.ny), h * (0.5 - 0.5 * volume.nz));
        const Eigen::Vector3d p_C0 = R_CB * first + p_CB;
        const Eigen::Vector3d step = h * R_CB.col(2);
        const std::size_t row = (i * volume.ny + j) * static_cast<std::size_t>(volume.nz);
        for (int k = 0; k < volume.nz; ++k) {
          const double z = p_C0[2] + k * step[2];
          if (!(z > 1e-3)) continue;
          const double x = (p_C0[0] + k * step[0]) / z, y = (p_C0[1] + k * step[1]) / z;
          const double u = image.fx * x + image.cx + 0.5, v = image.fy * y + image.cy + 0.5;
          if (!(u >= 0 && u < image.width && v >= 0 && v < image.height)) continue;
          const std::size_t pixel =
              static_cast<std::size_t>(v) * image.width + static_cast<std::size_t>(u);
          const float cosine = cosines[pixel];
          if (!(cosine > 0)) continue;
          const double behind = z - 1.0 / inverse_depth[pixel];
          const double distance = -behind * std::sqrt(1 + x * x + y * y) * cosine;
          if (distance < -truncation) continue;
          float& mean = volume.distances[row + k];
          float& weight = volume.weights[row + k];
          const double here = std::min(distance, truncation);
          // What lies far behind a voxel is no news to one that sees a surface close before it. But
          // what saw through a voxel outvotes what has it close behind a surface, in its shadow.
          const double nearness = 1.0 - std::abs(here) / truncation;
          const double trust = here >= 0 ? std::max(nearness * nearness, kSeenThrough)
                                         : 4 * kSeenThrough * nearness * nearness;
          const auto say = static_cast<float>(cosine * trust);
          if (!(say > 0)) continue;
          weight += say;
          mean += (static_cast<float>(here) - mean) * (say / weight);
        }
      }
    }
  });
}

}  // namespace prehensile
