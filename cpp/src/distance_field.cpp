#include "prehensile/distance_field.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "field_view.h"
#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

constexpr std::size_t kRowsPerThread = 4096;
constexpr double kOrigin[3] = {0, 0, 0};

}  // namespace

void Validate(const FieldGrid& grid) {
  constexpr double kFarthest = 1e9;  // So that squares stay within single precision.
  internal::Require(grid.spacing > 0 && grid.spacing < kFarthest,
                    "spacing: must be positive, finite and below 1e9");
  double count = 1;
  for (int k = 0; k < 3; ++k) {
    internal::Require(std::abs(grid.origin[k]) < kFarthest, "origin: must be finite and below 1e9");
    internal::Require(grid.sizes[k] >= 2, "sizes: must each be at least 2");
    count *= grid.sizes[k];
  }
  if (count > kMostFieldNodes) {
    throw std::invalid_argument("spacing: the grid would have " +
                                std::to_string(static_cast<long long>(count)) +
                                " nodes, more than 2^28: too fine for so large an object");
  }
}

DistanceField::DistanceField(const FieldGrid& grid, std::vector<FieldNode> nodes, bool is_signed)
    : grid_(grid), nodes_(std::move(nodes)), is_signed_(is_signed) {
  Validate(grid_);
  internal::Require(nodes_.size() == grid_.num_nodes(), "nodes: not as many as the grid has");
  for (const FieldNode& node : nodes_) {
    const float* const g = node.gradient;
    const float norm2 = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];
    // Written so that NaN fails.
    if (!(std::abs(node.distance) < 1e18F && norm2 < 1.01F)) {
      throw std::invalid_argument("nodes: a distance is not finite or a gradient longer than one");
    }
  }
}

DistanceField::Value DistanceField::OrientedAt(const Eigen::Vector3d& p_O) const {
  const auto value = internal::LookUp(internal::ViewField<double>(*this, kOrigin), p_O.data());
  return {value.distance, Eigen::Vector3d(value.gradient)};
}

DistanceField::Value DistanceField::At(const Eigen::Vector3d& p_O) const {
  Value value = OrientedAt(p_O);
  if (!is_signed_ && value.distance < 0) {
    value.distance = -value.distance;
    value.gradient = -value.gradient;
  }
  return value;
}

DistanceField::SurfacePoint DistanceField::Closest(const Eigen::Vector3d& p_O) const {
  const Value value = OrientedAt(p_O);
  const double norm = value.gradient.norm();
  const Eigen::Vector3d normal =
      norm > 1e-12 ? Eigen::Vector3d(value.gradient / norm) : Eigen::Vector3d::UnitX();
  return {p_O - value.distance * normal, normal, value.distance};
}

void DistanceField::AtRows(const double* p_O, std::size_t n, int num_threads, double* distances,
                           double* gradients) const {
  const auto view = internal::ViewField<double>(*this, kOrigin);
  internal::RunShares(n, kRowsPerThread, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto value = internal::LookUp(view, p_O + 3 * i);
      const double side = !is_signed_ && value.distance < 0 ? -1 : 1;
      distances[i] = side * value.distance;
      if (!gradients) continue;
      for (int k = 0; k < 3; ++k) gradients[3 * i + k] = side * value.gradient[k];
    }
  });
}

void NearestBodyAtRows(const std::vector<const DistanceField*>& fields,
                       const std::vector<Eigen::Isometry3d>& X_WL, const double* p_W, std::size_t n,
                       int num_threads, double* distances, double* gradients,
                       std::int32_t* bodies) {
  internal::Require(!fields.empty(), "fields: none");
  for (const DistanceField* field : fields) internal::Require(field, "fields: one is none");
  internal::Require(fields.size() == X_WL.size(), "X_WL: not as many as fields");
  std::vector<Eigen::Isometry3d> X_LW;
  for (const Eigen::Isometry3d& X : X_WL) X_LW.push_back(X.inverse());
  internal::RunShares(n, kRowsPerThread, num_threads, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Eigen::Vector3d p = Eigen::Map<const Eigen::Vector3d>(p_W + 3 * i);
      DistanceField::Value nearest{internal::kInfinity, Eigen::Vector3d::Zero()};
      std::size_t body = 0;
      for (std::size_t k = 0; k < fields.size(); ++k) {
        const DistanceField::Value value = fields[k]->At(X_LW[k] * p);
        if (value.distance < nearest.distance) {
          nearest = value;
          body = k;
        }
      }
      distances[i] = nearest.distance;
      bodies[i] = static_cast<std::int32_t>(body);
      Eigen::Map<Eigen::Vector3d>(gradients + 3 * i) = X_WL[body].linear() * nearest.gradient;
    }
  });
}

}  // namespace prehensile
