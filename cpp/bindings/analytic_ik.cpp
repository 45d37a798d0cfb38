#include "prehensile/analytic_ik.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>

#include "bindings.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

constexpr const char* kStatusNames[] = {"solved", "too far", "too near", "limits"};

using Rows3 = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Poses = nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Out = nb::ndarray<T, nb::c_contig, nb::device::cpu>;

/// A view of an object with a buffer, released in the end. Much faster than an ndarray argument.
class Buffer {
 public:
  Buffer() = default;
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  ~Buffer() {
    if (held_) PyBuffer_Release(&view_);
  }
  /// Whether the object has a buffer of float64 with so many dimensions.
  bool Open(nb::handle object, int ndim) {
    if (PyObject_GetBuffer(object.ptr(), &view_, PyBUF_STRIDES | PyBUF_FORMAT) != 0) {
      PyErr_Clear();
      return false;
    }
    held_ = true;
    return view_.ndim == ndim && view_.format != nullptr && std::strcmp(view_.format, "d") == 0;
  }
  Py_ssize_t shape(int i) const { return view_.shape[i]; }
  double at(Py_ssize_t i, Py_ssize_t j = 0) const {
    const char* p = static_cast<const char*>(view_.buf) + i * view_.strides[0];
    if (view_.ndim > 1) p += j * view_.strides[1];
    double value;
    std::memcpy(&value, p, sizeof(value));
    return value;
  }

 private:
  Py_buffer view_{};
  bool held_ = false;
};

/// numpy's functions, fetched once.
struct Numpy {
  nb::object empty, asarray, float64, uint8;
  nb::tuple shapes[2][IkSolutions::kMax + 1];  // Of solutions, for 6 and 7 joints.
  const nb::tuple& shape(int count, int num_joints) const { return shapes[num_joints - 6][count]; }
  Numpy() {
    for (int n : {6, 7}) {
      for (int count = 0; count <= IkSolutions::kMax; ++count) {
        shapes[n - 6][count] = nb::make_tuple(count, n);
      }
    }
    const nb::module_ numpy = nb::module_::import_("numpy");
    empty = numpy.attr("empty");
    asarray = numpy.attr("asarray");
    float64 = numpy.attr("float64");
    uint8 = numpy.attr("uint8");
  }
  static const Numpy& Get() {
    static const Numpy* const numpy = new Numpy;  // Lives as long as the process.
    return *numpy;
  }
};

nb::object AsFloat64(nb::handle values) {
  return Numpy::Get().asarray(values, Numpy::Get().float64);
}

/// A new array, and a copy of `values` in it.
template <typename T>
nb::object MakeArray(const nb::object& shape, const nb::object& dtype, const T* values,
                     std::size_t count) {
  PyObject* const args[] = {shape.ptr(), dtype.ptr()};
  nb::object array =
      nb::steal(PyObject_Vectorcall(Numpy::Get().empty.ptr(), args, std::size(args), nullptr));
  if (!array.is_valid()) throw nb::python_error();
  Py_buffer view;
  if (PyObject_GetBuffer(array.ptr(), &view, PyBUF_CONTIG) != 0) throw nb::python_error();
  std::memcpy(view.buf, values, count * sizeof(T));
  PyBuffer_Release(&view);
  return array;
}

/// Reads (4, 4) numbers, or a RigidTransform (anything with GetAsMatrix4), to row-major order.
std::array<double, 16> ReadMatrix(nb::handle X_WG) {
  std::array<double, 16> X;
  const auto read = [&](nb::handle object) {
    Buffer buffer;
    if (!buffer.Open(object, 2)) return false;
    if (buffer.shape(0) != 4 || buffer.shape(1) != 4) return false;
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) X[4 * i + j] = buffer.at(i, j);
    }
    return true;
  };
  if (read(X_WG)) return X;
  nb::object matrix = nb::hasattr(X_WG, "GetAsMatrix4") ? X_WG.attr("GetAsMatrix4")()
                                                        : nb::borrow<nb::object>(X_WG);
  if (!read(AsFloat64(matrix))) {
    throw std::invalid_argument("X_WG: expected a RigidTransform or shape (4, 4)");
  }
  return X;
}

/// n numbers; all finite.
std::array<double, IkSolutions::kMaxJoints> ReadJoints(const char* name, nb::handle values, int n) {
  std::array<double, IkSolutions::kMaxJoints> q;
  const auto read = [&](nb::handle object) {
    Buffer buffer;
    if (!buffer.Open(object, 1) || buffer.shape(0) != n) return false;
    for (int i = 0; i < n; ++i) q[i] = buffer.at(i);
    return true;
  };
  if (!read(values) && !read(AsFloat64(values))) {
    throw std::invalid_argument(std::string(name) + ": expected shape (" + std::to_string(n) +
                                ",)");
  }
  for (int i = 0; i < n; ++i) {
    if (!(q[i] - q[i] == 0)) throw std::invalid_argument(std::string(name) + ": not finite");
  }
  return q;
}

ArmLines MakeLines(const Rows3& axes, const Rows3& points, nb::handle X_WG0, const Numbers& lower,
                   const Numbers& upper) {
  const std::size_t n = axes.shape(0);
  if (points.shape(0) != n || lower.shape(0) != n || upper.shape(0) != n) {
    throw std::invalid_argument("axes, points, lower, upper: differ in length");
  }
  ArmLines lines;
  const std::array<double, 16> X = ReadMatrix(X_WG0);
  lines.X_WG0 = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(X.data());
  for (std::size_t i = 0; i < n; ++i) {
    lines.axes.emplace_back(axes(i, 0), axes(i, 1), axes(i, 2));
    lines.points.emplace_back(points(i, 0), points(i, 1), points(i, 2));
    lines.lower.push_back(lower(i));
    lines.upper.push_back(upper(i));
  }
  return lines;
}

/// Options of a call for one pose.
struct Near {
  std::array<double, IkSolutions::kMaxJoints> q;
  IkOptions options;
  Near(nb::handle q_near, bool limits, int n) {
    options.limits = limits;
    if (q_near.is_none()) return;
    q = ReadJoints("q_near", q_near, n);
    options.q_near = q.data();
  }
};

template <typename Arm, typename Solve>
nb::tuple Batch(const Arm& arm, const Poses& X_WG, nb::handle q_near, bool limits, int num_threads,
                const Solve& solve) {
  const std::size_t n = arm.num_joints(), count = X_WG.shape(0);
  std::optional<nb::ndarray<const double, nb::c_contig, nb::device::cpu>> near;
  bool near_each = false;
  if (!q_near.is_none()) {
    near = nb::cast<nb::ndarray<const double, nb::c_contig, nb::device::cpu>>(AsFloat64(q_near));
    near_each = near->ndim() == 2;
    if (near->ndim() < 1 || near->ndim() > 2 || near->shape(near->ndim() - 1) != n ||
        (near_each && near->shape(0) != count)) {
      throw std::invalid_argument("q_near: expected shape (n,) or (N, n)");
    }
    for (std::size_t i = 0; i < near->size(); ++i) {
      if (!(near->data()[i] - near->data()[i] == 0)) {
        throw std::invalid_argument("q_near: not finite");
      }
    }
  }
  const Numpy& numpy = Numpy::Get();
  nb::object q = numpy.empty(nb::make_tuple(count, 8, n), numpy.float64);
  nb::object status = numpy.empty(nb::make_tuple(count), numpy.uint8);
  const IkBatch batch{.num_poses = static_cast<int>(count),
                      .X_WG = X_WG.data(),
                      .q_near = near ? near->data() : nullptr,
                      .near_each = near_each,
                      .limits = limits,
                      .num_threads = num_threads,
                      .q = nb::cast<Out<double>>(q).data(),
                      .status = nb::cast<Out<std::uint8_t>>(status).data()};
  {
    const nb::gil_scoped_release release;
    solve(batch);
  }
  return nb::make_tuple(q, status);
}

template <typename Arm>
nb::class_<Arm> BindCommon(nb::module_& m, const char* name, const char* doc) {
  nb::class_<Arm> arm(m, name, doc);
  arm.def(
      "__init__",
      [](Arm* self, const Rows3& axes, const Rows3& points, nb::handle X_WG0, const Numbers& lower,
         const Numbers& upper, double tolerance) {
        new (self) Arm(MakeLines(axes, points, X_WG0, lower, upper), tolerance);
      },
      "axes"_a, "points"_a, "X_WG0"_a, "lower"_a, "upper"_a, "tolerance"_a = 1e-6);
  arm.def(
      "pose",
      [](const Arm& self, nb::handle q) {
        const auto joints = ReadJoints("q", q, self.num_joints());
        std::array<double, 16> X;
        self.Pose(joints.data(), X.data());
        return MakeArray(nb::make_tuple(4, 4), Numpy::Get().float64, X.data(), 16);
      },
      "q"_a, "Forward kinematics: X_WG, (4, 4), of the configuration q (n,).");
  arm.def_prop_ro("num_joints", &Arm::num_joints);
  const auto limit = [](const Arm& self, const std::array<double, 8>& values) {
    return MakeArray(nb::make_tuple(self.num_joints()), Numpy::Get().float64, values.data(),
                     self.num_joints());
  };
  arm.def_prop_ro("lower", [limit](const Arm& self) { return limit(self, self.lower()); });
  arm.def_prop_ro("upper", [limit](const Arm& self) { return limit(self, self.upper()); });
  return arm;
}

constexpr const char* kSolveDoc =
    R"(All solutions for one pose of the tool frame, in the order of their branches.

Solutions that coincide at a singular pose are given once.

Args:
    X_WG: RigidTransform or (4, 4).
    q_near: (n,) each joint's angle is the equivalent, by whole turns, that is nearest to this
        within the limits; a joint that a singular pose leaves free gets this value. Zeros if None.
    limits: whether solutions outside the joint limits are left out.

Raises:
    ValueError: X_WG is not a rigid transform (to 1e-6), or q_near is not (n,) finite numbers.)";

constexpr const char* kBatchDoc =
    R"(solve() for N poses.

Args:
    X_WG: (N, 4, 4).
    q_near: None, (n,) or (N, n).
    num_threads: number of threads to share the work; it does not change the result.

Returns:
    q: (N, 8, n), for each pose a row per branch, NaN where a branch has no solution.
    status: (N,) uint8, index into STATUSES.)";

template <typename Arm>
void BindSixJoints(nb::module_& m, const char* name, const char* doc) {
  nb::class_<Arm> arm = BindCommon<Arm>(m, name, doc);
  arm.def(
      "solve",
      [](const Arm& self, nb::handle X_WG, nb::handle q_near, bool limits) {
        const std::array<double, 16> X = ReadMatrix(X_WG);
        const Near near(q_near, limits, 6);
        IkSolutions solutions;
        self.Solve(X.data(), near.options, &solutions);
        return solutions;
      },
      "X_WG"_a, "q_near"_a = nb::none(), "limits"_a = true, kSolveDoc);
  arm.def(
      "solve_batch",
      [](const Arm& self, const Poses& X_WG, nb::handle q_near, bool limits, int num_threads) {
        return Batch(self, X_WG, q_near, limits, num_threads,
                     [&](const IkBatch& batch) { self.SolveBatch(batch); });
      },
      "X_WG"_a, "q_near"_a = nb::none(), "limits"_a = true, "num_threads"_a = 1, kBatchDoc);
  arm.def(
      "branch",
      [](const Arm& self, nb::handle q) { return self.Branch(ReadJoints("q", q, 6).data()); },
      "q"_a, "The branch of a configuration (6,).");
}

}  // namespace

void BindAnalyticIk(nb::module_& m) {
  nb::class_<IkSolutions>(m, "IkSolutions", "Solutions for one pose.")
      .def_prop_ro(
          "q",
          [](const IkSolutions& self) {
            return MakeArray(Numpy::Get().shape(self.count, self.num_joints), Numpy::Get().float64,
                             self.q.data(), self.count * self.num_joints);
          },
          "(B, n) a new array, row per solution.")
      .def_prop_ro(
          "branch",
          [](const IkSolutions& self) {
            return MakeArray(nb::make_tuple(self.count), Numpy::Get().uint8, self.branch.data(),
                             self.count);
          },
          "(B,) uint8 branch of each, ascending: 4 shoulder + 2 elbow + 1 wrist, where each is 0 "
          "or "
          "1; see the arm's class.")
      .def_prop_ro(
          "status",
          [](const IkSolutions& self) { return kStatusNames[static_cast<int>(self.status)]; },
          "\"solved\"; or why there is no solution: \"too far\", \"too near\" (to the base axis, "
          "or "
          "to the folded arm) or \"limits\" (of the joints).")
      .def("__len__", [](const IkSolutions& self) { return self.count; });

  nb::class_<ArmAngleChoice>(m, "ArmAngleChoice", "A solution chosen among all arm angles.")
      .def_prop_ro(
          "q",
          [](const ArmAngleChoice& self) -> nb::object {
            if (self.status != IkStatus::kSolved) return nb::none();
            return MakeArray(nb::make_tuple(7), Numpy::Get().float64, self.q.data(), 7);
          },
          "(7,) configuration; None if there is none.")
      .def_ro("psi", &ArmAngleChoice::psi, "Its arm angle, in [-π, π].")
      .def_ro("branch", &ArmAngleChoice::branch)
      .def_prop_ro(
          "status",
          [](const ArmAngleChoice& self) { return kStatusNames[static_cast<int>(self.status)]; },
          "As IkSolutions.status.");

  BindSixJoints<UrArm>(m, "UrArm",
                       R"(Arms of six joints whose axes 2, 3 and 4 are parallel.

Axis 1 is perpendicular to axis 2, axis 4 to axis 5, axis 5 to axis 6; axes 5 and 6 meet in a point
P (Universal Robots).

Branch, a bit is set where the quantity is negative: 4, (axis 1 × axis 2)·(P - axis 1); 2, the sine
of the angle from upper arm to forearm about axis 2; 1, the sine of the angle from axis 2 to axis 6
about axis 5.

Where axes 4 and 6 are parallel, joint 6 is free: it gets the value of q_near if the arm reaches so,
else the nearest with which it does.

K. P. Hawkins, "Analytic Inverse Kinematics for the Universal Robots UR-5/UR-10 Arms", Georgia Tech,
2013; here for lines, without Denavit-Hartenberg frames.)");
  BindSixJoints<PieperArm>(m, "PieperArm",
                           R"(Arms of six joints whose last three axes meet in a point P.

Axis 4 is perpendicular to axis 5, and axis 5 to axis 6. Of the first three either 2 and 3 are
parallel and 1 is perpendicular to them (PUMA, KUKA KR, ABB IRB; with any offsets), or 1 and 2 meet
in a point S (any angles).

Branch, a bit is set where the quantity is negative: 4, (axis 1 × axis 2)·(P - axis 1); 2, the sine
of the angle from upper arm to forearm about axis 2 or, if axes 2 and 3 are not parallel, of joint
3's angle counted from the longest reach; 1, the sine of the angle from axis 4 to axis 6 about
axis 5.

D. L. Pieper, "The Kinematics of Manipulators under Computer Control", Stanford, 1968.)");

  BindCommon<SrsArm>(m, "SrsArm",
                     R"(Arms of seven joints: spherical shoulder, elbow, spherical wrist.

Axes 1, 2 and 3 meet in a point S, axes 5, 6 and 7 in a point W, with axis 1 ⊥ axis 2 ⊥ axis 3 and
axis 5 ⊥ axis 6 ⊥ axis 7; axis 4 is perpendicular to a plane through S and W and meets it in E.

The arm angle ψ is the angle about d = (W - S) / |W - S|, by the right-hand rule, from the half
plane at line SW that contains the direction of axis 1 to the half plane that contains E. Where d is
parallel to axis 1, (axis 2 × axis 1) at q = 0 takes its place. At the stretched elbow, where E lies
on SW, the limit of small bends counts.

Branch, a bit is set where the sine of the angle is negative: 4, from axis 1 to axis 3 about axis 2;
2, from E - S to W - E about axis 4; 1, from axis 5 to axis 7 about axis 6. With one ψ all branches
have E in the same place.

M. Shimizu et al., "Analytical Inverse Kinematic Computation for 7-DOF Redundant Manipulators With
Joint Limits and Its Application to Redundancy Resolution", IEEE T-RO 24(5), 2008; C. Faria et al.,
"Position-based kinematics for 7-DoF serial manipulators with global configuration control, joint
limit and singularity avoidance", Mech. Mach. Theory 121, 2018.)")
      .def(
          "solve",
          [](const SrsArm& self, nb::handle X_WG, double psi, nb::handle q_near, bool limits) {
            const std::array<double, 16> X = ReadMatrix(X_WG);
            const Near near(q_near, limits, 7);
            IkSolutions solutions;
            self.Solve(X.data(), psi, near.options, &solutions);
            return solutions;
          },
          "X_WG"_a, "psi"_a, "q_near"_a = nb::none(), "limits"_a = true, kSolveDoc)
      .def(
          "solve_batch",
          [](const SrsArm& self, const Poses& X_WG, const Numbers& psi, nb::handle q_near,
             bool limits, int num_threads) {
            if (psi.shape(0) != X_WG.shape(0)) {
              throw std::invalid_argument("psi: expected one for each pose");
            }
            return Batch(self, X_WG, q_near, limits, num_threads,
                         [&](const IkBatch& batch) { self.SolveBatch(batch, psi.data()); });
          },
          "X_WG"_a, "psi"_a, "q_near"_a = nb::none(), "limits"_a = true, "num_threads"_a = 1,
          kBatchDoc)
      .def(
          "arm_angle",
          [](const SrsArm& self, nb::handle q) {
            int branch = 0;
            const double psi = self.ArmAngle(ReadJoints("q", q, 7).data(), &branch);
            return std::tuple(psi, branch);
          },
          "q"_a, "Arm angle, in [-π, π], and branch of a configuration (7,).")
      .def(
          "arm_angle_intervals",
          [](const SrsArm& self, nb::handle X_WG, int branch) {
            IkStatus status;
            const AngleIntervals intervals =
                self.Intervals(ReadMatrix(X_WG).data(), branch, &status);
            return MakeArray(nb::make_tuple(intervals.count, 2), Numpy::Get().float64,
                             intervals.bounds[0].data(), 2 * intervals.count);
          },
          "X_WG"_a, "branch"_a,
          R"(The arm angles at which a branch reaches the pose within all joint limits.

Computed in closed form: each joint's limits bound ψ where a sinusoid of ψ is zero.

Returns:
    (K, 2): closed intervals, disjoint; lower ends ascending in [-π, π), upper ends up to 2 π above.
    [-π, π] alone if all angles will do. Empty if none, or if the pose is out of reach (solve()
    says why). Intervals of no width are left out.)")
      .def(
          "closest",
          [](const SrsArm& self, nb::handle X_WG, nb::handle q) {
            return self.Closest(ReadMatrix(X_WG).data(), ReadJoints("q", q, 7).data());
          },
          "X_WG"_a, "q"_a,
          R"(Of all branches and arm angles within the limits, the configuration closest to q.

In Euclidean distance. Every interval of arm angles is sampled each 0.1 rad or finer and searched on
around the best sample. q also decides what joints do that a singular pose leaves free.)")
      .def(
          "farthest_from_limits",
          [](const SrsArm& self, nb::handle X_WG) {
            return self.FarthestFromLimits(ReadMatrix(X_WG).data());
          },
          "X_WG"_a,
          R"(The configuration whose joint nearest to a limit is as far from it as can be.

Distance as a fraction of half the joint's range; searched as by closest().)")
      .def(
          "widest_interval",
          [](const SrsArm& self, nb::handle X_WG) {
            return self.WidestInterval(ReadMatrix(X_WG).data());
          },
          "X_WG"_a, R"(The centre of the widest interval of arm angles of all branches.)");
}

}  // namespace prehensile
