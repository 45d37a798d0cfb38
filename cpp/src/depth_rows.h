#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "depth_fusion_kernel.h"
#include "prehensile/depth_fusion.h"

namespace prehensile::internal {

/// A half-open range of columns or rows.
struct Range {
  int begin = 0;
  int end = 0;
  bool empty() const { return begin >= end; }
  /// The least range that holds both.
  Range Union(const Range& other) const {
    if (empty()) return other;
    if (other.empty()) return *this;
    return {std::min(begin, other.begin), std::max(end, other.end)};
  }
};

/// Rows of numbers with room on either side, used again and again: row v is kept at v modulo their
/// number.
template <typename T>
class RowRing {
 public:
  RowRing(int num_rows, int width, T value)
      : num_rows_(num_rows),
        stride_(2 * kRowPad + (width + 15) / 16 * 16),
        values_(static_cast<std::size_t>(num_rows) * stride_, value) {}
  /// Column 0 of row v, v ≥ -num_rows.
  T* operator[](int v) {
    const int slot = (v + num_rows_) % num_rows_;
    return &values_[static_cast<std::size_t>(slot) * stride_ + kRowPad];
  }

 private:
  int num_rows_;
  std::size_t stride_;
  std::vector<T> values_;
};

/// Lines of sight of a view, row by row.
class RayRows {
 public:
  explicit RayRows(const DepthImageView& view);
  /// The lines of sight of row v; valid until the next call.
  const RayRow& Row(int v);

 private:
  const DepthImageView& view_;
  std::array<RowRing<float>, 6> values_;
  RayRow row_;
};

/// The kernels of a level.
///
/// @throws std::invalid_argument if this machine lacks it.
const DepthKernel& DepthKernelFor(std::optional<SimdLevel> level);

/// @throws std::invalid_argument naming the argument.
void CheckDepthOptions(const DepthOptions& options);
void CheckDepthImageView(const DepthImageView& view);
/// Whether it is a finite rigid transform.
bool IsPose(const Eigen::Matrix4d& X);

/// What a row of a view has become: points in L (if placed) and normals, where there are any.
struct SurfaceRow {
  int v;
  Range columns;
  PointRow points;
  const float* normals[3];
};

/// Walks down the rows of a part of a view, and makes points and normals of each.
class DepthRows {
 public:
  /// @param columns those to be read.
  /// @param placement null if only normals are wanted.
  /// @param R (3, 3) turns the normals.
  DepthRows(const DepthImageView& view, const DepthOptions& options, const DepthKernel& kernel,
            Range columns, const Placement* placement, const Eigen::Matrix3d& R);

  /// Calls take(SurfaceRow) for those of the rows that have a point.
  template <typename Take>
  void Walk(Range rows, const Take& take) {
    const int r = radius_;
    std::fill(ranges_.begin(), ranges_.end(), Range{});
    for (int s = rows.begin - 2 * r; s < rows.end + 2 * r; ++s) {
      Read(s, s >= rows.begin && s < rows.end);
      if (s - r >= rows.begin - r) FitRowAt(s - r);
      const int e = s - 2 * r;
      if (e < rows.begin || e >= rows.end || RangeAt(e).empty()) continue;
      MakeSurface(e);
      take(SurfaceRow{
          e, RangeAt(e), points_at(e), {normals_[0][0], normals_[1][0], normals_[2][0]}});
    }
  }

 private:
  void Read(int v, bool wanted);
  void FitRowAt(int v);
  void MakeSurface(int v);
  Range& RangeAt(int v) { return ranges_[(v + 2 * ring_) % ring_]; }
  FitRow fits_at(int v) { return {fit_mean_[v], fit_a_[v], fit_b_[v], fit_residual_[v]}; }
  PointRow points_at(int v) {
    return {{points_[0][v], points_[1][v], points_[2][v]},
            {voxels_[0][v], voxels_[1][v], voxels_[2][v]}};
  }

  const DepthImageView& view_;
  const DepthOptions& options_;
  const DepthKernel& kernel_;
  Range columns_;
  const Placement* placement_;
  std::array<float, 9> R_;
  FitLimits limits_;
  bool smooth_;
  int radius_;
  int ring_;
  RayRows rays_;
  RowRing<float> depth_;
  RowRing<float> w_;
  RowRing<float> fit_mean_, fit_a_, fit_b_, fit_residual_;
  std::array<RowRing<float>, 3> points_;
  std::array<RowRing<std::int32_t>, 3> voxels_;
  std::array<RowRing<float>, 3> normals_;
  RowRing<float> smooth_w_;
  std::vector<Range> ranges_;
};

}  // namespace prehensile::internal
