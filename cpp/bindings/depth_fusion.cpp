#include "prehensile/depth_fusion.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

template <typename T>
using Array = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;

/// A view and what keeps its arrays alive. Python gives a tuple (depth (H, W) float32 or uint16,
/// scale, [fx, fy, cx, cy], rays (2, H, W) float32 or None, X_WC, colors (H, W, 3) uint8 or None).
class ViewArgument {
 public:
  explicit ViewArgument(const nb::tuple& parts) {
    if (parts.size() != 6) throw std::invalid_argument("views: expected tuples of six");
    if (nb::try_cast(parts[0], metres_, false)) {
      SetSize(metres_);
      view_.depth = metres_->data();
    } else if (nb::try_cast(parts[0], raw_, false)) {
      SetSize(raw_);
      view_.raw_depth = raw_->data();
    } else {
      throw std::invalid_argument("depth: expected a contiguous array of float32 or uint16");
    }
    view_.scale = nb::cast<double>(parts[1]);
    const VectorArgument pinhole(parts[2], "camera", 4);
    view_.fx = pinhole[0], view_.fy = pinhole[1], view_.cx = pinhole[2], view_.cy = pinhole[3];
    if (!parts[3].is_none()) {
      if (!nb::try_cast(parts[3], rays_, false) || rays_->ndim() != 3 || rays_->shape(0) != 2 ||
          !IsImage(*rays_, 1)) {
        throw std::invalid_argument("rays: expected (2, H, W) float32 of the depth's size");
      }
      view_.rays = rays_->data();
    }
    const PoseArgument X_WC(parts[4], "X_WC");
    view_.X_WC = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(X_WC.data());
    if (!parts[5].is_none()) {
      if (!nb::try_cast(parts[5], colors_, false) || colors_->ndim() != 3 ||
          colors_->shape(2) != 3 || !IsImage(*colors_, 0)) {
        throw std::invalid_argument("colors: expected (H, W, 3) uint8 of the depth's size");
      }
      view_.colors = colors_->data();
    }
  }

  const DepthImageView& view() const { return view_; }

 private:
  template <typename T>
  void SetSize(const std::optional<Array<T>>& depth) {
    if (depth->ndim() != 2 || depth->shape(0) > 1 << 15 || depth->shape(1) > 1 << 15) {
      throw std::invalid_argument("depth: expected shape (H, W), at most 32768 each");
    }
    view_.height = static_cast<int>(depth->shape(0));
    view_.width = static_cast<int>(depth->shape(1));
  }
  template <typename T>
  bool IsImage(const Array<T>& array, int first) const {
    return array.shape(first) == static_cast<std::size_t>(view_.height) &&
           array.shape(first + 1) == static_cast<std::size_t>(view_.width);
  }

  DepthImageView view_;
  std::optional<Array<float>> metres_, rays_;
  std::optional<Array<std::uint16_t>> raw_;
  std::optional<Array<std::uint8_t>> colors_;
};

template <typename T>
nb::object Rows(std::vector<T>&& values) {
  auto* const owned = new std::vector<T>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, T>(owned->data(), {owned->size() / 3, 3}, owner));
}

DepthOptions Options(const nb::tuple& limits, int num_threads,
                     const std::optional<std::string>& simd) {
  DepthOptions options{.min_depth = nb::cast<double>(limits[0]),
                       .max_depth = nb::cast<double>(limits[1]),
                       .window = nb::cast<int>(limits[2]),
                       .max_residual = nb::cast<double>(limits[3]),
                       .max_incidence = nb::cast<double>(limits[4]),
                       .noise_constant = nb::cast<double>(limits[5]),
                       .noise_quadratic = nb::cast<double>(limits[6]),
                       .num_threads = num_threads};
  for (const SimdLevel level : AvailableSimdLevels()) {
    if (simd && Name(level) == *simd) options.simd = level;
  }
  if (simd && !options.simd) throw std::invalid_argument("simd: this machine lacks " + *simd);
  return options;
}

nb::tuple Fuse(const nb::list& views, nb::handle X_WB, nb::handle size, double voxel_size,
               const nb::tuple& limits, int num_threads, const std::optional<std::string>& simd) {
  std::vector<ViewArgument> arguments;
  arguments.reserve(views.size());
  for (const nb::handle view : views) arguments.emplace_back(nb::cast<nb::tuple>(view));
  std::vector<DepthImageView> plain;
  for (const ViewArgument& argument : arguments) plain.push_back(argument.view());
  const PoseArgument pose(X_WB, "X_WB");
  const VectorArgument edges(size, "size", 3);
  const DepthOptions options = Options(limits, num_threads, simd);
  FusedCloud cloud;
  {
    const nb::gil_scoped_release release;
    cloud = FuseDepthViews(
        plain, Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(pose.data()),
        Eigen::Map<const Eigen::Vector3d>(edges.data()), voxel_size, options);
  }
  nb::object colors = nb::none();
  if (!plain.empty() && plain[0].colors) colors = Rows(std::move(cloud.colors));
  return nb::make_tuple(Rows(std::move(cloud.points)), Rows(std::move(cloud.normals)),
                        Rows(std::move(cloud.sensor_origins)), colors);
}

template <void (*kFunction)(const DepthImageView&, const DepthOptions&, double*)>
nb::object PerPixel(const nb::tuple& view, const nb::tuple& limits, int num_threads,
                    const std::optional<std::string>& simd) {
  const ViewArgument argument(view);
  const DepthOptions options = Options(limits, num_threads, simd);
  ArrayResult<double> result({static_cast<std::size_t>(argument.view().height),
                              static_cast<std::size_t>(argument.view().width), 3});
  double* const data = result.data();
  {
    const nb::gil_scoped_release release;
    kFunction(argument.view(), options, data);
  }
  return result.Take();
}

}  // namespace

void BindDepthFusion(nb::module_& m) {
  m.def("fuse_depth", &Fuse, "views"_a, "X_WB"_a, "size"_a, "voxel_size"_a, "limits"_a,
        "num_threads"_a, "simd"_a = nb::none());
  m.def("unproject_depth", &PerPixel<UnprojectDepth>, "view"_a, "limits"_a, "num_threads"_a,
        "simd"_a = nb::none());
  m.def("depth_normals", &PerPixel<DepthNormals>, "view"_a, "limits"_a, "num_threads"_a,
        "simd"_a = nb::none());
}

}  // namespace prehensile
