#include "prehensile/reachability.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <string>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

template <typename T>
using Voxels = nb::ndarray<T, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

ReachPart ParsePart(const std::string& name) {
  if (name == "rotational") return ReachPart::kRotational;
  if (name == "translational") return ReachPart::kTranslational;
  if (name == "both") return ReachPart::kBoth;
  throw std::invalid_argument("part: must be rotational, translational or both, not '" + name +
                              "'");
}

nb::object Sample(const std::vector<double>& lower, const std::vector<double>& upper,
                  std::uint64_t seed, std::uint64_t first, std::size_t count, int num_threads) {
  ArrayResult<> Q{count, lower.size()};
  double* const data = Q.data();
  {
    const nb::gil_scoped_release release;
    SampleConfigurations(lower, upper, seed, first, count, num_threads, data);
  }
  return Q.Take();
}

std::size_t AddRows(const KinematicTree& tree, int frame, nb::handle q,
                    const std::array<double, 3>& axis, nb::handle directions,
                    const std::string& part, double length, double voxel_size,
                    const std::array<std::int64_t, 3>& first, const Voxels<std::uint32_t>& counts,
                    const Voxels<std::uint64_t>& reached, const Voxels<double>& manipulability,
                    const Voxels<double>& singular_value, int num_threads) {
  const ArrayArgument Q(q, "Q"), units(directions, "directions");
  Q.RequireShape({-1, tree.num_joints()});
  Q.RequireFinite();
  units.RequireShape({-1, 3});
  ReachQuery query{
      .frame = frame, .axis = axis, .directions = {}, .part = ParsePart(part), .length = length};
  for (std::size_t d = 0; d < units.shape(0); ++d) {
    const double* const u = units.data() + 3 * d;
    query.directions.push_back({u[0], u[1], u[2]});
  }
  std::array<std::int64_t, 3> shape;
  for (std::size_t k = 0; k < 3; ++k) {
    shape[k] = static_cast<std::int64_t>(counts.shape(k));
    if (reached.shape(k) != counts.shape(k) || manipulability.shape(k) != counts.shape(k) ||
        singular_value.shape(k) != counts.shape(k)) {
      throw std::invalid_argument("counts: the arrays of voxels differ in shape");
    }
  }
  const ReachVoxels voxels{.voxel_size = voxel_size,
                           .first = first,
                           .shape = shape,
                           .counts = counts.data(),
                           .directions = reached.data(),
                           .manipulability = manipulability.data(),
                           .singular_value = singular_value.data()};
  const nb::gil_scoped_release release;
  return AddToReach(tree, query, Q.data(), Q.shape(0), num_threads, voxels);
}

}  // namespace

void BindReachability(nb::module_& m) {
  m.def("sample_configurations", &Sample, "lower"_a, "upper"_a, "seed"_a, "first"_a, "count"_a,
        "num_threads"_a);
  m.def("add_to_reach", &AddRows, "tree"_a, "frame"_a, "Q"_a, "axis"_a, "directions"_a, "part"_a,
        "length"_a, "voxel_size"_a, "first"_a, "counts"_a.noconvert(), "reached"_a.noconvert(),
        "manipulability"_a.noconvert(), "singular_value"_a.noconvert(), "num_threads"_a);
}

}  // namespace prehensile
