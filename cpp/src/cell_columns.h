#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

// Points sorted into cubic cells, for loops over the neighbourhood of every cell.

namespace prehensile::internal {

/// Points in the order of their cells: by x, then y, then z; those of one cell in the order of the
/// input.
struct CellColumns {
  /// Cells of one x and y, from some z to some z without long gaps; in the order of the points.
  struct Column {
    std::uint64_t key;      // x · stride + y, both at least `reach`.
    std::int32_t low, end;  // Its z.
    std::uint32_t table;    // Its place in `begins`.
  };

  double low[3];  // The corner where cell (0, 0, 0) would begin.
  double size;
  int reach;
  std::uint64_t stride;
  std::vector<std::int32_t> index;  // In the input, for each sorted point.
  std::vector<double> x, y, z;      // Of the sorted points, and of kPadding more.
  std::vector<Column> columns;
  /// The first point of each z from `low` to `end` of each column; that of `end` is where the
  /// column's points end.
  std::vector<std::uint32_t> begins;

  static constexpr std::size_t kPadding = 16;

  /// @param points n rows of x, y, z, finite.
  /// @param reach how many cells to either side will be looked at.
  /// @param what the argument that sets the size, for messages.
  /// @throws std::invalid_argument naming it, if there are more than 2²⁰ cells in a row.
  CellColumns(const double* points, std::size_t n, double cell_size, int reach, const char* what,
              int num_threads);
};

/// Points [begin, end) of a grid.
struct CellRun {
  std::uint32_t begin, end;
};

/// Calls visit(center, own, runs) for each occupied cell of columns [first, last): its centre, its
/// points, and those of all cells up to `reach` away, itself included.
template <typename Visit>
void VisitCells(const CellColumns& grid, std::size_t first, std::size_t last, const Visit& visit) {
  using Column = CellColumns::Column;
  const auto reach = static_cast<std::uint64_t>(grid.reach);
  // For each shift in x the first column that may be near: they move on with the columns.
  std::vector<const Column*> starts(2 * reach + 1, grid.columns.data());
  const Column* const columns_end = grid.columns.data() + grid.columns.size();
  std::vector<const Column*> near;
  std::vector<CellRun> runs;
  for (std::size_t c = first; c < last; ++c) {
    const Column& column = grid.columns[c];
    near.clear();
    for (std::uint64_t shift = 0; shift <= 2 * reach; ++shift) {
      // Neither difference is negative: x and y are at least `reach`.
      const std::uint64_t least = column.key - reach * grid.stride - reach + shift * grid.stride;
      const Column*& start = starts[shift];
      if (c == first) {
        start = std::lower_bound(start, columns_end, least,
                                 [](const Column& o, std::uint64_t key) { return o.key < key; });
      }
      while (start < columns_end && start->key < least) ++start;
      for (const Column* o = start; o < columns_end && o->key <= least + 2 * reach; ++o) {
        if (o->low < column.end + grid.reach && column.low < o->end + grid.reach) {
          near.push_back(o);
        }
      }
    }
    if (runs.size() < near.size()) runs.resize(near.size());
    for (std::int32_t z = column.low; z < column.end; ++z) {
      const std::uint32_t* const begin = &grid.begins[column.table + (z - column.low)];
      if (begin[0] == begin[1]) continue;
      std::size_t num_runs = 0;
      for (const Column* o : near) {
        const std::uint32_t* const table = &grid.begins[o->table];
        const std::int32_t low = std::clamp(z - grid.reach, o->low, o->end);
        const std::int32_t end = std::clamp(z + grid.reach + 1, o->low, o->end);
        runs[num_runs] = {table[low - o->low], table[end - o->low]};
        num_runs += runs[num_runs].begin < runs[num_runs].end;
      }
      const double place[3] = {static_cast<double>(column.key / grid.stride),
                               static_cast<double>(column.key % grid.stride),
                               static_cast<double>(z)};
      double center[3];
      for (int k = 0; k < 3; ++k) center[k] = grid.low[k] + (place[k] + 0.5) * grid.size;
      visit(static_cast<const double*>(center), CellRun{begin[0], begin[1]},
            static_cast<const CellRun*>(runs.data()), num_runs);
    }
  }
}

}  // namespace prehensile::internal
