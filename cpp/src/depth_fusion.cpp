#include "prehensile/depth_fusion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>

#include "depth_rows.h"
#include "depth_voxels.h"
#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::DepthKernel;
using internal::DepthRows;
using internal::Placement;
using internal::Range;
using internal::Require;
using internal::SurfaceRow;
using internal::fusion::ColorSum;
using internal::fusion::Record;
using internal::fusion::Run;
using internal::fusion::Runs;
using internal::fusion::VoxelShare;

/// Voxels along an axis of the grid: 21 bits of a key.
constexpr double kMaxVoxels = 1 << 21;
/// Length of the sum of a voxel's unit normals, per normal, below which they
/// point nowhere.
constexpr double kLeastAgreement = 0.25;

/// The grid that voxels are numbered in: axes of W, origin on a corner of a
/// voxel of W.
struct Grid {
  Eigen::Vector3d origin;
  double voxel_size;
};

Grid MakeGrid(const Eigen::Matrix4d& X_WB, const Eigen::Vector3d& size, double voxel_size) {
  const Eigen::Vector3d reach = 0.5 * X_WB.topLeftCorner<3, 3>().cwiseAbs() * size;
  const Eigen::Vector3d low = (X_WB.topRightCorner<3, 1>() - reach) / voxel_size;
  const Eigen::Vector3d cells = 2 * reach / voxel_size;
  if (!(cells.maxCoeff() < kMaxVoxels - 4) || !(low.cwiseAbs().maxCoeff() < 1e9)) {
    throw std::invalid_argument(
        "voxel_size: " + std::to_string(voxel_size) +
        " is too small for the region: more than 2^21 voxels along an axis");
  }
  // One voxel of margin, as points are rounded.
  return {(low.array().floor() - 1).matrix() * voxel_size, voxel_size};
}

Placement MakePlacement(const DepthImageView& view, const Eigen::Matrix4d& X_WB,
                        const Eigen::Vector3d& size, const Grid& grid) {
  const Eigen::Matrix3d R_WC = view.X_WC.topLeftCorner<3, 3>();
  const Eigen::Vector3d p_WC = view.X_WC.topRightCorner<3, 1>();
  const Eigen::Matrix3d R_BW = X_WB.topLeftCorner<3, 3>().transpose();
  const Eigen::Matrix3d R_BC = R_BW * R_WC;
  const Eigen::Vector3d p_BC = R_BW * (p_WC - X_WB.topRightCorner<3, 1>());
  Placement at{};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      at.R_LC[3 * i + k] = static_cast<float>(R_WC(i, k));
      at.R_BC[3 * i + k] = static_cast<float>(R_BC(i, k));
    }
    at.p_LC[i] = static_cast<float>(p_WC[i] - grid.origin[i]);
    at.p_BC[i] = static_cast<float>(p_BC[i]);
    at.half_size[i] = static_cast<float>(0.5 * size[i]);
  }
  at.inverse_voxel = static_cast<float>(1 / grid.voxel_size);
  return at;
}

/// Columns and rows that can see the box; all if the box reaches near the
/// camera's plane or if the lens distorts.
std::pair<Range, Range> RegionOfInterest(const DepthImageView& view, const Placement& at) {
  Range columns{0, view.width}, rows{0, view.height};
  if (view.rays) return {columns, rows};
  const Eigen::Matrix3d R_BC =
      Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(at.R_BC).cast<double>();
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d p_B;
    for (int k = 0; k < 3; ++k) {
      p_B[k] = (corner >> k & 1 ? at.half_size[k] : -at.half_size[k]) - at.p_BC[k];
    }
    const Eigen::Vector3d p_C = R_BC.transpose() * p_B;
    if (p_C.z() < 0.01) return {columns, rows};
    const Eigen::Vector2d pixel(view.fx * p_C.x() / p_C.z() + view.cx,
                                view.fy * p_C.y() / p_C.z() + view.cy);
    low = low.cwiseMin(pixel);
    high = high.cwiseMax(pixel);
  }
  const auto range = [&](int k, int size) {
    const double begin = std::floor(std::clamp(low[k] - 1, 0.0, double(size)));
    const double end = std::ceil(std::clamp(high[k] + 2, 0.0, double(size)));
    return Range{static_cast<int>(begin), static_cast<int>(end)};
  };
  return {range(0, view.width), range(1, view.height)};
}

std::uint64_t Key(std::int32_t x, std::int32_t y, std::int32_t z) {
  return std::uint64_t(std::uint32_t(x)) << 42 | std::uint64_t(std::uint32_t(y)) << 21 |
         std::uint64_t(std::uint32_t(z));
}

/// A part of a view, and the runs that it gave to each share of the voxels.
struct Strip {
  std::uint16_t camera;
  Range columns;
  Range rows;
  std::vector<Runs> shares;
  std::uint32_t num_runs = 0;
};

/// Adds the runs of a row of pixels to a strip.
template <bool kColored>
void AppendRuns(const SurfaceRow& row, const std::uint8_t* colors, Strip* strip) {
  const float* const* const n = row.normals;
  const internal::PointRow& at = row.points;
  const std::size_t num_shares = strip->shares.size();
  std::int32_t x = -1, y = -1, z = -1;
  Run run{};
  ColorSum color{};
  const auto finish = [&] {
    if (!run.count) return;
    run.rank = strip->num_runs++;
    Runs& to = strip->shares[num_shares == 1 ? 0 : internal::fusion::ShareOf(run.key, num_shares)];
    to.runs.push_back(run);
    if constexpr (kColored) to.colors.push_back(color);
  };
  for (int u = row.columns.begin; u < row.columns.end; ++u) {
    if (at.voxel[0][u] < 0 || !(n[0][u] == n[0][u])) continue;
    if (((at.voxel[0][u] ^ x) | (at.voxel[1][u] ^ y) | (at.voxel[2][u] ^ z)) != 0) {
      finish();
      x = at.voxel[0][u], y = at.voxel[1][u], z = at.voxel[2][u];
      run = Run{.key = Key(x, y, z)};
      color = {};
    }
    ++run.count;
    for (int k = 0; k < 3; ++k) run.sum[k] += at.p[k][u];
    for (int k = 0; k < 3; ++k) run.normal[k] += n[k][u];
    if constexpr (kColored) {
      for (int k = 0; k < 3; ++k) color[k] += colors[3 * u + k];
    }
  }
  finish();
}

class Fusion {
 public:
  Fusion(std::span<const DepthImageView> views, const Eigen::Matrix4d& X_WB,
         const Eigen::Vector3d& size, double voxel_size, const DepthOptions& options)
      : views_(views),
        options_(options),
        kernel_(internal::DepthKernelFor(options.simd)),
        grid_(MakeGrid(X_WB, size, voxel_size)),
        colored_(std::all_of(views.begin(), views.end(), [](auto& v) { return v.colors; })) {
    for (const DepthImageView& view : views) {
      placements_.push_back(MakePlacement(view, X_WB, size, grid_));
    }
  }

  FusedCloud Run() {
    std::vector<Strip> strips = MakeStrips();
    const int num_shares = strips.empty() ? 1 : static_cast<int>(strips[0].shares.size());
    std::vector<VoxelShare> shares;
    if (num_shares == 1) {
      // Row by row, so that runs stay in the cache.
      shares.emplace_back(1, std::size_t{1} << 15, colored_);
      std::uint32_t num_runs = 0;
      for (Strip& strip : strips) {
        strip.num_runs = num_runs;
        Walk(&strip, [&] {
          shares[0].Add(strip.shares[0], strip.camera, 0);
          strip.shares[0].runs.clear();
          strip.shares[0].colors.clear();
        });
        num_runs = strip.num_runs;
      }
      return Write(shares, num_runs);
    }
    internal::RunParallel(num_shares, [&](int thread) {
      for (std::size_t i = thread; i < strips.size(); i += num_shares) Walk(&strips[i], [] {});
    });
    // Each share is added up in the order of the strips, so that sums do not
    // depend on threads.
    std::uint32_t num_runs = 0;
    for (const Strip& strip : strips) num_runs += strip.num_runs;
    for (int i = 0; i < num_shares; ++i) {
      shares.emplace_back(num_shares, num_runs / num_shares / 2, colored_);
    }
    internal::RunParallel(num_shares, [&](int i) {
      std::uint32_t offset = 0;
      for (const Strip& strip : strips) {
        shares[i].Add(strip.shares[i], strip.camera, offset);
        offset += strip.num_runs;
      }
    });
    return Write(shares, num_runs);
  }

 private:
  /// Views, or with several threads parts of them, and as many shares as there
  /// are threads.
  std::vector<Strip> MakeStrips() const {
    std::vector<std::pair<Range, Range>> regions;
    std::size_t num_rows = 0;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      regions.push_back(RegionOfInterest(views_[i], placements_[i]));
      if (!regions[i].first.empty()) num_rows += regions[i].second.end - regions[i].second.begin;
    }
    const int num_shares = internal::NumShares(num_rows, 64, options_.num_threads);
    // Rows at the borders of strips are read twice, but threads should end at
    // the same time.
    const int strip_rows = static_cast<int>(std::clamp<std::size_t>(
        num_shares == 1 ? num_rows : num_rows / (4 * std::size_t(num_shares)), 32, 1 << 15));
    std::vector<Strip> strips;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const Range columns = regions[i].first, rows = regions[i].second;
      if (columns.empty() || rows.empty()) continue;
      const int parts = std::max((rows.end - rows.begin) / std::max(strip_rows, 1), 1);
      for (int part = 0; part < parts; ++part) {
        const auto cut = [&](std::int64_t p) {
          return rows.begin + static_cast<int>((rows.end - rows.begin) * p / parts);
        };
        Strip strip{static_cast<std::uint16_t>(i), columns, {cut(part), cut(part + 1)}, {}, 0};
        strip.shares.resize(num_shares);
        if (num_shares > 1) {
          // About as much as there will be, in memory of this thread, which
          // keeps it for next time.
          const std::size_t pixels = std::size_t(columns.end - columns.begin) *
                                     std::size_t(strip.rows.end - strip.rows.begin);
          for (Runs& runs : strip.shares) runs.runs.reserve(pixels / 3 / num_shares);
        }
        strips.push_back(std::move(strip));
      }
    }
    return strips;
  }

  /// Makes the runs of a strip; calls after_row() after each row.
  template <typename AfterRow>
  void Walk(Strip* strip, const AfterRow& after_row) const {
    const DepthImageView& view = views_[strip->camera];
    DepthRows rows(view, options_, kernel_, strip->columns, &placements_[strip->camera],
                   view.X_WC.topLeftCorner<3, 3>());
    rows.Walk(strip->rows, [&](const SurfaceRow& row) {
      if (colored_) {
        AppendRuns<true>(row, view.colors + std::size_t{3} * view.width * row.v, strip);
      } else {
        AppendRuns<false>(row, nullptr, strip);
      }
      after_row();
    });
  }

  FusedCloud Write(const std::vector<VoxelShare>& shares, std::size_t num_runs) const {
    FusedCloud cloud;
    std::size_t total = 0;
    for (const VoxelShare& share : shares) total += share.records().size();
    cloud.points.reserve(3 * total);
    cloud.normals.reserve(3 * total);
    cloud.sensor_origins.reserve(3 * total);
    if (colored_) cloud.colors.reserve(3 * total);
    if (shares.size() == 1) {
      for (std::size_t i = 0; i < total; ++i) WriteVoxel(shares[0], i, &cloud);
      return cloud;
    }
    // By the run that made each.
    struct Maker {
      std::uint32_t share, record;
    };
    constexpr std::uint32_t kNone = ~std::uint32_t{0};
    std::vector<Maker> makers(num_runs, {kNone, 0});
    for (std::size_t s = 0; s < shares.size(); ++s) {
      for (std::size_t i = 0; i < shares[s].records().size(); ++i) {
        makers[shares[s].records()[i].first] = {static_cast<std::uint32_t>(s),
                                                static_cast<std::uint32_t>(i)};
      }
    }
    for (const Maker& maker : makers) {
      if (maker.share != kNone) WriteVoxel(shares[maker.share], maker.record, &cloud);
    }
    return cloud;
  }

  void WriteVoxel(const VoxelShare& share, std::size_t i, FusedCloud* cloud) const {
    const Record& record = share.records()[i];
    const double count = record.count;
    const Eigen::Vector3d normal = Eigen::Map<const Eigen::Vector3f>(record.normal).cast<double>();
    const double length = normal.norm();
    if (length < kLeastAgreement * count) return;
    const auto append = [](const Eigen::Vector3d& v, std::vector<double>* to) {
      to->insert(to->end(), v.data(), v.data() + 3);
    };
    append(grid_.origin + Eigen::Map<const Eigen::Vector3d>(record.sum) / count, &cloud->points);
    append(normal / length, &cloud->normals);
    append(views_[record.best_camera].X_WC.topRightCorner<3, 1>(), &cloud->sensor_origins);
    if (!colored_) return;
    for (const std::uint64_t sum : share.color(i)) {
      cloud->colors.push_back(static_cast<std::uint8_t>(std::lround(double(sum) / count)));
    }
  }

  std::span<const DepthImageView> views_;
  const DepthOptions& options_;
  const DepthKernel& kernel_;
  Grid grid_;
  bool colored_;
  std::vector<Placement> placements_;
};

}  // namespace

FusedCloud FuseDepthViews(std::span<const DepthImageView> views, const Eigen::Matrix4d& X_WB,
                          const Eigen::Vector3d& size, double voxel_size,
                          const DepthOptions& options) {
  internal::CheckDepthOptions(options);
  Require(!views.empty() && views.size() < 65536, "views: expected from 1 to 65535");
  std::size_t num_pixels = 0;
  for (const DepthImageView& view : views) {
    internal::CheckDepthImageView(view);
    num_pixels += static_cast<std::size_t>(view.width) * view.height;
  }
  Require(num_pixels < std::size_t{1} << 32, "views: more than 2^32 pixels");
  Require(internal::IsPose(X_WB), "X_WB: must be a finite rigid transform");
  Require(size.allFinite() && size.minCoeff() > 0, "size: must be positive and finite");
  Require(voxel_size > 0 && std::isfinite(voxel_size), "voxel_size: must be positive and finite");
  return Fusion(views, X_WB, size, voxel_size, options).Run();
}

void UnprojectDepth(const DepthImageView& view, const DepthOptions& options, double* points) {
  internal::CheckDepthOptions(options);
  internal::CheckDepthImageView(view);
  const std::size_t plane = static_cast<std::size_t>(view.width) * view.height;
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  internal::RunShares(
      view.height, 64, options.num_threads, [&](std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
          for (int u = 0; u < view.width; ++u) {
            const std::size_t at = v * view.width + u;
            const double z =
                view.scale * (view.depth ? double{view.depth[at]} : view.raw_depth[at]);
            const bool good = z >= options.min_depth && z <= options.max_depth;
            const double x = view.rays ? view.rays[at] : (u - view.cx) / view.fx;
            const double y =
                view.rays ? view.rays[plane + at] : (static_cast<double>(v) - view.cy) / view.fy;
            const bool seen = good && x == x && y == y;
            points[3 * at] = seen ? x * z : kNaN;
            points[3 * at + 1] = seen ? y * z : kNaN;
            points[3 * at + 2] = seen ? z : kNaN;
          }
        }
      });
}

void DepthNormals(const DepthImageView& view, const DepthOptions& options, double* normals) {
  internal::CheckDepthOptions(options);
  internal::CheckDepthImageView(view);
  const DepthKernel& kernel = internal::DepthKernelFor(options.simd);
  internal::RunShares(
      view.height, 64, options.num_threads, [&](std::size_t begin, std::size_t end) {
        DepthRows rows(view, options, kernel, {0, view.width}, nullptr,
                       Eigen::Matrix3d::Identity());
        rows.Walk({static_cast<int>(begin), static_cast<int>(end)}, [&](const SurfaceRow& row) {
          double* to = normals + std::size_t{3} * view.width * row.v;
          for (int u = 0; u < view.width; ++u) {
            const Eigen::Vector3d n(row.normals[0][u], row.normals[1][u], row.normals[2][u]);
            const Eigen::Vector3d unit = n / n.norm();  // To double precision.
            to = std::copy_n(unit.data(), 3, to);
          }
        });
      });
}

}  // namespace prehensile
