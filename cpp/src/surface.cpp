#include "prehensile/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kLeaf = 4;  // Most triangles in a leaf.
/// How many radii away a node counts as a dipole.
constexpr double kFar = 3;

std::uint64_t EdgeKey(std::int32_t a, std::int32_t b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
         static_cast<std::uint64_t>(std::max(a, b));
}

Vector3d UnitOrZero(const Vector3d& v) {
  const double norm = v.norm();
  return norm > 0 && std::isfinite(norm) ? Vector3d(v / norm) : Vector3d::Zero();
}

/// Place of the point of a segment from a along ab that is nearest to the query, 0 to 1.
double ClosestOnSegment(const Vector3d& a, const Vector3d& ab, const Vector3d& query) {
  const double squared = ab.squaredNorm();
  return squared > 0 ? internal::Clamped(ab.dot(query - a) / squared, 0, 1) : 0;
}

/// Solid angle of a triangle seen from the origin (van Oosterom and Strackee, 1983); 0 from its
/// plane, and so also from within it, where it is the mean of both sides.
double SolidAngle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double y = a.dot(b.cross(c));
  if (y == 0) return 0;
  const double x = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  return 2 * std::atan2(y, x);
}

}  // namespace

MeshSurface::MeshSurface(const double* vertices, std::size_t num_vertices,
                         const std::int32_t* triangles, std::size_t num_triangles)
    : num_triangles_(num_triangles) {
  constexpr std::size_t kMost = std::size_t{1} << 30;
  internal::Require(num_triangles > 0, "triangles: there are none");
  internal::Require(num_triangles < kMost, "triangles: more than 2^30 rows");
  internal::Require(num_vertices < kMost, "vertices: more than 2^30 rows");
  for (std::size_t i = 0; i < 3 * num_vertices; ++i) {
    if (!(std::abs(vertices[i]) <= 1e70)) {
      throw std::invalid_argument("vertices: row " + std::to_string(i / 3) +
                                  " is not finite, or beyond 1e70");
    }
  }
  JoinVertices(vertices, num_vertices);
  triangles_.resize(num_triangles);
  for (std::size_t i = 0; i < num_triangles; ++i) {
    Triangle& triangle = triangles_[i];
    Vector3d p[3];
    for (int k = 0; k < 3; ++k) {
      const std::int32_t v = triangles[3 * i + k];
      if (v < 0 || static_cast<std::size_t>(v) >= num_vertices) {
        throw std::invalid_argument("triangles: row " + std::to_string(i) +
                                    " names a vertex that does not exist");
      }
      p[k] = Eigen::Map<const Vector3d>(vertices + 3 * static_cast<std::size_t>(v));
      triangle.vertices[k] = joined_[v];
    }
    triangle.number = static_cast<std::int32_t>(i);
    triangle.a = p[0];
    triangle.ab = p[1] - p[0];
    triangle.ac = p[2] - p[0];
    // What is thinner than 1e-10 of its length is a line, and has no normal but rounding errors.
    const Vector3d cross = triangle.ab.cross(triangle.ac);
    const double longest = std::max(
        {triangle.ab.squaredNorm(), triangle.ac.squaredNorm(), (p[2] - p[1]).squaredNorm()});
    triangle.normal = cross.norm() > 1e-10 * longest ? UnitOrZero(cross) : Vector3d::Zero();
  }
  FindNormals();
  while ((num_triangles >> depth_) > kLeaf) ++depth_;
  const std::size_t num_leaves = std::size_t{1} << depth_;
  nodes_.resize(2 * num_leaves);
  Build(1, 0, num_leaves);
}

void MeshSurface::JoinVertices(const double* vertices, std::size_t num_vertices) {
  std::vector<std::int32_t> order(num_vertices);
  std::iota(order.begin(), order.end(), 0);
  const auto at = [&](std::int32_t v) { return vertices + 3 * static_cast<std::size_t>(v); };
  const auto compare = [&](std::int32_t a, std::int32_t b) {
    const double *const p = at(a), *const q = at(b);
    for (int k = 0; k < 3; ++k) {
      if (p[k] != q[k]) return p[k] < q[k];
    }
    return a < b;
  };
  std::sort(order.begin(), order.end(), compare);
  joined_.resize(num_vertices);
  for (std::size_t i = 0; i < num_vertices; ++i) {
    const bool same = i > 0 && std::equal(at(order[i]), at(order[i]) + 3, at(order[i - 1]));
    joined_[order[i]] = same ? joined_[order[i - 1]] : order[i];
  }
}

void MeshSurface::FindNormals() {
  vertex_normals_.assign(joined_.size(), Vector3d::Zero());
  struct Half {
    std::uint64_t key;
    int direction;
    std::int32_t triangle;
  };
  std::vector<Half> halves;
  halves.reserve(3 * num_triangles_);
  std::vector<std::int32_t> piece(joined_.size());  // A forest: the parent of each vertex.
  std::iota(piece.begin(), piece.end(), 0);
  const auto root = [&](std::int32_t v) {
    while (piece[v] != v) v = piece[v] = piece[piece[v]];
    return v;
  };
  for (const Triangle& triangle : triangles_) {
    const std::int32_t* const v = triangle.vertices;
    piece[root(v[1])] = root(v[0]);
    piece[root(v[2])] = root(v[0]);
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    const Vector3d bc = triangle.ac - triangle.ab;
    const Vector3d sides[3][2] = {
        {triangle.ab, triangle.ac}, {bc, -triangle.ab}, {-triangle.ac, -bc}};
    for (int k = 0; k < 3; ++k) {
      const double angle =
          std::atan2(sides[k][0].cross(sides[k][1]).norm(), sides[k][0].dot(sides[k][1]));
      vertex_normals_[v[k]] += angle * triangle.normal;
      const std::int32_t next = v[(k + 1) % 3];
      halves.push_back({EdgeKey(v[k], next), v[k] < next ? 1 : -1, triangle.number});
    }
  }
  for (Vector3d& normal : vertex_normals_) normal = UnitOrZero(normal);
  std::vector<char> used(joined_.size(), 0);
  for (const Triangle& triangle : triangles_) used[root(triangle.vertices[0])] = 1;
  num_pieces_ = static_cast<int>(std::count(used.begin(), used.end(), 1));

  std::sort(halves.begin(), halves.end(), [](const Half& a, const Half& b) {
    return a.key != b.key ? a.key < b.key : a.triangle < b.triangle;
  });
  closed_ = !halves.empty();
  for (std::size_t i = 0; i < halves.size();) {
    EdgeNormal edge{halves[i].key, Vector3d::Zero()};
    int balance = 0;
    for (; i < halves.size() && halves[i].key == edge.key; ++i) {
      balance += halves[i].direction;
      edge.normal += triangles_[halves[i].triangle].normal;
    }
    closed_ = closed_ && balance == 0;
    edge.normal = UnitOrZero(edge.normal);
    edge_normals_.push_back(edge);
  }
}

void MeshSurface::Build(std::size_t node_number, std::size_t first, std::size_t last) {
  const auto begin = triangles_.begin() + static_cast<std::ptrdiff_t>(Begin(first));
  const auto end = triangles_.begin() + static_cast<std::ptrdiff_t>(Begin(last));
  Node& node = nodes_[node_number];
  node.low.setConstant(internal::kInfinity);
  node.high.setConstant(-internal::kInfinity);
  node.center.setZero();
  node.area.setZero();
  Vector3d low = node.low, high = node.high;  // Of the middles of the triangles, times 3.
  const auto middle_of = [](const Triangle& t) -> Vector3d { return 3 * t.a + t.ab + t.ac; };
  double sum = 0;
  for (auto t = begin; t != end; ++t) {
    const Vector3d b = t->a + t->ab, c = t->a + t->ac, middle = middle_of(*t);
    node.low = node.low.cwiseMin(t->a).cwiseMin(b).cwiseMin(c);
    node.high = node.high.cwiseMax(t->a).cwiseMax(b).cwiseMax(c);
    low = low.cwiseMin(middle);
    high = high.cwiseMax(middle);
    const Vector3d area = 0.5 * t->ab.cross(t->ac);
    node.area += area;
    node.center += area.norm() / 3 * middle;
    sum += area.norm();
  }
  node.center = sum > 0 ? Vector3d(node.center / sum) : Vector3d(0.5 * (node.low + node.high));
  node.radius = 0;
  for (auto t = begin; t != end; ++t) {
    for (const Vector3d& p : {t->a, Vector3d(t->a + t->ab), Vector3d(t->a + t->ac)}) {
      node.radius = std::max(node.radius, (p - node.center).norm());
    }
  }
  if (last - first == 1) return;
  const std::size_t half = (first + last) / 2;
  int axis;
  (high - low).maxCoeff(&axis);
  std::nth_element(begin, triangles_.begin() + static_cast<std::ptrdiff_t>(Begin(half)), end,
                   [&](const Triangle& s, const Triangle& t) {
                     const double x = middle_of(s)[axis], y = middle_of(t)[axis];
                     return x != y ? x < y : s.number < t.number;
                   });
  Build(2 * node_number, first, half);
  Build(2 * node_number + 1, half, last);
}

double MeshSurface::BoxDistance(std::size_t node, const Vector3d& query) const {
  const Node& box = nodes_[node];
  return (box.low - query).cwiseMax(query - box.high).cwiseMax(0.0).squaredNorm();
}

MeshSurface::Feature MeshSurface::Closest(const Triangle& t, const Vector3d& query,
                                          Vector3d* barycentric) {
  if (t.normal.isZero(0)) {  // A line: the nearest of its three sides.
    const Vector3d b = t.a + t.ab, c = t.a + t.ac;
    const Vector3d starts[3] = {t.a, b, c}, sides[3] = {t.ab, c - b, -t.ac};
    double least = internal::kInfinity;
    Feature feature = Feature::kA;
    for (int k = 0; k < 3; ++k) {
      const double s = ClosestOnSegment(starts[k], sides[k], query);
      const double d = (starts[k] + s * sides[k] - query).squaredNorm();
      if (!(d < least)) continue;
      least = d;
      barycentric->setZero();
      (*barycentric)[k] = 1 - s;
      (*barycentric)[(k + 1) % 3] = s;
      const int corner = s < 1 ? k : (k + 1) % 3;
      feature = static_cast<Feature>(s > 0 && s < 1 ? static_cast<int>(Feature::kAb) + k : corner);
    }
    return feature;
  }
  // Which of the seven regions of its plane the query is above, by the signs of the products with
  // the sides (Ericson, "Real-Time Collision Detection", 5.1.5).
  const Vector3d ap = query - t.a;
  const double ab_ap = t.ab.dot(ap), ac_ap = t.ac.dot(ap);
  if (ab_ap <= 0 && ac_ap <= 0) {
    *barycentric = {1, 0, 0};
    return Feature::kA;
  }
  const Vector3d bp = ap - t.ab;
  const double ab_bp = t.ab.dot(bp), ac_bp = t.ac.dot(bp);
  if (ab_bp >= 0 && ac_bp <= ab_bp) {
    *barycentric = {0, 1, 0};
    return Feature::kB;
  }
  const Vector3d cp = ap - t.ac;
  const double ab_cp = t.ab.dot(cp), ac_cp = t.ac.dot(cp);
  if (ac_cp >= 0 && ab_cp <= ac_cp) {
    *barycentric = {0, 0, 1};
    return Feature::kC;
  }
  const double weight_c = ab_ap * ac_bp - ab_bp * ac_ap;
  if (weight_c <= 0 && ab_ap >= 0 && ab_bp <= 0 && ab_ap > ab_bp) {
    const double s = ab_ap / (ab_ap - ab_bp);
    *barycentric = {1 - s, s, 0};
    return Feature::kAb;
  }
  const double weight_b = ab_cp * ac_ap - ab_ap * ac_cp;
  if (weight_b <= 0 && ac_ap >= 0 && ac_cp <= 0 && ac_ap > ac_cp) {
    const double s = ac_ap / (ac_ap - ac_cp);
    *barycentric = {1 - s, 0, s};
    return Feature::kCa;
  }
  const double weight_a = ab_bp * ac_cp - ab_cp * ac_bp;
  const double from_b = ac_bp - ab_bp, from_c = ab_cp - ac_cp;
  if (weight_a <= 0 && from_b >= 0 && from_c >= 0 && from_b + from_c > 0) {
    const double s = from_b / (from_b + from_c);
    *barycentric = {0, 1 - s, s};
    return Feature::kBc;
  }
  const double sum = weight_a + weight_b + weight_c;
  const double s = weight_b / sum, u = weight_c / sum;
  *barycentric = {1 - s - u, s, u};
  return Feature::kFace;
}

Vector3d MeshSurface::NormalAt(const Triangle& triangle, Feature feature) const {
  if (feature == Feature::kFace) return triangle.normal;
  const int k = static_cast<int>(feature);
  if (k < 3) return vertex_normals_[triangle.vertices[k]];
  const std::uint64_t key = EdgeKey(triangle.vertices[k - 3], triangle.vertices[(k - 2) % 3]);
  const auto edge =
      std::lower_bound(edge_normals_.begin(), edge_normals_.end(), key,
                       [](const EdgeNormal& e, std::uint64_t value) { return e.key < value; });
  // A triangle with two vertices at one position adds no edges.
  return edge != edge_normals_.end() && edge->key == key ? edge->normal : triangle.normal;
}

SurfacePoint MeshSurface::Nearest(const Vector3d& query, double max_squared_distance) const {
  struct Pending {
    std::size_t node;
    double bound;
  };
  Pending stack[64];
  int height = 0;
  stack[height++] = {1, BoxDistance(1, query)};
  const std::size_t first_leaf = std::size_t{1} << depth_;
  SurfacePoint nearest;
  nearest.squared_distance = max_squared_distance;
  const Triangle* best = nullptr;
  Feature feature = Feature::kFace;
  while (height > 0) {
    const Pending top = stack[--height];
    if (!(top.bound <= nearest.squared_distance)) continue;
    std::size_t node = top.node;
    while (node < first_leaf) {
      const double left = BoxDistance(2 * node, query), right = BoxDistance(2 * node + 1, query);
      node = 2 * node + (left <= right ? 0 : 1);
      const double far = std::max(left, right);
      if (far <= nearest.squared_distance) stack[height++] = {node ^ 1, far};
    }
    const std::size_t end = Begin(node - first_leaf + 1);
    for (std::size_t i = Begin(node - first_leaf); i < end; ++i) {
      const Triangle& triangle = triangles_[i];
      Vector3d barycentric;
      const Feature where = Closest(triangle, query, &barycentric);
      const Vector3d p = triangle.a + barycentric[1] * triangle.ab + barycentric[2] * triangle.ac;
      const double distance = (p - query).squaredNorm();
      if (!(distance < nearest.squared_distance ||
            (distance == nearest.squared_distance && (!best || triangle.number < best->number)))) {
        continue;
      }
      best = &triangle;
      feature = where;
      nearest = {triangle.number, barycentric, p, Vector3d::Zero(), distance};
    }
  }
  if (best) {
    nearest.normal = NormalAt(*best, feature);
  } else {
    nearest.squared_distance = internal::kInfinity;
  }
  return nearest;
}

double MeshSurface::WindingNumber(const Vector3d& query) const {
  std::size_t stack[64];
  int height = 0;
  stack[height++] = 1;
  const std::size_t first_leaf = std::size_t{1} << depth_;
  double angle = 0;
  while (height > 0) {
    const std::size_t number = stack[--height];
    const Node& node = nodes_[number];
    const Vector3d r = node.center - query;
    const double distance = r.norm();
    if (distance > kFar * node.radius) {
      angle += node.area.dot(r) / (distance * distance * distance);
    } else if (number < first_leaf) {
      stack[height++] = 2 * number + 1;
      stack[height++] = 2 * number;
    } else {
      const std::size_t end = Begin(number - first_leaf + 1);
      for (std::size_t i = Begin(number - first_leaf); i < end; ++i) {
        const Vector3d a = triangles_[i].a - query;
        angle += SolidAngle(a, a + triangles_[i].ab, a + triangles_[i].ac);
      }
    }
  }
  return angle / (4 * std::numbers::pi);
}

bool MeshSurface::IsInside(const Vector3d& query, const SurfacePoint& nearest) const {
  if (closed_ && num_pieces_ == 1 && nearest.triangle >= 0) {
    return (query - nearest.p).dot(nearest.normal) < 0;
  }
  return WindingNumber(query) > 0.5;
}

void MeshSurface::NearestBatch(const double* queries, std::size_t m, double max_squared_distance,
                               int num_threads, SurfacePoint* points) const {
  internal::RunShares(m, 256, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      points[i] = Nearest(Eigen::Map<const Vector3d>(queries + 3 * i), max_squared_distance);
    }
  });
}

void MeshSurface::SignedDistanceBatch(const double* queries, std::size_t m, int num_threads,
                                      double* distances) const {
  internal::RunShares(m, 256, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Map<const Vector3d> query(queries + 3 * i);
      const SurfacePoint nearest = Nearest(query);
      const double distance = std::sqrt(nearest.squared_distance);
      distances[i] = IsInside(query, nearest) ? -distance : distance;
    }
  });
}

}  // namespace prehensile
