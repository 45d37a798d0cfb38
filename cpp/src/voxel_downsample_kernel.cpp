// The inner loops of voxel down-sampling, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt); the operations are written out so that every level rounds alike.

#include "voxel_downsample_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

using Double4 = double __attribute__((vector_size(32)));
using Double8 = double __attribute__((vector_size(64)));
using Int8 = std::int32_t __attribute__((vector_size(32)));
using Long8 = std::int64_t __attribute__((vector_size(64)));

template <typename Scalar>
struct Vectors;
template <>
struct Vectors<float> {
  using Four = float __attribute__((vector_size(16)));
  using Eight = float __attribute__((vector_size(32)));
};
template <>
struct Vectors<double> {
  using Four = Double4;
  using Eight = Double8;
};

bool IsFinite(double x) { return x - x == 0; }

std::uint64_t Key(const std::int32_t* index) {
  const auto field = [](std::int32_t i) { return static_cast<std::uint64_t>(i + kMaxIndex); };
  return field(index[0]) << 42 | field(index[1]) << 21 | field(index[2]);
}

template <typename Scalar>
std::size_t Quantize(const Scalar* points, std::size_t n, double inverse_size,
                     std::uint64_t* keys) {
  constexpr std::size_t kPoints = 128;
  alignas(64) std::int32_t index[3 * kPoints];
  for (std::size_t begin = 0; begin < n; begin += kPoints) {
    const std::size_t count = n - begin < kPoints ? n - begin : kPoints;
    const Scalar* const x = points + 3 * begin;
    Long8 all_valid = ~Long8{};
    for (std::size_t i = 0; i < 3 * count; i += 8) {
      typename Vectors<Scalar>::Eight raw{};
      if (i + 8 <= 3 * count) {
        __builtin_memcpy(&raw, x + i, sizeof(raw));
      } else {
        __builtin_memcpy(&raw, x + i, (3 * count - i) * sizeof(Scalar));
      }
      const Double8 t = __builtin_convertvector(raw, Double8) * inverse_size;
      // NaN and infinity are not valid either.
      const Long8 valid = (t >= double{-kMaxIndex}) & (t < double{kMaxIndex});
      all_valid &= valid;
      const Double8 clean = valid ? t : Double8{};
      const Int8 truncated = __builtin_convertvector(clean, Int8);
      const Long8 above = __builtin_convertvector(truncated, Double8) > clean;  // -1 where true.
      const Int8 floor = truncated + __builtin_convertvector(above, Int8);
      __builtin_memcpy(index + i, &floor, sizeof(floor));
    }
    for (std::size_t k = 0; k < count; ++k) keys[begin + k] = Key(index + 3 * k);

    bool clean_block = true;
    for (int lane = 0; lane < 8; ++lane) clean_block &= all_valid[lane] != 0;
    if (clean_block) continue;
    for (std::size_t k = 0; k < count; ++k) {
      bool finite = true;
      bool valid = true;
      for (int axis = 0; axis < 3; ++axis) {
        const double value = x[3 * k + axis];
        const double t = value * inverse_size;
        finite &= IsFinite(value);
        valid &= t >= -kMaxIndex && t < kMaxIndex;
      }
      if (!finite) {
        keys[begin + k] = kDropped;
      } else if (!valid) {
        return begin + k;
      }
    }
  }
  return n;
}

template <typename Scalar, bool kNormals>
void Accumulate(const std::uint64_t* keys, std::size_t n, const Scalar* points,
                const Scalar* normals, std::size_t begin, std::size_t total, std::uint64_t share,
                std::uint64_t num_shares, VoxelTable* table) {
  // First the rows and hashes of the points to add, then their places, then the sums: loops without
  // branches on the data where that can be, and independent of each other's memory latency.
  std::uint32_t rows[kBlock];
  std::uint64_t hashes[kBlock];
  std::size_t count = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const auto product = static_cast<unsigned __int128>(HashKey(keys[k])) * num_shares;
    rows[count] = static_cast<std::uint32_t>(k);
    hashes[count] = static_cast<std::uint64_t>(product);
    count += (static_cast<std::uint64_t>(product >> 64) == share) & (keys[k] != kDropped);
  }

  const int shift = table->shift;
  const std::uint64_t mask = ~std::uint64_t{0} >> shift;
  std::uint32_t* const buckets = table->buckets;
  VoxelRecord* const records = table->records;
  std::uint32_t size = table->size;
  std::uint64_t last_key = kDropped;
  VoxelRecord* record = nullptr;
  for (std::size_t r = 0; r < count; ++r) {
    const std::size_t k = rows[r];
    const std::size_t row = begin + k;
    const std::uint64_t key = keys[k];
    if (key != last_key) {
      last_key = key;
      std::uint64_t bucket = hashes[r] >> shift;
      while (true) {
        const std::uint32_t found = buckets[bucket];
        if (found == kEmpty) {
          buckets[bucket] = size;
          table->first[size] = static_cast<std::uint32_t>(row);
          record = &records[size++];
          *record = VoxelRecord{{0, 0, 0, 0}, {0, 0, 0}, key};
          break;
        }
        record = &records[found];
        if (record->key == key) break;
        bucket = (bucket + 1) & mask;
      }
    }
    typename Vectors<Scalar>::Four raw{};
    const Scalar* const x = points + 3 * row;
    if (row + 1 < total) {
      __builtin_memcpy(&raw, x, sizeof(raw));  // One number too many, replaced below.
    } else {
      __builtin_memcpy(&raw, x, 3 * sizeof(Scalar));
    }
    Double4 point = __builtin_convertvector(raw, Double4);
    point[3] = 1;
    Double4 sum;
    __builtin_memcpy(&sum, record->sum, sizeof(sum));
    sum += point;
    __builtin_memcpy(record->sum, &sum, sizeof(sum));
    if constexpr (kNormals) {
      const Scalar* const v = normals + 3 * row;
      if (IsFinite(v[0]) & IsFinite(v[1]) & IsFinite(v[2])) {
        record->normal[0] += v[0];
        record->normal[1] += v[1];
        record->normal[2] += v[2];
      }
    }
  }
  table->size = size;
}

template <typename Scalar>
void AccumulateEither(const std::uint64_t* keys, std::size_t n, const Scalar* points,
                      const Scalar* normals, std::size_t begin, std::size_t total,
                      std::uint64_t share, std::uint64_t num_shares, VoxelTable* table) {
  const auto accumulate = normals ? Accumulate<Scalar, true> : Accumulate<Scalar, false>;
  accumulate(keys, n, points, normals, begin, total, share, num_shares, table);
}

}  // namespace

extern const VoxelKernel<float> kFloat{Quantize<float>, AccumulateEither<float>};
extern const VoxelKernel<double> kDouble{Quantize<double>, AccumulateEither<double>};

}  // namespace prehensile::internal::PREHENSILE_SIMD
