#include "prehensile/voxel_downsample.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>
#include <string>
#include <utility>

#include "bindings.h"
#include "prehensile/simd.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

template <typename Scalar>
using Rows = nb::ndarray<const Scalar, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

/// Hands a vector over to NumPy, without a copy.
template <typename T>
nb::ndarray<nb::numpy, T> ToNumpy(std::vector<T>&& values, bool rows_of_three) {
  auto* const owned = new std::vector<T>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  if (rows_of_three) {
    return nb::ndarray<nb::numpy, T>(owned->data(), {owned->size() / 3, 3}, owner);
  }
  return nb::ndarray<nb::numpy, T>(owned->data(), {owned->size()}, owner);
}

SimdLevel ParseSimdLevel(const std::string& name) {
  for (const SimdLevel level : AvailableSimdLevels()) {
    if (Name(level) == name) return level;
  }
  throw std::invalid_argument("simd: this machine lacks '" + name + "'");
}

template <typename Scalar>
nb::tuple VoxelDownsampleArrays(const Rows<Scalar>& points, double voxel_size,
                                const std::optional<Rows<Scalar>>& normals, int num_threads,
                                const std::optional<std::string>& simd) {
  VoxelOptions options{.num_threads = num_threads};
  if (simd) options.simd = ParseSimdLevel(*simd);
  const auto view = [](const Rows<Scalar>& rows) {
    return RowsView<Scalar>(rows.data(), static_cast<Eigen::Index>(rows.shape(0)), 3);
  };
  const RowsView<Scalar> points_view = view(points);
  std::optional<RowsView<Scalar>> normals_view;
  if (normals) normals_view.emplace(view(*normals));
  VoxelCloud<Scalar> cloud;
  {
    const nb::gil_scoped_release release;
    cloud = VoxelDownsample<Scalar>(points_view, voxel_size,
                                    normals_view ? &*normals_view : nullptr, options);
  }
  nb::object cloud_normals = nb::none();
  if (normals) cloud_normals = nb::cast(ToNumpy(std::move(cloud.normals), true));
  return nb::make_tuple(ToNumpy(std::move(cloud.points), true), cloud_normals,
                        ToNumpy(std::move(cloud.counts), false));
}

template <typename Scalar>
void Bind(nb::module_& m) {
  m.def("voxel_downsample", &VoxelDownsampleArrays<Scalar>, "points"_a.noconvert(), "voxel_size"_a,
        "normals"_a.noconvert().none(), "num_threads"_a, "simd"_a = nb::none());
}

}  // namespace

void BindVoxelDownsample(nb::module_& m) {
  Bind<float>(m);
  Bind<double>(m);
  m.def("simd_levels", [] {
    std::vector<std::string> names;
    for (const SimdLevel level : AvailableSimdLevels()) names.emplace_back(Name(level));
    return names;
  });
}

}  // namespace prehensile
