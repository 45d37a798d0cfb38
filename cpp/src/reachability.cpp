#include "prehensile/reachability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "parallel.h"

namespace prehensile {
namespace {

constexpr std::size_t kRowsPerThread = 1024;

int Shares(std::size_t rows, int num_threads) {
  if (num_threads < 1) {
    throw std::invalid_argument("num_threads: must be at least 1, not " +
                                std::to_string(num_threads));
  }
  return static_cast<int>(std::clamp<std::size_t>(rows / kRowsPerThread, 1, num_threads));
}

constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15;

/// The output function of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
std::uint64_t Mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9;
  x = (x ^ (x >> 27)) * 0x94d049bb133111eb;
  return x ^ (x >> 31);
}

/// J Jᵀ of the rows of J that are asked for.
template <int kRows>
class Gram {
 public:
  Gram(const double* J, int n, const ReachQuery& query) {
    const int first_row = query.part == ReachPart::kTranslational ? 3 : 0;
    for (int i = 0; i < kRows; ++i) {
      const int row_i = first_row + i;
      for (int j = 0; j <= i; ++j) {
        const int row_j = first_row + j;
        double sum = 0;
        for (int k = 0; k < n; ++k) sum += J[n * row_i + k] * J[n * row_j + k];
        if (row_i >= 3) sum /= query.length;
        if (row_j >= 3) sum /= query.length;
        a_[i][j] = sum;
      }
    }
  }

  double Trace() const {
    double sum = 0;
    for (int i = 0; i < kRows; ++i) sum += a_[i][i];
    return sum;
  }

  /// Square root of the determinant of the matrix less shift · I; 0 unless positive definite.
  double RootOfDeterminant(double shift) const {
    double l[kRows][kRows];
    double product = 1;
    for (int j = 0; j < kRows; ++j) {
      double d = a_[j][j] - shift;
      for (int k = 0; k < j; ++k) d -= l[j][k] * l[j][k];
      if (!(d > 0)) return 0;
      const double root = std::sqrt(d);
      product *= root;
      for (int i = j + 1; i < kRows; ++i) {
        double sum = a_[i][j];
        for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
        l[i][j] = sum / root;
      }
    }
    return product;
  }

  double SmallestSingularValue() const {
    Eigen::Matrix<double, kRows, kRows> A;
    for (int i = 0; i < kRows; ++i) {
      for (int j = 0; j <= i; ++j) A(i, j) = a_[i][j];
    }
    const Eigen::SelfAdjointEigenSolver<decltype(A)> solver(A, Eigen::EigenvaluesOnly);
    return std::sqrt(std::max(0.0, solver.eigenvalues()[0]));
  }

 private:
  double a_[kRows][kRows];  // Lower triangle.
};

/// Whether the smallest singular value is possibly larger than the best one so far: A - best² I is
/// positive definite, up to rounding on the safe side, so that skipping never changes the largest.
template <int kRows>
bool MayBeat(const Gram<kRows>& gram, double best) {
  return gram.RootOfDeterminant(best * best - 1e-12 * gram.Trace()) > 0;
}

int Nearest(const std::vector<std::array<double, 3>>& directions, const double* a) {
  double largest = -2;
  int nearest = 0;
  for (std::size_t d = 0; d < directions.size(); ++d) {
    const double cosine =
        directions[d][0] * a[0] + directions[d][1] * a[1] + directions[d][2] * a[2];
    if (cosine > largest) {
      largest = cosine;
      nearest = static_cast<int>(d);
    }
  }
  return nearest;
}

/// Adds some of the configurations, with nobody else writing to these voxels.
template <int kRows>
std::size_t Add(const KinematicTree& tree, const ReachQuery& query, const double* Q, std::size_t N,
                const ReachVoxels& voxels) {
  const int n = tree.num_joints();
  const double inverse_size = 1 / voxels.voxel_size;
  std::vector<double> J(6 * n);
  double X[16];
  std::size_t outside = 0;
  for (std::size_t row = 0; row < N; ++row) {
    tree.PoseAndJacobian(Q + n * row, query.frame, X, J.data());
    std::int64_t at = 0;
    bool inside = true;
    for (int k = 0; k < 3; ++k) {
      // Compared as numbers of floating point: what is far outside may not fit an integer.
      const double i =
          std::floor(X[4 * k + 3] * inverse_size) - static_cast<double>(voxels.first[k]);
      inside = inside && i >= 0 && i < static_cast<double>(voxels.shape[k]);
      at = at * voxels.shape[k] + (inside ? static_cast<std::int64_t>(i) : 0);
    }
    if (!inside) {
      ++outside;
      continue;
    }
    ++voxels.counts[at];
    double a[3];
    for (int k = 0; k < 3; ++k) {
      a[k] = X[4 * k] * query.axis[0] + X[4 * k + 1] * query.axis[1] + X[4 * k + 2] * query.axis[2];
    }
    voxels.directions[at] |= std::uint64_t{1} << Nearest(query.directions, a);
    const Gram<kRows> gram(J.data(), n, query);
    voxels.manipulability[at] = std::max(voxels.manipulability[at], gram.RootOfDeterminant(0));
    double& best = voxels.singular_value[at];
    if (MayBeat(gram, best)) best = std::max(best, gram.SmallestSingularValue());
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
  const int num_shares = Shares(count, num_threads);
  const std::uint64_t start = Mix(seed + kGolden);
  internal::RunParallel(num_shares, [&](int share) {
    const std::size_t begin = count * share / num_shares, end = count * (share + 1) / num_shares;
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
  if (!(query.length > 0) || !std::isfinite(query.length)) {
    throw std::invalid_argument("length: must be positive and finite");
  }
  if (!(voxels.voxel_size > 0) || !std::isfinite(voxels.voxel_size) ||
      !std::isfinite(1 / voxels.voxel_size)) {
    throw std::invalid_argument("voxel_size: must be positive and finite");
  }
  const int num_shares = Shares(N, num_threads);
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
    const std::size_t begin = N * share / num_shares, end = N * (share + 1) / num_shares;
    ReachVoxels mine = voxels;
    if (share > 0) {
      Own& room = own[share - 1];
      room = {std::vector<std::uint32_t>(size), std::vector<std::uint64_t>(size), best_w, best_s};
      mine.counts = room.counts.data();
      mine.directions = room.directions.data();
      mine.manipulability = room.manipulability.data();
      mine.singular_value = room.singular_value.data();
    }
    const auto add = query.part == ReachPart::kBoth ? Add<6> : Add<3>;
    outside[share] = add(tree, query, Q + begin * tree.num_joints(), end - begin, mine);
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
