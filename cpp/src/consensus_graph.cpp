#include <algorithm>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <string>

#include "consensus_kernel.h"
#include "prehensile/consensus.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::kConsensusBlock;
using internal::kConsensusLanes;
using internal::Require;

constexpr int kBlockWords = kConsensusBlock / 64;
/// The kernel's distances of points with coordinates in [-1, 1] are this exact: each coordinate is
/// off by 2^-24 at most, each of the operations by as much of its result; twice the sum of those.
constexpr double kKernelError = 0x1p-18;

internal::ConsensusCompare KernelFor(std::optional<SimdLevel> wanted) {
  const SimdLevel level = wanted.value_or(BestSimdLevel());
  Require(IsAvailable(level), "simd: this machine lacks that level");
#ifdef __x86_64__
  if (level == SimdLevel::kAvx512) return internal::avx512::kConsensusCompare;
  if (level == SimdLevel::kAvx2) return internal::avx2::kConsensusCompare;
#endif
  return internal::baseline::kConsensusCompare;
}

using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Both clouds about their centres, and the tolerance, in a unit (a power of two) in which all
/// coordinates lie in [-1, 1].
struct Scaled {
  Rows a, b;
  double tolerance;

  Scaled(const PointRows& a_in, const PointRows& b_in, double tolerance_in, double scale) {
    const Eigen::RowVector3d center_a = a_in.colwise().mean(), center_b = b_in.colwise().mean();
    a = scale * (a_in.rowwise() - center_a);
    b = b_in.rowwise() - center_b;
    const double extent = std::max(a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff());
    Require(std::isfinite(extent), "points: too far from each other");
    const double unit = extent > 0 ? std::exp2(-std::ceil(std::log2(extent))) : 1;
    Require(std::isfinite(unit), "points: too near to each other");
    a *= unit;
    b *= unit;
    tolerance = tolerance_in * unit;
  }
};

/// Single-precision copies in the kernel's order.
class KernelPoints {
 public:
  KernelPoints(const Rows& a, const Rows& b, int num_blocks)
      : stride_(std::size_t(num_blocks) * kConsensusBlock), values_(6 * stride_) {
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      const Eigen::Index within = i % kConsensusBlock;
      const std::size_t place = i - within + within % 32 * kConsensusLanes + within / 32;
      for (int axis = 0; axis < 3; ++axis) {
        values_[axis * stride_ + place] = static_cast<float>(a(i, axis));
        values_[(3 + axis) * stride_ + place] = static_cast<float>(b(i, axis));
      }
    }
  }
  internal::ConsensusPoints view() const {
    const float* const v = values_.data();
    return {{v, v + stride_, v + 2 * stride_}, {v + 3 * stride_, v + 4 * stride_, v + 5 * stride_}};
  }

 private:
  std::size_t stride_;
  std::vector<float> values_;
};

/// Transposes 64 × 64 bits (Warren, Hacker's Delight, 7-3).
void Transpose(std::uint64_t bits[64]) {
  std::uint64_t mask = 0x00000000FFFFFFFF;
  for (int j = 32; j != 0; j >>= 1, mask ^= mask << j) {
    for (int k = 0; k < 64; k = (k + j + 1) & ~j) {
      const std::uint64_t swap = ((bits[k] >> j) ^ bits[k + j]) & mask;
      bits[k] ^= swap << j;
      bits[k + j] ^= swap;
    }
  }
}

/// Completes a matrix of which each row was computed from its own block of 512 columns on.
void Mirror(ConsistencyGraph* graph) {
  const int tiles = (graph->size() + 63) / 64;
  std::uint64_t bits[64];
  for (int row = kBlockWords; row < tiles; ++row) {
    for (int column = 0; column < row / kBlockWords * kBlockWords; ++column) {
      for (int k = 0; k < 64; ++k) bits[k] = graph->row(64 * column + k)[row];
      Transpose(bits);
      const int rows = std::min(64, graph->size() - 64 * row);
      for (int k = 0; k < rows; ++k) graph->mutable_row(64 * row + k)[column] = bits[k];
    }
  }
}

}  // namespace

ConsistencyGraph::ConsistencyGraph(std::size_t num_vertices) {
  Require(num_vertices <= kMaxVertices, "num_vertices: more than 2^15");
  size_ = static_cast<int>(num_vertices);
  words_ = (size_ + kConsensusBlock - 1) / kConsensusBlock * kBlockWords;
  bits_.resize(std::size_t(size_) * words_);
}

void ConsistencyGraph::Connect(int i, int j) {
  mutable_row(i)[j / 64] |= std::uint64_t{1} << j % 64;
  mutable_row(j)[i / 64] |= std::uint64_t{1} << i % 64;
}

int ConsistencyGraph::degree(int i) const {
  int sum = 0;
  for (int w = 0; w < words_; ++w) sum += std::popcount(row(i)[w]);
  return sum;
}

std::size_t ConsistencyGraph::num_edges() const {
  std::size_t sum = 0;
  for (const std::uint64_t word : bits_) sum += std::popcount(word);
  return sum / 2;
}

ConsistencyGraph MakeConsistencyGraph(const PointRows& a, const PointRows& b, double tolerance,
                                      double scale, double min_length,
                                      std::optional<SimdLevel> simd) {
  Require(a.rows() == b.rows(), "points: as many of the model as of the scene are needed");
  Require(a.allFinite() && b.allFinite(), "points: must be finite");
  Require(tolerance >= 0 && std::isfinite(tolerance), "tolerance: must be finite and not negative");
  Require(scale > 0 && std::isfinite(scale), "scale: must be positive and finite");
  Require(min_length >= 0, "min_length: must not be negative");
  const internal::ConsensusCompare compare = KernelFor(simd);
  ConsistencyGraph graph(static_cast<std::size_t>(a.rows()));
  if (graph.size() == 0) return graph;
  const Scaled points(a, b, tolerance, scale);
  const int num_blocks = graph.words_per_row() / kBlockWords;
  const KernelPoints kernel_points(points.a, points.b, num_blocks);
  const internal::ConsensusPoints view = kernel_points.view();
  const auto sure_bound = static_cast<float>(points.tolerance - kKernelError);
  const auto maybe_bound = static_cast<float>(points.tolerance + kKernelError);

  const auto consistent = [&](int i, int j) {
    const double length_a = (points.a.row(i) - points.a.row(j)).norm();
    const double length_b = (points.b.row(i) - points.b.row(j)).norm();
    return std::abs(length_b - length_a) <= points.tolerance;
  };
  const std::uint64_t last =
      graph.size() % 64 ? (std::uint64_t{1} << graph.size() % 64) - 1 : ~std::uint64_t{0};
  const int num_words = (graph.size() + 63) / 64;
  for (int i = 0; i < graph.size(); ++i) {
    const float from[6] = {static_cast<float>(points.a(i, 0)), static_cast<float>(points.a(i, 1)),
                           static_cast<float>(points.a(i, 2)), static_cast<float>(points.b(i, 0)),
                           static_cast<float>(points.b(i, 1)), static_cast<float>(points.b(i, 2))};
    std::uint64_t* const row = graph.mutable_row(i);
    for (int block = i / kConsensusBlock; block < num_blocks; ++block) {
      std::uint32_t sure[kConsensusLanes], maybe[kConsensusLanes];
      compare(view, from, block, sure_bound, maybe_bound, sure, maybe);
      const int end = std::min(kBlockWords, num_words - block * kBlockWords);
      for (int w = 0; w < end; ++w) {
        const int word = block * kBlockWords + w;
        const std::uint64_t mask = word == num_words - 1 ? last : ~std::uint64_t{0};
        std::uint64_t bits = sure[2 * w] | std::uint64_t{sure[2 * w + 1]} << 32;
        std::uint64_t open = (maybe[2 * w] | std::uint64_t{maybe[2 * w + 1]} << 32) & ~bits & mask;
        for (; open; open &= open - 1) {
          if (consistent(i, 64 * word + std::countr_zero(open))) bits |= open & -open;
        }
        row[word] = bits & mask;
      }
    }
    row[i / 64] &= ~(std::uint64_t{1} << i % 64);
  }
  Mirror(&graph);
  if (min_length > 0) {
    for (int i = 0; i < graph.size(); ++i) {
      for (int w = 0; w < num_words; ++w) {
        for (std::uint64_t bits = graph.row(i)[w]; bits; bits &= bits - 1) {
          const int j = 64 * w + std::countr_zero(bits);
          const double length_a = (a.row(i) - a.row(j)).norm();
          if (std::min(length_a, (b.row(i) - b.row(j)).norm()) < min_length) {
            graph.mutable_row(i)[w] &= ~(bits & -bits);
          }
        }
      }
    }
  }
  return graph;
}

}  // namespace prehensile
