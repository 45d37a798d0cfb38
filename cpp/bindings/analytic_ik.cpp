#include "prehensile/analytic_ik.h"

#include <nanobind/stl/tuple.h>

#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>

#include "bindings.h"
#include "numpy_arrays.h"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace prehensile {
namespace {

constexpr const char* kStatusNames[] = {"solved", "too far", "too near", "limits"};

/// Whole turns of more than this cost digits.
constexpr double kFarthest = 1e6;

/// Angles that others are to be near to.
void RequireNear(const ArrayArgument& q, const std::string& name) {
  for (const double* x = q.data(); x != q.end(); ++x) {
    if (!(std::abs(*x) <= kFarthest)) {
      throw std::invalid_argument(name + ": must be finite, and within 1e6 rad");
    }
  }
}

template <typename Arm>
void Construct(Arm* arm, nb::handle axes, nb::handle points, nb::handle X_WG0, nb::handle lower,
               nb::handle upper, double tolerance) {
  const ArrayArgument axis(axes, "axes"), point(points, "points"), low(lower, "lower"),
      high(upper, "upper");
  const PoseArgument X(X_WG0, "X_WG0");
  axis.RequireShape({-1, 3});
  const auto n = static_cast<std::ptrdiff_t>(axis.shape(0));
  point.RequireShape({n, 3});
  low.RequireShape({n});
  high.RequireShape({n});
  ArmLines lines{.lower = {low.data(), low.end()}, .upper = {high.data(), high.end()}};
  lines.X_WG0 = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(X.data());
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    lines.axes.emplace_back(axis.data() + 3 * i);
    lines.points.emplace_back(point.data() + 3 * i);
  }
  new (arm) Arm(lines, tolerance);
}

/// Options of a call for one pose.
class Near {
 public:
  Near(nb::handle q_near, bool limits, int n) {
    options.limits = limits;
    if (q_near.is_none()) return;
    q_.emplace(q_near, "q_near");
    q_->RequireShape({n});
    RequireNear(*q_, "q_near");
    options.q_near = q_->data();
  }
  IkOptions options;

 private:
  std::optional<ArrayArgument> q_;
};

template <typename Arm, typename Solve>
nb::tuple Batch(const Arm& arm, nb::handle X_WG, nb::handle q_near, bool limits, int num_threads,
                const Solve& solve) {
  const ArrayArgument poses(X_WG, "X_WG");
  poses.RequireShape({-1, 4, 4});
  const std::size_t n = arm.num_joints(), count = poses.shape(0);
  std::optional<ArrayArgument> near;
  bool near_each = false;
  if (!q_near.is_none()) {
    near.emplace(q_near, "q_near");
    near_each = near->ndim() == 2;
    const auto rows = static_cast<std::ptrdiff_t>(count), columns = static_cast<std::ptrdiff_t>(n);
    near_each ? near->RequireShape({rows, columns}) : near->RequireShape({columns});
    RequireNear(*near, "q_near");
  }
  ArrayResult<> q{count, IkSolutions::kMax, n};
  ArrayResult<std::uint8_t> status{count};
  const IkBatch batch{.num_poses = count,
                      .X_WG = poses.data(),
                      .q_near = near ? near->data() : nullptr,
                      .near_each = near_each,
                      .limits = limits,
                      .num_threads = num_threads,
                      .q = q.data(),
                      .status = status.data()};
  {
    const nb::gil_scoped_release release;
    solve(batch);
  }
  return nb::make_tuple(q.Take(), status.Take());
}

nb::object Array(const double* values, std::size_t n) { return ArrayResult<>({n}, values).Take(); }

template <typename Arm>
nb::class_<Arm> BindCommon(nb::module_& m, const char* name, const char* doc) {
  nb::class_<Arm> arm(m, name, doc);
  arm.def("__init__", &Construct<Arm>, "axes"_a, "points"_a, "X_WG0"_a, "lower"_a, "upper"_a,
          "tolerance"_a = 1e-6);
  arm.def(
      "pose",
      [](const Arm& self, nb::handle q) {
        const VectorArgument joints(q, "q", self.num_joints());
        ArrayResult<> X{4, 4};
        self.Pose(joints.data(), X.data());
        return X.Take();
      },
      "q"_a, "Forward kinematics: X_WG, (4, 4), of the configuration q (n,).");
  arm.def_prop_ro("num_joints", &Arm::num_joints);
  arm.def_prop_ro("lower",
                  [](const Arm& self) { return Array(self.lower().data(), self.num_joints()); });
  arm.def_prop_ro("upper",
                  [](const Arm& self) { return Array(self.upper().data(), self.num_joints()); });
  return arm;
}

constexpr const char* kSolveDoc =
    R"(All solutions for one pose of the tool frame, in the order of their branches.

Solutions that coincide at a singular pose are given once.

Args:
    X_WG: RigidTransform or (4, 4).
    q_near: (n,) within 1e6 rad; each joint's angle is the equivalent, by whole turns, that is
        nearest to this within the limits; a joint that a singular pose leaves free gets this value.
        Zeros if None.
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
        const PoseArgument X(X_WG, "X_WG");
        const Near near(q_near, limits, 6);
        IkSolutions solutions;
        self.Solve(X.data(), near.options, &solutions);
        return solutions;
      },
      "X_WG"_a, "q_near"_a = nb::none(), "limits"_a = true, kSolveDoc);
  arm.def(
      "solve_batch",
      [](const Arm& self, nb::handle X_WG, nb::handle q_near, bool limits, int num_threads) {
        return Batch(self, X_WG, q_near, limits, num_threads,
                     [&](const IkBatch& batch) { self.SolveBatch(batch); });
      },
      "X_WG"_a, "q_near"_a = nb::none(), "limits"_a = true, "num_threads"_a = 1, kBatchDoc);
  arm.def(
      "branch",
      [](const Arm& self, nb::handle q) { return self.Branch(VectorArgument(q, "q", 6).data()); },
      "q"_a, "The branch of a configuration (6,).");
}

}  // namespace

void BindAnalyticIk(nb::module_& m) {
  nb::class_<IkSolutions>(m, "IkSolutions", "Solutions for one pose.")
      .def_prop_ro(
          "q",
          [](const IkSolutions& self) {
            return ArrayResult<>({static_cast<std::size_t>(self.count),
                                  static_cast<std::size_t>(self.num_joints)},
                                 self.q.data())
                .Take();
          },
          "(B, n) a new array, row per solution.")
      .def_prop_ro(
          "branch",
          [](const IkSolutions& self) {
            return ArrayResult<std::uint8_t>({static_cast<std::size_t>(self.count)},
                                             self.branch.data())
                .Take();
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
            return Array(self.q.data(), 7);
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
            const PoseArgument X(X_WG, "X_WG");
            const Near near(q_near, limits, 7);
            IkSolutions solutions;
            self.Solve(X.data(), psi, near.options, &solutions);
            return solutions;
          },
          "X_WG"_a, "psi"_a, "q_near"_a = nb::none(), "limits"_a = true, kSolveDoc)
      .def(
          "solve_batch",
          [](const SrsArm& self, nb::handle X_WG, nb::handle psi, nb::handle q_near, bool limits,
             int num_threads) {
            const ArrayArgument poses(X_WG, "X_WG"), angles(psi, "psi");
            angles.RequireShape({static_cast<std::ptrdiff_t>(poses.size() / 16)});
            return Batch(self, X_WG, q_near, limits, num_threads,
                         [&](const IkBatch& batch) { self.SolveBatch(batch, angles.data()); });
          },
          "X_WG"_a, "psi"_a, "q_near"_a = nb::none(), "limits"_a = true, "num_threads"_a = 1,
          kBatchDoc)
      .def(
          "arm_angle",
          [](const SrsArm& self, nb::handle q) {
            int branch = 0;
            const double psi = self.ArmAngle(VectorArgument(q, "q", 7).data(), &branch);
            return std::tuple(psi, branch);
          },
          "q"_a, "Arm angle, in [-π, π], and branch of a configuration (7,).")
      .def(
          "arm_angle_intervals",
          [](const SrsArm& self, nb::handle X_WG, int branch) {
            IkStatus status;
            const AngleIntervals intervals =
                self.Intervals(PoseArgument(X_WG, "X_WG").data(), branch, &status);
            return ArrayResult<>({static_cast<std::size_t>(intervals.count), 2},
                                 intervals.bounds[0].data())
                .Take();
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
            const VectorArgument joints(q, "q", 7);
            RequireNear(joints, "q");
            return self.Closest(PoseArgument(X_WG, "X_WG").data(), joints.data());
          },
          "X_WG"_a, "q"_a,
          R"(Of all branches and arm angles within the limits, the configuration closest to q.

In Euclidean distance. Every interval of arm angles is sampled each 0.1 rad or finer and searched on
around the best sample. q also decides what joints do that a singular pose leaves free.)")
      .def(
          "farthest_from_limits",
          [](const SrsArm& self, nb::handle X_WG) {
            return self.FarthestFromLimits(PoseArgument(X_WG, "X_WG").data());
          },
          "X_WG"_a,
          R"(The configuration whose joint nearest to a limit is as far from it as can be.

Distance as a fraction of half the joint's range; searched as by closest().)")
      .def(
          "widest_interval",
          [](const SrsArm& self, nb::handle X_WG) {
            return self.WidestInterval(PoseArgument(X_WG, "X_WG").data());
          },
          "X_WG"_a, R"(The centre of the widest interval of arm angles of all branches.)");
}

}  // namespace prehensile
