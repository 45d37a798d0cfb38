#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "check.h"
#include "prehensile/distance_field.h"
#include "prehensile/refine.h"
#include "prehensile/simd.h"
#include "refine_kernel.h"

namespace prehensile {
namespace {

using Eigen::Vector3d;

/// Three spheres: of a pose, nothing is left free.
double Distance(const Vector3d& p, Vector3d* gradient) {
  const Vector3d centres[] = {{0.02, 0, 0}, {-0.03, 0.02, 0.01}, {0, -0.04, -0.03}};
  const double radii[] = {0.04, 0.03, 0.025};
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 3; ++k) {
    const Vector3d offset = p - centres[k];
    const double distance = offset.norm() - radii[k];
    if (distance >= least) continue;
    least = distance;
    *gradient = offset.normalized();
  }
  return least;
}

DistanceField MakeField(double spacing, std::int32_t size) {
  const double half = 0.5 * spacing * (size - 1);
  const FieldGrid grid{{-half, -half, -half}, spacing, {size, size, size}};
  std::vector<FieldNode> nodes;
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      for (int k = 0; k < size; ++k) {
        Vector3d g;
        const Vector3d p = Vector3d(i, j, k) * spacing - Vector3d::Constant(half);
        FieldNode node{.distance = static_cast<float>(Distance(p, &g))};
        for (int axis = 0; axis < 3; ++axis) node.gradient[axis] = static_cast<float>(g[axis]);
        nodes.push_back(node);
      }
    }
  }
  return {grid, nodes, true};
}

/// Points of the surface, rows of x, y, z.
std::vector<double> MakePoints(int n) {
  std::vector<double> points;
  for (int i = 0; i < n; ++i) {
    const double z = 1 - (2.0 * i + 1) / n, turn = 2.4 * i, s = std::sqrt(1 - z * z);
    Vector3d p = 0.09 * Vector3d(s * std::cos(turn), s * std::sin(turn), z), g;
    for (int k = 0; k < 40; ++k) {
      const double distance = Distance(p, &g);
      p -= distance * g;
    }
    points.insert(points.end(), p.data(), p.data() + 3);
  }
  return points;
}

void TestEverywhere() {
  const DistanceField field = MakeField(0.004, 40);
  // On the border, at nodes, and far outside: always a number, and memory is that of the grid.
  for (const double x : {0.0, 0.078, -0.078, 0.0780001, 0.5, -1e6, 1e300}) {
    for (const double y : {0.0, 0.078, -0.078, 1e-300, -7.0}) {
      const auto value = field.At({x, y, -x});
      Check(!std::isnan(value.distance), "a distance everywhere");
      Check(value.gradient.norm() < 1.001, "a gradient everywhere");
    }
  }
  const DistanceField least = MakeField(0.1, 2);
  Check(std::isfinite(least.Closest({0, 0, 0}).point.norm()), "eight nodes will do");
}

void TestRefine() {
  const DistanceField field = MakeField(0.003, 70);
  Eigen::Isometry3d start = Eigen::Isometry3d::Identity();
  start.rotate(Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()));
  start.translation() = Vector3d(0.01, -0.005, 0.004);
  for (const int n : {7, 8, 9, 500, 1003}) {  // What lanes and blocks divide, and do not.
    const std::vector<double> points = MakePoints(n);
    const auto poses = RefinePoses(points.data(), nullptr, n, field, {start, start}, {}, 2);
    Check(poses[0].cost == poses[1].cost || !poses[1].is_finalist, "same start, same end");
    Check(poses[0].is_inlier.size() == static_cast<std::size_t>(n), "a judgement for each point");
    if (n < 500) continue;
    Check(poses[0].num_inliers == static_cast<std::size_t>(n) && poses[0].inlier_rms < 1e-4,
          "all are inliers");
    Check(poses[0].converged, "converges");
    const Eigen::Isometry3d& X = poses[0].X_WO;
    Check(X.translation().norm() < 2e-4 && Eigen::AngleAxisd(X.linear()).angle() < 5e-3,
          "finds the pose of " + std::to_string(n) + " points");
  }
}

void TestLevelsAgree() {
#ifdef __x86_64__
  using namespace internal;
  constexpr std::size_t kCount = 40;
  std::vector<float> scene(4 * kCount), weights(kCount);
  const std::vector<double> points = MakePoints(kCount);
  for (std::size_t i = 0; i < kCount; ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      scene[k * kCount + i] = static_cast<float>(points[3 * i + k]);
    scene[3 * kCount + i] = 1;
  }
  const DistanceField field = MakeField(0.004, 40);
  FieldView<float> view{.nodes = &field.nodes().data()->distance,
                        .spacing = 0.004F,
                        .inverse_spacing = 250,
                        .is_signed = true};
  for (int k = 0; k < 3; ++k) {
    view.origin[k] = static_cast<float>(field.grid().origin[static_cast<std::size_t>(k)]);
    view.sizes[k] = 40;
  }
  const float R[9] = {0.8F, -0.6F, 0, 0.6F, 0.8F, 0, 0, 0, 1}, t[3] = {0.01F, 0.002F, 0};
  const auto sums = [&](const RefineKernel& kernel) {
    std::vector<float> memory(8 * kCount);
    const auto row = [&](std::size_t k) { return &memory[k * kCount]; };
    const RefineRows rows{row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7)};
    const float* const at = scene.data();
    const RefinePoints in{at,      at + kCount, at + 2 * kCount, nullptr,
                          nullptr, nullptr,     at + 3 * kCount};
    kernel.look_up(view, in, kCount, R, t, -1, rows);
    kernel.weigh(RobustLoss::kGemanMcClure, 0.003, 1, rows.r, rows.valid, kCount, weights.data());
    RefineSums result;
    kernel.sum(rows, weights.data(), kCount, &result);
    return result;
  };
  const RefineSums base = sums(baseline::kRefine);
  for (const SimdLevel level : AvailableSimdLevels()) {
    const RefineSums other = sums(level == SimdLevel::kAvx512 ? avx512::kRefine
                                  : level == SimdLevel::kAvx2 ? avx2::kRefine
                                                              : baseline::kRefine);
    for (int k = 0; k < 21; ++k) {
      Check(base.information[k] == other.information[k], "levels agree to the bit");
    }
  }
#endif
}

void TestErrors() {
  const FieldGrid good{{0, 0, 0}, 0.1, {2, 2, 2}};
  const std::vector<FieldNode> nodes(8);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CheckThrows("spacing", [&] { DistanceField({{0, 0, 0}, nan, {2, 2, 2}}, nodes, true); });
  CheckThrows("spacing", [&] { DistanceField({{0, 0, 0}, 1, {2000, 2000, 2000}}, nodes, true); });
  CheckThrows("origin", [&] { DistanceField({{0, nan, 0}, 1, {2, 2, 2}}, nodes, true); });
  CheckThrows("sizes", [&] { DistanceField({{0, 0, 0}, 1, {8, 1, 1}}, nodes, true); });
  CheckThrows("nodes", [&] { DistanceField({{0, 0, 0}, 1, {3, 2, 2}}, nodes, true); });
  CheckThrows("nodes", [&] {
    std::vector<FieldNode> bad = nodes;
    bad[3].gradient[1] = static_cast<float>(nan);
    DistanceField(good, bad, true);
  });
  const DistanceField field(good, nodes, true);
  const double point[3] = {0, 0, 0};
  CheckThrows("points", [&] { RefinePoses(point, nullptr, 0, field, {}, {}, 1); });
  CheckThrows("scale", [&] { RefinePoses(point, nullptr, 1, field, {}, {.scale = 0}, 1); });
  // A field that says nothing, and a start: the start comes back.
  const auto poses = RefinePoses(point, nullptr, 1, field, {Eigen::Isometry3d::Identity()}, {}, 1);
  Check(poses[0].X_WO.matrix().isIdentity(1e-12), "no information, no motion");
}

}  // namespace
}  // namespace prehensile

int main() {
  using namespace prehensile;
  TestEverywhere();
  TestRefine();
  TestLevelsAgree();
  TestErrors();
  return failures;
}
