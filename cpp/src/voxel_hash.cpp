#include "prehensile/voxel_hash.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

constexpr std::int64_t kMost = (std::int64_t{1} << 20) - 1;

/// Numbers of a voxel, each between -kMost - 1 and kMost + 1.
std::uint64_t Key(const std::int64_t* voxel) {
  std::uint64_t key = 0;
  for (int k = 0; k < 3; ++k) {
    key = key << 21 | static_cast<std::uint64_t>(voxel[k] + kMost + 1);
  }
  return key;
}

/// The voxel of a point; false if it is out of range.
bool Locate(const double* p, double size, std::int64_t* voxel) {
  for (int k = 0; k < 3; ++k) {
    const double number = std::floor(p[k] / size);
    if (!(std::abs(number) < static_cast<double>(kMost))) return false;
    voxel[k] = static_cast<std::int64_t>(number);
  }
  return true;
}

}  // namespace

// A little larger, so that rounding puts no point that is near enough two voxels away.
VoxelHash::VoxelHash(double max_distance)
    : max_distance_(max_distance), voxel_size_(max_distance * (1 + 1e-9)) {
  internal::Require(max_distance > 0 && std::isfinite(max_distance),
                    "max_distance: must be positive and finite");
}

void VoxelHash::Insert(const double* points, std::size_t n) {
  internal::Require(n < (std::size_t{1} << 31) - size_, "points: more than 2^31 - 1");
  std::int64_t voxel[3];
  for (std::size_t i = 0; i < n; ++i) {
    if (!Locate(points + 3 * i, voxel_size_, voxel)) {
      throw std::invalid_argument("points: row " + std::to_string(i) +
                                  " is not finite, or too far from the origin for max_distance");
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double* const p = points + 3 * i;
    Locate(p, voxel_size_, voxel);
    voxels_[Key(voxel)].push_back({{p[0], p[1], p[2]}, static_cast<std::int32_t>(size_++)});
  }
}

std::int32_t VoxelHash::Nearest(const double* query, double* squared_distance) const {
  *squared_distance = internal::kInfinity;
  std::int64_t own[3];
  // A query outside of the range is more than a voxel from all points.
  if (!Locate(query, voxel_size_, own)) return -1;
  std::int32_t nearest = -1;
  double least = max_distance_ * max_distance_;
  // The own voxel first: what is found there often rules the others out.
  for (int step = 0; step < 27; ++step) {
    const int number = step == 0 ? 13 : step <= 13 ? step - 1 : step;
    const int shift[3] = {number / 9 - 1, number / 3 % 3 - 1, number % 3 - 1};
    std::int64_t voxel[3];
    double bound = 0;
    for (int k = 0; k < 3; ++k) {
      voxel[k] = own[k] + shift[k];
      const double edge = static_cast<double>(own[k] + (shift[k] > 0)) * voxel_size_;
      if (shift[k] != 0) bound += (query[k] - edge) * (query[k] - edge);
    }
    // Not quite the bound: the edge may be off by its rounding.
    if (bound * (1 - 1e-6) > least) continue;
    const auto found = voxels_.find(Key(voxel));
    if (found == voxels_.end()) continue;
    for (const Point& point : found->second) {
      const double dx = point.p[0] - query[0], dy = point.p[1] - query[1],
                   dz = point.p[2] - query[2];
      const double squared = dx * dx + dy * dy + dz * dz;
      if (squared < least || (squared == least && (nearest < 0 || point.index < nearest))) {
        least = squared;
        nearest = point.index;
      }
    }
  }
  if (nearest >= 0) *squared_distance = least;
  return nearest;
}

void VoxelHash::NearestBatch(const double* queries, std::size_t m, int num_threads,
                             std::int32_t* indices, double* squared_distances) const {
  internal::RunShares(m, 512, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      indices[i] = Nearest(queries + 3 * i, squared_distances + i);
    }
  });
}

}  // namespace prehensile
