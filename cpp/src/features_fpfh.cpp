#include <Eigen/Dense>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include "features_kernel.h"
#include "parallel.h"
#include "prehensile/features.h"
#include "prehensile/kd_tree.h"
#include "prehensile/simd.h"

namespace prehensile {
namespace {

using Eigen::Vector3d;

constexpr int kBins = kFpfhSize / 3;
static_assert(kFpfhSize == internal::kFeatureSize);

Vector3d Row(const double* rows, std::size_t i) { return Eigen::Map<const Vector3d>(rows + 3 * i); }

int Bin(double value, double lowest, double highest) {
  const double bin = std::floor(kBins * (value - lowest) / (highest - lowest));
  return static_cast<int>(std::clamp(bin, 0.0, kBins - 1.0));
}

/// The bins of a pair's three angles, within their own histograms.
struct PairBins {
  int theta, alpha, phi;
};

/// @param d from the first to the second point, not zero.
PairBins BinsOf(const Vector3d& n1, const Vector3d& n2, const Vector3d& d, double distance) {
  const double cosine1 = n1.dot(d) / distance, cosine2 = n2.dot(d) / distance;
  // The frame stands at the point whose normal is closer to the line between the two.
  const bool swapped = std::abs(cosine1) < std::abs(cosine2);
  const Vector3d& u = swapped ? n2 : n1;
  const Vector3d& other = swapped ? n1 : n2;
  const double phi = swapped ? -cosine2 : cosine1;
  const Vector3d across = (swapped ? Vector3d(-d) : d).cross(u);
  const double norm = across.norm();
  if (!(norm > 1e-12 * distance)) return {Bin(0, -1, 1), Bin(0, -1, 1), Bin(phi, -1, 1)};
  const Vector3d v = across / norm;
  const double theta = std::atan2(u.cross(v).dot(other), u.dot(other));
  return {Bin(theta, -std::numbers::pi, std::numbers::pi), Bin(v.dot(other), -1, 1),
          Bin(phi, -1, 1)};
}

internal::NearestFeaturesKernel NearestKernel() {
#ifdef __x86_64__
  if (BestSimdLevel() == SimdLevel::kAvx512) return internal::avx512::kNearestFeatures;
  if (BestSimdLevel() == SimdLevel::kAvx2) return internal::avx2::kNearestFeatures;
#endif
  return internal::baseline::kNearestFeatures;
}

/// Below 1e70, so that products of a few are finite.
void RequireFinite(const double* values, std::size_t n, const char* name) {
  for (std::size_t i = 0; i < n; ++i) {
    if (!(std::abs(values[i]) < 1e70)) {
      throw std::invalid_argument(std::string(name) + ": must be finite");
    }
  }
}

}  // namespace

void Fpfh(const double* points, const double* normals, std::size_t n, double radius,
          int num_threads, float* features) {
  if (!(radius > 0) || !std::isfinite(radius)) {
    throw std::invalid_argument("radius: must be positive and finite");
  }
  RequireFinite(points, 3 * n, "points");
  RequireFinite(normals, 3 * n, "normals");
  const KdTree tree(points, n);
  std::vector<char> known(n);
  for (std::size_t i = 0; i < n; ++i) known[i] = !Row(normals, i).isZero();

  struct Neighbor {
    std::int32_t index;
    float weight;
  };
  std::vector<std::vector<Neighbor>> neighbors(n);
  std::vector<float> own(n * kFpfhSize, 0.0f);
  constexpr std::size_t kMostPairs = std::size_t{1} << 28;  // Two gigabytes.
  std::atomic<std::size_t> num_pairs = 0;
  constexpr std::size_t kRowsPerThread = 128;
  internal::RunShares(n, kRowsPerThread, num_threads, [&](std::size_t begin, std::size_t end) {
    std::vector<std::int32_t> indices;
    std::vector<double> squared_distances;
    for (std::size_t i = begin; i < end; ++i) {
      if (!known[i]) continue;
      const Vector3d p = Row(points, i), normal = Row(normals, i);
      tree.WithinRadius(p.data(), radius, &indices, &squared_distances);
      if ((num_pairs += indices.size()) > kMostPairs) {
        throw std::invalid_argument("radius: too large for so dense a cloud; down-sample it first");
      }
      neighbors[i].reserve(indices.size());
      int counts[kFpfhSize] = {};
      for (std::size_t k = 0; k < indices.size(); ++k) {
        const std::int32_t j = indices[k];
        // A point at the same place has no direction, and is no neighbour.
        if (!known[j] || !(squared_distances[k] > 1e-30 * radius * radius)) continue;
        neighbors[i].push_back({j, static_cast<float>(1 / squared_distances[k])});
        const PairBins bins =
            BinsOf(normal, Row(normals, j), Row(points, j) - p, std::sqrt(squared_distances[k]));
        ++counts[bins.theta];
        ++counts[kBins + bins.alpha];
        ++counts[2 * kBins + bins.phi];
      }
      if (neighbors[i].empty()) continue;
      const float share = 100.0f / static_cast<float>(neighbors[i].size());
      for (int k = 0; k < kFpfhSize; ++k) {
        own[i * kFpfhSize + k] = share * static_cast<float>(counts[k]);
      }
    }
  });
  internal::RunShares(n, kRowsPerThread, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      float sums[kFpfhSize] = {};
      for (const Neighbor& neighbor : neighbors[i]) {
        const float* const theirs = &own[static_cast<std::size_t>(neighbor.index) * kFpfhSize];
        for (int k = 0; k < kFpfhSize; ++k) sums[k] += neighbor.weight * theirs[k];
      }
      float* const feature = features + i * kFpfhSize;
      for (int h = 0; h < kFpfhSize; h += kBins) {
        float total = 0;
        for (int k = h; k < h + kBins; ++k) total += sums[k];
        const float scale = total > 0 ? 100 / total : 0;
        for (int k = h; k < h + kBins; ++k) {
          feature[k] = scale * sums[k] + own[i * kFpfhSize + k];
        }
      }
    }
  });
}

void NearestFeatures(const float* a, std::size_t n, const float* b, std::size_t m, int num_threads,
                     std::int32_t* nearest, float* squared_distances,
                     float* second_squared_distances) {
  constexpr std::size_t kBlock = internal::kFeatureBlock;
  constexpr std::size_t kMost = std::numeric_limits<std::int32_t>::max();
  if (n > kMost || m > kMost - kBlock) throw std::invalid_argument("features: 2^31 rows or more");
  const std::size_t num_blocks = (m + kBlock - 1) / kBlock;
  // Places after the last feature are infinitely far from everything.
  std::vector<float> blocks(num_blocks * kBlock * kFpfhSize,
                            std::numeric_limits<float>::infinity());
  for (std::size_t j = 0; j < m; ++j) {
    for (int k = 0; k < kFpfhSize; ++k) {
      blocks[((j / kBlock) * kFpfhSize + k) * kBlock + j % kBlock] = b[j * kFpfhSize + k];
    }
  }
  std::fill_n(nearest, n, -1);
  std::fill_n(squared_distances, n, std::numeric_limits<float>::infinity());
  std::fill_n(second_squared_distances, n, std::numeric_limits<float>::infinity());
  constexpr std::size_t kBlocksAtOnce = 12;  // 25 kB: they stay in the first-level cache.
  internal::RunShares(n, 64, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t first = 0; first < num_blocks; first += kBlocksAtOnce) {
      NearestKernel()(a + begin * kFpfhSize, end - begin, &blocks[first * kBlock * kFpfhSize],
                      std::min(kBlocksAtOnce, num_blocks - first),
                      static_cast<std::int32_t>(first * kBlock), nearest + begin,
                      squared_distances + begin, second_squared_distances + begin);
    }
  });
}

}  // namespace prehensile
