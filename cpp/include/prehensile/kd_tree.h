#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

/// Exact nearest neighbours among points in space, which are copied in.
///
/// Queries may run on several threads at once. Of neighbours at equal distance the one with the
/// smaller index counts as nearer, so that answers do not depend on how the tree was built.
class KdTree {
 public:
  /// @param points n rows of x, y, z.
  /// @throws std::invalid_argument if a coordinate is not finite or n ≥ 2³¹.
  KdTree(const double* points, std::size_t n);

  std::size_t size() const { return size_; }

  /// Finds the k nearest points no further than the given distance.
  ///
  /// @param query x, y, z, finite.
  /// @param k at least 1.
  /// @param max_squared_distance infinity for no limit.
  /// @param indices room for k, nearest first.
  /// @param squared_distances room for k.
  /// @return how many were found: k or fewer.
  int Nearest(const double* query, int k, double max_squared_distance, std::int32_t* indices,
              double* squared_distances) const;

  /// Finds all points no further than the radius, nearest first; replaces what the vectors held.
  void WithinRadius(const double* query, double radius, std::vector<std::int32_t>* indices,
                    std::vector<double>* squared_distances) const;

 private:
  std::size_t size_ = 0;
};

}  // namespace prehensile
