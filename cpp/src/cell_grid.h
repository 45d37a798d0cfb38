#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace prehensile::internal {

/// Points sorted into the cells of a grid through the origin; only cells that hold points exist.
class CellGrid {
 public:
  static constexpr std::int64_t kMaxIndex = std::int64_t{1} << 20;

  /// @param cell edge of a cell.
  /// @param name of the argument that the edge comes from, for messages.
  /// @throws std::invalid_argument if the edge is not positive and finite, a point not finite or
  ///   more than 2²⁰ cells from the origin, or n ≥ 2³⁰.
  CellGrid(const double* points, std::size_t n, double cell, const char* name) {
    if (!(cell > 0) || !std::isfinite(cell)) {
      throw std::invalid_argument(std::string(name) + ": must be positive and finite");
    }
    // So that three times an index fits 32 bits.
    if (n >= (std::size_t{1} << 30)) throw std::invalid_argument("points: too many, 2^30 or more");
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(n);
    const double inverse = 1.0 / cell;
    constexpr double kLimit = static_cast<double>(kMaxIndex) - 2;  // Room for neighbours.
    for (std::size_t i = 0; i < n; ++i) {
      std::uint64_t key = 0;
      for (int k = 0; k < 3; ++k) {
        const double index = std::floor(points[3 * i + k] * inverse);
        if (!(std::abs(index) < kLimit)) {
          throw std::invalid_argument(std::isfinite(points[3 * i + k])
                                          ? std::string(name) +
                                                ": too small for a point so far from the origin"
                                          : std::string("points: must be finite"));
        }
        key = key << 21 | static_cast<std::uint64_t>(static_cast<std::int64_t>(index) + kMaxIndex);
      }
      keys[i] = {key, static_cast<std::uint32_t>(i)};
    }
    std::sort(keys.begin(), keys.end());
    order_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      order_[i] = keys[i].second;
      if (i == 0 || keys[i].first != keys[i - 1].first) {
        cells_.push_back(keys[i].first);
        begin_.push_back(static_cast<std::uint32_t>(i));
      }
    }
    begin_.push_back(static_cast<std::uint32_t>(n));
    const std::size_t buckets = std::bit_ceil(2 * cells_.size() + 2);
    shift_ = 64 - std::countr_zero(buckets);
    table_.assign(buckets, kNone);
    for (std::size_t c = 0; c < cells_.size(); ++c) {
      std::size_t bucket = Bucket(cells_[c]);
      while (table_[bucket] != kNone) bucket = (bucket + 1) & (buckets - 1);
      table_[bucket] = static_cast<std::uint32_t>(c);
    }
  }

  std::size_t num_cells() const { return cells_.size(); }
  /// The points of cell c, by increasing index.
  const std::uint32_t* begin(std::size_t c) const { return order_.data() + begin_[c]; }
  const std::uint32_t* end(std::size_t c) const { return order_.data() + begin_[c + 1]; }

  /// Number of cell c along axis k: its points lie in [Index, Index + 1) cells.
  std::int64_t Index(std::size_t c, int k) const {
    return static_cast<std::int64_t>(cells_[c] >> (42 - 21 * k) & ((std::uint64_t{1} << 21) - 1)) -
           kMaxIndex;
  }

  /// The cell that lies so many cells from cell c, or -1 if no point is in it. |d| ≤ 2.
  std::int64_t Neighbor(std::size_t c, int dx, int dy, int dz) const {
    // No carry between the three numbers: points keep two cells away from the limits.
    const std::uint64_t key = cells_[c] + (static_cast<std::uint64_t>(dx) << 42) +
                              (static_cast<std::uint64_t>(dy) << 21) +
                              static_cast<std::uint64_t>(dz);
    std::size_t bucket = Bucket(key);
    while (table_[bucket] != kNone) {
      if (cells_[table_[bucket]] == key) return table_[bucket];
      bucket = (bucket + 1) & (table_.size() - 1);
    }
    return -1;
  }

  /// The number of pairs of points in one cell or in two that touch.
  std::uint64_t num_adjacent_pairs() const {
    std::uint64_t pairs = 0;
    for (std::size_t c = 0; c < num_cells(); ++c) {
      const std::uint64_t own = begin_[c + 1] - begin_[c];
      pairs += own * (own - 1) / 2;
      for (int d = 14; d < 27; ++d) {
        const std::int64_t other = Neighbor(c, d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1);
        if (other >= 0) pairs += own * (begin_[other + 1] - begin_[other]);
      }
    }
    return pairs;
  }

  /// For what keeps a list of them: far too many are an error, not the end of memory.
  ///
  /// @throws std::invalid_argument if there are more than 2²⁷ adjacent pairs.
  void RequireFewPairs(const char* name) const {
    if (num_adjacent_pairs() <= std::uint64_t{1} << 27) return;
    throw std::invalid_argument(std::string(name) +
                                ": too large for so dense a cloud; down-sample it first");
  }

  /// Calls visit(i, j) once for each pair of points in one cell or in two that touch.
  template <typename Visit>
  void ForEachAdjacentPair(const Visit& visit) const {
    for (std::size_t c = 0; c < num_cells(); ++c) {
      for (const std::uint32_t* i = begin(c); i != end(c); ++i) {
        for (const std::uint32_t* j = i + 1; j != end(c); ++j) visit(*i, *j);
      }
      for (int d = 14; d < 27; ++d) {  // Half of the 26 around.
        const std::int64_t other = Neighbor(c, d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1);
        if (other < 0) continue;
        for (const std::uint32_t* i = begin(c); i != end(c); ++i) {
          for (const std::uint32_t* j = begin(other); j != end(other); ++j) visit(*i, *j);
        }
      }
    }
  }

 private:
  static constexpr std::uint32_t kNone = ~std::uint32_t{0};

  std::size_t Bucket(std::uint64_t key) const {
    key ^= key >> 32;
    return (key * 0x9E3779B97F4A7C15u) >> shift_;
  }

  std::vector<std::uint64_t> cells_;  // Keys, ascending.
  std::vector<std::uint32_t> begin_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> table_;
  int shift_ = 0;
};

/// Disjoint sets; the root of a set is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t n) : parent_(n) {
    for (std::size_t i = 0; i < n; ++i) parent_[i] = static_cast<std::uint32_t>(i);
  }
  std::uint32_t Root(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void Join(std::uint32_t i, std::uint32_t j) {
    i = Root(i);
    j = Root(j);
    if (i < j) {
      parent_[j] = i;
    } else {
      parent_[i] = j;
    }
  }

  /// 0, 1, ... by decreasing size (equal ones by their roots), -1 for fewer than min_points.
  std::vector<std::int64_t> Labels(std::size_t min_points) {
    const std::size_t n = parent_.size();
    std::vector<std::uint32_t> count(n, 0), roots;
    for (std::size_t i = 0; i < n; ++i) {
      if (count[Root(static_cast<std::uint32_t>(i))]++ == 0) {
        roots.push_back(Root(static_cast<std::uint32_t>(i)));
      }
    }
    std::stable_sort(roots.begin(), roots.end(),
                     [&](std::uint32_t a, std::uint32_t b) { return count[a] > count[b]; });
    std::vector<std::int64_t> rank(n, -1), labels(n);
    for (std::size_t k = 0; k < roots.size(); ++k) {
      if (count[roots[k]] >= min_points) rank[roots[k]] = static_cast<std::int64_t>(k);
    }
    for (std::size_t i = 0; i < n; ++i) labels[i] = rank[Root(static_cast<std::uint32_t>(i))];
    return labels;
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace prehensile::internal
