#include "prehensile/reachability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "kinematics_lanes.h"
#include "parallel.h"

namespace prehensile {
namespace {

constexpr std::size_t kRowsPerThread = 1024;

constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15;

/// The output function of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
std::uint64_t Mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
  return x ^ (x >> 31);
}

using internal::kLanes;

constexpr std::int64_t kOutside = -1;

/// Element of the voxel that a lane's frame is in, or kOutside.
std::int64_t Locate(const ReachVoxels& voxels, double inverse_size, const internal::LaneRoom& room,
                    int lane) {
  std::int64_t at = 0;
  for (int k = 0; k < 3; ++k) {
    // Compared as numbers of floating point: what is far outside may not fit an integer.
    const double i =
        std::floor(room.p[k][lane] * inverse_size) - static_cast<double>(voxels.first[k]);
    if (!(i >= 0 && i < static_cast<double>(voxels.shape[k]))) return kOutside;
    at = at * voxels.shape[k] + static_cast<std::int64_t>(i);
  }
  return at;
}

/// Smallest singular value of J, from the lower triangle of J Jᵀ by rows in one lane.
template <int kRows>
double SmallestSingularValue(const double (*gram)[kLanes], int lane) {
  Eigen::Matrix<double, kRows, kRows> A;
  for (int i = 0, at = 0; i < kRows; ++i) {
    for (int j = 0; j <= i; ++j, ++at) A(i, j) = gram[at][lane];
  }
  const Eigen::SelfAdjointEigenSolver<decltype(A)> solver(A, Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, solver.eigenvalues()[0]));
}

/// Adds some of the configurations, with nobody else writing to these voxels.
std::size_t Add(const KinematicTree& tree, const ReachQuery& query, const double* Q, std::size_t N,
                const ReachVoxels& voxels) {
  const internal::KinematicsKernel& kernel = internal::BestKinematicsKernel();
  const internal::ChainView chain = tree.chain(query.frame);
  const int n = tree.num_joints();
  const int rows = query.part == ReachPart::kBoth ? 6 : 3;
  const int first_row = query.part == ReachPart::kTranslational ? 3 : 0;
  const double inverse_size = 1 / voxels.voxel_size;
  internal::LaneRoom room;
  alignas(64) double axis[3][kLanes], nearest[kLanes], gram[21][kLanes], shift[kLanes],
      root[kLanes];
  std::size_t outside = 0;
  for (std::size_t begin = 0; begin < N; begin += kLanes) {
    const auto count = static_cast<int>(std::min<std::size_t>(N - begin, kLanes));
    room.Walk(chain, Q + n * begin, n, count, true);
    for (int k = 0; k < 3; ++k) {
      for (int lane = 0; lane < kLanes; ++lane) {
        axis[k][lane] = room.R[3 * k][lane] * query.axis[0] +
                        room.R[3 * k + 1][lane] * query.axis[1] +
                        room.R[3 * k + 2][lane] * query.axis[2];
      }
    }
    kernel.nearest(query.directions.data()->data(), static_cast<int>(query.directions.size()),
                   axis[0], nearest);
    kernel.gram(room.columns[0][0], chain.num_steps, first_row, rows, 1 / query.length, gram[0]);
    std::fill_n(shift, kLanes, 0.0);
    kernel.root_of_determinant(gram[0], rows, shift, root);

    std::int64_t at[kLanes];
    for (int lane = 0; lane < kLanes; ++lane) {
      at[lane] = lane < count ? Locate(voxels, inverse_size, room, lane) : kOutside;
      if (at[lane] == kOutside) {
        outside += lane < count;
        continue;
      }
      ++voxels.counts[at[lane]];
      voxels.directions[at[lane]] |= std::uint64_t{1} << static_cast<int>(nearest[lane]);
      voxels.manipulability[at[lane]] = std::max(voxels.manipulability[at[lane]], root[lane]);
      // The smallest singular value can be larger than the best so far only if J Jᵀ - best² I is
      // positive definite: most need no eigenvalues. Rounding is put on the safe side, so that the
      // largest does not depend on the order.
      double trace = 0;
      for (int i = 0; i < rows; ++i) trace += gram[i * (i + 3) / 2][lane];
      const double best = voxels.singular_value[at[lane]];
      shift[lane] = best * best - 1e-12 * trace;
    }
    kernel.root_of_determinant(gram[0], rows, shift, root);
    for (int lane = 0; lane < count; ++lane) {
      if (at[lane] == kOutside || root[lane] == 0) continue;
      double& best = voxels.singular_value[at[lane]];
      best = std::max(best, rows == 6 ? SmallestSingularValue<6>(gram, lane)
                                      : SmallestSingularValue<3>(gram, lane));
    }
  }
  return outside;
}

}  // namespace

void SampleConfigurations(const std::vector<double>& lower, const std::vector<double>& upper,
                          std::uint64_t seed, std::uint64_t first, std::size_t count,
                          int num_threads, double* Q) {
  const std::size_t n = lower.size();
  if (upper.size() != n) throw std::invalid_argument("upper: must be as many as lower");
  for (std::size_t i = 0; i < n; ++i) {
    if (!std::isfinite(lower[i])) throw std::invalid_argument("lower: must be finite");
    if (!std::isfinite(upper[i]) || upper[i] < lower[i]) {
      throw std::invalid_argument("upper: must be finite and not below lower");
    }
  }
  const std::uint64_t start = Mix(seed + kGolden);
  internal::RunShares(count, kRowsPerThread, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (std::size_t i = 0; i < n; ++i) {
        const std::uint64_t bits = Mix(start + ((first + row) * n + i + 1) * kGolden);
        const double u = static_cast<double>(bits >> 11) * 0x1p-53;
        Q[row * n + i] = lower[i] + u * (upper[i] - lower[i]);
      }
    }
  });
}

std::size_t AddToReach(const KinematicTree& tree, const ReachQuery& query, const double* Q,
                       std::size_t N, int num_threads, const ReachVoxels& voxels) {
  if (query.frame < 0 || query.frame >= tree.num_frames()) {
    throw std::invalid_argument("frame: no frame has number " + std::to_string(query.frame));
  }
  if (query.directions.empty() || query.directions.size() > 64) {
    throw std::invalid_argument("directions: must be 1 to 64, not " +
                                std::to_string(query.directions.size()));
  }
  if (tree.chain(query.frame).num_steps > internal::kMostSteps) {
    throw std::invalid_argument("frame: more than " + std::to_string(internal::kMostSteps) +
                                " joints move it");
  }
  if (!(query.length > 0) || !std::isfinite(query.length)) {
    throw std::invalid_argument("length: must be positive and finite");
  }
  if (!(voxels.voxel_size > 0) || !std::isfinite(voxels.voxel_size) ||
      !std::isfinite(1 / voxels.voxel_size)) {
    throw std::invalid_argument("voxel_size: must be positive and finite");
  }
  const int num_shares = internal::NumShares(N, kRowsPerThread, num_threads);
  const auto size = static_cast<std::size_t>(voxels.shape[0] * voxels.shape[1] * voxels.shape[2]);

  // The first share adds to the voxels themselves, every other to some of its own, which know the
  // best values so far.
  struct Own {
    std::vector<std::uint32_t> counts;
    std::vector<std::uint64_t> directions;
    std::vector<double> manipulability, singular_value;
  };
  std::vector<Own> own(num_shares - 1);
  std::vector<std::size_t> outside(num_shares);
  const std::vector<double> best_w(voxels.manipulability,
                                   voxels.manipulability + (num_shares > 1 ? size : 0));
  const std::vector<double> best_s(voxels.singular_value,
                                   voxels.singular_value + (num_shares > 1 ? size : 0));
  internal::RunParallel(num_shares, [&](int share) {
    const std::size_t begin = internal::ShareBegin(N, share, num_shares);
    const std::size_t end = internal::ShareBegin(N, share + 1, num_shares);
    ReachVoxels mine = voxels;
    if (share > 0) {
      Own& room = own[share - 1];
      room = {std::vector<std::uint32_t>(size), std::vector<std::uint64_t>(size), best_w, best_s};
      mine.counts = room.counts.data();
      mine.directions = room.directions.data();
      mine.manipulability = room.manipulability.data();
      mine.singular_value = room.singular_value.data();
    }
    outside[share] = Add(tree, query, Q + begin * tree.num_joints(), end - begin, mine);
  });
  for (const Own& room : own) {
    for (std::size_t i = 0; i < size; ++i) {
      voxels.counts[i] += room.counts[i];
      voxels.directions[i] |= room.directions[i];
      voxels.manipulability[i] = std::max(voxels.manipulability[i], room.manipulability[i]);
      voxels.singular_value[i] = std::max(voxels.singular_value[i], room.singular_value[i]);
    }
  }
  std::size_t sum = 0;
  for (const std::size_t count : outside) sum += count;
  return sum;
}

}  // namespace prehensile
