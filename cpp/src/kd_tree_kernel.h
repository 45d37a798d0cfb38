#pragma once

#include <cstddef>
#include <cstdint>

#include "prehensile/kd_tree.h"

namespace prehensile::internal {

/// Most points in a leaf; the blocks of coordinates are so long.
inline constexpr int kLeaf = 16;

/// What a search sees of a KdTree; see there.
struct KdView {
  const KdNode* nodes;
  const double* blocks;
  const std::int32_t* indices;
  const double* box;
  std::uint64_t size;
  int depth;
};

/// Gets the points of one leaf that are near enough.
///
/// @param indices, squared_distances of the leaf's points.
/// @param hits bit j is set if point j counts.
using KdVisit = void (*)(void* context, const std::int32_t* indices,
                         const double* squared_distances, std::uint32_t hits);

struct KdKernel {
  int (*nearest)(const KdView& tree, const double* query, int k, double max_squared_distance,
                 std::int32_t* indices, double* squared_distances);
  void (*within)(const KdView& tree, const double* query, double squared_radius, KdVisit visit,
                 void* context);
};

#define PREHENSILE_DECLARE_KD_KERNEL(level) \
  namespace level {                         \
  extern const KdKernel kKdKernel;          \
  }
PREHENSILE_DECLARE_KD_KERNEL(baseline)
PREHENSILE_DECLARE_KD_KERNEL(avx2)
PREHENSILE_DECLARE_KD_KERNEL(avx512)
#undef PREHENSILE_DECLARE_KD_KERNEL

}  // namespace prehensile::internal
