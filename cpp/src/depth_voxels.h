#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

// The voxels of a fused cloud while it grows.

namespace prehensile::internal::fusion {

/// Neighbouring pixels of a row that lie in the same voxel.
struct Run {
  std::uint64_t key;
  std::uint32_t count;
  /// Number of the runs before it.
  std::uint32_t rank;
  float sum[3];
  float normal[3];
};
using ColorSum = std::array<std::uint32_t, 3>;

/// Runs of one share of the voxels that one camera saw, in order; their
/// colours, if any is known.
struct Runs {
  std::vector<Run> runs;
  std::vector<ColorSum> colors;
};

inline std::uint64_t Hash(std::uint64_t key) {
  key ^= key >> 32;
  key *= 0x9E3779B97F4A7C15u;
  return key;
}

/// The voxels are shared out by their hash h, a fraction of 2⁶⁴: the integer
/// part of h · num_shares says to whom a voxel belongs, and the fraction that
/// is left is its hash within that share.
inline std::uint64_t ShareOf(std::uint64_t key, std::uint64_t num_shares) {
  return static_cast<std::uint64_t>(static_cast<unsigned __int128>(Hash(key)) * num_shares >> 64);
}

/// What is known of one voxel: one cache line.
struct alignas(64) Record {
  std::uint64_t key;
  double sum[3];
  float normal[3];
  std::uint32_t count;
  /// The camera that is adding now and the number of its points, and the best
  /// one before it.
  std::uint16_t camera, best_camera;
  std::uint32_t camera_count, best_count;
  /// Rank of the run that made it.
  std::uint32_t first;
};

/// One share of the voxels, an open-addressing hash table.
class VoxelShare {
 public:
  /// @param expected about how many voxels there will be; more find room, too.
  VoxelShare(std::uint64_t num_shares, std::size_t expected, bool colored)
      : num_shares_(num_shares), colored_(colored) {
    Grow(std::bit_ceil(std::max(expected, std::size_t{1} << 12)));
  }

  /// Adds runs of this share. `offset` is added to their ranks.
  void Add(const Runs& some, std::uint16_t camera, std::uint32_t offset) {
    constexpr std::size_t kBlock = 64;
    const std::vector<Run>& runs = some.runs;
    std::uint64_t bucket[kBlock];
    for (std::size_t begin = 0; begin < runs.size(); begin += kBlock) {
      const std::size_t count = std::min(runs.size() - begin, kBlock);
      if (records_.size() + kBlock > capacity_) Grow(4 * capacity_);
      // Ask for the buckets and the records in them ahead of use.
      for (std::size_t i = 0; i < count; ++i) {
        bucket[i] = (Hash(runs[begin + i].key) * num_shares_) >> shift_;
        __builtin_prefetch(&buckets_[bucket[i]]);
      }
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t at = buckets_[bucket[i]];
        if (at != kEmpty) __builtin_prefetch(&records_[at], 1);
      }
      for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t at = AddOne(runs[begin + i], bucket[i], camera, offset);
        if (!colored_) continue;
        for (int k = 0; k < 3; ++k) colors_[at][k] += some.colors[begin + i][k];
      }
    }
  }

  const std::vector<Record>& records() const { return records_; }
  const std::array<std::uint64_t, 3>& color(std::size_t i) const { return colors_[i]; }

 private:
  static constexpr std::uint32_t kEmpty = ~std::uint32_t{0};

  /// Returns the number of the record.
  std::uint32_t AddOne(const Run& run, std::uint64_t bucket, std::uint16_t camera,
                       std::uint32_t offset) {
    while (buckets_[bucket] != kEmpty && records_[buckets_[bucket]].key != run.key) {
      bucket = (bucket + 1) & (buckets_.size() - 1);
    }
    if (buckets_[bucket] == kEmpty) {
      buckets_[bucket] = static_cast<std::uint32_t>(records_.size());
      records_.push_back(
          {.key = run.key, .camera = camera, .best_camera = camera, .first = offset + run.rank});
      if (colored_) colors_.push_back({});
    }
    const std::uint32_t at = buckets_[bucket];
    Record& record = records_[at];
    for (int k = 0; k < 3; ++k) record.sum[k] += run.sum[k];
    for (int k = 0; k < 3; ++k) record.normal[k] += run.normal[k];
    record.count += run.count;
    // Cameras come one after the other.
    record.camera_count = record.camera == camera ? record.camera_count + run.count : run.count;
    record.camera = camera;
    if (record.camera_count > record.best_count) {
      record.best_count = record.camera_count;
      record.best_camera = camera;
    }
    return at;
  }

  /// Makes room for `capacity` records, a power of two, and twice as many
  /// buckets.
  void Grow(std::size_t capacity) {
    capacity_ = capacity;
    records_.reserve(capacity);
    buckets_.assign(2 * capacity, kEmpty);
    shift_ = 64 - std::countr_zero(buckets_.size());
    for (std::size_t i = 0; i < records_.size(); ++i) {
      std::uint64_t bucket = (Hash(records_[i].key) * num_shares_) >> shift_;
      while (buckets_[bucket] != kEmpty) bucket = (bucket + 1) & (buckets_.size() - 1);
      buckets_[bucket] = static_cast<std::uint32_t>(i);
    }
  }

  std::uint64_t num_shares_;
  bool colored_;
  std::size_t capacity_ = 0;
  int shift_ = 0;
  std::vector<Record> records_;
  std::vector<std::array<std::uint64_t, 3>> colors_;
  std::vector<std::uint32_t> buckets_;
};

}  // namespace prehensile::internal::fusion
