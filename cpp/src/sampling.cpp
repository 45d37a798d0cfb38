#include "prehensile/sampling.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "prehensile/kd_tree.h"
#include "vectors.h"

namespace prehensile {

using internal::Require;

void FarthestPoints(const double* points, std::size_t n, std::size_t count, std::size_t start,
                    std::int32_t* indices, double* distances) {
  Require(n < std::size_t{1} << 31, "points: more than 2^31 - 1 rows");
  Require(count <= n, "count: more than there are points");
  Require(count == 0 || start < n, "start: there is no such point");
  std::vector<double> x(n), y(n), z(n), nearest(n, internal::kInfinity);
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = points[3 * i];
    y[i] = points[3 * i + 1];
    z[i] = points[3 * i + 2];
    if (!std::isfinite(x[i]) || !std::isfinite(y[i]) || !std::isfinite(z[i])) {
      throw std::invalid_argument("points: row " + std::to_string(i) + " is not finite");
    }
  }
  std::size_t chosen = start;
  for (std::size_t c = 0; c < count; ++c) {
    indices[c] = static_cast<std::int32_t>(chosen);
    distances[c] = std::sqrt(nearest[chosen]);
    nearest[chosen] = -1;  // Not once more, even if others are at the same place.
    const double px = x[chosen], py = y[chosen], pz = z[chosen];
    double most = -1;
    for (std::size_t i = 0; i < n; ++i) {
      const double dx = x[i] - px, dy = y[i] - py, dz = z[i] - pz;
      nearest[i] = std::min(nearest[i], dx * dx + dy * dy + dz * dz);
      most = std::max(most, nearest[i]);
    }
    chosen =
        static_cast<std::size_t>(std::find(nearest.begin(), nearest.end(), most) - nearest.begin());
  }
}

std::vector<std::int32_t> EliminateSamples(const double* points, std::size_t n, std::size_t count,
                                           double radius) {
  Require(count >= 1 && count <= n, "count: must be 1 to the number of points");
  Require(radius > 0 && std::isfinite(radius), "radius: must be positive and finite");
  const KdTree tree(points, n);
  // Points that are closer than this crowd no more than at this distance: else pairs by chance
  // would leave holes (the paper's β = 0.65 and γ = 1.5).
  const double share = static_cast<double>(count) / static_cast<double>(n);
  const double least = 0.65 * (1 - std::pow(share, 1.5));
  const auto weight = [radius, least](double squared) {
    const double gap = std::max(0.0, 1 - std::max(least, std::sqrt(squared) / radius));
    const double g2 = gap * gap, g4 = g2 * g2;
    return g4 * g4;
  };
  std::vector<double> crowding(n, 0);
  std::vector<std::int32_t> near;
  std::vector<double> squared;
  for (std::size_t i = 0; i < n; ++i) {
    tree.WithinRadius(points + 3 * i, radius, &near, &squared);
    for (std::size_t k = 0; k < near.size(); ++k) {
      if (near[k] != static_cast<std::int32_t>(i)) crowding[i] += weight(squared[k]);
    }
  }
  // A heap of points by crowding, whose entries are out of date where a neighbour has gone.
  struct Entry {
    double crowding;
    std::int32_t index;
    bool operator<(const Entry& other) const {
      return crowding != other.crowding ? crowding < other.crowding : index < other.index;
    }
  };
  std::vector<Entry> heap(n);
  for (std::size_t i = 0; i < n; ++i) heap[i] = {crowding[i], static_cast<std::int32_t>(i)};
  std::make_heap(heap.begin(), heap.end());
  std::vector<char> gone(n, 0);
  for (std::size_t left = n; left > count;) {
    std::pop_heap(heap.begin(), heap.end());
    const Entry top = heap.back();
    heap.pop_back();
    if (top.crowding > crowding[top.index]) {  // Out of date: crowding only falls.
      heap.push_back({crowding[top.index], top.index});
      std::push_heap(heap.begin(), heap.end());
      continue;
    }
    gone[top.index] = 1;
    --left;
    tree.WithinRadius(points + 3 * static_cast<std::size_t>(top.index), radius, &near, &squared);
    for (std::size_t k = 0; k < near.size(); ++k) crowding[near[k]] -= weight(squared[k]);
  }
  std::vector<std::int32_t> kept;
  for (std::size_t i = 0; i < n; ++i) {
    if (!gone[i]) kept.push_back(static_cast<std::int32_t>(i));
  }
  return kept;
}

std::vector<std::int32_t> KeepApart(const double* points, std::size_t n, double radius) {
  Require(radius > 0 && std::isfinite(radius), "radius: must be positive and finite");
  const KdTree tree(points, n);
  std::vector<char> covered(n, 0);
  std::vector<std::int32_t> kept, near;
  std::vector<double> squared;
  for (std::size_t i = 0; i < n; ++i) {
    if (covered[i]) continue;
    kept.push_back(static_cast<std::int32_t>(i));
    tree.WithinRadius(points + 3 * i, radius, &near, &squared);
    for (std::size_t k = 0; k < near.size(); ++k) {
      if (squared[k] < radius * radius) covered[near[k]] = 1;
    }
  }
  return kept;
}

}  // namespace prehensile
