#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

namespace internal {

/// A split across one axis: on the left all coordinates are at most `low`, on the right at least
/// `high`.
struct KdNode {
  double low, high;
  std::int32_t axis;
};

}  // namespace internal

/// Exact nearest neighbours among points in space, which are copied in.
///
/// Queries may run on several threads at once. Of neighbours at equal distance the one with the
/// smaller index counts as nearer, so that answers do not depend on how the tree was built.
///
/// A balanced tree of splits along the widest side of each cell, with 8 to 16 points in a leaf
/// (Bentley, "Multidimensional binary search trees used for associative searching", 1975).
class KdTree {
 public:
  /// @param points n rows of x, y, z.
  /// @throws std::invalid_argument if a coordinate is not finite or n ≥ 2³¹.
  KdTree(const double* points, std::size_t n);

  std::size_t size() const { return size_; }

  /// Finds the k nearest points no further than the given distance.
  ///
  /// @param query x, y, z, finite.
  /// @param k at least 1. The time grows with k² where k is large.
  /// @param max_squared_distance infinity for no limit.
  /// @param indices room for k, nearest first.
  /// @param squared_distances room for k.
  /// @return how many were found: k or fewer. What lies behind them in the arrays is undefined.
  int Nearest(const double* query, int k, double max_squared_distance, std::int32_t* indices,
              double* squared_distances) const;

  /// Finds all points no further than the radius, nearest first; replaces what the vectors held.
  void WithinRadius(const double* query, double radius, std::vector<std::int32_t>* indices,
                    std::vector<double>* squared_distances) const;

  /// Nearest for m queries. Where fewer than k are found, the rest of a row is -1 and infinity.
  ///
  /// @param queries m rows of x, y, z, finite.
  /// @param indices, squared_distances m rows of k.
  void NearestBatch(const double* queries, std::size_t m, int k, double max_squared_distance,
                    int num_threads, std::int32_t* indices, double* squared_distances) const;

  /// What WithinRadius finds for several queries, one after the other.
  struct Neighbors {
    std::vector<std::int32_t> counts;  // For each query how many.
    std::vector<std::int32_t> indices;
    std::vector<double> squared_distances;
  };
  /// WithinRadius for m queries.
  Neighbors WithinRadiusBatch(const double* queries, std::size_t m, double radius,
                              int num_threads) const;

 private:
  std::size_t size_ = 0;
  int depth_ = 0;
  double box_[6] = {};                   // Least x, y, z, greatest x, y, z.
  std::vector<internal::KdNode> nodes_;  // Node i has the children 2 i and 2 i + 1; 1 is the root.
  std::vector<double> blocks_;           // For each leaf 16 x, 16 y, 16 z.
  std::vector<std::int32_t> indices_;    // For each leaf 16.
};

}  // namespace prehensile
