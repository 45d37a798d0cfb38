#include <cmath>

#include "cell_grid.h"
#include "prehensile/regions.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::CellGrid;
using internal::DisjointSets;

double SquaredDistance(const double* a, const double* b) {
  const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return x * x + y * y + z * z;
}

}  // namespace

std::vector<std::int64_t> EuclideanClusters(const double* points, std::size_t n, double tolerance,
                                            std::size_t min_points) {
  // Any two points of a cell are near enough; those of cells up to two apart may be.
  const CellGrid grid(points, n, tolerance * 0.577, "tolerance");
  const double limit = tolerance * tolerance;
  DisjointSets sets(n);
  const auto near = [&](std::size_t a, std::size_t b) {
    for (const std::uint32_t* i = grid.begin(a); i != grid.end(a); ++i) {
      for (const std::uint32_t* j = grid.begin(b); j != grid.end(b); ++j) {
        if (SquaredDistance(points + 3 * *i, points + 3 * *j) <= limit) return true;
      }
    }
    return false;
  };
  for (std::size_t c = 0; c < grid.num_cells(); ++c) {
    const std::uint32_t first = *grid.begin(c);
    for (const std::uint32_t* i = grid.begin(c) + 1; i != grid.end(c); ++i) sets.Join(first, *i);
    for (int d = 63; d < 125; ++d) {
      const std::int64_t other = grid.Neighbor(c, d / 25 - 2, d / 5 % 5 - 2, d % 5 - 2);
      if (other < 0 || sets.Root(first) == sets.Root(*grid.begin(other))) continue;
      if (near(c, other)) sets.Join(first, *grid.begin(other));
    }
  }
  return sets.Labels(min_points);
}

std::vector<std::int64_t> ConvexSegments(const double* points, const double* normals, std::size_t n,
                                         const ConvexSegmentsOptions& options) {
  const double voxel = options.voxel_size;
  const CellGrid grid(points, n, voxel, "voxel_size");
  grid.RequireFewPairs("voxel_size");
  enum Kind : std::uint8_t { kJoined, kApart, kEdge };
  struct Pair {
    std::uint32_t i, j;
  };
  std::vector<Pair> joined;
  joined.reserve(4 * n);
  std::vector<std::uint8_t> at_edge(n, 0);
  const double bend = -2 * std::sin(0.5 * options.max_concavity);
  // Between unit normals an angle is a distance: |turn| = 2 sin(angle / 2).
  constexpr double kLike = 4 * 0.3289899283;      // (2 sin 35 degrees)²
  constexpr double kOpposite = 4 * 0.9095760221;  // (2 sin 72.5 degrees)²
  grid.ForEachAdjacentPair([&](std::uint32_t i, std::uint32_t j) {
    double turn_d = 0, turn_2 = 0, sum_d = 0, d_2 = 0;
    for (int k = 0; k < 3; ++k) {
      const double d = points[3 * j + k] - points[3 * i + k];
      const double turn = normals[3 * j + k] - normals[3 * i + k];
      d_2 += d * d;
      turn_d += turn * d;
      turn_2 += turn * turn;
      sum_d += (normals[3 * i + k] + normals[3 * j + k]) * d;
    }
    // Convex: going from i to j the normal leans forward, so turn · d ≥ 0. Points of adjacent
    // cells can be very near each other; then direction means little.
    const double length = std::max(std::sqrt(d_2), 0.5 * voxel);
    const bool concave = turn_d < bend * length;
    const bool step = 0.5 * std::abs(sum_d) > options.max_step * voxel && turn_2 < kLike;
    if (concave || step) {
      at_edge[i] = at_edge[j] = 1;
    } else if (turn_2 <= kOpposite) {  // Else: the two faces of a sheet.
      joined.push_back({i, j});
    }
  });
  // Points on an edge average both its sides and would bridge it: they join a piece afterwards.
  DisjointSets sets(n);
  for (const Pair& p : joined) {
    if (!at_edge[p.i] && !at_edge[p.j]) sets.Join(p.i, p.j);
  }
  std::vector<std::int64_t> labels = sets.Labels(options.min_points);
  for (int round = 0; round < 2; ++round) {  // An edge is two cells wide.
    const std::vector<std::int64_t> before = labels;
    const auto take = [&](std::uint32_t i, std::uint32_t j) {
      // Of several pieces the one with the smallest label, whatever the order of the pairs.
      if (before[i] < 0 && before[j] >= 0 && (labels[i] < 0 || before[j] < labels[i])) {
        labels[i] = before[j];
      }
    };
    for (const Pair& p : joined) {
      take(p.i, p.j);
      take(p.j, p.i);
    }
  }
  return labels;
}

std::vector<std::int64_t> RestingPairs(const double* points, const double* normals,
                                       const std::int64_t* labels, std::size_t n, double voxel_size,
                                       std::size_t num_labels) {
  // Their square is what is allocated.
  internal::Require(num_labels <= std::size_t{1} << 13, "num_labels: more than 2^13");
  const CellGrid grid(points, n, voxel_size, "voxel_size");
  grid.RequireFewPairs("voxel_size");
  for (std::size_t i = 0; i < n; ++i) {
    internal::Require(labels[i] < static_cast<std::int64_t>(num_labels), "labels: out of range");
  }
  std::vector<std::int64_t> counts(num_labels * num_labels, 0);
  const auto count = [&](std::uint32_t i, std::uint32_t j) {
    const std::int64_t a = labels[i], b = labels[j];
    if (a != b && a >= 0 && b >= 0 && normals[3 * i + 2] > 0.5 && normals[3 * j + 2] < 0.5 &&
        points[3 * j + 2] >= points[3 * i + 2]) {
      ++counts[a * num_labels + b];
    }
  };
  grid.ForEachAdjacentPair([&](std::uint32_t i, std::uint32_t j) {
    count(i, j);
    count(j, i);
  });
  return counts;
}

}  // namespace prehensile
