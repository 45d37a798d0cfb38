#include "prehensile/regions.h"

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

nb::object ToNumpy(const std::vector<std::int64_t>& values) {
  return ArrayResult<std::int64_t>({values.size()}, values.data()).Take();
}

nb::object ToNumpy(const std::vector<Plane>& planes) {
  ArrayResult<> result({planes.size(), 4});
  for (std::size_t i = 0; i < planes.size(); ++i) {
    std::copy_n(planes[i].normal, 3, result.data() + 4 * i);
    result.data()[4 * i + 3] = planes[i].offset;
  }
  return result.Take();
}

}  // namespace

void BindRegions(nb::module_& m) {
  m.def(
      "ransac_plane",
      [](nb::handle points, double max_distance, double confidence, int max_iterations,
         std::uint64_t seed) {
        const RowsArgument p(points, "points");
        PlaneResult result;
        {
          const nb::gil_scoped_release release;
          result = RansacPlane(p.data(), p.shape(0),
                               {.max_distance = max_distance,
                                .confidence = confidence,
                                .max_iterations = max_iterations,
                                .seed = seed});
        }
        std::vector<Plane> planes;
        if (result.found) planes.push_back(result.plane);
        return nb::make_tuple(
            ToNumpy(planes),
            ArrayResult<std::uint8_t>({result.inliers.size()}, result.inliers.data()).Take(),
            result.iterations);
      },
      "points"_a, "max_distance"_a, "confidence"_a, "max_iterations"_a, "seed"_a);
  m.def(
      "euclidean_clusters",
      [](nb::handle points, double tolerance, std::size_t min_points) {
        const RowsArgument p(points, "points");
        std::vector<std::int64_t> labels;
        {
          const nb::gil_scoped_release release;
          labels = EuclideanClusters(p.data(), p.shape(0), tolerance, min_points);
        }
        return ToNumpy(labels);
      },
      "points"_a, "tolerance"_a, "min_points"_a);
  m.def(
      "grow_planes",
      [](nb::handle points, nb::handle normals, double radius, double max_angle,
         double max_distance, std::size_t min_points) {
        const RowsArgument p(points, "points");
        const RowsArgument n(normals, "normals", static_cast<std::ptrdiff_t>(p.shape(0)));
        std::vector<Plane> planes;
        std::vector<std::int64_t> labels;
        {
          const nb::gil_scoped_release release;
          labels = GrowPlanes(p.data(), n.data(), p.shape(0),
                              {.radius = radius,
                               .max_angle = max_angle,
                               .max_distance = max_distance,
                               .min_points = min_points},
                              &planes);
        }
        return nb::make_tuple(ToNumpy(labels), ToNumpy(planes));
      },
      "points"_a, "normals"_a, "radius"_a, "max_angle"_a, "max_distance"_a, "min_points"_a);
  m.def(
      "convex_segments",
      [](nb::handle points, nb::handle normals, double voxel_size, double max_concavity,
         double max_step, std::size_t min_points) {
        const RowsArgument p(points, "points");
        const RowsArgument n(normals, "normals", static_cast<std::ptrdiff_t>(p.shape(0)));
        std::vector<std::int64_t> labels;
        {
          const nb::gil_scoped_release release;
          labels = ConvexSegments(p.data(), n.data(), p.shape(0),
                                  {.voxel_size = voxel_size,
                                   .max_concavity = max_concavity,
                                   .max_step = max_step,
                                   .min_points = min_points});
        }
        return ToNumpy(labels);
      },
      "points"_a, "normals"_a, "voxel_size"_a, "max_concavity"_a, "max_step"_a, "min_points"_a);
  m.def(
      "resting_pairs",
      [](nb::handle points, nb::handle normals, nb::handle labels, double voxel_size,
         std::size_t num_labels) {
        const RowsArgument p(points, "points");
        const RowsArgument n(normals, "normals", static_cast<std::ptrdiff_t>(p.shape(0)));
        const ArrayArgument l(labels, "labels");
        l.RequireShape({static_cast<std::ptrdiff_t>(p.shape(0))});
        const std::vector<int> whole = l.Integers();
        const std::vector<std::int64_t> of_point(whole.begin(), whole.end());
        std::vector<std::int64_t> counts;
        {
          const nb::gil_scoped_release release;
          counts =
              RestingPairs(p.data(), n.data(), of_point.data(), p.shape(0), voxel_size, num_labels);
        }
        return ArrayResult<std::int64_t>({num_labels, num_labels}, counts.data()).Take();
      },
      "points"_a, "normals"_a, "labels"_a, "voxel_size"_a, "num_labels"_a);
}

}  // namespace prehensile
