#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

#include "cell_grid.h"
#include "prehensile/regions.h"
#include "split_mix.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::CellGrid;
using internal::Require;
using Vector = Eigen::Vector3d;

/// Sums of points about an origin, from which planes are fitted.
struct Moments {
  Vector origin = Vector::Zero();
  double count = 0;
  Vector sum = Vector::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();

  void Add(const double* point) {
    const Vector p = Eigen::Map<const Vector>(point) - origin;
    count += 1;
    sum += p;
    squares += p * p.transpose();
  }

  /// The plane of least squares; false if the points lie on a line.
  bool Fit(Plane* plane) const {
    const Vector mean = sum / count;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(squares / count -
                                                               mean * mean.transpose());
    if (!(eigen.eigenvalues()[1] > 1e-10 * eigen.eigenvalues()[2])) return false;
    const Vector normal = eigen.eigenvectors().col(0);
    Eigen::Map<Vector>(plane->normal) = normal;
    plane->offset = normal.dot(mean + origin);
    return true;
  }
};

}  // namespace

PlaneResult RansacPlane(const double* points, std::size_t n, const RansacPlaneOptions& options) {
  Require(options.max_distance > 0 && std::isfinite(options.max_distance),
          "max_distance: must be positive and finite");
  Require(options.confidence > 0 && options.confidence < 1, "confidence: must lie in (0, 1)");
  Require(options.max_iterations > 0, "max_iterations: must be at least 1");
  Require(n < (std::size_t{1} << 30), "points: too many, 2^30 or more");
  for (std::size_t i = 0; i < 3 * n; ++i) Require(std::isfinite(points[i]), "points: not finite");
  PlaneResult result;
  result.inliers.assign(n, 0);
  if (n < 3) return result;

  // One array per coordinate, for the loop over all points.
  std::vector<double> x(n), y(n), z(n);
  for (std::size_t i = 0; i < n; ++i) {
    x[i] = points[3 * i];
    y[i] = points[3 * i + 1];
    z[i] = points[3 * i + 2];
  }
  const auto count = [&](const Plane& plane) {
    const auto [a, b, c] = plane.normal;
    std::int64_t inside = 0;
    for (std::size_t i = 0; i < n; ++i) {
      inside += std::abs(a * x[i] + b * y[i] + c * z[i] - plane.offset) <= options.max_distance;
    }
    return inside;
  };
  internal::SplitMix random(options.seed);
  const auto any = [&] {
    return Eigen::Map<const Vector>(points + std::ptrdiff_t{3} * random.Below(static_cast<int>(n)));
  };
  std::int64_t best = 0;
  double needed = options.max_iterations;
  while (result.iterations < needed) {
    ++result.iterations;
    const Vector p0 = any();
    const Vector p1 = any();
    const Vector p2 = any();
    const Vector across = (p1 - p0).cross(p2 - p0);
    const double area = across.norm();
    if (!(area > 1e-9 * (p1 - p0).norm() * (p2 - p0).norm())) continue;
    Plane plane;
    Eigen::Map<Vector>(plane.normal) = across / area;
    plane.offset = across.dot(p0) / area;
    const std::int64_t inside = count(plane);
    if (inside <= best) continue;
    best = inside;
    result.plane = plane;
    result.found = true;
    const double share = static_cast<double>(inside) / static_cast<double>(n);
    const double missed = 1.0 - share * share * share;
    needed = missed <= 0 ? 0
                         : std::min<double>(options.max_iterations,
                                            std::log(1 - options.confidence) / std::log(missed));
  }
  if (!result.found) return result;
  // Fitted to its inliers, until those stay the same. (It may lose a few; a fit that loses many
  // follows something else.)
  for (int round = 0; round < 10; ++round) {
    Moments moments{.origin = Eigen::Map<const Vector>(result.plane.normal) * result.plane.offset};
    for (std::size_t i = 0; i < n; ++i) {
      const double height = result.plane.normal[0] * x[i] + result.plane.normal[1] * y[i] +
                            result.plane.normal[2] * z[i] - result.plane.offset;
      if (std::abs(height) <= options.max_distance) moments.Add(points + 3 * i);
    }
    Plane fitted;
    if (!moments.Fit(&fitted)) break;
    const std::int64_t inside = count(fitted);
    if (inside < best - best / 10) break;
    const Vector before = Eigen::Map<const Vector>(result.plane.normal);
    const bool settled = before.cross(Eigen::Map<const Vector>(fitted.normal)).norm() < 1e-12;
    result.plane = fitted;
    if (settled) break;
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double height = result.plane.normal[0] * x[i] + result.plane.normal[1] * y[i] +
                          result.plane.normal[2] * z[i] - result.plane.offset;
    result.inliers[i] = std::abs(height) <= options.max_distance;
  }
  return result;
}

std::vector<std::int64_t> GrowPlanes(const double* points, const double* normals, std::size_t n,
                                     const PlaneRegionsOptions& options,
                                     std::vector<Plane>* planes) {
  Require(options.max_distance > 0, "max_distance: must be positive");
  Require(options.max_angle > 0, "max_angle: must be positive");
  const CellGrid grid(points, n, options.radius, "radius");
  grid.RequireFewPairs("radius");
  const double limit = options.radius * options.radius;
  std::vector<std::uint32_t> start(n + 1, 0), neighbors;
  {
    const auto near = [&](std::uint32_t i, std::uint32_t j) {
      return (Eigen::Map<const Vector>(points + 3 * i) - Eigen::Map<const Vector>(points + 3 * j))
                 .squaredNorm() <= limit;
    };
    grid.ForEachAdjacentPair([&](std::uint32_t i, std::uint32_t j) {
      if (near(i, j)) {
        ++start[i];
        ++start[j];
      }
    });
    std::size_t total = 0;
    for (std::uint32_t& s : start) {
      const std::uint32_t count = s;
      s = static_cast<std::uint32_t>(total);
      total += count;
    }
    neighbors.resize(total);
    std::vector<std::uint32_t> fill(start.begin(), start.end() - 1);
    grid.ForEachAdjacentPair([&](std::uint32_t i, std::uint32_t j) {
      if (near(i, j)) {
        neighbors[fill[i]++] = j;
        neighbors[fill[j]++] = i;
      }
    });
  }
  const auto normal = [&](std::size_t i) { return Eigen::Map<const Vector>(normals + 3 * i); };

  // The flattest points first: those whose neighbours' normals agree with theirs.
  std::vector<double> bend(n, 2.0);
  for (std::size_t i = 0; i < n; ++i) {
    if (start[i + 1] == start[i]) continue;
    double sum = 0;
    for (std::uint32_t k = start[i]; k < start[i + 1]; ++k) {
      sum += 1.0 - normal(i).dot(normal(neighbors[k]));
    }
    bend[i] = sum / (start[i + 1] - start[i]);
  }
  std::vector<std::uint32_t> seeds(n);
  std::iota(seeds.begin(), seeds.end(), 0u);
  std::stable_sort(seeds.begin(), seeds.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return bend[a] < bend[b]; });

  constexpr std::int64_t kNone = -1;
  std::vector<std::int64_t> region_of(n, kNone);
  std::vector<std::uint8_t> tried(n, 0);
  struct Region {
    Plane plane;
    std::size_t count;
  };
  std::vector<Region> regions;
  std::vector<std::uint32_t> members;
  const double min_cosine = std::cos(options.max_angle);
  for (const std::uint32_t seed : seeds) {
    if (region_of[seed] != kNone || tried[seed]) continue;
    tried[seed] = 1;
    const std::int64_t id = static_cast<std::int64_t>(regions.size());
    Vector plane_normal = normal(seed);
    if (!(plane_normal.squaredNorm() > 0.25)) continue;  // No normal here.
    double offset = plane_normal.dot(Eigen::Map<const Vector>(points + 3 * seed));
    Moments moments{.origin = Eigen::Map<const Vector>(points + 3 * seed)};
    std::size_t fit_at = 12;
    members.assign(1, seed);
    region_of[seed] = id;
    moments.Add(points + 3 * seed);
    for (std::size_t m = 0; m < members.size(); ++m) {
      for (std::uint32_t k = start[members[m]]; k < start[members[m] + 1]; ++k) {
        const std::uint32_t j = neighbors[k];
        if (region_of[j] != kNone || normal(j).dot(plane_normal) < min_cosine) continue;
        const double height = plane_normal.dot(Eigen::Map<const Vector>(points + 3 * j)) - offset;
        if (std::abs(height) > options.max_distance) continue;
        region_of[j] = id;
        members.push_back(j);
        moments.Add(points + 3 * j);
        Plane fitted;
        if (members.size() >= fit_at && moments.Fit(&fitted)) {
          const double sign = Eigen::Map<Vector>(fitted.normal).dot(plane_normal) < 0 ? -1 : 1;
          plane_normal = sign * Eigen::Map<Vector>(fitted.normal);
          offset = sign * fitted.offset;
          fit_at = members.size() + members.size() / 2;
        }
      }
    }
    if (members.size() < std::max<std::size_t>(options.min_points, 1)) {
      for (const std::uint32_t i : members) region_of[i] = kNone;
      continue;
    }
    Plane plane;
    Eigen::Map<Vector>(plane.normal) = plane_normal;
    plane.offset = offset;
    if (Plane fitted; moments.Fit(&fitted)) {
      const double sign = Eigen::Map<Vector>(fitted.normal).dot(plane_normal) < 0 ? -1 : 1;
      Eigen::Map<Vector>(plane.normal) = sign * Eigen::Map<Vector>(fitted.normal);
      plane.offset = sign * fitted.offset;
    }
    regions.push_back({plane, members.size()});
  }
  std::vector<std::size_t> order(regions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return regions[a].count > regions[b].count;
  });
  std::vector<std::int64_t> rank(regions.size());
  planes->clear();
  for (std::size_t k = 0; k < order.size(); ++k) {
    rank[order[k]] = static_cast<std::int64_t>(k);
    planes->push_back(regions[order[k]].plane);
  }
  for (std::int64_t& r : region_of) r = r < 0 ? -1 : rank[r];
  return region_of;
}

}  // namespace prehensile
