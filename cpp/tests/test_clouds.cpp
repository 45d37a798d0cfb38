// Clouds as a C++ program uses them, against brute force and closed forms, and
// on input that is meant to break them.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "check.h"
#include "cloud_normals_kernel.h"
#include "prehensile/cloud_normals.h"
#include "prehensile/crop.h"
#include "prehensile/depth_fusion.h"
#include "prehensile/kd_tree.h"
#include "prehensile/regions.h"
#include "prehensile/sampling.h"
#include "prehensile/simd.h"
#include "prehensile/surface.h"
#include "prehensile/volumes.h"
#include "prehensile/voxel_hash.h"

namespace prehensile {
namespace {

using Numbers = std::vector<double>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const double kNaN = std::nan("");

/// n numbers of [-size, size), plus an offset.
Numbers Uniform(std::size_t n, double size, double offset = 0, int seed = 1) {
  std::mt19937_64 random(static_cast<std::uint64_t>(seed));
  Numbers numbers(n);
  for (double& x : numbers) {
    x = offset + size * (static_cast<double>(random() >> 11) * 0x1p-52 - 1);
  }
  return numbers;
}

/// Clouds of n points on which neighbours are hard to tell: spread out, all in
/// one place, in line, far away, and with some that coincide.
std::vector<Numbers> HardClouds(std::size_t n) {
  std::vector<Numbers> clouds = {Uniform(3 * n, 1), Numbers(3 * n, 0.25), Uniform(3 * n, 1),
                                 Uniform(3 * n, 1, 1e9), Uniform(3 * n, 1)};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 1; k < 3; ++k) clouds[2][3 * i + k] = clouds[2][3 * i];
    for (std::size_t k = 0; k < 3; ++k) clouds[4][3 * i + k] = clouds[4][3 * (i / 3) + k];
  }
  return clouds;
}

double Squared(const double* p, const double* q) {
  const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
  return x * x + y * y + z * z;
}

/// All points by distance from the query, of equal ones the first before.
std::vector<std::pair<double, std::int32_t>> Sorted(const Numbers& points, const double* query) {
  std::vector<std::pair<double, std::int32_t>> all;
  for (std::size_t i = 0; 3 * i < points.size(); ++i) {
    all.emplace_back(Squared(&points[3 * i], query), static_cast<std::int32_t>(i));
  }
  std::sort(all.begin(), all.end());
  return all;
}

void TestKdTree() {
  for (const std::size_t n : {1, 2, 17, 300}) {
    for (const Numbers& points : HardClouds(n)) {
      const KdTree tree(points.data(), n);
      Numbers queries = points;
      for (const double x : {1e300, -1e160, 0.3}) queries.insert(queries.end(), {x, 0.1, -x});
      const std::size_t m = queries.size() / 3;
      constexpr int kNeighbors = 5;
      std::vector<std::int32_t> indices(m * kNeighbors), other(m * kNeighbors);
      Numbers squares(m * kNeighbors);
      tree.NearestBatch(queries.data(), m, kNeighbors, kInfinity, 1, indices.data(),
                        squares.data());
      const KdTree::Neighbors within = tree.WithinRadiusBatch(queries.data(), m, 0.5, 1);
      std::size_t at = 0;
      bool nearest = true, all_within = true;
      for (std::size_t i = 0; i < m; ++i) {
        const auto sorted = Sorted(points, &queries[3 * i]);
        for (std::size_t k = 0; k < kNeighbors; ++k) {
          nearest &= indices[i * kNeighbors + k] == (k < n ? sorted[k].second : -1);
        }
        std::size_t count = 0;
        while (count < n && sorted[count].first <= 0.25) ++count;
        all_within &= within.counts[i] == static_cast<std::int32_t>(count);
        for (std::size_t k = 0; k < count && all_within; ++k) {
          all_within &= within.indices[at + k] == sorted[k].second;
        }
        at += count;
      }
      Check(nearest, "nearest are those of brute force");
      Check(all_within, "within the radius are those of brute force");
      tree.NearestBatch(queries.data(), m, kNeighbors, kInfinity, 3, other.data(), squares.data());
      Check(indices == other, "threads do not change neighbours");
    }
  }
  const double query[3] = {0, 0, 0};
  std::int32_t index = 0;
  double squared = 0;
  KdTree(nullptr, 0).NearestBatch(query, 1, 1, kInfinity, 1, &index, &squared);
  Check(index == -1 && squared == kInfinity, "nothing is near in an empty tree");
  CheckThrows("points", [&] { KdTree(&kNaN, 1); });
  CheckThrows("k", [&] { KdTree(query, 1).NearestBatch(query, 1, 0, 1, 1, &index, &squared); });
}

void TestVoxelHash() {
  const Numbers points = Uniform(900, 1), queries = Uniform(600, 1.2, 0, 2);
  VoxelHash voxels(0.2);
  voxels.Insert(points.data(), 100);
  voxels.Insert(points.data() + 300, 200);
  bool same = true;
  for (std::size_t i = 0; i < 200; ++i) {
    const auto [squared, index] = Sorted(points, &queries[3 * i])[0];
    double found = 0;
    same &= voxels.Nearest(&queries[3 * i], &found) == (squared <= 0.2 * 0.2 ? index : -1);
  }
  Check(same, "the nearest in voxels is that of brute force");
  const double far[3] = {1e300, 0, 0};
  double found = 0;
  Check(voxels.Nearest(far, &found) == -1, "nothing is near far away");
  CheckThrows("points", [&] { voxels.Insert(far, 1); });
  CheckThrows("max_distance", [] { VoxelHash(0); });
}

void TestNormals() {
  // On a tilted plane, each has its normal, however far off the cloud is.
  for (const double offset : {0.0, 1e5}) {
    Numbers points = Uniform(3 * 400, 0.05, offset);
    for (std::size_t i = 0; i < 400; ++i) {
      points[3 * i + 2] = 0.75 * points[3 * i] - 0.5 * points[3 * i + 1];
    }
    Numbers normals(1200), others(1200), variation(400);
    const double length = std::sqrt(0.75 * 0.75 + 0.25 + 1);
    for (int method = 0; method < 2; ++method) {
      const auto estimate = [&](int num_threads, Numbers* to) {
        if (method == 0) {
          NormalsWithinRadius(points.data(), 400, 0.02, num_threads, to->data(), variation.data());
        } else {
          NormalsOfNearest(points.data(), 400, 12, num_threads, to->data(), variation.data());
        }
      };
      estimate(1, &normals);
      estimate(3, &others);
      bool good = true;
      for (std::size_t i = 0; i < 400; ++i) {
        const double* const n = &normals[3 * i];
        const double cosine = (-0.75 * n[0] + 0.5 * n[1] + n[2]) / length;
        good &= cosine > 1 - 1e-5 && std::abs(variation[i]) < 1e-5;
      }
      Check(good, "normals of a plane");
      Check(normals == others, "threads do not change normals");
    }
  }
  // Zero where there is no plane.
  for (const std::size_t n : {1, 2, 40}) {
    for (const Numbers& points : {HardClouds(n)[1], HardClouds(n)[2]}) {
      Numbers normals(3 * n, 7), variation(n);
      NormalsWithinRadius(points.data(), n, 0.5, 1, normals.data(), variation.data());
      Check(normals == Numbers(3 * n, 0), "no normals within a radius on a line");
      NormalsOfNearest(points.data(), n, 5, 1, normals.data(), variation.data());
      Check(normals == Numbers(3 * n, 0), "no normals of neighbours on a line");
    }
  }
  const double far[6] = {0, 0, 0, 1e9, 0, 0};
  Numbers out(6);
  NormalsWithinRadius(nullptr, 0, 1, 1, nullptr, nullptr);
  CheckThrows("radius", [&] { NormalsWithinRadius(far, 2, 1e-3, 1, out.data(), out.data()); });
  CheckThrows("radius", [&] { NormalsWithinRadius(far, 2, kNaN, 1, out.data(), out.data()); });
  CheckThrows("points", [&] { NormalsWithinRadius(&kNaN, 1, 1, 1, out.data(), out.data()); });
  CheckThrows("num_threads", [&] { NormalsWithinRadius(far, 2, 1e5, 0, out.data(), out.data()); });

#ifdef __x86_64__
  internal::CovarianceBlock block{};
  const Numbers rows = Uniform(5 * internal::kCovarianceLanes, 1);
  for (std::size_t lane = 0; lane < internal::kCovarianceLanes; ++lane) {
    const double a = rows[5 * lane], b = rows[5 * lane + 1], c = rows[5 * lane + 2];
    block.xx[lane] = a * a + 0.1, block.yy[lane] = b * b + 0.2, block.zz[lane] = c * c + 0.05;
    block.xy[lane] = a * b, block.xz[lane] = a * c, block.yz[lane] = b * c;
  }
  internal::CovarianceBlock base = block;
  internal::baseline::kNormalsKernel.solve(&base);
  for (const SimdLevel level : AvailableSimdLevels()) {
    internal::CovarianceBlock other = block;
    if (level == SimdLevel::kAvx2) internal::avx2::kNormalsKernel.solve(&other);
    if (level == SimdLevel::kAvx512) internal::avx512::kNormalsKernel.solve(&other);
    if (level == SimdLevel::kBaseline) internal::baseline::kNormalsKernel.solve(&other);
    Check(std::memcmp(&base, &other, sizeof(base)) == 0, "levels agree on eigenvectors");
  }
#endif
}

/// A cube with corners at ±1, outward.
struct Cube {
  Numbers vertices;
  std::vector<std::int32_t> triangles;
  Cube() {
    for (int i = 0; i < 8; ++i) {
      for (const int bit : {1, 2, 4}) vertices.push_back(i & bit ? 1 : -1);
    }
    const int quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                             {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (const auto& q : quads) {
      for (const int k : {0, 1, 2, 0, 2, 3}) triangles.push_back(q[k]);
    }
  }
};

void TestSurface() {
  const Cube cube;
  const MeshSurface surface(cube.vertices.data(), 8, cube.triangles.data(), 12);
  Check(surface.is_closed() && surface.num_pieces() == 1, "a cube is closed");
  const Numbers queries = Uniform(900, 2);
  Numbers distances(300), others(300);
  surface.SignedDistanceBatch(queries.data(), 300, 1, distances.data());
  surface.SignedDistanceBatch(queries.data(), 300, 3, others.data());
  Check(distances == others, "threads do not change distances");
  bool good = true, winding = true;
  for (std::size_t i = 0; i < 300; ++i) {
    double outside = 0, most = -kInfinity;
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = std::abs(queries[3 * i + k]) - 1;
      outside += x > 0 ? x * x : 0;
      most = std::max(most, x);
    }
    const double expected = outside > 0 ? std::sqrt(outside) : most;
    good &= std::abs(distances[i] - expected) < 1e-12;
    const double number = surface.WindingNumber(Eigen::Map<const Eigen::Vector3d>(&queries[3 * i]));
    winding &= std::abs(number - (expected < 0)) < 0.1;
  }
  Check(good, "distances from a cube");
  Check(winding, "winding numbers of a cube");
  // Triangles that are lines or points have no inside, and still a nearest
  // point.
  const double line[9] = {0, 0, 0, 1, 0, 0, 3, 0, 0};
  const std::int32_t flat[6] = {0, 1, 2, 1, 1, 1};
  const SurfacePoint nearest = MeshSurface(line, 3, flat, 2).Nearest({2, 1, 0});
  Check(std::abs(nearest.squared_distance - 1) < 1e-12, "nearest point of a line");
  const std::int32_t wrong[3] = {0, 1, 3};
  CheckThrows("triangles", [&] { MeshSurface(line, 3, wrong, 1); });
  CheckThrows("triangles", [&] { MeshSurface(line, 3, flat, 0); });
  CheckThrows("vertices", [&] { MeshSurface(&kNaN, 1, flat, 1); });
}

void TestRegions() {
  // Three blobs, one of them too small; far blobs do not touch.
  Numbers points = Uniform(300, 0.05);
  for (const double at : {1.0, 2.0}) {
    const Numbers blob = Uniform(at == 1.0 ? 240 : 30, 0.05, at, 3);
    points.insert(points.end(), blob.begin(), blob.end());
  }
  const std::size_t n = points.size() / 3;
  const auto labels = EuclideanClusters(points.data(), n, 0.1, 20);
  bool good = true;
  for (std::size_t i = 0; i < n; ++i) good &= labels[i] == (i < 100 ? 0 : i < 180 ? 1 : -1);
  Check(good, "clusters are the blobs");
  Check(EuclideanClusters(nullptr, 0, 0.1, 1).empty(), "no point, no cluster");
  CheckThrows("points", [&] { EuclideanClusters(&kNaN, 1, 0.1, 1); });
  CheckThrows("tolerance", [&] { EuclideanClusters(points.data(), n, 1e-9, 1); });
  CheckThrows("tolerance", [&] { EuclideanClusters(points.data(), n, 0, 1); });

  // A plane with outliers.
  Numbers plane = Uniform(3 * 400, 1);
  for (std::size_t i = 0; i < 300; ++i) plane[3 * i + 2] = 0.5 + 0.1 * plane[3 * i];
  const PlaneResult result = RansacPlane(plane.data(), 400, {.max_distance = 1e-6});
  Check(result.found && std::abs(result.plane.normal[1]) < 1e-9 &&
            std::abs(std::abs(result.plane.offset) - 0.5 / std::sqrt(1.01)) < 1e-9,
        "the plane is found");
  Check(std::count(result.inliers.begin(), result.inliers.begin() + 300, 1) == 300, "all of it");
  for (const std::size_t few : {0, 1, 2, 3}) {
    Check(!RansacPlane(points.data(), few, {}).found || few == 3, "too few points for a plane");
  }
  Check(!RansacPlane(HardClouds(50)[2].data(), 50, {.max_iterations = 100}).found,
        "no plane on a line");
  CheckThrows("points", [&] { RansacPlane(&kNaN, 1, {}); });

  // Pieces of dense clouds must not take all memory.
  const Numbers dense(3 * 20000, 0.5), up(3 * 20000, 1);
  std::vector<Plane> planes;
  CheckThrows("radius", [&] { GrowPlanes(dense.data(), up.data(), 20000, {}, &planes); });
  CheckThrows("voxel_size", [&] { ConvexSegments(dense.data(), up.data(), 20000, {}); });
  const std::vector<std::int64_t> zeros(1);
  CheckThrows("num_labels", [&] {
    RestingPairs(dense.data(), up.data(), zeros.data(), 1, 1, std::size_t{1} << 32);
  });
  CheckThrows("labels", [&] { RestingPairs(dense.data(), up.data(), zeros.data(), 1, 1, 0); });

  // Two level plates, one above the other: two planes; the smaller one is
  // second.
  Numbers plates, normals;
  for (int i = 0; i < 40 * 40; ++i) {
    const int x = i % 40, y = i / 40;
    plates.insert(plates.end(), {0.005 * x + 0.002, 0.005 * y + 0.002, x < 25 ? 0.0 : 0.1});
    normals.insert(normals.end(), {0, 0, 1});
  }
  const auto pieces = GrowPlanes(plates.data(), normals.data(), 1600, {}, &planes);
  Check(planes.size() == 2 && std::abs(planes[1].offset - 0.1) < 1e-9, "two plates");
  const auto segments = ConvexSegments(plates.data(), normals.data(), 1600, {});
  bool same = true;
  for (std::size_t i = 0; i < 1600; ++i) {
    const std::int64_t expected = i % 40 < 25 ? 0 : 1;
    same &= pieces[i] == expected && segments[i] == expected;
  }
  Check(same, "each point is of its plate");
}

void TestSampling() {
  for (const Numbers& points : HardClouds(60)) {
    std::vector<std::int32_t> indices(60);
    Numbers distances(60);
    FarthestPoints(points.data(), 60, 60, 7, indices.data(), distances.data());
    std::vector<std::int32_t> sorted = indices;
    std::sort(sorted.begin(), sorted.end());
    bool each = indices[0] == 7;
    for (int i = 0; i < 60; ++i) each &= sorted[static_cast<std::size_t>(i)] == i;
    Check(each, "each point is chosen once");
    Check(std::is_sorted(distances.rbegin(), distances.rend()), "farthest first");
    const auto kept = KeepApart(points.data(), 60, 0.3);
    bool apart = true, covered = true;
    for (std::size_t i = 0; i < 60; ++i) {
      double least = kInfinity;
      for (const std::int32_t k : kept) {
        const double squared = Squared(&points[3 * i], &points[3 * static_cast<std::size_t>(k)]);
        least = std::min(least, squared);
        const bool self = static_cast<std::size_t>(k) == i;
        apart &= self || std::find(kept.begin(), kept.end(), i) == kept.end() || squared >= 0.09;
      }
      covered &= least < 0.09;
    }
    Check(apart && covered, "kept apart, and near to all others");
    Check(EliminateSamples(points.data(), 60, 20, 0.3).size() == 20, "as many as were asked for");
  }
  std::int32_t index = 0;
  double distance = 0;
  CheckThrows("count", [&] { FarthestPoints(nullptr, 0, 1, 0, &index, &distance); });
  CheckThrows("points", [&] { KeepApart(&kNaN, 1, 1); });
}

void TestCrop() {
  const Numbers points = Uniform(300, 1);
  const double X_BW[16] = {0, 1, 0, 0.1, -1, 0, 0, 0, 0, 0, 1, -0.2, 0, 0, 0, 1};
  const double size[3] = {1, 0.5, 2};
  std::vector<std::uint8_t> mask(101);
  InsideBox(points.data(), 100, X_BW, size, mask.data());
  bool good = true;
  for (std::size_t i = 0; i < 100; ++i) {
    const double x = points[3 * i + 1] + 0.1, y = -points[3 * i], z = points[3 * i + 2] - 0.2;
    good &= mask[i] == (std::abs(x) <= 0.5 && std::abs(y) <= 0.25 && std::abs(z) <= 1);
  }
  Check(good, "inside the box");
  const double bad[9] = {kNaN, 0, 0, 0, kInfinity, 0, 0, 0, 1e308};
  InsideBox(bad, 3, X_BW, size, mask.data());
  Check(mask[0] + mask[1] + mask[2] == 0, "nowhere is not inside");
  const double down[3] = {0, 0, -1};
  InsideHalfSpace(bad, 3, down, -1e300, mask.data());
  Check(mask[0] == 0 && mask[2] == 0, "nor in a half-space");
}

/// A camera above a level table at z = 0, and a box on it.
struct Scene {
  static constexpr int kWidth = 67, kHeight = 41;
  std::vector<float> depth;
  std::vector<std::uint8_t> colors;
  DepthImageView view;
  Scene() : depth(kWidth * kHeight, 0.5f), colors(3 * kWidth * kHeight, 100) {
    for (int v = 10; v < 30; ++v) {
      for (int u = 20; u < 40; ++u) depth[static_cast<std::size_t>(v * kWidth + u)] = 0.45f;
    }
    depth[5] = std::numeric_limits<float>::quiet_NaN();
    depth[6] = std::numeric_limits<float>::infinity();
    depth[7] = -1;
    view.width = kWidth;
    view.height = kHeight;
    view.depth = depth.data();
    view.fx = view.fy = 60;
    view.cx = 33;
    view.cy = 20;
    view.X_WC << 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0.5, 0, 0, 0, 1;
    view.colors = colors.data();
  }
};

void TestFusion() {
  const Scene scene;
  const std::vector<DepthImageView> views(2, scene.view);
  const Eigen::Vector3d size(0.6, 0.4, 0.2);
  for (const int window : {3, 5, 17}) {
    DepthOptions options{.window = window};
    const FusedCloud cloud =
        FuseDepthViews(views, Eigen::Matrix4d::Identity(), size, 0.01, options);
    const std::size_t n = cloud.points.size() / 3;
    Check(n > 100 && cloud.colors.size() == 3 * n, "table and box are seen");
    bool good = true;
    for (std::size_t i = 0; i < n; ++i) {
      const double z = cloud.points[3 * i + 2];
      good &= (std::abs(z) < 1e-6 || std::abs(z - 0.05) < 1e-6) && cloud.colors[3 * i] == 100;
      good &= cloud.normals[3 * i + 2] > 0.999 && cloud.sensor_origins[3 * i + 2] == 0.5;
    }
    Check(good, "where they are, normals up");
    for (const SimdLevel level : AvailableSimdLevels()) {
      for (const int num_threads : {1, 3}) {
        for (const double noise : {0.0, 0.001}) {
          DepthOptions other = options;
          other.noise_constant = noise;
          const auto fuse = [&] {
            return FuseDepthViews(views, Eigen::Matrix4d::Identity(), size, 0.01, other);
          };
          const FusedCloud expected = fuse();
          other.simd = level;
          other.num_threads = num_threads;
          const FusedCloud again = fuse();
          Check(again.points == expected.points && again.normals == expected.normals,
                "levels and threads do not change the cloud");
        }
      }
    }
  }
  // From so far off that single precision cannot tell voxels from each other.
  DepthImageView far = scene.view;
  far.scale = 2e5;
  for (const double height : {1e5, 1e5 + 0.003}) {
    far.X_WC(2, 3) = height;
    FuseDepthViews({&far, 1}, Eigen::Matrix4d::Identity(), {0.1, 0.1, 0.1}, 1e-6,
                   {.max_depth = 1e6});
  }
  Numbers points(3 * Scene::kWidth * Scene::kHeight), normals(points.size());
  UnprojectDepth(scene.view, {}, points.data());
  Check(std::isnan(points[15]) && points[2] == 0.5f, "points where there is a measurement");
  DepthNormals(scene.view, {.num_threads = 2}, normals.data());
  Check(normals[normals.size() / 2 / 3 * 3 + 2] < -0.999, "normals toward the camera");
  const Eigen::Matrix4d I = Eigen::Matrix4d::Identity();
  CheckThrows("voxel_size", [&] { FuseDepthViews(views, I, size, 1e-12); });
  CheckThrows("voxel_size", [&] { FuseDepthViews(views, I, size, kNaN); });
  CheckThrows("size", [&] { FuseDepthViews(views, I, {1, kInfinity, 1}, 0.01); });
  CheckThrows("X_WB", [&] { FuseDepthViews(views, kNaN * I, size, 0.01); });
  CheckThrows("views", [&] { FuseDepthViews({}, I, size, 0.01); });
  CheckThrows("depth", [&] { FuseDepthViews({{DepthImageView{}}}, I, size, 0.01); });
  CheckThrows("window", [&] { FuseDepthViews(views, I, size, 0.01, {.window = 4}); });
}

void TestVolumes() {
  const Scene scene;
  constexpr int kSize = 32;
  std::vector<float> distances(kSize * kSize * kSize), weights(distances.size());
  VolumeView volume{kSize, kSize, kSize, 0.01, distances.data(), weights.data()};
  IntegrateDepth(scene.view, Eigen::Matrix4d::Identity(), 0.03, {}, volume);
  bool good = true;
  int known = 0;
  for (int k = 0; k < kSize; ++k) {
    // Over the table, beside the box.
    const std::size_t at = (static_cast<std::size_t>(24) * kSize + 16) * kSize + k;
    const double z = 0.01 * (k + 0.5 - 0.5 * kSize);
    if (weights[at] == 0) continue;
    ++known;
    good &= std::abs(distances[at] - std::clamp(z, -0.03, 0.03)) < 1e-3;
  }
  Check(good && known > 10, "distances above a table");
  std::vector<float> other(distances.size()), other_weights(distances.size());
  VolumeView again{kSize, kSize, kSize, 0.01, other.data(), other_weights.data()};
  IntegrateDepth(scene.view, Eigen::Matrix4d::Identity(), 0.03, {.num_threads = 3}, again);
  Check(other == distances && other_weights == weights, "threads do not change the volume");
  const auto integrate = [&](double truncation) {
    IntegrateDepth(scene.view, Eigen::Matrix4d::Identity(), truncation, {}, volume);
  };
  CheckThrows("truncation", [&] { integrate(kNaN); });
  CheckThrows("depth", [&] { IntegrateDepth({}, Eigen::Matrix4d::Identity(), 0.03, {}, volume); });
  volume.voxel_size = 0;
  CheckThrows("voxel_size", [&] { integrate(0.03); });
}

}  // namespace
}  // namespace prehensile

int main() {
  using namespace prehensile;
  TestKdTree();
  TestVoxelHash();
  TestNormals();
  TestSurface();
  TestRegions();
  TestSampling();
  TestCrop();
  TestFusion();
  TestVolumes();
  return failures;
}
