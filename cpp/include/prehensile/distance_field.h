#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

/// Where the nodes of a regular grid are: node (i, j, k) at origin + spacing ·
/// (i, j, k), stored at (i · sizes[1] + j) · sizes[2] + k.
struct FieldGrid {
  /// Node (0, 0, 0), in the object's frame O [m].
  std::array<double, 3> origin{};
  /// Distance of neighbouring nodes [m].
  double spacing = 0;
  /// Number of nodes along x, y and z, each at least 2.
  std::array<std::int32_t, 3> sizes{};

  std::size_t num_nodes() const {
    return static_cast<std::size_t>(sizes[0]) * static_cast<std::size_t>(sizes[1]) *
           static_cast<std::size_t>(sizes[2]);
  }
};

/// Most nodes of a grid: 4 GiB.
inline constexpr double kMostFieldNodes = 1 << 28;

/// @throws std::invalid_argument naming origin, spacing or sizes if the grid is none, or too large.
void Validate(const FieldGrid& grid);

/// What a field knows at a node. 16 bytes, aligned so that one load takes them.
struct alignas(16) FieldNode {
  /// Distance to the surface, negative inside, or on the side that its normal
  /// points away from [m].
  float distance = 0;
  /// Gradient of the distance: the unit direction from the nearest surface
  /// point, outward.
  float gradient[3] = {0, 0, 0};
};

/// The distance to the surface of a rigid object at any point, looked up in a
/// grid.
///
/// Between nodes, f(p) = Σ wᵢ (dᵢ + ½ gᵢ · (p - xᵢ)) with the trilinear weights
/// wᵢ of the eight nodes around p: exact where the distance is a quadratic
/// function, while dᵢ alone or Taylor's dᵢ + gᵢ · (p - xᵢ) err by half a cell's
/// curvature, in opposite directions. The gradient is Σ wᵢ gᵢ.
///
/// Outside the grid, the surface point is taken that is nearest to the nearest
/// point of the grid: the distance is then an upper bound of the true one, and
/// the tighter the wider the grid.
///
/// A field that is not signed (of a cloud, or of a mesh that is not closed) has
/// sides only near its surface. It gives the absolute distance; inside, it
/// keeps the sides, so that interpolation is as good across the surface as
/// elsewhere.
///
/// Constant; may be asked on several threads at once.
class DistanceField {
 public:
  struct Value {
    /// f [m].
    double distance;
    /// Derivative of f; of unit length but near edges, corners and the medial
    /// axis.
    Eigen::Vector3d gradient;
  };
  struct SurfacePoint {
    /// The surface point next to the one asked for, expressed in O [m].
    Eigen::Vector3d point;
    /// Unit normal there: outward; for a field that is not signed, on the side
    /// of its model's normals. (1, 0, 0) in the one case that there is none: in
    /// the very middle of things.
    Eigen::Vector3d normal;
    /// Distance of the point asked for [m], with the side that the normal
    /// gives, signed or not.
    double distance;
  };

  /// @param nodes as FieldGrid says.
  /// @throws std::invalid_argument naming the argument if a number is not
  /// finite, a size below 2,
  ///   or the number of nodes is not that of the grid, or 2³¹ or more.
  DistanceField(const FieldGrid& grid, std::vector<FieldNode> nodes, bool is_signed);

  const FieldGrid& grid() const { return grid_; }
  const std::vector<FieldNode>& nodes() const { return nodes_; }
  /// Whether the sign of the distance tells inside from outside.
  bool is_signed() const { return is_signed_; }

  /// @param p_O finite point in the object's frame.
  Value At(const Eigen::Vector3d& p_O) const;

  /// As At(), but with sides near the surface also where the field is not
  /// signed: what least squares and interpolation want.
  Value OrientedAt(const Eigen::Vector3d& p_O) const;

  /// @param p_O finite point in the object's frame.
  SurfacePoint Closest(const Eigen::Vector3d& p_O) const;

  /// At() for n rows of x, y, z.
  ///
  /// @param distances room for n.
  /// @param gradients room for n rows; nullptr for none.
  void AtRows(const double* p_O, std::size_t n, int num_threads, double* distances,
              double* gradients) const;

 private:
  FieldGrid grid_;
  std::vector<FieldNode> nodes_;
  bool is_signed_;
};

/// The field of a mesh.
///
/// Distances are exact at the nodes. Signs are those of the angle-weighted
/// pseudo-normals (Bærentzen and Aanæs, "Signed distance computation using the
/// angle weighted pseudonormal", IEEE TVCG 2005), checked against the winding
/// number in every region that the surface separates.
///
/// @param vertices num_vertices rows of x, y, z, in O.
/// @param triangles num_triangles rows of indices, counter-clockwise seen from
/// outside. Vertices at the
///   same place count as one.
/// @param is_signed whether the mesh must tell inside from outside.
/// @throws std::invalid_argument naming the argument: values out of range, or
/// triangles that should
///   be signed but are not closed, or are turned inside out.
DistanceField MeshDistanceField(const double* vertices, std::size_t num_vertices,
                                const std::int32_t* triangles, std::size_t num_triangles,
                                const FieldGrid& grid, bool is_signed, int num_threads);

/// The field, not signed, of points with normals: each stands for a disc.
///
/// @param points, normals n rows of x, y, z each; the normals of unit length.
/// @param radius of the discs [m]: about the distance of neighbouring points.
/// @throws std::invalid_argument naming the argument.
DistanceField CloudDistanceField(const double* points, const double* normals, std::size_t n,
                                 double radius, const FieldGrid& grid, int num_threads);

/// The distance to bodies that move, each with a field: the least over the bodies, which body it
/// is, and the gradient, for n points in W.
///
/// @param fields of the bodies, each in the body's frame L; at least one, and fewer than 2³¹.
/// @param X_WL as many.
/// @param p_W n rows of x, y, z.
/// @param distances, bodies room for n; of bodies alike the first counts.
/// @param gradients room for n rows, expressed in W.
/// @throws std::invalid_argument naming the argument.
void NearestBodyAtRows(const std::vector<const DistanceField*>& fields,
                       const std::vector<Eigen::Isometry3d>& X_WL, const double* p_W, std::size_t n,
                       int num_threads, double* distances, double* gradients, std::int32_t* bodies);

}  // namespace prehensile
