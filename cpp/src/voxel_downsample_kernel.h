#pragma once

#include <cstddef>
#include <cstdint>

namespace prehensile::internal {

/// Key of a point that is dropped. Keys of voxels use 63 bits.
inline constexpr std::uint64_t kDropped = ~std::uint64_t{0};
inline constexpr std::uint32_t kEmpty = ~std::uint32_t{0};
/// Voxel indices lie in [-kMaxIndex, kMaxIndex).
inline constexpr int kMaxIndex = 1 << 20;
/// Most points per call of a kernel: the records they touch fit the first-level cache.
inline constexpr std::size_t kBlock = 256;

/// Spreads a key over 64 bits. (Defined here because growing a table needs it too; `static`, so
/// that each SIMD level has its own.)
static inline std::uint64_t HashKey(std::uint64_t key) {
  key ^= key >> 32;
  key *= 0x9E3779B97F4A7C15u;
  return key;
}

/// What is known of one voxel: one cache line.
struct alignas(64) VoxelRecord {
  double sum[4];     // Σx, Σy, Σz, number of points.
  double normal[3];  // Σ of the finite normals.
  std::uint64_t key;
};

/// A view of one share of the voxels as an open-addressing hash table. The voxels are shared out by
/// their hash h, a fraction of 2⁶⁴: the integer part of h · num_shares says to whom a voxel
/// belongs, and the fraction that is left is its hash within that share's table.
struct VoxelTable {
  std::uint32_t* buckets;  // Index of a record, or kEmpty. 2^(64 - shift) of them.
  int shift;
  VoxelRecord* records;  // In the order of first occurrence.
  std::uint32_t* first;  // For each record the row of the point that made it.
  std::uint32_t size;    // Number of records.
};

/// Computes the keys of n ≤ kBlock points (3 n numbers, row per point).
///
/// @return n, or the number of the first point whose indices are out of range.
template <typename Scalar>
using VoxelQuantize = std::size_t (*)(const Scalar* points, std::size_t n, double inverse_size,
                                      std::uint64_t* keys);

/// Adds those of the points [begin, begin + n), n ≤ kBlock, to the table that belong to its share.
/// The table must have room for n more records.
///
/// @param keys the keys of these n points.
/// @param points, normals the whole cloud's; normals may be null.
/// @param total the number of points in the whole cloud.
template <typename Scalar>
using VoxelAccumulate = void (*)(const std::uint64_t* keys, std::size_t n, const Scalar* points,
                                 const Scalar* normals, std::size_t begin, std::size_t total,
                                 std::uint64_t share, std::uint64_t num_shares, VoxelTable* table);

template <typename Scalar>
struct VoxelKernel {
  VoxelQuantize<Scalar> quantize;
  VoxelAccumulate<Scalar> accumulate;
};

#define PREHENSILE_DECLARE_VOXEL_KERNEL(level) \
  namespace level {                            \
  extern const VoxelKernel<float> kFloat;      \
  extern const VoxelKernel<double> kDouble;    \
  }
PREHENSILE_DECLARE_VOXEL_KERNEL(baseline)
PREHENSILE_DECLARE_VOXEL_KERNEL(avx2)
PREHENSILE_DECLARE_VOXEL_KERNEL(avx512)
#undef PREHENSILE_DECLARE_VOXEL_KERNEL

}  // namespace prehensile::internal
