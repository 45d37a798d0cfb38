// Searches of a k-d tree, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt).

#include "kd_tree_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

constexpr std::int32_t kNoIndex = 0x7fffffff;  // Greater than that of any point.

/// A part of the tree that is still to be searched, and how far the query is outside of its cell.
struct Pending {
  std::uint32_t node;
  double outside[3];
  double bound;  // Squared distance from the query to the cell.
};

double SquaredNorm(const double* v) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

/// Calls leaf(indices, squared distances, hits) for every leaf with points no further than
/// `*limit`, near cells first; `leaf` may lower the limit.
///
/// Bounds are computed in the same order as distances, from coordinates that are no further away:
/// rounding is monotone, so no point is ever nearer than the bound of its cell, exactly.
template <typename Leaf>
void Search(const KdView& tree, const double* query, const double* limit, const Leaf& leaf) {
  if (tree.size == 0) return;
  Pending stack[64];
  int height = 0;
  {
    Pending& root = stack[height++];
    root.node = 1;
    for (int k = 0; k < 3; ++k) {
      const double below = tree.box[k] - query[k], above = query[k] - tree.box[3 + k];
      const double most = below > above ? below : above;
      root.outside[k] = most > 0 ? most : 0;
    }
    root.bound = SquaredNorm(root.outside);
  }
  const std::uint32_t first_leaf = std::uint32_t{1} << tree.depth;
  const double x = query[0], y = query[1], z = query[2];
  while (height > 0) {
    const Pending& top = stack[--height];
    if (!(top.bound <= *limit)) continue;
    std::uint32_t node = top.node;
    const double outside[3] = {top.outside[0], top.outside[1], top.outside[2]};
    while (node < first_leaf) {
      const KdNode& split = tree.nodes[node];
      const double past_low = query[split.axis] - split.low;
      const double before_high = split.high - query[split.axis];
      const bool left = past_low < before_high;
      const double gap = left ? before_high : past_low;
      Pending& far = stack[height];
      far.node = 2 * node + (left ? 1 : 0);
      far.outside[0] = outside[0];
      far.outside[1] = outside[1];
      far.outside[2] = outside[2];
      if (gap > far.outside[split.axis]) far.outside[split.axis] = gap;
      far.bound = SquaredNorm(far.outside);
      height += far.bound <= *limit;
      node = 2 * node + (left ? 0 : 1);
    }
    const std::uint64_t number = node - first_leaf;
    const std::uint64_t count =
        (tree.size * (number + 1) >> tree.depth) - (tree.size * number >> tree.depth);
    const double* const block = tree.blocks + 3 * kLeaf * number;
    double distances[kLeaf];
    std::uint32_t hits = 0;
    for (int j = 0; j < kLeaf; ++j) {
      const double dx = block[j] - x, dy = block[kLeaf + j] - y, dz = block[2 * kLeaf + j] - z;
      distances[j] = dx * dx + dy * dy + dz * dz;
    }
    const double most = *limit;
    for (int j = 0; j < kLeaf; ++j) hits |= static_cast<std::uint32_t>(distances[j] <= most) << j;
    hits &= (std::uint32_t{1} << count) - 1;
    if (hits) leaf(tree.indices + kLeaf * number, distances, hits);
  }
}

int Nearest(const KdView& tree, const double* query, int k, double max_squared_distance,
            std::int32_t* indices, double* squared_distances) {
  // Sorted at all times; the places that are still free hold the limit.
  for (int i = 0; i < k; ++i) {
    indices[i] = kNoIndex;
    squared_distances[i] = max_squared_distance;
  }
  const double* const limit = squared_distances + k - 1;
  Search(
      tree, query, limit,
      [&](const std::int32_t* leaf_indices, const double* distances, std::uint32_t hits) {
        for (; hits; hits &= hits - 1) {
          const int j = __builtin_ctz(hits);
          const double d = distances[j];
          const std::int32_t index = leaf_indices[j];
          int place = k - 1;
          if (!(d < *limit || (d == *limit && index < indices[place]))) continue;
          while (place > 0 && (d < squared_distances[place - 1] ||
                               (d == squared_distances[place - 1] && index < indices[place - 1]))) {
            squared_distances[place] = squared_distances[place - 1];
            indices[place] = indices[place - 1];
            --place;
          }
          squared_distances[place] = d;
          indices[place] = index;
        }
      });
  int found = k;
  while (found > 0 && indices[found - 1] == kNoIndex) --found;
  return found;
}

void Within(const KdView& tree, const double* query, double squared_radius, KdVisit visit,
            void* context) {
  Search(tree, query, &squared_radius,
         [&](const std::int32_t* indices, const double* distances, std::uint32_t hits) {
           visit(context, indices, distances, hits);
         });
}

}  // namespace

extern const KdKernel kKdKernel{Nearest, Within};

}  // namespace prehensile::internal::PREHENSILE_SIMD
