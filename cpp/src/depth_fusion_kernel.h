#pragma once

#include <cstddef>
#include <cstdint>

namespace prehensile::internal {

/// Rows of pixels are padded by so many floats on either side, and may be written up to a multiple
/// of 16 beyond their end, so that no loop over a row needs a remainder.
inline constexpr int kRowPad = 48;
/// Largest half edge of a window of pixels.
inline constexpr int kMaxRadius = 8;

/// Lines of sight of a row of pixels: x/z and y/z, and the inverse transposed of the Jacobian
/// [x_u, x_v; y_u, y_v] of the slopes by the pixel, which turns the gradient of a function of the
/// pixel into one of the slopes.
struct RayRow {
  const float* x;
  const float* y;
  const float* x_by_u;
  const float* x_by_v;
  const float* y_by_u;
  const float* y_by_v;
};

/// The planes in inverse depth, w(u + du, v + dv) = mean + a du + b dv, of the windows centred on a
/// row of pixels, and the mean squared distance of the windows' pixels to them along the optical
/// axis [m²], infinite where the window's centre or too many of its pixels are no measurement.
struct FitRow {
  float* mean;
  float* a;
  float* b;
  float* residual;
};

/// Where to put points: the grid's frame L (axes of W, origin on a corner of a voxel) and the box
/// B.
struct Placement {
  float R_LC[9], p_LC[3];
  float R_BC[9], p_BC[3];
  float half_size[3];
  float inverse_voxel;
};

/// Points p_L of a row and their voxels; voxel x is -1 for a pixel that is left out.
struct PointRow {
  float* p[3];
  std::int32_t* voxel[3];
};

/// When a window fits and which one a pixel takes; see Surface of the kernel.
struct FitLimits {
  float max_variance;      // Of a window's residuals, without noise [m²].
  float settled_variance;  // A pixel whose own window is as good keeps it [m²].
  float min_cosine;        // Of the angle of incidence.
  float noise_constant;    // Standard deviation of the depth [m] is this ...
  float noise_quadratic;   // ... plus this times z² [1/m].
};

/// The kernels of one SIMD level. All work on columns [begin, end), rounded out to multiples of 16.
struct DepthKernel {
  /// w = 1/z, NaN where z is not within [low, high].
  void (*invert)(const float* z, float low, float high, int begin, int end, float* w);
  /// Points and voxels of the measured pixels inside the box; the w of others becomes NaN. Returns
  /// whether there is any.
  bool (*place)(float* w, const RayRow& rays, const Placement& placement, int begin, int end,
                const PointRow& points);
  /// Fits the windows of (2 radius + 1)² pixels centred on the middle one of 2 radius + 1 rows.
  void (*fit)(const float* const* w, int radius, int begin, int end, const FitRow& fits);
  /// Normals in C rotated by R (3, 3) from the best of nine windows that hold each pixel: of the
  /// rows `radius` above, at, and `radius` below the pixel's. NaN where no window fits. If smooth_w
  /// is not null, it gets the inverse depth of the window's plane at the pixel, NaN without a
  /// normal.
  void (*surface)(const float* w, const FitRow* fits, int radius, const RayRow& rays,
                  const FitLimits& limits, const float* R, int begin, int end,
                  float* const* normals, float* smooth_w);
};

namespace baseline {
extern const DepthKernel kDepth;
}
namespace avx2 {
extern const DepthKernel kDepth;
}
namespace avx512 {
extern const DepthKernel kDepth;
}

}  // namespace prehensile::internal
