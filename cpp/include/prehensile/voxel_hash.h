#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace prehensile {

/// Nearest neighbours up to a fixed distance among points that may be added at any time.
///
/// Points lie in the voxels of a grid through the origin whose edge is that distance, so that the
/// 27 around a query hold all that count. Where points do not change, KdTree is the one to take.
/// Queries may run on several threads at once, but not while points are added.
class VoxelHash {
 public:
  /// @throws std::invalid_argument if the distance is not positive and finite.
  explicit VoxelHash(double max_distance);

  std::size_t size() const { return size_; }

  /// Adds n rows of x, y, z; their indices follow those of the points that are there.
  ///
  /// @throws std::invalid_argument if a coordinate is not finite or more than 2²⁰ - 1 voxels from
  ///     the origin, or there are 2³¹ points. No point is added then.
  void Insert(const double* points, std::size_t n);

  /// Finds the nearest point no further than the distance; of several the smallest index.
  ///
  /// @param query x, y, z, finite.
  /// @return its index, or -1 if there is none.
  std::int32_t Nearest(const double* query, double* squared_distance) const;

  /// Nearest for m queries; squared distances are infinite where the index is -1.
  void NearestBatch(const double* queries, std::size_t m, int num_threads, std::int32_t* indices,
                    double* squared_distances) const;

 private:
  struct Point {
    double p[3];
    std::int32_t index;
  };

  double max_distance_;
  double voxel_size_;
  std::size_t size_ = 0;
  std::unordered_map<std::uint64_t, std::vector<Point>> voxels_;
};

}  // namespace prehensile
