#include "prehensile/volumes.h"

#include <nanobind/ndarray.h>

#include <stdexcept>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

using Grid = nb::ndarray<float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Depth = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

Eigen::Matrix4d Matrix(const PoseArgument& pose) {
  pose.RequireFinite();
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(pose.data());
}

void Integrate(const Grid& distances, const Grid& weights, double voxel_size, nb::handle X_WB,
               const Depth& depth, nb::handle intrinsics, nb::handle X_WC, double truncation,
               double min_depth, double max_depth, int num_threads) {
  constexpr std::size_t kLimit = 1 << 15;
  for (int i = 0; i < 3; ++i) {
    if (distances.shape(i) != weights.shape(i) || distances.shape(i) > kLimit) {
      throw std::invalid_argument("weights: expected the shape of distances, at most 32768 each");
    }
  }
  if (depth.shape(0) > kLimit || depth.shape(1) > kLimit) {
    throw std::invalid_argument("depth: expected shape (H, W), at most 32768 each");
  }
  const VectorArgument pinhole(intrinsics, "intrinsics", 4);
  DepthImageView image;
  image.height = static_cast<int>(depth.shape(0));
  image.width = static_cast<int>(depth.shape(1));
  image.depth = depth.data();
  image.fx = pinhole[0], image.fy = pinhole[1], image.cx = pinhole[2], image.cy = pinhole[3];
  image.X_WC = Matrix(PoseArgument(X_WC, "X_WC"));
  const Eigen::Matrix4d box = Matrix(PoseArgument(X_WB, "X_WB"));
  const VolumeView volume{.nx = static_cast<int>(distances.shape(0)),
                          .ny = static_cast<int>(distances.shape(1)),
                          .nz = static_cast<int>(distances.shape(2)),
                          .voxel_size = voxel_size,
                          .distances = distances.data(),
                          .weights = weights.data()};
  DepthOptions options;
  options.min_depth = min_depth;
  options.max_depth = max_depth;
  options.num_threads = num_threads;
  const nb::gil_scoped_release release;
  IntegrateDepth(image, box, truncation, options, volume);
}

}  // namespace

void BindVolumes(nb::module_& m) {
  m.def("integrate_depth", &Integrate, "distances"_a.noconvert(), "weights"_a.noconvert(),
        "voxel_size"_a, "X_WB"_a, "depth"_a.noconvert(), "intrinsics"_a, "X_WC"_a, "truncation"_a,
        "min_depth"_a, "max_depth"_a, "num_threads"_a);
}

}  // namespace prehensile
