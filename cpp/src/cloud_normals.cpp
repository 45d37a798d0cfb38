#include "prehensile/cloud_normals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "cell_columns.h"
#include "cell_grid.h"
#include "cloud_normals_kernel.h"
#include "parallel.h"
#include "prehensile/kd_tree.h"
#include "prehensile/simd.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::CellColumns;
using internal::CellGrid;
using internal::CellRun;
using internal::CovarianceBlock;
using internal::kCandidateLanes;
using internal::kCovarianceLanes;
using internal::Moments;
using internal::NormalsKernel;

const NormalsKernel& Kernel() {
#ifdef __x86_64__
  if (BestSimdLevel() == SimdLevel::kAvx512) return internal::avx512::kNormalsKernel;
  if (BestSimdLevel() == SimdLevel::kAvx2) return internal::avx2::kNormalsKernel;
#endif
  return internal::baseline::kNormalsKernel;
}

/// Collects covariances until a block is full, then writes what is found in them.
class Solver {
 public:
  Solver(double* normals, double* variation) : normals_(normals), variation_(variation) {}

  /// @param sums of 1, x, y, z, xx, xy, xz, yy, yz, zz over the neighbours of a point.
  template <typename Scalar>
  void Add(std::size_t row, const Scalar* sums) {
    const double inverse = sums[0] > 0 ? 1 / static_cast<double>(sums[0]) : 0;
    const double x = sums[1], y = sums[2], z = sums[3];
    block_.xx[size_] = sums[4] - x * x * inverse;
    block_.xy[size_] = sums[5] - x * y * inverse;
    block_.xz[size_] = sums[6] - x * z * inverse;
    block_.yy[size_] = sums[7] - y * y * inverse;
    block_.yz[size_] = sums[8] - y * z * inverse;
    block_.zz[size_] = sums[9] - z * z * inverse;
    rows_[size_] = row;
    if (++size_ == kCovarianceLanes) Finish();
  }

  void Finish() {
    kernel_.solve(&block_);
    for (std::size_t i = 0; i < size_; ++i) {
      const double sign = block_.nz[i] < 0 ? -1 : 1;
      double* const normal = normals_ + 3 * rows_[i];
      normal[0] = sign * block_.nx[i];
      normal[1] = sign * block_.ny[i];
      normal[2] = sign * block_.nz[i];
      if (variation_) variation_[rows_[i]] = block_.variation[i];
    }
    size_ = 0;
  }

 private:
  const NormalsKernel& kernel_ = Kernel();
  double* const normals_;
  double* const variation_;
  CovarianceBlock block_{};
  std::size_t rows_[kCovarianceLanes];
  std::size_t size_ = 0;
};

void RequireFinite(const double* points, std::size_t n) {
  internal::Require(n < std::size_t{1} << 31, "points: more than 2^31 - 1 rows");
  for (std::size_t i = 0; i < 3 * n; ++i) {
    if (!std::isfinite(points[i])) {
      throw std::invalid_argument("points: row " + std::to_string(i / 3) + " is not finite");
    }
  }
}

}  // namespace

void NormalsWithinRadius(const double* points, std::size_t n, double radius, int num_threads,
                         double* normals, double* variation) {
  internal::Require(radius > 0 && std::isfinite(radius) && std::isfinite(1 / radius),
                    "radius: must be positive and finite");
  RequireFinite(points, n);
  // Cells of half the radius: half of the points in the 5³ around a cell are neighbours of one in
  // it, if they lie on a surface. Larger cells hold more that are not, smaller ones are too many.
  constexpr int kReach = 2;
  const CellColumns grid(points, n, radius / kReach, kReach, "radius", num_threads);
  const NormalsKernel& kernel = Kernel();
  internal::RunShares(
      grid.columns.size(), 256, num_threads, [&](std::size_t first, std::size_t last) {
        Solver solver(normals, variation);
        std::vector<float> candidates, queries;
        std::vector<Moments> moments;
        internal::VisitCells(
            grid, first, last,
            [&](const double* center, CellRun own, const CellRun* runs, std::size_t num_runs) {
              std::size_t count = 0;
              for (std::size_t r = 0; r < num_runs; ++r) count += runs[r].end - runs[r].begin;
              // A whole vector too much is written behind the candidates, and another by gathering.
              const std::size_t padded = (count / kCandidateLanes + 1) * kCandidateLanes;
              const std::size_t room = padded + 2 * kCandidateLanes;
              const std::size_t m = own.end - own.begin, query_room = m + 2 * kCandidateLanes;
              if (candidates.size() < 3 * room) candidates.resize(6 * room);
              if (queries.size() < 3 * query_room) queries.resize(6 * query_room);
              if (moments.size() < m) moments.resize(2 * m);
              const double* const sources[3] = {grid.x.data(), grid.y.data(), grid.z.data()};
              for (std::size_t k = 0; k < 3; ++k) {
                float* const target = candidates.data() + k * room;
                kernel.gather(sources[k], runs, num_runs, center[k], 1 / radius, target);
                std::fill(target + count, target + padded, 100.0f);  // Too far to count.
                kernel.gather(sources[k], &own, 1, center[k], 1 / radius,
                              queries.data() + k * query_room);
              }
              const float *const x = candidates.data(), *const qx = queries.data();
              kernel.sum({x, x + room, x + 2 * room}, padded,
                         {qx, qx + query_room, qx + 2 * query_room}, m, moments.data());
              for (std::size_t i = 0; i < m; ++i) {
                solver.Add(static_cast<std::size_t>(grid.index[own.begin + i]), moments[i].sums);
              }
            });
        solver.Finish();
      });
}

void NormalsOfNearest(const double* points, std::size_t n, int k, int num_threads, double* normals,
                      double* variation) {
  internal::Require(k >= 3, "neighbors: must be at least 3");
  const KdTree tree(points, n);
  const int most = static_cast<int>(std::min<std::size_t>(k, n));
  internal::RunShares(n, 512, num_threads, [&](std::size_t first, std::size_t last) {
    Solver solver(normals, variation);
    std::vector<std::int32_t> indices(most);
    std::vector<double> distances(most);
    for (std::size_t i = first; i < last; ++i) {
      const double* const p = points + 3 * i;
      const int found =
          tree.Nearest(p, most, internal::kInfinity, indices.data(), distances.data());
      const double scale = distances[found - 1] > 0 ? 1 / std::sqrt(distances[found - 1]) : 0;
      double sums[10] = {static_cast<double>(found)};
      for (int j = 0; j < found; ++j) {
        const double* const q = points + 3 * static_cast<std::size_t>(indices[j]);
        const double x = (q[0] - p[0]) * scale, y = (q[1] - p[1]) * scale,
                     z = (q[2] - p[2]) * scale;
        sums[1] += x;
        sums[2] += y;
        sums[3] += z;
        sums[4] += x * x;
        sums[5] += x * y;
        sums[6] += x * z;
        sums[7] += y * y;
        sums[8] += y * z;
        sums[9] += z * z;
      }
      solver.Add(i, sums);
    }
    solver.Finish();
  });
}

void NormalsOfVoxels(const double* points, std::size_t n, double voxel_size, int num_threads,
                     double* normals, double* variation) {
  RequireFinite(points, n);
  const CellGrid grid(points, n, voxel_size, "voxel_size");
  const std::size_t cells = grid.num_cells();
  using Sums = std::array<double, 10>;
  // Of each cell, from its centre, in cells.
  std::vector<Sums> own(cells);
  internal::RunShares(cells, 512, num_threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t c = first; c < last; ++c) {
      Sums& sums = own[c];
      sums.fill(0);
      for (const std::uint32_t* i = grid.begin(c); i != grid.end(c); ++i) {
        double p[3];
        for (int k = 0; k < 3; ++k) {
          p[k] = points[3 * static_cast<std::size_t>(*i) + k] / voxel_size -
                 (static_cast<double>(grid.Index(c, k)) + 0.5);
        }
        const double terms[10] = {1,           p[0],        p[1],        p[2],        p[0] * p[0],
                                  p[0] * p[1], p[0] * p[2], p[1] * p[1], p[1] * p[2], p[2] * p[2]};
        for (int k = 0; k < 10; ++k) sums[k] += terms[k];
      }
    }
  });
  std::vector<double> cell_normals(3 * cells), cell_variation(cells);
  internal::RunShares(cells, 512, num_threads, [&](std::size_t first, std::size_t last) {
    Solver solver(cell_normals.data(), cell_variation.data());
    for (std::size_t c = first; c < last; ++c) {
      Sums total{};
      for (int d = 0; d < 27; ++d) {
        const int o[3] = {d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1};
        const std::int64_t at =
            d == 13 ? static_cast<std::int64_t>(c) : grid.Neighbor(c, o[0], o[1], o[2]);
        if (at < 0) continue;
        const Sums& s = own[at];
        // Moved to this cell's centre.
        total[0] += s[0];
        for (int k = 0; k < 3; ++k) total[1 + k] += s[1 + k] + s[0] * o[k];
        int m = 4;
        for (int j = 0; j < 3; ++j) {
          for (int k = j; k < 3; ++k, ++m) {
            total[m] += s[m] + o[j] * s[1 + k] + o[k] * s[1 + j] + s[0] * o[j] * o[k];
          }
        }
      }
      solver.Add(c, total.data());
    }
    solver.Finish();
  });
  for (std::size_t c = 0; c < cells; ++c) {
    for (const std::uint32_t* i = grid.begin(c); i != grid.end(c); ++i) {
      std::copy_n(&cell_normals[3 * c], 3, normals + 3 * static_cast<std::size_t>(*i));
      if (variation) variation[*i] = cell_variation[c];
    }
  }
}

}  // namespace prehensile
