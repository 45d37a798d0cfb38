// The inner loops of voxel down-sampling, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt); the operations are written out so that every level rounds alike.

#include "voxel_downsample_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

using Double4 = double __attribute__((vector_size(32)));
template <typename Scalar>
struct Vector4;
template <>
struct Vector4<float> {
  using Type = float __attribute__((vector_size(16)));
};
template <>
struct Vector4<double> {
  using Type = Double4;
};

template <typename Scalar>
bool AllFinite(const Scalar* row) {
  return (row[0] - row[0]) + (row[1] - row[1]) + (row[2] - row[2]) == 0;
}

template <typename Scalar>
std::size_t Quantize(const Scalar* points, std::size_t n, double inverse_size,
                     std::uint64_t* keys) {
  // Plain loops over flat arrays, for the compiler to vectorize at the width of the level.
  std::uint32_t field[3 * kBlock];  // Voxel index + kMaxIndex: 21 bits if the index is in range.
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < 3 * n; ++i) {
    double t = points[i] * inverse_size;
    t = t < kMaxIndex ? t : kMaxIndex;  // NaN, too, ends here, and sets a 22nd bit below.
    t = t > -kMaxIndex - 1 ? t : -kMaxIndex - 1;
    const auto truncated = static_cast<std::int32_t>(t);
    const std::int32_t floor = truncated - (truncated > t);
    field[i] = static_cast<std::uint32_t>(floor + kMaxIndex);
    bits |= field[i];
  }
  for (std::size_t k = 0; k < n; ++k) {
    const auto wide = [&](std::size_t axis) { return std::uint64_t{field[3 * k + axis]}; };
    keys[k] = wide(0) << 42 | wide(1) << 21 | wide(2);
  }
  if (bits < 2 * kMaxIndex) return n;

  for (std::size_t k = 0; k < n; ++k) {
    const Scalar* const p = points + 3 * k;
    if (!AllFinite(p)) {
      keys[k] = kDropped;
    } else if ((field[3 * k] | field[3 * k + 1] | field[3 * k + 2]) >= 2 * kMaxIndex) {
      return k;
    }
  }
  return n;
}

template <typename Scalar, bool kNormals>
void Accumulate(const std::uint64_t* keys, std::size_t n, const Scalar* points,
                const Scalar* normals, std::size_t begin, std::size_t total, std::uint64_t share,
                std::uint64_t num_shares, VoxelTable* table) {
  const int shift = table->shift;
  const std::uint64_t mask = ~std::uint64_t{0} >> shift;
  std::uint32_t* const buckets = table->buckets;
  VoxelRecord* const records = table->records;
  std::uint32_t size = table->size;

  // The points of this share and their first buckets, and then the records in those, are asked for
  // ahead of use: their places in memory are as good as random.
  std::uint32_t mine[kBlock];
  std::uint64_t first_bucket[kBlock];
  std::size_t count = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const auto product = static_cast<unsigned __int128>(HashKey(keys[k])) * num_shares;
    mine[count] = static_cast<std::uint32_t>(k);
    first_bucket[count] = static_cast<std::uint64_t>(product) >> shift;
    __builtin_prefetch(&buckets[first_bucket[count]]);
    count += (static_cast<std::uint64_t>(product >> 64) == share) & (keys[k] != kDropped);
  }
  for (std::size_t r = 0; r < count; ++r) {
    const std::uint32_t found = buckets[first_bucket[r]];
    __builtin_prefetch(&records[found == kEmpty ? size : found], 1);
  }

  for (std::size_t r = 0; r < count; ++r) {
    const std::size_t k = mine[r];
    const std::size_t row = begin + k;
    const std::uint64_t key = keys[k];
    std::uint64_t bucket = first_bucket[r];
    while (buckets[bucket] != kEmpty && records[buckets[bucket]].key != key) {
      bucket = (bucket + 1) & mask;
    }
    if (buckets[bucket] == kEmpty) {
      buckets[bucket] = size;
      table->first[size] = static_cast<std::uint32_t>(row);
      records[size++] = VoxelRecord{{0, 0, 0, 0}, {0, 0, 0}, key};
    }
    VoxelRecord* const record = &records[buckets[bucket]];
    typename Vector4<Scalar>::Type raw{};
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
      if (AllFinite(v)) {
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
