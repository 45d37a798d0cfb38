#include "cell_columns.h"

#include <bit>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "parallel.h"

namespace prehensile::internal {
namespace {

struct Item {
  std::uint64_t key;
  std::int32_t index;
};

/// Sorts by key, keeping the order of equal ones; all keys are below 2^bits.
void RadixSort(std::vector<Item>* items, int bits) {
  constexpr int kDigit = 11;
  constexpr std::uint64_t kMask = (1u << kDigit) - 1;
  std::vector<Item> other(items->size());
  std::vector<std::uint32_t> start(kMask + 1);
  for (int shift = 0; shift < bits; shift += kDigit) {
    std::fill(start.begin(), start.end(), 0);
    for (const Item& item : *items) ++start[item.key >> shift & kMask];
    std::uint32_t sum = 0;
    for (std::uint32_t& count : start) sum += std::exchange(count, sum);
    for (const Item& item : *items) other[start[item.key >> shift & kMask]++] = item;
    items->swap(other);
  }
}

}  // namespace

CellColumns::CellColumns(const double* points, std::size_t n, double cell_size, int cell_reach,
                         const char* what, int num_threads)
    : size(cell_size), reach(cell_reach) {
  constexpr double kMost = 1 << 20;
  double high[3];
  for (int k = 0; k < 3; ++k) {
    low[k] = n ? points[k] : 0;
    high[k] = low[k];
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], points[3 * i + k]);
      high[k] = std::max(high[k], points[3 * i + k]);
    }
  }
  const double inverse = 1 / cell_size;
  int bits[3];
  for (int k = 0; k < 3; ++k) {
    const double span = (high[k] - low[k]) * inverse;
    if (!(span < kMost)) {
      throw std::invalid_argument(std::string(what) +
                                  ": too small for a cloud of this extent: it spans more than "
                                  "2^20 cells");
    }
    const int margin = k < 2 ? reach : 0;
    bits[k] = std::bit_width(static_cast<std::uint64_t>(span) + 2 * margin);
    low[k] -= margin * cell_size;
  }
  const int y_shift = bits[2], x_shift = bits[2] + bits[1];
  stride = std::uint64_t{1} << bits[1];

  constexpr std::size_t kRowsPerShare = 8192;
  std::vector<Item> items(n);
  RunShares(n, kRowsPerShare, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      // The corner has moved; rounding must not move a point beyond the margin left for it.
      const auto cell = [&](int k) {
        return static_cast<std::uint64_t>(std::max((points[3 * i + k] - low[k]) * inverse,
                                                   k < 2 ? static_cast<double>(reach) : 0.0));
      };
      items[i] = {cell(0) << x_shift | cell(1) << y_shift | cell(2), static_cast<std::int32_t>(i)};
    }
  });
  RadixSort(&items, x_shift + bits[0]);

  index.resize(n);
  for (std::vector<double>* const coordinates : {&x, &y, &z}) coordinates->resize(n + kPadding);
  RunShares(n, kRowsPerShare, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const double* const p = points + 3 * static_cast<std::size_t>(items[i].index);
      index[i] = items[i].index;
      x[i] = p[0];
      y[i] = p[1];
      z[i] = p[2];
    }
  });
  const std::uint64_t z_mask = (std::uint64_t{1} << y_shift) - 1;
  // Longer gaps would let the tables of thin columns outgrow the points.
  constexpr std::int32_t kLongestGap = 8;
  for (std::size_t i = 0; i < n; ++i) {
    const Item& item = items[i];
    if (i > 0 && item.key == items[i - 1].key) continue;
    const std::uint64_t key = item.key >> y_shift;
    const auto cell = static_cast<std::int32_t>(item.key & z_mask);
    if (columns.empty() || columns.back().key != key || cell > columns.back().end + kLongestGap) {
      if (!columns.empty()) begins.push_back(static_cast<std::uint32_t>(i));
      columns.push_back({key, cell, cell, static_cast<std::uint32_t>(begins.size())});
    }
    Column& column = columns.back();
    for (; column.end <= cell; ++column.end) begins.push_back(static_cast<std::uint32_t>(i));
  }
  begins.push_back(static_cast<std::uint32_t>(n));
}

}  // namespace prehensile::internal
