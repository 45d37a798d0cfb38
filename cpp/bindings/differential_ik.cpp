#include "prehensile/differential_ik.h"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bindings.h"
#include "numpy_arrays.h"
#include "prehensile/frame_ik.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<double> Numbers(nb::handle value, const char* name) {
  if (value.is_none()) return {};
  const ArrayArgument array(value, name);
  array.RequireShape({-1});
  return {array.data(), array.end()};
}

void Construct(DifferentialIk* ik, nb::handle position_lower, nb::handle position_upper,
               nb::handle velocity, nb::handle acceleration, double period, int formulation,
               double damping, int centering, double centering_weight, nb::handle centering_gain,
               nb::handle nominal_position, double direction_weight, double rank_tolerance) {
  JointLimits limits{Numbers(position_lower, "position_lower"),
                     Numbers(position_upper, "position_upper"), Numbers(velocity, "velocity"),
                     Numbers(acceleration, "acceleration")};
  DifferentialIkOptions options{
      .period = period,
      .formulation = static_cast<IkFormulation>(formulation),
      .damping = damping,
      .centering = static_cast<IkCentering>(centering),
      .centering_weight = centering_weight,
      .centering_gain = Numbers(centering_gain, "centering_gain"),
      .nominal_position = Numbers(nominal_position, "nominal_position"),
      .direction_weight = direction_weight,
      .rank_tolerance = rank_tolerance,
  };
  new (ik) DifferentialIk(std::move(limits), std::move(options));
}

/// An argument of doubles that may be None.
class OptionalArray {
 public:
  OptionalArray(nb::handle value, const char* name) {
    if (!value.is_none()) array_.emplace(value, name);
  }
  explicit operator bool() const { return array_.has_value(); }
  const ArrayArgument* operator->() const { return &*array_; }
  const double* data() const { return array_ ? array_->data() : nullptr; }

 private:
  std::optional<ArrayArgument> array_;
};

/// A state (n,), or N of them (N, n) in a batch.
struct State {
  State(int n, nb::handle q_handle, nb::handle v_handle, bool batch)
      : q(q_handle, "q"), v(v_handle, "v"), N(batch && q.ndim() > 0 ? q.shape(0) : 1) {
    const auto rows = static_cast<std::ptrdiff_t>(N);
    for (const ArrayArgument* array : {&q, &v}) {
      batch ? array->RequireShape({rows, n}) : array->RequireShape({n});
      array->RequireFinite();
    }
  }
  ArrayArgument q, v;
  std::size_t N;
};

/// Constraints lower <= A v <= upper; in a batch (N, m, n) and (N, m).
class Constraints {
 public:
  Constraints(int n, nb::handle A, nb::handle lower, nb::handle upper, bool batch, std::size_t N)
      : A_(A, "A"), lower_(lower, "lower"), upper_(upper, "upper") {
    if (!A_) {
      if (lower_ || upper_) throw std::invalid_argument("A: missing, though there are bounds");
      return;
    }
    const auto count = static_cast<std::ptrdiff_t>(N);
    const int dims = batch ? 3 : 2;
    const auto m =
        A_->ndim() == dims ? static_cast<std::ptrdiff_t>(A_->shape(dims - 2)) : std::ptrdiff_t{-1};
    batch ? A_->RequireShape({count, m, n}) : A_->RequireShape({m, n});
    A_->RequireFinite();
    if (m > kMaxIkRows) throw std::invalid_argument("A: more than 96 rows");
    for (OptionalArray* side : {&lower_, &upper_}) {
      if (!*side) continue;
      batch ? (*side)->RequireShape({count, m}) : (*side)->RequireShape({m});
    }
    const std::size_t size = N * static_cast<std::size_t>(m);
    rows.num = static_cast<int>(m);
    rows.C = A_.data();
    rows.lower = Side(lower_, "lower", size, -kInfinity);
    rows.upper = Side(upper_, "upper", size, kInfinity);
    if (lower_ && upper_) {
      for (std::size_t i = 0; i < lower_->size(); ++i) {
        if (lower_.data()[i] > upper_.data()[i]) {
          throw std::invalid_argument("lower: above upper");
        }
      }
    }
  }

  LinearRows rows;

 private:
  const double* Side(const OptionalArray& side, const char* name, std::size_t size, double none) {
    if (!side) {
      missing_.assign(size, none);
      return missing_.data();
    }
    for (std::size_t i = 0; i < size; ++i) {
      if (std::isnan(side.data()[i]) || side.data()[i] == -none) {
        throw std::invalid_argument(std::string(name) + ": NaN, or infinite on the wrong side");
      }
    }
    return side.data();
  }

  OptionalArray A_, lower_, upper_;
  std::vector<double> missing_;  // At most one side is: else there is nothing to constrain.
};

/// Rows J v ≈ V; in a batch (N, k, n) and (N, k).
struct Tasks {
  Tasks(int n, nb::handle J_handle, nb::handle V_handle, nb::handle weight_handle,
        const std::optional<std::vector<int>>& sizes, bool batch, std::size_t N)
      : J(J_handle, "J"), V(V_handle, "V"), weights(weight_handle, "weights") {
    const auto count = static_cast<std::ptrdiff_t>(N);
    const int dims = batch ? 3 : 2;
    const auto k =
        J.ndim() == dims ? static_cast<std::ptrdiff_t>(J.shape(dims - 2)) : std::ptrdiff_t{-1};
    batch ? J.RequireShape({count, k, n}) : J.RequireShape({k, n});
    batch ? V.RequireShape({count, k}) : V.RequireShape({k});
    J.RequireFinite();
    V.RequireFinite();
    if (k > kMaxIkRows) throw std::invalid_argument("J: more than 96 rows");
    rows.num = static_cast<int>(k);
    rows.J = J.data();
    rows.V = V.data();
    if (weights) {
      weights->RequireShape({k});
      weights->RequireFinite();
      rows.weights = weights.data();
    }
    if (sizes) {
      const bool negative = std::any_of(sizes->begin(), sizes->end(), [](int s) { return s < 0; });
      if (sizes->empty() || negative ||
          std::accumulate(sizes->begin(), sizes->end(), 0) != rows.num) {
        throw std::invalid_argument("level_sizes: do not add up to the rows of J");
      }
      rows.level_sizes = sizes->data();
      rows.num_levels = static_cast<int>(sizes->size());
    }
  }
  ArrayArgument J, V;
  OptionalArray weights;
  IkTaskRows rows;
};

IkStep Step(const DifferentialIk& ik, nb::handle q, nb::handle v, nb::handle J, nb::handle V,
            nb::handle weights, const std::optional<std::vector<int>>& level_sizes, nb::handle A,
            nb::handle lower, nb::handle upper) {
  const int n = ik.num_joints();
  const State state(n, q, v, false);
  const Tasks tasks(n, J, V, weights, level_sizes, false, 1);
  const Constraints constraints(n, A, lower, upper, false, 1);
  IkStep step;
  ik.Step(state.q.data(), state.v.data(), tasks.rows, constraints.rows, &step);
  return step;
}

nb::tuple StepBatch(const DifferentialIk& ik, nb::handle q, nb::handle v, nb::handle J,
                    nb::handle V, nb::handle weights,
                    const std::optional<std::vector<int>>& level_sizes, nb::handle A,
                    nb::handle lower, nb::handle upper, int num_threads) {
  const int n = ik.num_joints();
  const State state(n, q, v, true);
  const Tasks tasks(n, J, V, weights, level_sizes, true, state.N);
  const Constraints constraints(n, A, lower, upper, true, state.N);
  ArrayResult<> v_next{state.N, static_cast<std::size_t>(n)};
  ArrayResult<std::int32_t> status{state.N};
  {
    const nb::gil_scoped_release release;
    ik.StepBatch(state.N, state.q.data(), state.v.data(), tasks.rows, constraints.rows,
                 v_next.data(), status.data(), num_threads);
  }
  return nb::make_tuple(v_next.Take(), status.Take());
}

nb::tuple VelocityInterval(const DifferentialIk& ik, nb::handle q, nb::handle v) {
  const int n = ik.num_joints();
  const State state(n, q, v, false);
  ArrayResult<> lower{static_cast<std::size_t>(n)}, upper{static_cast<std::size_t>(n)};
  const bool beyond =
      ik.VelocityInterval(state.q.data(), state.v.data(), lower.data(), upper.data());
  return nb::make_tuple(lower.Take(), upper.Take(), beyond);
}

void ConstructFrames(FrameIk* frame_ik, const KinematicTree& tree, const DifferentialIk& ik,
                     nb::handle frames, nb::handle weights, nb::handle in_frame, nb::handle levels,
                     nb::handle gains, nb::handle max_angular, nb::handle max_linear) {
  const ArrayArgument frame(frames, "frames"), weight(weights, "weights"),
      own_axes(in_frame, "in_frame"), level(levels, "levels"), gain(gains, "gains"),
      angular(max_angular, "max_angular"), linear(max_linear, "max_linear");
  const auto m = static_cast<std::ptrdiff_t>(frame.size());
  weight.RequireShape({m, 6});
  for (const ArrayArgument* array : {&frame, &own_axes, &level, &gain, &angular, &linear}) {
    array->RequireShape({m});
  }
  const std::vector<int> numbers = frame.Integers(), priorities = level.Integers();
  std::vector<FrameTask> tasks(frame.size());
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    FrameTask& task = tasks[i];
    task.frame = numbers[i];
    std::copy(weight.data() + 6 * i, weight.data() + 6 * (i + 1), task.weights);
    task.in_frame = own_axes[i] != 0.0;
    task.level = priorities[i];
    task.gain = gain[i];
    task.max_angular = angular[i];
    task.max_linear = linear[i];
  }
  new (frame_ik) FrameIk(std::make_shared<const KinematicTree>(tree), ik, std::move(tasks));
}

IkStep FrameStep(const FrameIk& ik, nb::handle q, nb::handle v, nb::handle X_WD, nb::handle V_WD,
                 nb::handle A, nb::handle lower, nb::handle upper) {
  const int n = ik.num_joints();
  const State state(n, q, v, false);
  const OptionalArray poses(X_WD, "X_WD"), velocities(V_WD, "V_WD");
  if (poses) {
    ik.num_tasks() == 1 && poses->ndim() == 2 ? poses->RequireShape({4, 4})
                                              : poses->RequireShape({ik.num_tasks(), 4, 4});
    poses->RequireFinite();
  }
  if (velocities) {
    ik.num_tasks() == 1 && velocities->ndim() == 1 ? velocities->RequireShape({6})
                                                   : velocities->RequireShape({ik.num_tasks(), 6});
    velocities->RequireFinite();
  }
  const Constraints constraints(n, A, lower, upper, false, 1);
  IkStep step;
  ik.Step(state.q.data(), state.v.data(), poses.data(), velocities.data(), constraints.rows, &step);
  return step;
}

nb::tuple Rollout(const FrameIk& ik, nb::handle q, nb::handle v, nb::handle X_WD, int steps,
                  bool keep_path, int num_threads) {
  const int n = ik.num_joints();
  const State state(n, q, v, true);
  const ArrayArgument poses(X_WD, "X_WD");
  poses.RequireShape({static_cast<std::ptrdiff_t>(state.N), ik.num_tasks(), 4, 4});
  poses.RequireFinite();
  if (steps < 0) throw std::invalid_argument("steps: expected >= 0");
  const auto columns = static_cast<std::size_t>(n);
  ArrayResult<> q_end({state.N, columns}, state.q.data()),
      v_end({state.N, columns}, state.v.data());
  ArrayResult<std::int32_t> status{state.N};
  std::optional<ArrayResult<>> path;
  if (keep_path) path.emplace(ArrayResult<>{state.N, static_cast<std::size_t>(steps), columns});
  {
    double* const path_data = path ? path->data() : nullptr;
    const nb::gil_scoped_release release;
    ik.Rollout(state.N, steps, q_end.data(), v_end.data(), poses.data(), path_data, status.data(),
               num_threads);
  }
  return nb::make_tuple(q_end.Take(), v_end.Take(), status.Take(),
                        path ? path->Take() : nb::none());
}

nb::object Array(const double* values, int n) {
  return ArrayResult<>({static_cast<std::size_t>(n)}, values).Take();
}

}  // namespace

void BindDifferentialIk(nb::module_& m) {
  nb::class_<IkStep>(m, "IkStep")
      .def_prop_ro("v", [](const IkStep& s) { return Array(s.v, s.n); })
      .def_prop_ro("lower", [](const IkStep& s) { return Array(s.lower, s.n); })
      .def_prop_ro("upper", [](const IkStep& s) { return Array(s.upper, s.n); })
      .def_prop_ro("status", [](const IkStep& s) { return static_cast<int>(s.status); })
      .def_ro("alpha", &IkStep::alpha)
      .def_ro("violation", &IkStep::violation)
      .def_ro("iterations", &IkStep::iterations);
  nb::class_<DifferentialIk>(m, "DifferentialIk")
      .def("__init__", &Construct, "position_lower"_a, "position_upper"_a, "velocity"_a,
           "acceleration"_a, "period"_a, "formulation"_a, "damping"_a, "centering"_a,
           "centering_weight"_a, "centering_gain"_a.none(), "nominal_position"_a.none(),
           "direction_weight"_a, "rank_tolerance"_a)
      .def_prop_ro("num_joints", &DifferentialIk::num_joints)
      .def("step", &Step, "q"_a, "v"_a, "J"_a, "V"_a, "weights"_a = nb::none(),
           "level_sizes"_a = nb::none(), "A"_a = nb::none(), "lower"_a = nb::none(),
           "upper"_a = nb::none())
      .def("step_batch", &StepBatch, "q"_a, "v"_a, "J"_a, "V"_a, "weights"_a = nb::none(),
           "level_sizes"_a = nb::none(), "A"_a = nb::none(), "lower"_a = nb::none(),
           "upper"_a = nb::none(), "num_threads"_a = 1)
      .def("velocity_interval", &VelocityInterval, "q"_a, "v"_a);
  nb::class_<FrameIk>(m, "FrameIk")
      .def("__init__", &ConstructFrames, "tree"_a, "ik"_a, "frames"_a, "weights"_a, "in_frame"_a,
           "levels"_a, "gains"_a, "max_angular"_a, "max_linear"_a)
      .def_prop_ro("num_joints", &FrameIk::num_joints)
      .def_prop_ro("num_tasks", &FrameIk::num_tasks)
      .def("step", &FrameStep, "q"_a, "v"_a, "X_WD"_a = nb::none(), "V_WD"_a = nb::none(),
           "A"_a = nb::none(), "lower"_a = nb::none(), "upper"_a = nb::none())
      .def("rollout", &Rollout, "q"_a, "v"_a, "X_WD"_a, "steps"_a, "keep_path"_a = false,
           "num_threads"_a = 1);
}

}  // namespace prehensile
