#include "prehensile/voxel_downsample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "parallel.h"
#include "voxel_downsample_kernel.h"

namespace prehensile {
namespace {

using internal::kBlock;
using internal::kEmpty;
using internal::VoxelKernel;
using internal::VoxelRecord;
using internal::VoxelTable;

template <typename Scalar>
const VoxelKernel<Scalar>& Choose(const VoxelKernel<float>& f, const VoxelKernel<double>& d) {
  if constexpr (std::is_same_v<Scalar, float>) {
    return f;
  } else {
    return d;
  }
}

template <typename Scalar>
const VoxelKernel<Scalar>& KernelFor([[maybe_unused]] SimdLevel level) {
  using namespace internal;
#ifdef __x86_64__
  if (level == SimdLevel::kAvx512) return Choose<Scalar>(avx512::kFloat, avx512::kDouble);
  if (level == SimdLevel::kAvx2) return Choose<Scalar>(avx2::kFloat, avx2::kDouble);
#endif
  return Choose<Scalar>(baseline::kFloat, baseline::kDouble);
}

/// One share of the voxels: owns the memory of a VoxelTable.
class Share {
 public:
  Share(std::uint64_t index, std::uint64_t num_shares, std::size_t expected_voxels)
      : index_(index), num_shares_(num_shares) {
    Reserve(std::max(expected_voxels, 2 * kBlock));
  }

  /// Adds n ≤ kBlock points; see VoxelAccumulate.
  template <typename Scalar>
  void Add(const VoxelKernel<Scalar>& kernel, const std::uint64_t* keys, std::size_t n,
           const Scalar* points, const Scalar* normals, std::size_t begin, std::size_t total) {
    if (table_.size + n > capacity_) Reserve(2 * capacity_);
    kernel.accumulate(keys, n, points, normals, begin, total, index_, num_shares_, &table_);
  }

  std::size_t size() const { return table_.size; }
  const VoxelRecord& record(std::size_t i) const { return records_[i]; }
  /// Row of the point that made record i.
  std::uint32_t first(std::size_t i) const { return first_[i]; }

 private:
  /// Makes room for `capacity` records, rounded up to a power of two, and twice as many buckets.
  void Reserve(std::size_t capacity) {
    capacity_ = std::bit_ceil(capacity);
    auto records = std::make_unique_for_overwrite<VoxelRecord[]>(capacity_);
    auto first = std::make_unique_for_overwrite<std::uint32_t[]>(capacity_);
    std::copy_n(records_.get(), size(), records.get());
    std::copy_n(first_.get(), size(), first.get());
    records_ = std::move(records);
    first_ = std::move(first);

    const std::size_t num_buckets = 2 * capacity_;
    const int shift = 64 - std::countr_zero(num_buckets);
    buckets_ = std::make_unique_for_overwrite<std::uint32_t[]>(num_buckets);
    std::fill_n(buckets_.get(), num_buckets, kEmpty);
    for (std::size_t i = 0; i < size(); ++i) {
      std::uint64_t bucket = (internal::HashKey(records_[i].key) * num_shares_) >> shift;
      while (buckets_[bucket] != kEmpty) bucket = (bucket + 1) & (num_buckets - 1);
      buckets_[bucket] = static_cast<std::uint32_t>(i);
    }
    table_ = {buckets_.get(), shift, records_.get(), first_.get(), table_.size};
  }

  std::uint64_t index_;
  std::uint64_t num_shares_;
  std::size_t capacity_ = 0;
  std::unique_ptr<VoxelRecord[]> records_;
  std::unique_ptr<std::uint32_t[]> first_;
  std::unique_ptr<std::uint32_t[]> buckets_;
  VoxelTable table_{};
};

/// The rank of a row among the rows that made a voxel: its voxel's place in the result.
class Ranks {
 public:
  Ranks(const std::vector<Share>& shares, std::size_t num_rows)
      : bits_(num_rows / 64 + 1), before_(bits_.size()) {
    for (const Share& share : shares) {
      for (std::size_t i = 0; i < share.size(); ++i) {
        bits_[share.first(i) / 64] |= std::uint64_t{1} << share.first(i) % 64;
      }
    }
    std::uint32_t sum = 0;
    for (std::size_t word = 0; word < bits_.size(); ++word) {
      before_[word] = sum;
      sum += std::popcount(bits_[word]);
    }
  }

  std::size_t operator()(std::size_t row) const {
    const std::uint64_t below = bits_[row / 64] & ((std::uint64_t{1} << row % 64) - 1);
    return before_[row / 64] + std::popcount(below);
  }

 private:
  std::vector<std::uint64_t> bits_;
  std::vector<std::uint32_t> before_;
};

template <typename Scalar>
void WriteVoxel(const VoxelRecord& record, std::size_t i, VoxelCloud<Scalar>* cloud) {
  using Row = Eigen::Map<Eigen::Matrix<Scalar, 3, 1>>;
  const double count = record.sum[3];
  Row(&cloud->points[3 * i]) =
      (Eigen::Map<const Eigen::Vector3d>(record.sum) / count).template cast<Scalar>();
  cloud->counts[i] = static_cast<std::int32_t>(count);
  if (!cloud->normals.empty()) {
    const Eigen::Map<const Eigen::Vector3d> sum(record.normal);
    // Unit normals that cancel leave their rounding errors behind, which point nowhere.
    const double norm = sum.norm();
    const Eigen::Vector3d unit =
        norm > 1e-6 * count ? Eigen::Vector3d(sum / norm) : Eigen::Vector3d::Zero();
    Row(&cloud->normals[3 * i]) = unit.template cast<Scalar>();
  }
}

[[noreturn]] void ThrowOutOfRange(std::size_t row, double voxel_size) {
  throw std::invalid_argument("voxel_size: " + std::to_string(voxel_size) +
                              " is too small: point " + std::to_string(row) +
                              " lies more than 2^20 voxels from the origin");
}

}  // namespace

template <typename Scalar>
VoxelCloud<Scalar> VoxelDownsample(const RowsView<Scalar>& points, double voxel_size,
                                   const RowsView<Scalar>* normals, const VoxelOptions& options) {
  const double inverse_size = 1 / voxel_size;
  if (!(voxel_size > 0) || !std::isfinite(voxel_size) || !std::isfinite(inverse_size)) {
    throw std::invalid_argument("voxel_size: must be positive and finite, not " +
                                std::to_string(voxel_size));
  }
  if (normals && normals->rows() != points.rows()) {
    throw std::invalid_argument("normals: " + std::to_string(normals->rows()) + " rows for " +
                                std::to_string(points.rows()) + " points");
  }
  const SimdLevel level = options.simd.value_or(BestSimdLevel());
  if (!IsAvailable(level)) {
    throw std::invalid_argument("simd: this machine lacks " + std::string(Name(level)));
  }
  const auto n = static_cast<std::size_t>(points.rows());
  if (n > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max())) {
    throw std::invalid_argument("points: more than 2^31 - 1 rows");
  }

  const VoxelKernel<Scalar>& kernel = KernelFor<Scalar>(level);
  const Scalar* const normals_data = normals ? normals->data() : nullptr;
  const int num_shares = internal::NumShares(n, 16 * 1024, options.num_threads);

  std::vector<Share> shares;
  shares.reserve(num_shares);
  for (int i = 0; i < num_shares; ++i) shares.emplace_back(i, num_shares, n / 4 / num_shares);
  const auto block_size = [n](std::size_t begin) { return std::min(kBlock, n - begin); };
  const auto quantize = [&](std::size_t begin, std::uint64_t* keys) {
    const std::size_t done =
        kernel.quantize(points.data() + 3 * begin, block_size(begin), inverse_size, keys);
    if (done < block_size(begin)) ThrowOutOfRange(begin + done, voxel_size);
  };
  const auto add = [&](Share& share, std::size_t begin, const std::uint64_t* keys) {
    share.Add(kernel, keys, block_size(begin), points.data(), normals_data, begin, n);
  };

  if (num_shares == 1) {
    std::uint64_t keys[kBlock];
    for (std::size_t begin = 0; begin < n; begin += kBlock) {
      quantize(begin, keys);
      add(shares[0], begin, keys);
    }
  } else {
    // All keys first, then each thread walks over all of them and adds the points of its voxels, in
    // the order of the input: which thread adds does not change a sum.
    const auto keys = std::make_unique_for_overwrite<std::uint64_t[]>(n);
    const std::size_t num_blocks = (n + kBlock - 1) / kBlock;
    internal::RunParallel(num_shares, [&](int i) {
      const std::size_t end = num_blocks * (i + 1) / num_shares;
      for (std::size_t block = num_blocks * i / num_shares; block < end; ++block) {
        quantize(block * kBlock, &keys[block * kBlock]);
      }
    });
    internal::RunParallel(num_shares, [&](int i) {
      for (std::size_t begin = 0; begin < n; begin += kBlock) add(shares[i], begin, &keys[begin]);
    });
  }

  std::size_t num_voxels = 0;
  for (const Share& share : shares) num_voxels += share.size();
  VoxelCloud<Scalar> cloud;
  cloud.points.resize(3 * num_voxels);
  cloud.counts.resize(num_voxels);
  if (normals) cloud.normals.resize(3 * num_voxels);
  if (num_shares == 1) {
    for (std::size_t i = 0; i < num_voxels; ++i) WriteVoxel(shares[0].record(i), i, &cloud);
  } else {
    const Ranks rank(shares, n);
    internal::RunParallel(num_shares, [&](int s) {
      const Share& share = shares[s];
      for (std::size_t i = 0; i < share.size(); ++i) {
        WriteVoxel(share.record(i), rank(share.first(i)), &cloud);
      }
    });
  }
  return cloud;
}

template VoxelCloud<float> VoxelDownsample(const RowsView<float>&, double, const RowsView<float>*,
                                           const VoxelOptions&);
template VoxelCloud<double> VoxelDownsample(const RowsView<double>&, double,
                                            const RowsView<double>*, const VoxelOptions&);

}  // namespace prehensile
