#include "depth_rows.h"

#include <Eigen/LU>
#include <cmath>
#include <stdexcept>
#include <string>

#include "vectors.h"

namespace prehensile::internal {
namespace {

constexpr float kNoNumber = std::numeric_limits<float>::quiet_NaN();

RowRing<float> Rows(int num_rows, int width, float value = 0.0f) {
  return RowRing<float>(num_rows, width, value);
}

std::array<RowRing<float>, 3> ThreeRows(int num_rows, int width) {
  return {Rows(num_rows, width), Rows(num_rows, width), Rows(num_rows, width)};
}

}  // namespace

const DepthKernel& DepthKernelFor(std::optional<SimdLevel> wanted) {
  const SimdLevel level = wanted.value_or(BestSimdLevel());
  if (!IsAvailable(level)) {
    throw std::invalid_argument("simd: this machine lacks " + std::string(Name(level)));
  }
#ifdef __x86_64__
  if (level == SimdLevel::kAvx512) return avx512::kDepth;
  if (level == SimdLevel::kAvx2) return avx2::kDepth;
#endif
  return baseline::kDepth;
}

void CheckDepthOptions(const DepthOptions& options) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  Require(positive(options.min_depth), "min_depth: must be positive and finite");
  Require(options.max_depth > options.min_depth && options.max_depth <= 1e6,
          "max_depth: must be above min_depth, at most 1e6");
  Require(options.window >= 3 && options.window <= 2 * kMaxRadius + 1 && options.window % 2 == 1,
          "window: must be odd, from 3 to 17");
  Require(positive(options.max_residual), "max_residual: must be positive and finite");
  Require(options.max_incidence > 0 && options.max_incidence < 1.5708,
          "max_incidence: must be above 0 and below pi/2");
  Require(options.noise_constant >= 0 && options.noise_quadratic >= 0 &&
              std::isfinite(options.noise_constant) && std::isfinite(options.noise_quadratic),
          "noise: must be finite and not negative");
  Require(options.num_threads >= 1, "num_threads: must be at least 1");
}

bool IsPose(const Eigen::Matrix4d& X) {
  const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
  return X.allFinite() && (R.transpose() * R).isIdentity(1e-6) && R.determinant() > 0;
}

void CheckDepthImageView(const DepthImageView& view) {
  Require(view.width > 0 && view.height > 0 && view.width <= 1 << 15 && view.height <= 1 << 15,
          "depth: must have from 1 to 32768 rows and columns");
  Require((view.depth != nullptr) != (view.raw_depth != nullptr),
          "depth: exactly one of depth and raw_depth must be given");
  Require(view.scale > 0 && std::isfinite(view.scale), "scale: must be positive and finite");
  if (!view.rays) {
    Require(view.fx > 0 && view.fy > 0 && std::isfinite(view.fx) && std::isfinite(view.fy),
            "camera: focal lengths must be positive and finite");
    Require(std::isfinite(view.cx) && std::isfinite(view.cy),
            "camera: the principal point must be finite");
  }
  Require(IsPose(view.X_WC), "X_WC: must be a finite rigid transform");
}

RayRows::RayRows(const DepthImageView& view)
    : view_(view),
      values_{Rows(1, view.width), Rows(1, view.width), Rows(1, view.width),
              Rows(1, view.width), Rows(1, view.width), Rows(1, view.width)},
      row_{values_[0][0], values_[1][0], values_[2][0],
           values_[3][0], values_[4][0], values_[5][0]} {
  if (view_.rays) return;
  for (int u = 0; u < view_.width; ++u) {
    values_[0][0][u] = static_cast<float>((u - view_.cx) / view_.fx);
    values_[2][0][u] = static_cast<float>(view_.fx);
    values_[5][0][u] = static_cast<float>(view_.fy);
  }
}

const RayRow& RayRows::Row(int v) {
  const int width = view_.width, height = view_.height;
  if (!view_.rays) {
    std::fill_n(values_[1][0], width, static_cast<float>((v - view_.cy) / view_.fy));
    return row_;
  }
  const std::size_t plane = static_cast<std::size_t>(width) * height;
  const int above = std::max(v - 1, 0), below = std::min(v + 1, height - 1);
  const float* const x = view_.rays;
  const float* const y = view_.rays + plane;
  const auto at = [width](int row, int u) { return static_cast<std::size_t>(row) * width + u; };
  std::copy_n(x + at(v, 0), width, values_[0][0]);
  std::copy_n(y + at(v, 0), width, values_[1][0]);
  const float per_v = 1.0f / static_cast<float>(std::max(below - above, 1));
  for (int u = 0; u < width; ++u) {
    const int left = std::max(u - 1, 0), right = std::min(u + 1, width - 1);
    const float per_u = 1.0f / static_cast<float>(std::max(right - left, 1));
    const float x_u = (x[at(v, right)] - x[at(v, left)]) * per_u;
    const float y_u = (y[at(v, right)] - y[at(v, left)]) * per_u;
    const float x_v = (x[at(below, u)] - x[at(above, u)]) * per_v;
    const float y_v = (y[at(below, u)] - y[at(above, u)]) * per_v;
    const float determinant = x_u * y_v - y_u * x_v;
    values_[2][0][u] = y_v / determinant;
    values_[3][0][u] = -y_u / determinant;
    values_[4][0][u] = -x_v / determinant;
    values_[5][0][u] = x_u / determinant;
  }
  return row_;
}

DepthRows::DepthRows(const DepthImageView& view, const DepthOptions& options,
                     const DepthKernel& kernel, Range columns, const Placement* placement,
                     const Eigen::Matrix3d& R)
    : view_(view),
      options_(options),
      kernel_(kernel),
      columns_(columns),
      placement_(placement),
      smooth_(options.noise_constant > 0 || options.noise_quadratic > 0),
      radius_(options.window / 2),
      ring_(2 * radius_ + 1),
      rays_(view),
      depth_(1, view.width, 0.0f),
      w_(ring_, view.width, kNoNumber),
      fit_mean_(ring_, view.width, 0.0f),
      fit_a_(ring_, view.width, 0.0f),
      fit_b_(ring_, view.width, 0.0f),
      fit_residual_(ring_, view.width, std::numeric_limits<float>::infinity()),
      points_(ThreeRows(ring_, view.width)),
      voxels_{RowRing<std::int32_t>(ring_, view.width, -1),
              RowRing<std::int32_t>(ring_, view.width, -1),
              RowRing<std::int32_t>(ring_, view.width, -1)},
      normals_(ThreeRows(1, view.width)),
      smooth_w_(1, view.width, kNoNumber),
      ranges_(ring_) {
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) R_[3 * i + k] = static_cast<float>(R(i, k));
  }
  const double settled = 0.05 * options.max_residual;
  limits_ = {
      static_cast<float>(options.max_residual * options.max_residual),
      static_cast<float>(settled * settled), static_cast<float>(std::cos(options.max_incidence)),
      static_cast<float>(options.noise_constant), static_cast<float>(options.noise_quadratic)};
}

void DepthRows::Read(int v, bool wanted) {
  float* const w = w_[v];
  RangeAt(v) = {};
  if (v < 0 || v >= view_.height) {
    std::fill(w + columns_.begin, w + columns_.end, kNoNumber);
    return;
  }
  const std::size_t at = static_cast<std::size_t>(v) * view_.width;
  float* const depth = depth_[0];
  const auto scale = static_cast<float>(view_.scale);
  for (int u = columns_.begin; u < columns_.end; ++u) {
    depth[u] =
        scale * (view_.depth ? view_.depth[at + u] : static_cast<float>(view_.raw_depth[at + u]));
  }
  kernel_.invert(depth, static_cast<float>(options_.min_depth),
                 static_cast<float>(options_.max_depth), columns_.begin, columns_.end, w);
  Range range = columns_;
  if (placement_) {
    // What lies outside the box is no neighbour either: slivers of the bin's walls get no normal.
    const PointRow points = points_at(v);
    if (!kernel_.place(w, rays_.Row(v), *placement_, range.begin, range.end, points)) return;
    // From far off, rounding may put a point of the box outside of the grid: none may be left.
    while (!range.empty() && points.voxel[0][range.begin] < 0) ++range.begin;
    while (!range.empty() && points.voxel[0][range.end - 1] < 0) --range.end;
  }
  if (wanted) RangeAt(v) = range;
}

void DepthRows::FitRowAt(int v) {
  // The rows that will ask for these windows.
  const Range range = RangeAt(v - radius_).Union(RangeAt(v)).Union(RangeAt(v + radius_));
  if (range.empty()) return;
  const float* rows[2 * kMaxRadius + 1];
  for (int dv = -radius_; dv <= radius_; ++dv) rows[dv + radius_] = w_[v + dv + ring_];
  kernel_.fit(rows, radius_, range.begin - radius_, range.end + radius_, fits_at(v + ring_));
}

void DepthRows::MakeSurface(int v) {
  const Range range = RangeAt(v);
  const FitRow fits[3] = {fits_at(v - radius_ + ring_), fits_at(v), fits_at(v + radius_)};
  float* const normals[3] = {normals_[0][0], normals_[1][0], normals_[2][0]};
  float* const smooth_w = smooth_ ? smooth_w_[0] : nullptr;
  const RayRow& rays = rays_.Row(v);
  kernel_.surface(w_[v], fits, radius_, rays, limits_, R_.data(), range.begin, range.end, normals,
                  smooth_w);
  if (smooth_ && placement_) {
    kernel_.place(smooth_w, rays, *placement_, range.begin, range.end, points_at(v));
  }
}

}  // namespace prehensile::internal
