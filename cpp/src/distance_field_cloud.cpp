#include <algorithm>
#include <cmath>
#include <vector>

#include "parallel.h"
#include "prehensile/distance_field.h"
#include "prehensile/kd_tree.h"
#include "vectors.h"

namespace prehensile {
namespace {

/// Points near a node whose discs are looked at.
constexpr int kCandidates = 6;

/// The node at p, from the nearest point of the disc about c with normal n.
FieldNode NodeOfDisc(const Eigen::Vector3d& p, const Eigen::Vector3d& c, const Eigen::Vector3d& n,
                     double radius) {
  const double height = n.dot(p - c);
  const Eigen::Vector3d across = p - c - height * n;
  const double reach = across.norm();
  const Eigen::Vector3d rim =
      reach > radius ? Eigen::Vector3d(across * (1 - radius / reach)) : Eigen::Vector3d::Zero();
  const double distance = std::hypot(height, rim.norm());
  const double side = height < 0 ? -1 : 1;
  // In the disc's own plane its normal, where it is part of a surface that goes on.
  const bool above = rim.isZero(0) || distance <= 1e-9 * radius;
  const Eigen::Vector3d gradient =
      above ? n : Eigen::Vector3d(side / distance * (height * n + rim));
  FieldNode node{.distance = static_cast<float>(side * distance)};
  for (int k = 0; k < 3; ++k) node.gradient[k] = static_cast<float>(gradient[k]);
  return node;
}

}  // namespace

DistanceField CloudDistanceField(const double* points, const double* normals, std::size_t n,
                                 double radius, const FieldGrid& grid, int num_threads) {
  Validate(grid);
  internal::Require(n > 0, "points: none");
  internal::Require(radius > 0 && std::isfinite(radius), "radius: must be positive and finite");
  for (std::size_t i = 0; i < n; ++i) {
    const double norm = Eigen::Map<const Eigen::Vector3d>(normals + 3 * i).norm();
    internal::Require(std::abs(norm - 1) < 1e-3, "normals: must be of unit length");
  }
  const KdTree tree(points, n);
  std::vector<FieldNode> nodes(grid.num_nodes());
  const auto row = static_cast<std::size_t>(grid.sizes[2]);
  const std::size_t num_rows = nodes.size() / row;
  internal::RunShares(num_rows, 16, num_threads, [&](std::size_t begin, std::size_t end) {
    std::int32_t indices[kCandidates];
    double squared[kCandidates];
    for (std::size_t r = begin; r < end; ++r) {
      for (std::size_t z = 0; z < row; ++z) {
        const auto y = static_cast<std::size_t>(grid.sizes[1]);
        const Eigen::Vector3d p =
            Eigen::Vector3d(grid.origin.data()) +
            grid.spacing * Eigen::Vector3d(static_cast<double>(r / y), static_cast<double>(r % y),
                                           static_cast<double>(z));
        const int found =
            tree.Nearest(p.data(), kCandidates, internal::kInfinity, indices, squared);
        FieldNode& node = nodes[r * row + z];
        for (int k = 0; k < found; ++k) {
          const auto at = 3 * static_cast<std::size_t>(indices[k]);
          const FieldNode other =
              NodeOfDisc(p, Eigen::Map<const Eigen::Vector3d>(points + at),
                         Eigen::Map<const Eigen::Vector3d>(normals + at), radius);
          if (k == 0 || std::abs(other.distance) < std::abs(node.distance)) node = other;
        }
      }
    }
  });
  return DistanceField(grid, std::move(nodes), false);
}

}  // namespace prehensile
