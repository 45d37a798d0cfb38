#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "parallel.h"
#include "prehensile/distance_field.h"
#include "prehensile/surface.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Vector3d;

/// Six times the volume that the triangles enclose.
double SignedVolume(const double* vertices, const std::int32_t* triangles, std::size_t n) {
  const Vector3d origin = Eigen::Map<const Vector3d>(vertices);
  const auto at = [&](std::int32_t i) -> Vector3d {
    return Eigen::Map<const Vector3d>(vertices + 3 * static_cast<std::ptrdiff_t>(i)) - origin;
  };
  double volume = 0;
  for (const std::int32_t* t = triangles; t != triangles + 3 * n; t += 3) {
    volume += at(t[0]).dot(at(t[1]).cross(at(t[2])));
  }
  return volume;
}

}  // namespace

DistanceField MeshDistanceField(const double* vertices, std::size_t num_vertices,
                                const std::int32_t* triangles, std::size_t num_triangles,
                                const FieldGrid& grid, bool is_signed, int num_threads) {
  Validate(grid);
  const MeshSurface surface(vertices, num_vertices, triangles, num_triangles);
  if (is_signed) {
    internal::Require(surface.is_closed(), "triangles: the surface is not closed");
    internal::Require(SignedVolume(vertices, triangles, num_triangles) > 0,
                      "triangles: turned inside out, or without volume");
  }
  std::vector<FieldNode> nodes(grid.num_nodes());
  const auto row = static_cast<std::size_t>(grid.sizes[2]);
  const auto num_y = static_cast<std::size_t>(grid.sizes[1]);
  internal::RunShares(nodes.size() / row, 4, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r) {
      // The nearest point of the neighbour bounds the search.
      double most = internal::kInfinity;
      for (std::size_t z = 0; z < row; ++z) {
        const Vector3d x =
            Vector3d(grid.origin.data()) + grid.spacing * Vector3d(static_cast<double>(r / num_y),
                                                                   static_cast<double>(r % num_y),
                                                                   static_cast<double>(z));
        const SurfacePoint nearest = surface.Nearest(x, most * most);
        const Vector3d offset = x - nearest.p;
        const double distance = offset.norm();
        const bool inside =
            is_signed ? surface.IsInside(x, nearest) : offset.dot(nearest.normal) < 0;
        const double side = inside ? -1 : 1;
        const Vector3d gradient =
            distance > 1e-6 * grid.spacing ? Vector3d(side / distance * offset) : nearest.normal;
        FieldNode& node = nodes[r * row + z];
        node.distance = static_cast<float>(side * distance);
        for (int k = 0; k < 3; ++k) node.gradient[k] = static_cast<float>(gradient[k]);
        most = distance + 1.001 * grid.spacing;
      }
    }
  });
  return DistanceField(grid, std::move(nodes), is_signed);
}

}  // namespace prehensile
