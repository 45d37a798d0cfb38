#include "prehensile/tracking.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "losses.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using internal::kInfinity;
using internal::Require;

/// A rectangle of pixels [begin, end).
struct Region {
  int u_begin = std::numeric_limits<int>::max();
  int v_begin = std::numeric_limits<int>::max();
  int u_end = 0;
  int v_end = 0;
};

void Check(const DepthView& view) {
  constexpr int kMost = 1 << 15;
  Require(view.width >= 1 && view.height >= 1 && view.width <= kMost && view.height <= kMost,
          "depth: must have from 1 to 32768 rows and columns");
  Require(view.fx > 0 && view.fy > 0, "K: focal lengths must be positive");
}

void Check(const std::vector<TrackedBody>& bodies, const char* message) {
  for (const TrackedBody& body : bodies) Require(body.field != nullptr, message);
}

/// Where a body's surface can be, in B.
struct Box {
  explicit Box(const TrackedBody& body) {
    if (!body.box.isEmpty()) {
      lower = body.box.min();
      upper = body.box.max();
      return;
    }
    const FieldGrid& grid = body.field->grid();
    for (int i = 0; i < 3; ++i) {
      lower[i] = grid.origin[i];
      upper[i] = grid.origin[i] + grid.spacing * (grid.sizes[i] - 1);
    }
  }
  bool IsNear(const Vector3d& p, double margin) const {
    return ((p - lower).array() >= -margin).all() && ((upper - p).array() >= -margin).all();
  }
  Vector3d lower;
  Vector3d upper;
};

/// A point's depth and pixel.
struct Projection {
  double z;
  double u;
  double v;
};

Projection Project(const DepthView& view, const Vector3d& p_W) {
  const Vector3d p_C = view.R_WC.transpose() * (p_W - view.p_WC);
  return {p_C.z(), view.fx * p_C.x() / p_C.z() + view.cx, view.fy * p_C.y() / p_C.z() + view.cy};
}

/// The depth measured at a pixel, 0 where there is none.
double DepthAt(const DepthView& view, int u, int v) {
  const std::size_t at = static_cast<std::size_t>(v) * view.width + u;
  const float depth = view.depth[at];
  if (!(depth > 0) || !std::isfinite(depth) || (view.ignored && view.ignored[at])) return 0;
  return depth;
}

/// The depth measured where a point projects to: -1 out of the image, 0 where there is none.
double DepthBehind(const DepthView& view, const Projection& at, int* u, int* v) {
  if (!(at.z > 0) || !(at.u > -0.5 && at.u < view.width - 0.5) ||
      !(at.v > -0.5 && at.v < view.height - 0.5)) {
    return -1;
  }
  *u = static_cast<int>(at.u + 0.5);
  *v = static_cast<int>(at.v + 0.5);
  return DepthAt(view, *u, *v);
}

/// The pixels where a body, or what is within max_distance of it, can be seen.
Region RegionOf(const DepthView& view, const TrackedBody& body, const Box& box,
                double max_distance) {
  double low[2] = {kInfinity, kInfinity};
  double high[2] = {-kInfinity, -kInfinity};
  for (int corner = 0; corner < 8; ++corner) {
    Vector3d p;
    for (int i = 0; i < 3; ++i) {
      p[i] = corner >> i & 1 ? box.upper[i] + max_distance : box.lower[i] - max_distance;
    }
    const Projection at = Project(view, body.R_WB * p + body.p_WB);
    if (!(at.z > 0.01)) return {0, 0, view.width, view.height};  // Around the camera.
    low[0] = std::min(low[0], at.u);
    low[1] = std::min(low[1], at.v);
    high[0] = std::max(high[0], at.u);
    high[1] = std::max(high[1], at.v);
  }
  const auto inside = [](double x, int size) {
    return static_cast<int>(internal::Clamped(x, 0, size));
  };
  return {inside(low[0], view.width), inside(low[1], view.height), inside(high[0] + 1, view.width),
          inside(high[1] + 1, view.height)};
}

/// The derivative of the logarithm of the depth by the line of sight's slope along u or v, from the
/// pixels a few millimetres before and after one; false if neither was measured, or if both lie on
/// other surfaces.
bool Slope(const DepthView& view, int u, int v, int du, int dv, double z, double focal,
           double* slope) {
  constexpr double kReach = 0.005;  // [m]
  constexpr double kSteepest = 5;   // Where it rises by more, another surface begins.
  const int step = static_cast<int>(internal::Clamped(kReach * focal / z + 0.5, 1, 8));
  double rises = 0;
  int count = 0;
  for (const int side : {-step, step}) {
    const int x = u + side * du;
    const int y = v + side * dv;
    if (x < 0 || y < 0 || x >= view.width || y >= view.height) continue;
    const double depth = DepthAt(view, x, y);
    const double rise = (depth - z) * focal / (side * z);
    if (depth == 0 || std::abs(rise) > kSteepest) continue;
    rises += rise;
    ++count;
  }
  if (count == 0) return false;
  *slope = rises / count;
  return true;
}

/// The direction, not of unit length, out of the surface that a pixel shows, expressed in C; zero
/// where it cannot be told.
Vector3d MeasuredNormal(const DepthView& view, int u, int v, double z) {
  double a = 0;
  double b = 0;
  if (!Slope(view, u, v, 1, 0, z, view.fx, &a) || !Slope(view, u, v, 0, 1, z, view.fy, &b)) {
    return Vector3d::Zero();
  }
  // The cross product of the derivatives of z [x, y, 1] by x and y, over z^2, turned to the camera.
  const double x = (u - view.cx) / view.fx;
  const double y = (v - view.cy) / view.fy;
  return {a, b, -(1 + a * x + b * y)};
}

void Accumulate(const Vector3d& arm, const Vector3d& direction, double residual, double weight,
                BodyTerm* term) {
  // The residual falls as the body moves along the direction: J = -[arm × n; n].
  const Vector3d turn = arm.cross(direction);
  const double j[6] = {turn.x(), turn.y(), turn.z(), direction.x(), direction.y(), direction.z()};
  for (int column = 0; column < 6; ++column) {
    const double weighted = weight * j[column];
    term->gradient[column] -= weighted * residual;
    for (int row = 0; row <= column; ++row) term->information(row, column) += weighted * j[row];
  }
}

/// Fills the lower half of the information.
void Mirror(std::vector<BodyTerm>* terms) {
  for (BodyTerm& term : *terms) {
    for (int column = 0; column < 6; ++column) {
      for (int row = 0; row < column; ++row) {
        term.information(column, row) = term.information(row, column);
      }
    }
  }
}

/// The way sideways, in the image, from a pixel to the nearest one where something was measured no
/// further than z: its length [m], less one and a half pixels for what pixels cannot tell.
/// Infinite if there is none within the radius.
double WayAside(const DepthView& view, int u, int v, double z, double max_depth, int radius,
                Vector3d* direction_C) {
  double best = kInfinity;
  const double pixel = z / std::max(view.fx, view.fy);
  for (int ring = 1; ring <= radius && best > ring * pixel; ++ring) {
    const auto look = [&](int du, int dv) {
      const int x = u + du;
      const int y = v + dv;
      if (x < 0 || y < 0 || x >= view.width || y >= view.height) return;
      const double depth = DepthAt(view, x, y);
      if (depth == 0 || depth > max_depth) return;
      const Vector3d way(du * z / view.fx, dv * z / view.fy, 0);
      const double length = way.norm();
      if (length < best) {
        best = length;
        *direction_C = way / length;
      }
    };
    for (int i = -ring; i <= ring; ++i) {
      look(i, -ring);
      look(i, ring);
    }
    for (int i = 1 - ring; i < ring; ++i) {
      look(-ring, i);
      look(ring, i);
    }
  }
  return std::max(best - 1.5 * pixel, 0.0);
}

}  // namespace

std::vector<double> PointsNearBodies(const std::vector<DepthView>& views,
                                     const std::vector<TrackedBody>& bodies,
                                     const std::vector<TrackedBody>& others, double max_distance,
                                     double other_margin, double max_normal_angle, int max_pixels) {
  Check(bodies, "bodies: each needs a field");
  Check(others, "others: each needs a field");
  Require(max_distance > 0 && std::isfinite(max_distance), "max_distance: must be positive");
  Require(other_margin >= 0 && std::isfinite(other_margin), "other_margin: must be 0 or more");
  Require(max_normal_angle >= 0, "max_normal_angle: must be 0 or more");
  Require(max_pixels >= 1, "max_pixels: must be at least 1");
  const bool any_normal = max_normal_angle >= M_PI;
  const double min_cosine = std::cos(std::min(max_normal_angle, M_PI));
  std::vector<Box> boxes;
  std::vector<Box> other_boxes;
  for (const TrackedBody& body : bodies) boxes.emplace_back(body);
  for (const TrackedBody& other : others) other_boxes.emplace_back(other);

  std::vector<double> points;
  for (const DepthView& view : views) {
    Check(view);
    Region region;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Region part = RegionOf(view, bodies[i], boxes[i], max_distance);
      region.u_begin = std::min(region.u_begin, part.u_begin);
      region.v_begin = std::min(region.v_begin, part.v_begin);
      region.u_end = std::max(region.u_end, part.u_end);
      region.v_end = std::max(region.v_end, part.v_end);
    }
    if (region.u_begin >= region.u_end || region.v_begin >= region.v_end) continue;
    const double area =
        static_cast<double>(region.u_end - region.u_begin) * (region.v_end - region.v_begin);
    const int step = std::max(1, static_cast<int>(std::ceil(std::sqrt(area / max_pixels))));
    for (int v = region.v_begin; v < region.v_end; v += step) {
      for (int u = region.u_begin; u < region.u_end; u += step) {
        const double z = DepthAt(view, u, v);
        if (z == 0) continue;
        const Vector3d p_C((u - view.cx) / view.fx * z, (v - view.cy) / view.fy * z, z);
        const Vector3d p_W = view.R_WC * p_C + view.p_WC;
        double nearest = kInfinity;
        Vector3d outward = Vector3d::Zero();
        for (std::size_t i = 0; i < bodies.size(); ++i) {
          const Vector3d p_B = bodies[i].R_WB.transpose() * (p_W - bodies[i].p_WB);
          if (!boxes[i].IsNear(p_B, max_distance)) continue;
          const DistanceField::Value value = bodies[i].field->OrientedAt(p_B);
          if (std::abs(value.distance) >= nearest) continue;
          nearest = std::abs(value.distance);
          outward = bodies[i].R_WB * value.gradient;
        }
        if (!(nearest <= max_distance)) continue;
        if (!any_normal) {
          const Vector3d normal = view.R_WC * MeasuredNormal(view, u, v, z);
          if (normal.dot(outward) < min_cosine * normal.norm() * outward.norm()) continue;
        }
        bool is_other = false;
        const double claimed = std::min(nearest, other_margin);
        for (std::size_t i = 0; i < others.size() && !is_other; ++i) {
          const Vector3d p_B = others[i].R_WB.transpose() * (p_W - others[i].p_WB);
          if (!other_boxes[i].IsNear(p_B, claimed)) continue;
          is_other = std::abs(others[i].field->OrientedAt(p_B).distance) <= claimed;
        }
        if (!is_other) points.insert(points.end(), p_W.data(), p_W.data() + 3);
      }
    }
  }
  return points;
}

std::vector<BodyTerm> SurfaceTerms(const double* points, std::size_t n,
                                   const std::vector<TrackedBody>& bodies, RobustLoss loss,
                                   double loss_scale) {
  Check(bodies, "bodies: each needs a field");
  Require(loss_scale > 0 && std::isfinite(loss_scale), "loss_scale: must be positive");
  std::vector<Box> boxes;
  for (const TrackedBody& body : bodies) boxes.emplace_back(body);
  std::vector<BodyTerm> terms(bodies.size());
  for (std::size_t k = 0; k < n; ++k) {
    const Vector3d p_W = Eigen::Map<const Vector3d>(points + 3 * k);
    DistanceField::Value nearest{kInfinity, Vector3d::Zero()};
    std::size_t body = 0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Vector3d p_B = bodies[i].R_WB.transpose() * (p_W - bodies[i].p_WB);
      // Where no other body is nearer, one outside its box counts too.
      if (nearest.distance < kInfinity && !boxes[i].IsNear(p_B, std::abs(nearest.distance))) {
        continue;
      }
      const DistanceField::Value value = bodies[i].field->OrientedAt(p_B);
      if (std::abs(value.distance) < std::abs(nearest.distance)) {
        nearest = value;
        body = i;
      }
    }
    if (bodies.empty()) break;
    const double r = nearest.distance;
    const double weight = internal::Weight(loss, r * r, loss_scale);
    BodyTerm& term = terms[body];
    term.cost += internal::Loss(loss, r * r, loss_scale);
    term.weight += weight;
    term.weighted_squares += weight * r * r;
    if (weight > 0) {
      Accumulate(p_W - bodies[body].p_WB, bodies[body].R_WB * nearest.gradient, r, weight, &term);
    }
  }
  Mirror(&terms);
  return terms;
}

std::vector<SampleCounts> AddFreeSpaceTerms(const std::vector<DepthView>& views,
                                            const std::vector<TrackedBody>& bodies,
                                            const std::vector<SurfaceSamples>& samples,
                                            const FreeSpaceOptions& options, double weight,
                                            std::vector<BodyTerm>* terms) {
  Require(samples.size() == bodies.size(), "samples: there must be one set per body");
  Require(terms->size() == bodies.size(), "terms: there must be one per body");
  Require(options.margin >= 0 && options.max_violation > 0 && options.search_radius >= 0,
          "margin, max_violation, search_radius: must not be negative");
  Require(options.search_radius <= 100, "search_radius: must be at most 100");
  Require(weight >= 0 && std::isfinite(weight), "weight: must be 0 or more");
  std::vector<SampleCounts> counts(bodies.size());
  for (const DepthView& view : views) {
    Check(view);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const TrackedBody& body = bodies[i];
      for (std::size_t k = 0; k < samples[i].n; ++k) {
        const Vector3d arm = body.R_WB * Eigen::Map<const Vector3d>(samples[i].points + 3 * k);
        const Vector3d normal = body.R_WB * Eigen::Map<const Vector3d>(samples[i].normals + 3 * k);
        const Vector3d p_W = arm + body.p_WB;
        if (normal.dot(p_W - view.p_WC) >= 0) continue;  // The far side.
        const Projection at = Project(view, p_W);
        int u = 0;
        int v = 0;
        const double depth = DepthBehind(view, at, &u, &v);
        if (depth < 0) continue;
        ++counts[i].facing;
        if (depth == 0) {
          ++counts[i].unknown;
          continue;
        }
        const double beyond = depth - at.z - options.margin;
        if (beyond <= 0) {
          ++(at.z - depth > options.margin ? counts[i].occluded : counts[i].seen);
          continue;
        }
        Vector3d direction_C(0, 0, 1);
        double violation = beyond;
        Vector3d aside;
        const double way =
            WayAside(view, u, v, at.z, at.z + options.margin, options.search_radius, &aside);
        if (way < violation) {
          violation = way;
          direction_C = aside;
        }
        if (violation <= 0) {  // Within what pixels can tell of an edge.
          ++counts[i].seen;
          continue;
        }
        // Near an edge, it is a matter of refining the pose.
        ++(way <= options.margin ? counts[i].seen : counts[i].in_free);
        violation = std::min(violation, options.max_violation);
        BodyTerm& term = (*terms)[i];
        term.cost += weight * violation * violation;
        if (weight > 0) Accumulate(arm, view.R_WC * direction_C, violation, weight, &term);
      }
    }
  }
  Mirror(terms);
  return counts;
}

void FreeSpaceViolation(const DepthView& view, const double* points, std::size_t n, double margin,
                        double* violations) {
  Check(view);
  for (std::size_t k = 0; k < n; ++k) {
    const Projection at = Project(view, Eigen::Map<const Vector3d>(points + 3 * k));
    int u = 0;
    int v = 0;
    const double depth = DepthBehind(view, at, &u, &v);
    violations[k] = depth > 0 ? std::max(depth - margin - at.z, 0.0) : 0.0;
  }
}

}  // namespace prehensile
