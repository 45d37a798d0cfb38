#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace prehensile {

/// The point of a surface that is nearest to a query.
struct SurfacePoint {
  /// Which triangle it lies on; of several the smallest found. -1 if there is none near enough.
  std::int32_t triangle = -1;
  /// p = Σ barycentric[k] · vertex k of the triangle; not negative, sum 1.
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  /// Angle-weighted pseudo-normal at p, unit length: of a face, or the mean over the faces at an
  /// edge or vertex. Zero where all of these are degenerate.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double squared_distance = std::numeric_limits<double>::infinity();
};

/// Nearest points, inside and outside of a surface of triangles, which is copied in.
///
/// A balanced hierarchy of bounding boxes. Which side of a closed surface a point is on: for one
/// connected piece from the pseudo-normal at the nearest point (Bærentzen and Aanæs, "Signed
/// distance computation using the angle weighted pseudonormal", 2005); for several, which may
/// overlap, and for open surfaces from the generalized winding number (Jacobson et al., "Robust
/// inside-outside segmentation using generalized winding numbers", 2013), far parts of which are
/// summed as dipoles (Barill et al., "Fast winding numbers for soups and clouds", 2018).
///
/// Vertices at the same position are taken as one. Queries may run on several threads at once.
class MeshSurface {
 public:
  /// @param vertices rows of x, y, z.
  /// @param triangles rows of three indices, counter-clockwise seen from outside; at least one row.
  /// @throws std::invalid_argument if a coordinate is not finite or beyond 1e70, or an index out of
  ///     range.
  MeshSurface(const double* vertices, std::size_t num_vertices, const std::int32_t* triangles,
              std::size_t num_triangles);

  std::size_t num_triangles() const { return num_triangles_; }
  /// Whether each edge is shared by as many triangles one way round as the other, so that there is
  /// an inside. Triangles with two vertices at one position are not counted.
  bool is_closed() const { return closed_; }
  /// Number of pieces that share no vertex.
  int num_pieces() const { return num_pieces_; }

  /// @param query finite.
  SurfacePoint Nearest(const Eigen::Vector3d& query,
                       double max_squared_distance = std::numeric_limits<double>::infinity()) const;

  /// How often the surface winds around a point: 1 inside and 0 outside of a closed one, in between
  /// for one with holes. Within some 0.02.
  double WindingNumber(const Eigen::Vector3d& query) const;

  /// Whether the query, whose nearest point is given, is inside (see the class).
  bool IsInside(const Eigen::Vector3d& query, const SurfacePoint& nearest) const;

  /// Nearest for m queries, rows of x, y, z.
  void NearestBatch(const double* queries, std::size_t m, double max_squared_distance,
                    int num_threads, SurfacePoint* points) const;

  /// Distances of m queries, rows of x, y, z, from the surface, negative inside.
  void SignedDistanceBatch(const double* queries, std::size_t m, int num_threads,
                           double* distances) const;

 private:
  struct Triangle {
    Eigen::Vector3d a, ab, ac;  // A vertex, and the edges from there.
    Eigen::Vector3d normal;     // Unit length, or zero.
    std::int32_t vertices[3];   // After joining those at the same position.
    std::int32_t number;        // In the order of the input.
  };
  struct Node {
    Eigen::Vector3d low, high;  // Its bounding box.
    Eigen::Vector3d center;     // Mean over the area of its triangles.
    Eigen::Vector3d area;       // Sum of the triangles' area vectors.
    double radius;              // Of a ball at the centre that holds them.
  };
  struct EdgeNormal {
    std::uint64_t key;
    Eigen::Vector3d normal;
  };
  enum class Feature { kA, kB, kC, kAb, kBc, kCa, kFace };

  static Feature Closest(const Triangle& triangle, const Eigen::Vector3d& query,
                         Eigen::Vector3d* barycentric);
  void Build(std::size_t node, std::size_t first, std::size_t last);
  void JoinVertices(const double* vertices, std::size_t num_vertices);
  void FindNormals();
  std::size_t Begin(std::size_t leaf) const { return num_triangles_ * leaf >> depth_; }
  double BoxDistance(std::size_t node, const Eigen::Vector3d& query) const;
  Eigen::Vector3d NormalAt(const Triangle& triangle, Feature feature) const;

  std::size_t num_triangles_;
  int depth_ = 0;
  bool closed_ = true;
  int num_pieces_ = 0;
  std::vector<Triangle> triangles_;   // In the order of the leaves.
  std::vector<Node> nodes_;           // Node i has the children 2 i and 2 i + 1; 1 is the root.
  std::vector<std::int32_t> joined_;  // For each vertex of the input.
  std::vector<Eigen::Vector3d> vertex_normals_;
  std::vector<EdgeNormal> edge_normals_;  // Sorted by key.
};

}  // namespace prehensile
