#include <algorithm>
#include <cmath>
#include <numeric>

#include "parallel.h"
#include "point_drift_kernel.h"
#include "prehensile/point_drift.h"
#include "prehensile/simd.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Vector3d;
using internal::DriftBlock;
using internal::kDriftLanes;
using internal::Require;

constexpr float kFarAway = 1e15f;  // Where lanes without a point are.
constexpr double kFarthestPoint = 1e13;
constexpr double kFarthestQuery = 1e14;
/// Gaussians are cut where they have fallen to exp of minus this.
constexpr double kCut = 40;
/// Part of a sum that may be cut off.
constexpr double kLost = 1e-9;

const internal::DriftKernel& Kernel() {
#ifdef __x86_64__
  const SimdLevel level = BestSimdLevel();
  if (level == SimdLevel::kAvx512) return internal::avx512::kDrift;
  if (level == SimdLevel::kAvx2) return internal::avx2::kDrift;
#endif
  return internal::baseline::kDrift;
}

/// In single precision, within the limit. Limits that differ keep apart what is beyond both.
float Scaled(double value, double limit) {
  return static_cast<float>(std::clamp(value, -limit, limit));
}

/// Divides points at the middle of the longest side, down to runs of sixteen.
void Divide(const double* points, std::int32_t* begin, std::int32_t* end) {
  const std::ptrdiff_t count = end - begin;
  if (count <= kDriftLanes) return;
  Vector3d lower = Vector3d::Constant(internal::kInfinity), upper = -lower;
  for (const std::int32_t* i = begin; i != end; ++i) {
    const Eigen::Map<const Vector3d> p(points + 3 * *i);
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  int axis;
  (upper - lower).maxCoeff(&axis);
  const std::ptrdiff_t half = (count / 2 + kDriftLanes - 1) / kDriftLanes * kDriftLanes;
  std::nth_element(begin, begin + half, end, [&](std::int32_t a, std::int32_t b) {
    const double x = points[3 * a + axis], y = points[3 * b + axis];
    return x < y || (x == y && a < b);
  });
  Divide(points, begin, begin + half);
  Divide(points, begin + half, end);
}

void RequireFinite(const double* rows, std::size_t n, const char* message) {
  Require(std::all_of(rows, rows + 3 * n, [](double x) { return std::isfinite(x); }), message);
}

}  // namespace

std::vector<std::int32_t> SpatialOrder(const double* points, std::size_t n) {
  Require(n <= std::numeric_limits<std::int32_t>::max(), "points: more than 2^31 - 1 rows");
  RequireFinite(points, n, "points: must be finite");
  std::vector<std::int32_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  Divide(points, order.data(), order.data() + n);
  return order;
}

GaussianSums::GaussianSums(const double* points, std::size_t n)
    : size_(n), center_(Vector3d::Zero()) {
  Require(n > 0, "points: there is no point");
  const std::vector<std::int32_t> order = SpatialOrder(points, n);
  const Eigen::Map<const Eigen::Matrix<double, 3, -1>> p(points, 3, static_cast<Eigen::Index>(n));
  // Medians: single points far off must not cost the others their precision.
  std::vector<double> values(n);
  const auto median = [&values] {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < n; ++i) values[i] = p(axis, static_cast<Eigen::Index>(i));
    center_[axis] = median();
  }
  for (std::size_t i = 0; i < n; ++i) {
    values[i] = (p.col(static_cast<Eigen::Index>(i)) - center_).norm();
  }
  const double spread = median();
  unit_ = spread > 0 ? spread : 1.0;

  const std::size_t num_blocks = (n + kDriftLanes - 1) / kDriftLanes;
  blocks_.assign(num_blocks * 3 * kDriftLanes, kFarAway);
  boxes_.resize(num_blocks);
  for (std::size_t b = 0; b < num_blocks; ++b) {
    Box& box = boxes_[b];
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = kFarAway;
      box.upper[axis] = -kFarAway;
      for (std::size_t k = 0; k < kDriftLanes && b * kDriftLanes + k < n; ++k) {
        const std::int32_t i = order[b * kDriftLanes + k];
        const float value = Scaled((p(axis, i) - center_[axis]) / unit_, kFarthestPoint);
        blocks_[(3 * b + axis) * kDriftLanes + k] = value;
        box.lower[axis] = std::min(box.lower[axis], value);
        box.upper[axis] = std::max(box.upper[axis], value);
      }
    }
  }
}

void GaussianSums::At(const double* queries, std::size_t n, double sigma, double floor,
                      double reach, double* sums, int num_threads) const {
  Require(sigma > 0 && std::isfinite(sigma), "sigma: must be positive and finite");
  Require(floor >= 0, "floor: must be at least 0");
  Require(reach > 0, "reach: must be positive");
  RequireFinite(queries, n, "queries: must be finite");
  static_assert(sizeof(DriftBlock) == 3 * kDriftLanes * sizeof(float));
  const auto* const blocks = reinterpret_cast<const DriftBlock*>(blocks_.data());
  const auto num_blocks = static_cast<std::int32_t>(boxes_.size());
  const internal::DriftKernel& kernel = Kernel();
  const double width = 2 * (sigma / unit_) * (sigma / unit_);        // 2 sigma² in the sums' unit.
  const auto rate = static_cast<float>(1.4426950408889634 / width);  // log2(e) / (2 sigma²).
  const bool cut = reach < internal::kInfinity;
  const auto squared_reach = static_cast<float>((cut ? 0.5 * reach * reach : kCut) * width);
  const double least = cut ? 0.0 : static_cast<double>(size_) * std::exp(-kCut) / kLost;

  std::vector<std::int32_t> all(boxes_.size());
  std::iota(all.begin(), all.end(), 0);
  const std::size_t num_tiles = (n + kDriftLanes - 1) / kDriftLanes;
  internal::RunShares(num_tiles, 32, num_threads, [&](std::size_t first, std::size_t last) {
    std::vector<std::int32_t> near;
    for (std::size_t tile = first; tile < last; ++tile) {
      const std::size_t begin = tile * kDriftLanes, end = std::min(begin + kDriftLanes, n);
      float local[kDriftLanes][3];
      Box box;
      for (int axis = 0; axis < 3; ++axis) {
        for (std::size_t i = begin; i < end; ++i) {
          const float value =
              Scaled((queries[3 * i + axis] - center_[axis]) / unit_, kFarthestQuery);
          local[i - begin][axis] = value;
          box.lower[axis] = i == begin ? value : std::min(box.lower[axis], value);
          box.upper[axis] = i == begin ? value : std::max(box.upper[axis], value);
        }
      }
      near.clear();
      for (std::int32_t b = 0; b < num_blocks; ++b) {
        float squared = 0;
        for (int axis = 0; axis < 3; ++axis) {
          const float gap = std::max({boxes_[b].lower[axis] - box.upper[axis],
                                      box.lower[axis] - boxes_[b].upper[axis], 0.0f});
          squared += gap * gap;
        }
        if (squared <= squared_reach) near.push_back(b);
      }
      for (std::size_t i = begin; i < end; ++i) {
        const float* const query = local[i - begin];
        double* const row = sums + 6 * i;
        row[0] = 0;
        kernel.sums(query, blocks, near.data(), static_cast<int>(near.size()), rate, 0, row + 1);
        if (row[1] + floor < least) {
          const float shift = kernel.nearest(query, blocks, num_blocks);
          row[0] = shift * unit_ * unit_;
          kernel.sums(query, blocks, all.data(), num_blocks, rate, shift, row + 1);
        }
        for (int axis = 0; axis < 3; ++axis) row[2 + axis] *= unit_;
        row[5] *= unit_ * unit_;
      }
    }
  });
}

}  // namespace prehensile
