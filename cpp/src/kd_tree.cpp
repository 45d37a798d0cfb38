#include "prehensile/kd_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "kd_tree_kernel.h"
#include "parallel.h"
#include "prehensile/simd.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::KdKernel;
using internal::KdNode;
using internal::kLeaf;

const KdKernel& Kernel() {
#ifdef __x86_64__
  if (BestSimdLevel() == SimdLevel::kAvx512) return internal::avx512::kKdKernel;
  if (BestSimdLevel() == SimdLevel::kAvx2) return internal::avx2::kKdKernel;
#endif
  return internal::baseline::kKdKernel;
}

struct Point {
  double p[3];
  std::int32_t index;
};

/// Orders the points of leaves [first, last) of the tree below a node, and fills its nodes.
struct Builder {
  std::vector<Point>* points;
  std::vector<KdNode>* nodes;
  int depth;

  std::size_t Begin(std::size_t leaf) const { return points->size() * leaf >> depth; }

  void Build(std::size_t node, std::size_t first, std::size_t last) {
    if (last - first == 1) return;
    const std::size_t middle = (first + last) / 2;
    const auto begin = points->begin() + Begin(first), end = points->begin() + Begin(last);
    const auto split = points->begin() + Begin(middle);
    double low[3], high[3];
    for (int k = 0; k < 3; ++k) low[k] = high[k] = begin->p[k];
    for (auto i = begin; i != end; ++i) {
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], i->p[k]);
        high[k] = std::max(high[k], i->p[k]);
      }
    }
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
      // Halves, because a difference of huge numbers may overflow.
      if (high[k] / 2 - low[k] / 2 > high[axis] / 2 - low[axis] / 2) axis = k;
    }
    const auto less = [axis](const Point& a, const Point& b) { return a.p[axis] < b.p[axis]; };
    std::nth_element(begin, split, end, less);
    (*nodes)[node] = {std::max_element(begin, split, less)->p[axis], split->p[axis], axis};
    Build(2 * node, first, middle);
    Build(2 * node + 1, middle, last);
  }
};

}  // namespace

KdTree::KdTree(const double* points, std::size_t n) : size_(n) {
  internal::Require(n < std::size_t{1} << 31, "points: more than 2^31 - 1 rows");
  std::vector<Point> sorted(n);
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double x = points[3 * i + k];
      if (!std::isfinite(x)) {
        throw std::invalid_argument("points: row " + std::to_string(i) + " is not finite");
      }
      sorted[i].p[k] = x;
      box_[k] = i ? std::min(box_[k], x) : x;
      box_[3 + k] = i ? std::max(box_[3 + k], x) : x;
    }
    sorted[i].index = static_cast<std::int32_t>(i);
  }
  while ((n >> depth_) + ((n & ((std::size_t{1} << depth_) - 1)) != 0) > kLeaf) ++depth_;
  const std::size_t num_leaves = std::size_t{1} << depth_;
  nodes_.resize(num_leaves);
  Builder builder{&sorted, &nodes_, depth_};
  builder.Build(1, 0, num_leaves);

  blocks_.resize(num_leaves * 3 * kLeaf);
  indices_.resize(num_leaves * kLeaf);
  for (std::size_t leaf = 0; leaf < num_leaves; ++leaf) {
    const std::size_t begin = builder.Begin(leaf), end = builder.Begin(leaf + 1);
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t lane = i - begin;
      for (int k = 0; k < 3; ++k) blocks_[(3 * leaf + k) * kLeaf + lane] = sorted[i].p[k];
      indices_[leaf * kLeaf + lane] = sorted[i].index;
    }
  }
}

int KdTree::Nearest(const double* query, int k, double max_squared_distance, std::int32_t* indices,
                    double* squared_distances) const {
  return Kernel().nearest({nodes_.data(), blocks_.data(), indices_.data(), box_, size_, depth_},
                          query, k, max_squared_distance, indices, squared_distances);
}

void KdTree::WithinRadius(const double* query, double radius, std::vector<std::int32_t>* indices,
                          std::vector<double>* squared_distances) const {
  thread_local std::vector<std::pair<double, std::int32_t>> found;
  found.clear();
  Kernel().within(
      {nodes_.data(), blocks_.data(), indices_.data(), box_, size_, depth_}, query, radius * radius,
      [](void* context, const std::int32_t* leaf_indices, const double* distances,
         std::uint32_t hits) {
        auto& list = *static_cast<std::vector<std::pair<double, std::int32_t>>*>(context);
        for (; hits; hits &= hits - 1) {
          const int j = std::countr_zero(hits);
          list.emplace_back(distances[j], leaf_indices[j]);
        }
      },
      &found);
  std::sort(found.begin(), found.end());
  indices->resize(found.size());
  squared_distances->resize(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    (*squared_distances)[i] = found[i].first;
    (*indices)[i] = found[i].second;
  }
}

void KdTree::NearestBatch(const double* queries, std::size_t m, int k, double max_squared_distance,
                          int num_threads, std::int32_t* indices, double* squared_distances) const {
  internal::Require(k >= 1, "k: must be at least 1");
  internal::RunShares(m, 512, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      std::int32_t* const index = indices + i * k;
      double* const distance = squared_distances + i * k;
      const int found = Nearest(queries + 3 * i, k, max_squared_distance, index, distance);
      std::fill(index + found, index + k, -1);
      std::fill(distance + found, distance + k, internal::kInfinity);
    }
  });
}

KdTree::Neighbors KdTree::WithinRadiusBatch(const double* queries, std::size_t m, double radius,
                                            int num_threads) const {
  // Each share keeps its own lists, which are joined in order.
  const int num_shares = internal::NumShares(m, 512, num_threads);
  std::vector<Neighbors> parts(num_shares);
  internal::RunParallel(num_shares, [&](int share) {
    Neighbors& part = parts[share];
    std::vector<std::int32_t> indices;
    std::vector<double> distances;
    const std::size_t end = internal::ShareBegin(m, share + 1, num_shares);
    for (std::size_t i = internal::ShareBegin(m, share, num_shares); i < end; ++i) {
      WithinRadius(queries + 3 * i, radius, &indices, &distances);
      part.counts.push_back(static_cast<std::int32_t>(indices.size()));
      part.indices.insert(part.indices.end(), indices.begin(), indices.end());
      part.squared_distances.insert(part.squared_distances.end(), distances.begin(),
                                    distances.end());
    }
  });
  Neighbors all = std::move(parts[0]);
  for (int share = 1; share < num_shares; ++share) {
    const Neighbors& part = parts[share];
    all.counts.insert(all.counts.end(), part.counts.begin(), part.counts.end());
    all.indices.insert(all.indices.end(), part.indices.begin(), part.indices.end());
    all.squared_distances.insert(all.squared_distances.end(), part.squared_distances.begin(),
                                 part.squared_distances.end());
  }
  return all;
}

}  // namespace prehensile
