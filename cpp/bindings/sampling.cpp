#include "prehensile/sampling.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

/// (N, 3)
class PointsArgument : public ArrayArgument {
 public:
  explicit PointsArgument(nb::handle value) : ArrayArgument(value, "points") {
    RequireShape({-1, 3});
  }
};

nb::object ToArray(const std::vector<std::int32_t>& indices) {
  return ArrayResult<std::int32_t>({indices.size()}, indices.data()).Take();
}

}  // namespace

void BindSampling(nb::module_& m) {
  m.def(
      "farthest_points",
      [](nb::handle points_argument, std::size_t count, std::size_t start) {
        const PointsArgument points(points_argument);
        std::vector<std::int32_t> indices(std::min(count, points.shape(0) + 1));
        std::vector<double> distances(indices.size());
        {
          const nb::gil_scoped_release release;
          FarthestPoints(points.data(), points.shape(0), count, start, indices.data(),
                         distances.data());
        }
        return nb::make_tuple(ToArray(indices),
                              ArrayResult<>({distances.size()}, distances.data()).Take());
      },
      "points"_a, "count"_a, "start"_a);
  m.def(
      "eliminate_samples",
      [](nb::handle points_argument, std::size_t count, double radius) {
        const PointsArgument points(points_argument);
        std::vector<std::int32_t> kept;
        {
          const nb::gil_scoped_release release;
          kept = EliminateSamples(points.data(), points.shape(0), count, radius);
        }
        return ToArray(kept);
      },
      "points"_a, "count"_a, "radius"_a);
  m.def(
      "keep_apart",
      [](nb::handle points_argument, double radius) {
        const PointsArgument points(points_argument);
        std::vector<std::int32_t> kept;
        {
          const nb::gil_scoped_release release;
          kept = KeepApart(points.data(), points.shape(0), radius);
        }
        return ToArray(kept);
      },
      "points"_a, "radius"_a);
}

}  // namespace prehensile
