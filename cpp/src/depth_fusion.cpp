#include "prehensile/depth_fusion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>

#include "depth_rows.h"
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

/// Voxels along an axis of the grid: 21 bits of a key.
constexpr double kMaxVoxels = 1 << 21;
/// Length of the sum of a voxel's unit normals, per normal, below which they point nowhere.
constexpr double kLeastAgreement = 0.25;

/// Neighbouring pixels of a row that lie in the same voxel.
struct Run {
  std::uint64_t key;
  std::uint32_t camera;
  std::uint32_t count;
  float sum[3];
  float normal[3];
  std::uint32_t color[3];
};

/// What is known of one voxel: one cache line.
struct alignas(64) Record {
  std::uint64_t key;
  double sum[3];
  float normal[3];
  std::uint32_t count;
  /// The camera that is adding now and the number of its points, and the best one before it.
  std::uint16_t camera, best_camera;
  std::uint32_t camera_count, best_count;
  /// Number of the run that made it.
  std::uint32_t first;
};

/// One share of the voxels, an open-addressing hash table. To whom a voxel belongs is decided by
/// its key alone.
class VoxelShare {
 public:
  VoxelShare(std::uint64_t share, std::uint64_t num_shares, bool colored)
      : share_(share), num_shares_(num_shares), colored_(colored) {
    Grow(1 << 14);
  }

  /// Adds those of the runs that belong to this share.
  void Add(std::span<const Run> runs, std::size_t first) {
    constexpr std::size_t kBlock = 64;
    std::uint32_t mine[kBlock];
    std::uint64_t bucket[kBlock];
    for (std::size_t begin = 0; begin < runs.size(); begin += kBlock) {
      const std::size_t end = std::min(runs.size(), begin + kBlock);
      if (records_.size() + kBlock > capacity_) Grow(2 * capacity_);
      // Ask for the buckets and the records in them ahead of use.
      std::size_t count = 0;
      for (std::size_t i = begin; i < end; ++i) {
        const auto product = static_cast<unsigned __int128>(Hash(runs[i].key)) * num_shares_;
        mine[count] = static_cast<std::uint32_t>(i);
        bucket[count] = static_cast<std::uint64_t>(product) >> shift_;
        __builtin_prefetch(&buckets_[bucket[count]]);
        count += static_cast<std::uint64_t>(product >> 64) == share_;
      }
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t at = buckets_[bucket[i]];
        if (at != kEmpty) __builtin_prefetch(&records_[at], 1);
      }
      for (std::size_t i = 0; i < count; ++i) {
        AddOne(runs[mine[i]], bucket[i], static_cast<std::uint32_t>(first + mine[i]));
      }
    }
  }

  const std::vector<Record>& records() const { return records_; }
  const std::array<std::uint64_t, 3>& color(std::size_t i) const { return colors_[i]; }

 private:
  static constexpr std::uint32_t kEmpty = ~std::uint32_t{0};

  static std::uint64_t Hash(std::uint64_t key) {
    key ^= key >> 32;
    key *= 0x9E3779B97F4A7C15u;
    return key;
  }

  void AddOne(const Run& run, std::uint64_t bucket, std::uint32_t first) {
    while (buckets_[bucket] != kEmpty && records_[buckets_[bucket]].key != run.key) {
      bucket = (bucket + 1) & (buckets_.size() - 1);
    }
    std::uint32_t& at = buckets_[bucket];
    if (at == kEmpty) {
      at = static_cast<std::uint32_t>(records_.size());
      const auto camera = static_cast<std::uint16_t>(run.camera);
      records_.push_back({.key = run.key, .camera = camera, .best_camera = camera, .first = first});
      if (colored_) colors_.push_back({});
    }
    Record& record = records_[at];
    for (int k = 0; k < 3; ++k) record.sum[k] += run.sum[k];
    for (int k = 0; k < 3; ++k) record.normal[k] += run.normal[k];
    record.count += run.count;
    if (record.camera != run.camera) {  // Cameras come one after the other.
      record.camera = static_cast<std::uint16_t>(run.camera);
      record.camera_count = 0;
    }
    record.camera_count += run.count;
    if (record.camera_count > record.best_count) {
      record.best_count = record.camera_count;
      record.best_camera = record.camera;
    }
    if (colored_) {
      for (int k = 0; k < 3; ++k) colors_[at][k] += run.color[k];
    }
  }

  /// Makes room for `capacity` records, a power of two, and twice as many buckets.
  void Grow(std::size_t capacity) {
    capacity_ = capacity;
    records_.reserve(capacity);
    buckets_.assign(2 * capacity, kEmpty);
    shift_ = 64 - std::countr_zero(buckets_.size());
    for (std::size_t i = 0; i < records_.size(); ++i) {
      std::uint64_t bucket = (Hash(records_[i].key) * num_shares_) >> shift_;
      while (buckets_[bucket] != kEmpty) bucket = (bucket + 1) & (buckets_.size() - 1);
      buckets_[bucket] = static_cast<std::uint32_t>(i);
    }
  }

  std::uint64_t share_;
  std::uint64_t num_shares_;
  bool colored_;
  std::size_t capacity_ = 0;
  int shift_ = 0;
  std::vector<Record> records_;
  std::vector<std::array<std::uint64_t, 3>> colors_;
  std::vector<std::uint32_t> buckets_;
};

/// The grid that voxels are numbered in: axes of W, origin on a corner of a voxel of W.
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

/// Columns and rows that can see the box; all if the box reaches near the camera's plane or if the
/// lens distorts.
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

/// Appends the runs of a row of pixels.
template <bool kColored>
void AppendRuns(const SurfaceRow& row, std::uint32_t camera, const std::uint8_t* colors,
                std::vector<Run>* runs) {
  const float* const* const n = row.normals;
  const internal::PointRow& at = row.points;
  std::int32_t x = -1, y = -1, z = -1;
  Run run{};
  for (int u = row.columns.begin; u < row.columns.end; ++u) {
    if (at.voxel[0][u] < 0 || !(n[0][u] == n[0][u])) continue;
    if (((at.voxel[0][u] ^ x) | (at.voxel[1][u] ^ y) | (at.voxel[2][u] ^ z)) != 0) {
      if (run.count) runs->push_back(run);
      x = at.voxel[0][u], y = at.voxel[1][u], z = at.voxel[2][u];
      run = Run{.key = Key(x, y, z), .camera = camera};
    }
    ++run.count;
    for (int k = 0; k < 3; ++k) run.sum[k] += at.p[k][u];
    for (int k = 0; k < 3; ++k) run.normal[k] += n[k][u];
    if constexpr (kColored) {
      for (int k = 0; k < 3; ++k) run.color[k] += colors[3 * u + k];
    }
  }
  if (run.count) runs->push_back(run);
}

/// A part of a view, and the runs that it gave.
struct Strip {
  std::uint32_t camera;
  Range columns;
  Range rows;
  std::vector<Run> runs;
};

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
    const int num_threads = options_.num_threads;
    std::vector<Strip> strips = MakeStrips();
    std::vector<VoxelShare> shares;
    const auto walk = [&](Strip& strip, const auto& after_row) {
      const DepthImageView& view = views_[strip.camera];
      DepthRows rows(view, options_, kernel_, strip.columns, &placements_[strip.camera],
                     view.X_WC.topLeftCorner<3, 3>());
      rows.Walk(strip.rows, [&](const SurfaceRow& row) {
        if (colored_) {
          const std::size_t at = std::size_t{3} * view.width * row.v;
          AppendRuns<true>(row, strip.camera, view.colors + at, &strip.runs);
        } else {
          AppendRuns<false>(row, strip.camera, nullptr, &strip.runs);
        }
        after_row();
      });
    };
    std::size_t num_runs = 0;
    if (num_threads == 1) {
      shares.emplace_back(0, 1, colored_);
      for (Strip& strip : strips) {
        walk(strip, [&] {
          shares[0].Add(strip.runs, num_runs);
          num_runs += strip.runs.size();
          strip.runs.clear();
        });
      }
      return Write(shares, num_runs);
    }
    internal::RunParallel(num_threads, [&](int thread) {
      for (std::size_t i = thread; i < strips.size(); i += num_threads) walk(strips[i], [] {});
    });
    for (int i = 0; i < num_threads; ++i) shares.emplace_back(i, num_threads, colored_);
    internal::RunParallel(num_threads, [&](int thread) {
      std::size_t first = 0;
      for (const Strip& strip : strips) {
        shares[thread].Add(strip.runs, first);
        first += strip.runs.size();
      }
    });
    for (const Strip& strip : strips) num_runs += strip.runs.size();
    return Write(shares, num_runs);
  }

 private:
  /// Views, or with several threads parts of them, of like numbers of rows.
  std::vector<Strip> MakeStrips() const {
    std::vector<Strip> strips;
    for (std::size_t i = 0; i < views_.size(); ++i) {
      const auto [columns, rows] = RegionOfInterest(views_[i], placements_[i]);
      if (columns.empty() || rows.empty()) continue;
      const int parts = options_.num_threads == 1 ? 1 : 2 * options_.num_threads;
      for (int part = 0; part < parts; ++part) {
        const auto cut = [&](int p) {
          return rows.begin + static_cast<int>(std::int64_t{rows.end - rows.begin} * p / parts);
        };
        const Range some{cut(part), cut(part + 1)};
        if (!some.empty()) strips.push_back({static_cast<std::uint32_t>(i), columns, some, {}});
      }
    }
    return strips;
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
  for (const DepthImageView& view : views) internal::CheckDepthImageView(view);
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
