// Uses prehensile::core as a C++ program would: no Python, no Drake.

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "check.h"
#include "prehensile/voxel_downsample.h"

namespace prehensile {
namespace {

template <typename Scalar>
RowsView<Scalar> View(const std::vector<Scalar>& rows) {
  return {rows.data(), static_cast<Eigen::Index>(rows.size() / 3), 3};
}

template <typename Scalar>
std::vector<Scalar> RandomRows(std::size_t n, double half_width, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<Scalar> uniform(-half_width, half_width);
  std::vector<Scalar> rows(3 * n);
  for (Scalar& x : rows) x = uniform(generator);
  return rows;
}

/// Compares with sums over an ordered map.
template <typename Scalar>
void TestAgainstMap() {
  constexpr double kSize = 0.05;
  const auto points = RandomRows<Scalar>(20'001, 1, 1);
  struct Sum {
    std::size_t first;
    std::array<double, 3> sum{};
    int count = 0;
  };
  std::map<std::array<double, 3>, Sum> sums;
  for (std::size_t i = 0; i < points.size() / 3; ++i) {
    std::array<double, 3> index;
    for (int k = 0; k < 3; ++k) index[k] = std::floor(points[3 * i + k] * (1 / kSize));
    Sum& sum = sums.try_emplace(index, Sum{.first = i}).first->second;
    for (int k = 0; k < 3; ++k) sum.sum[k] += points[3 * i + k];
    ++sum.count;
  }
  std::map<std::size_t, Sum> in_order;
  for (const auto& [index, sum] : sums) in_order[sum.first] = sum;

  const VoxelCloud<Scalar> cloud = VoxelDownsample<Scalar>(View(points), kSize);
  Check(cloud.counts.size() == in_order.size(), "number of voxels");
  std::size_t row = 0;
  for (const auto& [first, sum] : in_order) {
    bool same = cloud.counts[row] == sum.count;
    for (int k = 0; k < 3; ++k) {
      same &= cloud.points[3 * row + k] == static_cast<Scalar>(sum.sum[k] / sum.count);
    }
    Check(same, "voxel of point " + std::to_string(first));
    ++row;
  }
}

template <typename Scalar>
void TestThreadsAndLevelsAgree() {
  auto points = RandomRows<Scalar>(100'003, 1, 2);
  const auto normals = RandomRows<Scalar>(100'003, 1, 3);
  points[30] = std::numeric_limits<Scalar>::quiet_NaN();
  const RowsView<Scalar> normals_view = View(normals);
  const auto run = [&](SimdLevel level, int num_threads) {
    return VoxelDownsample<Scalar>(View(points), 0.03, &normals_view,
                                   {.num_threads = num_threads, .simd = level});
  };
  const VoxelCloud<Scalar> one = run(SimdLevel::kBaseline, 1);
  for (const SimdLevel level : AvailableSimdLevels()) {
    for (const int num_threads : {1, 2, 3, 8}) {
      const VoxelCloud<Scalar> other = run(level, num_threads);
      Check(
          one.points == other.points && one.normals == other.normals && one.counts == other.counts,
          std::string(Name(level)) + " with " + std::to_string(num_threads) + " threads");
    }
  }
}

void TestBadArguments() {
  const std::vector<double> points{1, 2, 3};
  const std::vector<double> normals{0, 0, 1, 0, 0, 1};
  const RowsView<double> view = View(points);
  const RowsView<double> normals_view = View(normals);
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double size : {0.0, -1.0, infinity, std::nan(""), 1e-310, 1e-9}) {
    CheckThrows("voxel_size", [&] { VoxelDownsample<double>(view, size); });
  }
  CheckThrows("normals", [&] { VoxelDownsample<double>(view, 1, &normals_view); });
  CheckThrows("num_threads",
              [&] { VoxelDownsample<double>(view, 1, nullptr, {.num_threads = 0}); });
}

}  // namespace
}  // namespace prehensile

int main() {
  using namespace prehensile;
  TestAgainstMap<float>();
  TestAgainstMap<double>();
  TestThreadsAndLevelsAgree<float>();
  TestThreadsAndLevelsAgree<double>();
  TestBadArguments();
  std::printf("SIMD level %s, %d failures\n", Name(BestSimdLevel()).data(), failures);
  return failures;
}
