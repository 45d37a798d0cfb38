// Registration as a C++ program uses it: poses that are known, answers of brute
// force, and input that is meant to break it.

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "check.h"
#include "features_kernel.h"
#include "point_drift_kernel.h"
#include "prehensile/branch_and_bound.h"
#include "prehensile/consensus.h"
#include "prehensile/features.h"
#include "prehensile/icp.h"
#include "prehensile/point_drift.h"
#include "prehensile/simd.h"
#include "prehensile/tracking.h"

namespace prehensile {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNaN = std::nan("");

/// Rows of numbers in [-size, size).
Rows Uniform(int n, double size, int seed = 1) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed));
  Rows rows(n, 3);
  for (int i = 0; i < rows.size(); ++i) {
    rows.data()[i] = size * (static_cast<double>(random() >> 11) * 0x1p-52 - 1);
  }
  return rows;
}

PointRows View(const Rows& rows) { return {rows.data(), rows.rows(), 3}; }
std::size_t Count(const Rows& rows) { return static_cast<std::size_t>(rows.rows()); }

Matrix4d Pose(double angle, const Vector3d& p) {
  Matrix4d X = Matrix4d::Identity();
  X.topLeftCorner<3, 3>() = Eigen::AngleAxisd(angle, Vector3d(1, 2, 2) / 3).toRotationMatrix();
  X.topRightCorner<3, 1>() = p;
  return X;
}

Rows Moved(const Matrix4d& X, const Rows& rows) {
  return (rows * X.topLeftCorner<3, 3>().transpose()).rowwise() +
         X.topRightCorner<3, 1>().transpose();
}

/// Points on an ellipsoid of half axes 0.1, 0.07 and 0.05, with their normals.
struct Ellipsoid {
  Rows points, normals;
  explicit Ellipsoid(int n) : points(Uniform(n, 1)), normals(n, 3) {
    const Eigen::RowVector3d axes(0.1, 0.07, 0.05);
    for (int i = 0; i < n; ++i) {
      const Eigen::RowVector3d on_ball = points.row(i).normalized();
      points.row(i) = on_ball.cwiseProduct(axes);
      normals.row(i) = on_ball.cwiseQuotient(axes).normalized();
    }
  }
};

void TestIcp() {
  const Ellipsoid shape(400);
  const Matrix4d X_WO = Pose(0.1, {0.01, -0.005, 0.2});
  const Rows scene_points = Moved(X_WO, shape.points).topRows(300);
  Matrix4d turn = X_WO;
  turn.topRightCorner<3, 1>().setZero();
  const Rows scene_normals = Moved(turn, shape.normals).topRows(300);
  const IcpCloud scene(scene_points.data(), 300, scene_normals.data(), nullptr, {});
  const IcpCloud model(shape.points.data(), 400, shape.normals.data(), nullptr, {});
  const std::vector<Matrix4d> guesses = {Pose(0, {0, 0, 0.2}), Pose(0.2, {0.02, 0, 0.2}),
                                         Pose(0.05, {0, 0.01, 0.19})};
  for (const IcpKind kind :
       {IcpKind::kPointToPoint, IcpKind::kPointToPlane, IcpKind::kGeneralized}) {
    for (const IcpDirection direction : {IcpDirection::kSceneToModel, IcpDirection::kBoth}) {
      for (const RobustLoss loss : {RobustLoss::kLeastSquares, RobustLoss::kTukey}) {
        const IcpOptions options{.kind = kind, .direction = direction, .loss = loss};
        const auto one = IcpManyStarts(scene, model, guesses, options, 1);
        const auto three = IcpManyStarts(scene, model, guesses, options, 3);
        bool same = true, good = true;
        for (std::size_t k = 0; k < 3; ++k) {
          same &= one[k].X_WO == three[k].X_WO && one[k].inliers == three[k].inliers;
          // From model to scene, a quarter of the model has no partner of its
          // own.
          good &= direction == IcpDirection::kBoth || one[k].X_WO.isApprox(X_WO, 2e-3);
        }
        Check(same, "threads do not change registration");
        Check(good, "finds the pose");
      }
    }
  }
  // Clouds that tell of no pose, or of very little: an outcome, and no crash.
  for (const int n : {1, 2, 3, 20}) {
    for (const double spread : {0.0, 1.0, 1e9, 1e150}) {
      Rows points = Uniform(n, spread, n);
      if (n == 20) points.rightCols<2>().setZero();
      const IcpCloud cloud(points.data(), Count(points), nullptr, nullptr, {});
      for (const IcpKind kind :
           {IcpKind::kPointToPoint, IcpKind::kPointToPlane, IcpKind::kGeneralized}) {
        const IcpResult result =
            Icp(cloud, model, Matrix4d::Identity(), {.kind = kind, .max_iterations = 5});
        Check(n >= 3 || result.outcome == IcpOutcome::kTooFewPairs, "too few points for a pose");
      }
    }
  }
  const auto icp = [&](const Matrix4d& guess, const IcpOptions& options) {
    Icp(scene, model, guess, options);
  };
  CheckThrows("X_WO_guess", [&] { icp(kNaN * X_WO, {}); });
  CheckThrows("X_WO_guess", [&] { icp(2 * X_WO, {}); });
  CheckThrows("max_distance", [&] { icp(X_WO, {.max_distance = kNaN}); });
  CheckThrows("kept_fraction", [&] { icp(X_WO, {.kept_fraction = 0}); });
  CheckThrows("num_threads", [&] { IcpManyStarts(scene, model, guesses, {}, 0); });
  CheckThrows("points", [] { IcpCloud(nullptr, 0, nullptr, nullptr, {}); });
  const double point[3] = {0, 0, kNaN};
  CheckThrows("points", [&] { IcpCloud(point, 1, nullptr, nullptr, {}); });
  CheckThrows("normals", [&] { IcpCloud(shape.points.data(), 1, point, nullptr, {}); });
  CheckThrows("intensities", [&] { IcpCloud(shape.points.data(), 1, nullptr, point + 2, {}); });
}

void TestPointDrift() {
  const Rows points = Uniform(70, 1), queries = Uniform(50, 1.5, 2);
  const GaussianSums sums(points.data(), 70);
  std::vector<double> found(300), again(300);
  sums.At(queries.data(), 50, 0.4, 0, kInfinity, found.data(), 1);
  sums.At(queries.data(), 50, 0.4, 0, kInfinity, again.data(), 3);
  Check(found == again, "threads do not change sums");
  bool good = true;
  for (int i = 0; i < 50; ++i) {
    double k_sum = 0;
    Vector3d offset = Vector3d::Zero();
    for (int j = 0; j < 70; ++j) {
      const Vector3d d = (points.row(j) - queries.row(i)).transpose();
      const double k = std::exp(-d.squaredNorm() / (2 * 0.4 * 0.4));
      k_sum += k;
      offset += k * d;
    }
    const double* const row = &found[static_cast<std::size_t>(6 * i)];
    const double scale = std::exp(-row[0] / (2 * 0.4 * 0.4));
    good &= std::abs(row[1] * scale - k_sum) < 1e-5 * k_sum;
    good &= (scale * Vector3d(row[2], row[3], row[4]) - offset).norm() < 1e-5;
  }
  Check(good, "sums of Gaussians");

  const Matrix4d X_WO = Pose(0.3, {0.1, 0, 2});
  Rows model = Uniform(60, 1, 3);
  model.col(1) *= 0.5;
  const Rows scene = Moved(X_WO, model);
  const PointDriftResult result = CoherentPointDrift(scene.data(), 60, model.data(), 60,
                                                     Pose(0, {0, 0, 2}), {.outlier_volume = 4});
  Check(result.converged && result.X_WO.isApprox(X_WO, 1e-4), "point drift finds the pose");
  for (const double spread : {0.0, 1e-9, 1e9, 1e30}) {
    for (const int n : {1, 2, 40}) {
      const Rows cloud = Uniform(n, spread, 4);
      CoherentPointDrift(cloud.data(), Count(cloud), model.data(), 60, X_WO, {.max_iterations = 5});
      CoherentPointDrift(model.data(), 60, cloud.data(), Count(cloud), X_WO, {.max_iterations = 5});
    }
  }
  const auto drift = [&](std::size_t n, const Matrix4d& X, const PointDriftOptions& options) {
    CoherentPointDrift(scene.data(), n, model.data(), 60, X, options);
  };
  CheckThrows("scene", [&] { drift(0, X_WO, {}); });
  CheckThrows("X_WO_guess", [&] { drift(60, kNaN * X_WO, {}); });
  CheckThrows("outlier_weight", [&] { drift(60, X_WO, {.outlier_weight = 1}); });
  CheckThrows("model", [&] { CoherentPointDrift(scene.data(), 60, &kNaN, 0, X_WO, {}); });
}

void TestConsensus() {
  // Half of the correspondences are right.
  const Rows model = Uniform(120, 1);
  const Matrix4d X_WO = Pose(2, {0.3, 0.2, -1});
  Rows scene = Moved(X_WO, model);
  scene.bottomRows(60) = Uniform(60, 2, 2);
  const PointRows a = View(model), b = View(scene);
  const RobustPose robust = RobustRegistration(a, b, 0.01);
  Check(robust.status == ConsensusStatus::kFound &&
            robust.R.isApprox(X_WO.topLeftCorner<3, 3>(), 1e-9),
        "robust registration finds the pose");
  const RansacPose ransac = RansacRegistration(a, b, 0.01, {.seed = 5});
  Check(ransac.num_inliers >= 60 && ransac.R.isApprox(X_WO.topLeftCorner<3, 3>(), 1e-9),
        "samples find the pose");
  for (const SimdLevel level : AvailableSimdLevels()) {
    const ConsistencyGraph graph = MakeConsistencyGraph(a, b, 0.02, 1, 0, level);
    bool good = true;
    for (int i = 0; i < 120; ++i) {
      for (int j = 0; j < 120; ++j) {
        const double gap =
            std::abs((model.row(i) - model.row(j)).norm() - (scene.row(i) - scene.row(j)).norm());
        good &= graph.adjacent(i, j) == (i != j && gap <= 0.02);
      }
    }
    Check(good, "the graph is that of all pairs");
  }
  // Cliques of small random graphs, by trying all sets.
  std::mt19937_64 random(7);
  for (int trial = 0; trial < 20; ++trial) {
    constexpr int kSize = 12;
    ConsistencyGraph graph(kSize);
    for (int i = 0; i < kSize; ++i) {
      for (int j = 0; j < i; ++j) {
        if (random() % 5 < 3) graph.Connect(i, j);
      }
    }
    int most = 0;
    for (unsigned set = 0; set < 1u << kSize; ++set) {
      bool clique = true;
      for (int i = 0; i < kSize && clique; ++i) {
        for (int j = 0; j < i && clique; ++j) {
          clique = !(set >> i & 1) || !(set >> j & 1) || graph.adjacent(i, j);
        }
      }
      if (clique) most = std::max(most, __builtin_popcount(set));
    }
    const Clique found = MaximumClique(graph);
    Check(found.proven && static_cast<int>(found.vertices.size()) == most, "the largest clique");
  }
  Check(MaximumClique(ConsistencyGraph(0)).vertices.empty(), "no vertex, no clique");
  // Little or nothing to tell a pose from.
  for (const int n : {0, 1, 2, 3, 4, 30}) {
    for (const double spread : {0.0, 1.0, 1e9}) {
      Rows points = Uniform(n, spread, n);
      if (n == 30) points.rightCols<2>().setZero();
      RobustRegistration(View(points), View(points), 0.01);
      const RansacPose pose = RansacRegistration(View(points), View(points), 0.01, {});
      Check(n >= 3 || pose.num_inliers == 0, "no pose from fewer than three");
    }
  }
  const Rows bad = Rows::Constant(120, 3, kNaN);
  CheckThrows("model_points", [&] { RobustRegistration(View(bad), b, 0.01); });
  CheckThrows("scene_points", [&] { RansacRegistration(a, View(bad), 0.01); });
  CheckThrows("noise_bound", [&] { RobustRegistration(a, b, 0); });
  CheckThrows("scene_points", [&] { RansacRegistration(a, View(Uniform(3, 1)), 0.01); });
  CheckThrows("num_vertices", [] { ConsistencyGraph(std::size_t{1} << 40); });
  CheckThrows("max_iterations", [&] { GncRotation(a, b, 1, 0); });
  CheckThrows("values", [] { VoteForScalar(nullptr, nullptr, 0, true); });
}

void TestBranchAndBound() {
  Rows model = Uniform(25, 1);
  model.col(2).setZero();
  Matrix4d X_WO = Matrix4d::Identity();
  X_WO.topLeftCorner<2, 2>() << 0, -1, 1, 0;
  X_WO(0, 3) = 0.4;
  const Rows scene = Moved(X_WO, model).topRows(20);
  const auto found = BranchAndBound(View(scene), View(model), {.max_gap = 1e-6, .planar = true});
  Check(
      found.closed && found.cost < 1e-12 && (found.R * X_WO.topLeftCorner<3, 3>()).isIdentity(1e-6),
      "the best of all poses");
  const auto search = [&](const Rows& s, const Rows& m) { BranchAndBound(View(s), View(m), {}); };
  CheckThrows("scene_points", [&] { search(Rows(0, 3), model); });
  CheckThrows("model_points", [&] { search(scene, Rows::Constant(1, 3, kNaN)); });
  CheckThrows("model_points", [&] { search(scene, Rows::Constant(2, 3, 1e300)); });
  CheckThrows("model_points", [&] { search(scene, Rows::Zero(20'000, 3)); });
  for (const double at : {0.0, 1e9}) {  // All in one place.
    const auto one = BranchAndBound(View(Rows::Constant(3, 3, at)), View(Rows::Constant(2, 3, at)),
                                    {.max_gap = 1e-9, .max_nodes = 100});
    Check(one.cost < 1e-9, "a point fits a point");
  }
}

void TestFeatures() {
  const Ellipsoid shape(150);
  std::vector<float> features(150 * kFpfhSize), others(features.size());
  Fpfh(shape.points.data(), shape.normals.data(), 150, 0.04, 1, features.data());
  Fpfh(shape.points.data(), shape.normals.data(), 150, 0.04, 3, others.data());
  Check(features == others, "threads do not change features");
  const Matrix4d X_WO = Pose(1, {1, 2, 3});
  Matrix4d turn = X_WO;
  turn.topRightCorner<3, 1>().setZero();
  const Rows points = Moved(X_WO, shape.points), normals = Moved(turn, shape.normals);
  Fpfh(points.data(), normals.data(), 150, 0.04, 1, others.data());
  std::vector<std::int32_t> nearest(150);
  std::vector<float> first(150), second(150);
  NearestFeatures(features.data(), 150, others.data(), 150, 2, nearest.data(), first.data(),
                  second.data());
  int right = 0, exact = 0;
  for (std::size_t i = 0; i < 150; ++i) {
    right += nearest[i] == static_cast<int>(i);
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t j = 0; j < 150; ++j) {
      float sum = 0;
      for (std::size_t k = 0; k < kFpfhSize; ++k) {
        const float d = features[i * kFpfhSize + k] - others[j * kFpfhSize + k];
        sum += d * d;
      }
      least = std::min(least, sum);
    }
    exact += std::abs(first[i] - least) <= 1e-5f * least + 1e-3f && first[i] <= second[i];
  }
  Check(right >= 145, "features do not turn with the cloud");
  Check(exact == 150, "the nearest features are those of brute force");

  const PointPairTable table(shape.points.data(), shape.normals.data(), 150, 0.01);
  const auto votes = table.Vote(points.data(), normals.data(), 150, 20, 2, 5, 1);
  const auto again = table.Vote(points.data(), normals.data(), 150, 20, 2, 5, 3);
  bool same = votes.size() == again.size() && !votes.empty(), found = false;
  for (std::size_t k = 0; same && k < votes.size(); ++k) {
    same = votes[k].votes == again[k].votes &&
           std::equal(votes[k].X_WO, votes[k].X_WO + 16, again[k].X_WO);
    // An ellipsoid looks the same after half a turn about an axis.
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> X(votes[k].X_WO);
    found |= (X - X_WO).rightCols<1>().norm() < 0.02;
  }
  Check(same, "threads do not change votes");
  Check(found, "voting finds the place");
  // Normals that are no normals, and points in one place.
  for (const double length : {0.0, 1e-300, 1e60}) {
    const Rows odd = length * shape.normals;
    Fpfh(points.data(), odd.data(), 150, 0.04, 1, others.data());
    PointPairTable(shape.points.data(), odd.data(), 150, 0.01)
        .Vote(points.data(), odd.data(), 150, 5, 2, 5, 1);
    table.Vote(points.data(), odd.data(), 150, 5, 2, 5, 1);
  }
  const Rows place = Rows::Constant(150, 3, 0.5);
  Fpfh(place.data(), normals.data(), 150, 0.04, 1, others.data());
  PointPairTable(place.data(), normals.data(), 150, 0.01)
      .Vote(place.data(), normals.data(), 150, 5, 2, 5, 1);
  const Rows huge = Rows::Constant(150, 3, 1e308);
  CheckThrows("normals", [&] { Fpfh(points.data(), huge.data(), 2, 1, 1, others.data()); });
  CheckThrows("normals", [&] { PointPairTable(points.data(), huge.data(), 150, 0.01); });
  CheckThrows("points", [&] { PointPairTable(points.data(), normals.data(), 1, 0.01); });
  CheckThrows("distance_step", [&] { PointPairTable(points.data(), normals.data(), 150, 1e-9); });
  CheckThrows("radius", [&] { Fpfh(points.data(), normals.data(), 150, kNaN, 1, others.data()); });

#ifdef __x86_64__
  std::vector<float> blocks(4 * kFpfhSize * internal::kFeatureBlock);
  for (std::size_t i = 0; i < blocks.size(); ++i) blocks[i] = features[i];
  for (const SimdLevel level : AvailableSimdLevels()) {
    float squares[2][150], seconds[2][150];
    std::int32_t indices[2][150];
    const auto run = [&](internal::NearestFeaturesKernel kernel, int k) {
      std::fill_n(squares[k], 150, std::numeric_limits<float>::infinity());
      std::fill_n(seconds[k], 150, std::numeric_limits<float>::infinity());
      std::fill_n(indices[k], 150, -1);
      kernel(others.data(), 150, blocks.data(), 4, 0, indices[k], squares[k], seconds[k]);
    };
    run(internal::baseline::kNearestFeatures, 0);
    run(level == SimdLevel::kAvx512 ? internal::avx512::kNearestFeatures
        : level == SimdLevel::kAvx2 ? internal::avx2::kNearestFeatures
                                    : internal::baseline::kNearestFeatures,
        1);
    Check(std::equal(squares[0], squares[0] + 150, squares[1]) &&
              std::equal(indices[0], indices[0] + 150, indices[1]),
          "levels agree on features");
  }
  std::vector<internal::DriftBlock> drift(3);
  const Rows numbers = Uniform(48, 1);
  for (int i = 0; i < 48; ++i) {
    internal::DriftBlock& block = drift[static_cast<std::size_t>(i / 16)];
    block.x[i % 16] = static_cast<float>(numbers(i, 0));
    block.y[i % 16] = static_cast<float>(numbers(i, 1));
    block.z[i % 16] = static_cast<float>(numbers(i, 2));
  }
  const std::int32_t all[3] = {0, 1, 2};
  const float query[3] = {0.1f, -0.2f, 0.3f};
  double base[5], other[5];
  internal::baseline::kDrift.sums(query, drift.data(), all, 3, 2.5f, 0, base);
  for (const SimdLevel level : AvailableSimdLevels()) {
    const internal::DriftKernel& kernel = level == SimdLevel::kAvx512 ? internal::avx512::kDrift
                                          : level == SimdLevel::kAvx2 ? internal::avx2::kDrift
                                                                      : internal::baseline::kDrift;
    kernel.sums(query, drift.data(), all, 3, 2.5f, 0, other);
    Check(std::equal(base, base + 5, other), "levels agree on sums of Gaussians");
  }
#endif
}

void TestTracking() {
  // A ball of radius 0.1 about the origin, seen from 0.5 m; its field is exact
  // at the nodes.
  const FieldGrid grid{{-0.2, -0.2, -0.2}, 0.02, {21, 21, 21}};
  std::vector<FieldNode> nodes(grid.num_nodes());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Vector3d p = 0.02 * Vector3d(double(i / 441), double(i / 21 % 21), double(i % 21)) -
                       Vector3d::Constant(0.2);
    const Vector3d g = p.norm() > 1e-9 ? Vector3d(p.normalized()) : Vector3d::UnitX();
    nodes[i] = {static_cast<float>(p.norm() - 0.1),
                {static_cast<float>(g[0]), static_cast<float>(g[1]), static_cast<float>(g[2])}};
  }
  const DistanceField field(grid, nodes, true);
  constexpr int kWidth = 50, kHeight = 40;
  std::vector<float> depth(kWidth * kHeight, 2.0f);
  DepthView view{.depth = depth.data(), .width = kWidth, .height = kHeight, .fx = 60, .fy = 60};
  view.cx = 25, view.cy = 20;
  view.p_WC = {0, 0, -0.5};
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      // |s r - 0.5 z| = 0.1 for the line of sight r.
      const Vector3d r((u - 25) / 60.0, (v - 20) / 60.0, 1);
      const double A = r.squaredNorm(), root = 0.25 - A * 0.24;
      if (root > 0)
        depth[static_cast<std::size_t>(v * kWidth + u)] =
            static_cast<float>((0.5 - std::sqrt(root)) / A);
    }
  }
  depth[0] = static_cast<float>(kNaN);
  const std::vector<TrackedBody> bodies = {{&field}};
  const auto near = PointsNearBodies({view}, bodies, {}, 0.02, 0, 4, 10'000);
  bool on_ball = near.size() > 300;
  for (std::size_t i = 0; i < near.size(); i += 3) {
    on_ball &= std::abs(Vector3d(&near[i]).norm() - 0.1) < 1e-5;
  }
  Check(on_ball, "points near the ball are on it");
  std::vector<TrackedBody> moved = bodies;
  moved[0].p_WB = {0.004, 0, 0};
  auto terms = SurfaceTerms(near.data(), near.size() / 3, moved, RobustLoss::kGemanMcClure, 0.01);
  Check(terms[0].gradient[3] > 0 && terms[0].cost > 0, "the cost falls back to the ball");
  const Ellipsoid ball(100);
  const Rows samples = 0.1 * ball.points.rowwise().normalized();
  const Rows normals = ball.points.rowwise().normalized();
  const auto counts =
      AddFreeSpaceTerms({view}, bodies, {{samples.data(), normals.data(), 100}}, {}, 1, &terms);
  Check(counts[0].facing > 20 && counts[0].in_free == 0, "nothing of it is in free space");
  for (const double at : {1e300, -1e300, 0.0}) {
    moved[0].p_WB = Vector3d::Constant(at);
    PointsNearBodies({view}, moved, bodies, 0.02, 0.1, 0.5, 1);
    AddFreeSpaceTerms({view}, moved, {{samples.data(), normals.data(), 100}}, {}, 1, &terms);
  }
  double violation = 0;
  const double front[3] = {0, 0, -0.3};
  FreeSpaceViolation(view, front, 1, 0.01, &violation);
  Check(std::abs(violation - 0.19) < 1e-6, "how far a point is in free space");
  CheckThrows("bodies", [&] { PointsNearBodies({view}, {{}}, {}, 0.02, 0, 4, 10); });
  CheckThrows("depth", [&] { PointsNearBodies({DepthView{}}, bodies, {}, 0.02, 0, 4, 10); });
  CheckThrows("loss_scale",
              [&] { SurfaceTerms(near.data(), 1, bodies, RobustLoss::kHuber, kNaN); });
  CheckThrows("fields", [] {
    NearestBodyAtRows({nullptr}, {Eigen::Isometry3d::Identity()}, nullptr, 0, 1, nullptr, nullptr,
                      nullptr);
  });
}

}  // namespace
}  // namespace prehensile

int main() {
  using namespace prehensile;
  TestIcp();
  TestPointDrift();
  TestConsensus();
  TestBranchAndBound();
  TestFeatures();
  TestTracking();
  return failures;
}
