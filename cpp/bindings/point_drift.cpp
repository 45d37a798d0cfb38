#include "prehensile/point_drift.h"

#include <optional>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

using RowMajor4d = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

void ConstructSums(GaussianSums* sums, nb::handle points) {
  const ArrayArgument rows(points, "points");
  rows.RequireShape({-1, 3});
  const nb::gil_scoped_release release;
  new (sums) GaussianSums(rows.data(), rows.shape(0));
}

nb::object SumsAt(const GaussianSums& sums, nb::handle queries, double sigma, double floor,
                  double reach, int num_threads) {
  const ArrayArgument rows(queries, "queries");
  rows.RequireShape({-1, 3});
  ArrayResult<> result{rows.shape(0), 6};
  double* const out = result.data();
  {
    const nb::gil_scoped_release release;
    sums.At(rows.data(), rows.shape(0), sigma, floor, reach, out, num_threads);
  }
  return result.Take();
}

nb::object Order(nb::handle points) {
  const ArrayArgument rows(points, "points");
  rows.RequireShape({-1, 3});
  std::vector<std::int32_t> order;
  {
    const nb::gil_scoped_release release;
    order = SpatialOrder(rows.data(), rows.shape(0));
  }
  return ArrayResult<std::int32_t>({order.size()}, order.data()).Take();
}

nb::object PoseRows(const Eigen::Matrix4d& X) {
  const RowMajor4d rows = X;
  return ArrayResult<>({4, 4}, rows.data()).Take();
}

nb::dict Drift(nb::handle scene, nb::handle model, nb::handle X_WO_guess, int dimension,
               double outlier_weight, double outlier_volume, double sigma, int max_iterations,
               double tolerance, bool keep_history, int num_threads) {
  const ArrayArgument s(scene, "scene"), m(model, "model");
  s.RequireShape({-1, 3});
  m.RequireShape({-1, 3});
  const PoseArgument guess(X_WO_guess, "X_WO_guess");
  const Eigen::Matrix4d X = Eigen::Map<const RowMajor4d>(guess.data());
  const PointDriftOptions options{dimension,      outlier_weight, outlier_volume, sigma,
                                  max_iterations, tolerance,      num_threads};
  PointDriftResult result;
  {
    const nb::gil_scoped_release release;
    result =
        CoherentPointDrift(s.data(), s.shape(0), m.data(), m.shape(0), X, options, keep_history);
  }
  nb::dict d;
  d["X_WO"] = PoseRows(result.X_WO);
  d["converged"] = result.converged;
  d["iterations"] = result.iterations;
  d["sigma"] = result.sigma;
  d["probabilities"] =
      ArrayResult<>({result.probabilities.size()}, result.probabilities.data()).Take();
  d["num_explained"] = result.num_explained;
  d["rotation_information"] = ArrayResult<>({3, 3}, result.rotation_information.data()).Take();
  d["centroid"] = ArrayResult<>({3}, result.centroid.data()).Take();
  d["length_scale"] = result.length_scale;
  nb::list history;
  for (const Eigen::Matrix4d& pose : result.history) history.append(PoseRows(pose));
  d["history"] = history;
  return d;
}

}  // namespace

void BindPointDrift(nb::module_& m) {
  nb::class_<GaussianSums>(m, "GaussianSums")
      .def("__init__", &ConstructSums, "points"_a)
      .def("__len__", &GaussianSums::size)
      .def("at", &SumsAt, "queries"_a, "sigma"_a, "floor"_a, "reach"_a, "num_threads"_a);
  m.def("spatial_order", &Order, "points"_a);
  m.def("coherent_point_drift", &Drift, "scene"_a, "model"_a, "X_WO_guess"_a, nb::kw_only(),
        "dimension"_a, "outlier_weight"_a, "outlier_volume"_a, "sigma"_a, "max_iterations"_a,
        "tolerance"_a, "keep_history"_a, "num_threads"_a);
}

}  // namespace prehensile
