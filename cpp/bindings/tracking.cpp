#include "prehensile/tracking.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

using Image = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Mask = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Fields = std::vector<const DistanceField*>;
using RowMatrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

/// Depth images with all that belongs to them. The arrays are not copied.
class Views {
 public:
  /// @param list of (depth (H, W) float32, K (3, 3), X_WC, ignored (H, W) uint8 or None).
  explicit Views(const nb::list& list) {
    for (const nb::handle item : list) {
      const nb::tuple parts = nb::cast<nb::tuple>(item);
      if (parts.size() != 4) throw std::invalid_argument("views: expected 4 values each");
      Image depth;
      if (!nb::try_cast(parts[0], depth)) {
        throw std::invalid_argument("depth: expected (H, W) float32");
      }
      const ArrayArgument K(parts[1], "K");
      K.RequireShape({3, 3});
      K.RequireFinite();
      const PoseArgument pose(parts[2], "X_WC");
      pose.RequireFinite();
      const Eigen::Map<const RowMatrix4> X_WC(pose.data());
      DepthView view{.depth = depth.data(),
                     .width = static_cast<int>(depth.shape(1)),
                     .height = static_cast<int>(depth.shape(0)),
                     .fx = K[0],
                     .fy = K[4],
                     .cx = K[2],
                     .cy = K[5],
                     .R_WC = X_WC.topLeftCorner<3, 3>(),
                     .p_WC = X_WC.topRightCorner<3, 1>()};
      if (!parts[3].is_none()) {
        Mask ignored;
        if (!nb::try_cast(parts[3], ignored)) {
          throw std::invalid_argument("ignored: expected (H, W) uint8");
        }
        if (ignored.shape(0) != depth.shape(0) || ignored.shape(1) != depth.shape(1)) {
          throw std::invalid_argument("ignored: must have the shape of depth");
        }
        view.ignored = ignored.data();
        masks_.push_back(ignored);
      }
      images_.push_back(depth);
      views_.push_back(view);
    }
  }
  const std::vector<DepthView>& get() const { return views_; }

 private:
  std::vector<Image> images_;
  std::vector<Mask> masks_;
  std::vector<DepthView> views_;
};

std::vector<TrackedBody> Bodies(const Fields& fields, nb::handle X_WB, const char* name) {
  const ArrayArgument poses(X_WB, name);
  poses.RequireShape({static_cast<std::ptrdiff_t>(fields.size()), 4, 4});
  poses.RequireFinite();
  std::vector<TrackedBody> bodies;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const Eigen::Map<const RowMatrix4> X(poses.data() + 16 * i);
    bodies.push_back({fields[i], X.topLeftCorner<3, 3>(), X.topRightCorner<3, 1>()});
  }
  return bodies;
}

nb::object PointsNear(const nb::list& views, const Fields& fields, nb::handle X_WB,
                      nb::handle boxes_B, const Fields& other_fields, nb::handle X_WK,
                      double max_distance, double other_margin, int max_pixels,
                      double max_normal_angle) {
  const Views images(views);
  std::vector<TrackedBody> bodies = Bodies(fields, X_WB, "X_WB");
  const ArrayArgument boxes(boxes_B, "boxes");
  boxes.RequireShape({static_cast<std::ptrdiff_t>(bodies.size()), 2, 3});
  boxes.RequireFinite();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const double* const box = boxes.data() + 6 * i;
    bodies[i].box.extend(Eigen::Vector3d(box[0], box[1], box[2]));
    bodies[i].box.extend(Eigen::Vector3d(box[3], box[4], box[5]));
  }
  const std::vector<TrackedBody> others = Bodies(other_fields, X_WK, "X_WK");
  std::vector<double> points;
  {
    const nb::gil_scoped_release release;
    points = PointsNearBodies(images.get(), bodies, others, max_distance, other_margin,
                              max_normal_angle, max_pixels);
  }
  return ArrayResult<>({points.size() / 3, 3}, points.data()).Take();
}

nb::tuple Terms(nb::handle points_W, const Fields& fields, nb::handle X_WB, const std::string& loss,
                double loss_scale, const nb::list& views, const nb::list& samples, double margin,
                double max_violation, int search_radius, double free_space_weight) {
  const RowsArgument points(points_W, "points");
  const std::vector<TrackedBody> bodies = Bodies(fields, X_WB, "X_WB");
  const RobustLoss robust_loss = ParseRobustLoss(loss);
  const Views images(views);
  std::vector<SurfaceSamples> surfaces;
  std::vector<std::unique_ptr<ArrayArgument>> arrays;
  for (const nb::handle item : samples) {
    const nb::tuple parts = nb::cast<nb::tuple>(item);
    if (parts.size() != 2) throw std::invalid_argument("samples: expected points and normals");
    arrays.push_back(std::make_unique<ArrayArgument>(parts[0], "samples"));
    arrays.push_back(std::make_unique<ArrayArgument>(parts[1], "samples"));
    const ArrayArgument& p = **(arrays.end() - 2);
    const ArrayArgument& n = *arrays.back();
    p.RequireShape({-1, 3});
    p.RequireFinite();
    n.RequireShape({static_cast<std::ptrdiff_t>(p.shape(0)), 3});
    n.RequireFinite();
    surfaces.push_back({p.data(), n.data(), p.shape(0)});
  }
  std::vector<BodyTerm> terms;
  std::vector<SampleCounts> counts(bodies.size());
  {
    const nb::gil_scoped_release release;
    terms = SurfaceTerms(points.data(), points.shape(0), bodies, robust_loss, loss_scale);
    if (!images.get().empty()) {
      counts = AddFreeSpaceTerms(images.get(), bodies, surfaces,
                                 {margin, max_violation, search_radius}, free_space_weight, &terms);
    }
  }
  const std::size_t n = terms.size();
  ArrayResult<> information({n, 6, 6});
  ArrayResult<> gradient({n, 6});
  ArrayResult<> sums({n, 3});
  ArrayResult<> tallies({n, 5});
  for (std::size_t i = 0; i < n; ++i) {
    const BodyTerm& term = terms[i];
    std::copy_n(term.information.data(), 36, information.data() + 36 * i);  // Symmetric.
    std::copy_n(term.gradient.data(), 6, gradient.data() + 6 * i);
    const double three[] = {term.cost, term.weight, term.weighted_squares};
    std::copy_n(three, 3, sums.data() + 3 * i);
    const SampleCounts& c = counts[i];
    const std::int64_t five[] = {c.facing, c.seen, c.in_free, c.occluded, c.unknown};
    std::copy_n(five, 5, tallies.data() + 5 * i);
  }
  return nb::make_tuple(information.Take(), gradient.Take(), sums.Take(), tallies.Take());
}

nb::object Violation(nb::handle points_W, const nb::list& view, double margin) {
  const RowsArgument points(points_W, "points_W");
  const Views images(view);
  if (images.get().size() != 1) throw std::invalid_argument("view: expected one");
  if (!std::isfinite(margin)) throw std::invalid_argument("margin: must be finite");
  ArrayResult<> violations({points.shape(0)});
  {
    const nb::gil_scoped_release release;
    FreeSpaceViolation(images.get()[0], points.data(), points.shape(0), margin, violations.data());
  }
  return violations.Take();
}

}  // namespace

void BindTracking(nb::module_& m) {
  m.def("points_near_bodies", &PointsNear, "views"_a, "fields"_a, "X_WB"_a, "boxes"_a,
        "other_fields"_a, "X_WK"_a, "max_distance"_a, "other_margin"_a, "max_pixels"_a,
        "max_normal_angle"_a = M_PI);
  m.def("body_terms", &Terms, "points"_a, "fields"_a, "X_WB"_a, "loss"_a, "loss_scale"_a, "views"_a,
        "samples"_a, "margin"_a, "max_violation"_a, "search_radius"_a, "free_space_weight"_a);
  m.def("free_space_violation", &Violation, "points_W"_a, "view"_a, "margin"_a);
}

}  // namespace prehensile
