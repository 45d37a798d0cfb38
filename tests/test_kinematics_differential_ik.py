"""The formulations of differential inverse kinematics against their definitions."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DifferentialInverseKinematicsStatus,
    DoDifferentialInverseKinematics,
)
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.planning import RobotDiagramBuilder
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from prehensile.kinematics.differential_ik import (
    DifferentialIkConfig,
    DifferentialIkStatus,
    JointLimits,
    at_most,
    centered,
    collision_constraints,
    compile_ik,
    damped,
    direction_preserving,
    equal,
    limited,
    point_jacobian,
    prioritized,
    pseudo_inverse,
    stack_constraints,
    stack_tasks,
    velocity_interval,
    velocity_limited,
    virtual_walls,
)

WIDE = JointLimits(np.full(7, -9.0), np.full(7, 9.0), np.full(7, 1.0), np.full(7, np.inf))
H = 0.01


def solve(n: int, costs: Sequence, lower, upper, equalities: Sequence = (), linear=None):
    """min Σ |A x − b|² + linear · x by Clarabel, as exactly as it can."""
    program = MathematicalProgram()
    x = program.NewContinuousVariables(n)
    for A, b in costs:
        program.Add2NormSquaredCost(A, b, x)
    if linear is not None:
        program.AddLinearCost(linear, 0.0, x)
    program.AddBoundingBoxConstraint(lower, upper, x)
    for A, b in equalities:
        program.AddLinearEqualityConstraint(A, b, x)
    options = SolverOptions()
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(ClarabelSolver.id(), name, 1e-13)
    result = ClarabelSolver().Solve(program, None, options)
    assert result.is_success()
    return result.GetSolution(x)


def kernel(J):
    """Orthonormal rows."""
    _, sigma, Vt = np.linalg.svd(J)
    return Vt[(sigma > 1e-9).sum() :]


def problem(seed: int, n: int = 7, k: int = 6):
    rng = np.random.default_rng(seed)
    J, V = rng.normal(size=(k, n)), rng.normal(size=k) * rng.choice([0.2, 1.0, 4.0])
    return J, V, rng.uniform(-1, 1, n), rng.uniform(-0.3, 0.3, n)


def test_closed_forms():
    for seed in range(20):
        J, V, _, _ = problem(seed)
        v = pseudo_inverse(J, V)
        np.testing.assert_allclose(J @ v, V, atol=1e-9)
        np.testing.assert_allclose(kernel(J) @ v, 0, atol=1e-9)
        stacked = np.vstack([J, 0.3 * np.eye(7)])
        least = np.linalg.lstsq(stacked, np.append(V, np.zeros(7)), rcond=None)[0]
        np.testing.assert_allclose(damped(J, V, damping=0.3), least, atol=1e-9)
        # Far from a singularity there is no damping, at one it is that of the argument.
        np.testing.assert_allclose(damped(J, V, damping=0.3, threshold=1e-6), v, atol=1e-9)
        J[5] = J[4]
        np.testing.assert_allclose(
            damped(J, V, damping=0.3, threshold=0.1), damped(J, V, damping=0.3), atol=1e-9
        )


def test_exercise_of_competing_objectives():
    """Objectives of their own variables compete once a constraint links them."""
    A, b = np.array([[1.0, -1.0]]), np.array([6.0])
    free = np.full(2, np.inf)
    both = velocity_limited(np.eye(2), [5, -3], free, constraints=at_most(A, b))
    np.testing.assert_allclose(both.v, [4, -2], atol=1e-9)
    J, V = stack_tasks([([[1, 0]], [5]), ([[0, 1]], [-3])], [1.0, 0.01])
    weighted = velocity_limited(J, V, free, constraints=at_most(A, b))
    # (x − 5)² + (y + 3)² / 100 on x − y = 6: 2 (x − 5) + 2 (x − 3) / 100 = 0.
    x = (5 + 0.03) / 1.01
    np.testing.assert_allclose(weighted.v, [x, x - 6], atol=1e-6)
    strict = prioritized(
        [([[1, 0]], [5]), ([[0, 1]], [-3])],
        [0, 0],
        [0, 0],
        JointLimits.unlimited(2),
        period=H,
        constraints=at_most(A, b),
    )
    np.testing.assert_allclose(strict.v, [5, -1], atol=1e-9)


def test_limits_and_centering_are_those_of_the_program():
    for seed in range(40):
        J, V, q, v = problem(seed)
        limits = JointLimits(np.full(7, -1.0), np.full(7, 1.0), np.full(7, 1.0), np.full(7, 40.0))
        lower, upper = velocity_interval(q, v, limits, H)
        got = limited(J, V, q, v, limits, period=H, damping=0.01)
        best = solve(7, [(J, V), (0.01 * np.eye(7), np.zeros(7))], lower, upper)
        np.testing.assert_allclose(got.v, best, atol=1e-6)
        np.testing.assert_allclose(got.residual, J @ got.v - V)
        np.testing.assert_array_equal(got.at_limit == 1, got.v > upper - 1e-9)
        wanted = 2.0 * (0.3 - q)
        got = centered(J, V, q, v, limits, period=H, nominal_position=np.full(7, 0.3), gain=2.0)
        P = 0.1 * kernel(J)
        best = solve(7, [(J, V), (P, P @ wanted)], lower, upper)
        np.testing.assert_allclose(got.v, best, atol=1e-6)


def test_centering_leaves_the_task_alone_without_limits():
    J, V, q, _ = problem(3)
    free = JointLimits.unlimited(7)
    got = centered(J, V, q, np.zeros(7), free, period=H, nominal_position=np.zeros(7), gain=0.5)
    P = kernel(J)
    np.testing.assert_allclose(got.v, pseudo_inverse(J, V) + P.T @ P @ (-0.5 * q), atol=1e-8)


def test_direction_is_kept_and_as_much_as_possible_of_it():
    some = 0
    for seed in range(40):
        J, V, q, _ = problem(seed)
        got = direction_preserving(
            J, V, q, np.zeros(7), WIDE, period=H, nominal_position=np.zeros(7), weight=1e4
        )
        assert got.status == DifferentialIkStatus.OPTIMAL
        np.testing.assert_allclose(J @ got.v, got.alpha * V, atol=1e-8)
        program = np.hstack([J, -V[:, None]])
        ends = np.append(np.ones(7), 1.0)
        most = solve(
            8,
            [],
            np.append(-ends[:7], 0),
            ends,
            [(program, np.zeros(6))],
            linear=np.append(np.zeros(7), -1.0),
        )
        assert got.alpha == pytest.approx(most[7], abs=1e-6)
        some += got.alpha < 1
    assert some > 10


def test_direction_is_that_of_drake():
    compared = 0
    for seed in range(60):
        J, V, q, v = problem(seed)
        q, v = 0.7 * q, 0.1 * v
        limits = JointLimits(np.full(7, -3.0), np.full(7, 3.0), np.full(7, 1.0), np.full(7, 50.0))
        parameters = DifferentialInverseKinematicsParameters(7, 7)
        parameters.set_time_step(H)
        parameters.set_joint_position_limits((limits.lower, limits.upper))
        parameters.set_joint_velocity_limits((-limits.velocity, limits.velocity))
        parameters.set_joint_acceleration_limits((-limits.acceleration, limits.acceleration))
        parameters.set_nominal_joint_position(np.zeros(7))
        parameters.set_joint_centering_gain(np.eye(7))
        drake = DoDifferentialInverseKinematics(q, v, V, J, parameters)
        if drake.status != DifferentialInverseKinematicsStatus.kSolutionFound:
            continue
        got = direction_preserving(
            J, V, q, v, limits, period=H, nominal_position=np.zeros(7), weight=1e6
        )
        # Its rows of P are not normalized, so that its trade of alpha for centering is another:
        # compared is where both take as much of alpha as there is.
        alpha = (J @ drake.joint_velocities) @ V / (V @ V)
        if abs(alpha - got.alpha) > 1e-7:
            assert alpha < got.alpha + 1e-6
            continue
        np.testing.assert_allclose(got.v, drake.joint_velocities, atol=1e-6)
        compared += 1
    assert compared > 20


def test_priorities_are_the_cascade_of_programs():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        sizes = [(3, 2, 2), (6, 3), (2, 2, 2)][seed % 3]
        tasks = [(rng.normal(size=(k, 7)), rng.normal(size=k) * 2) for k in sizes]
        q = rng.uniform(-1, 1, 7)
        got = prioritized(tasks, q, np.zeros(7), WIDE, period=H, nominal_position=np.zeros(7))
        assert got.status == DifferentialIkStatus.OPTIMAL
        achieved = []
        for J, V in [*tasks, (np.eye(7), -q)]:
            best = solve(7, [(J, V)], -np.ones(7), np.ones(7), achieved)
            mine = np.linalg.norm(J @ got.v - V)
            assert mine == pytest.approx(np.linalg.norm(J @ best - V), abs=2e-6)
            achieved.append((J, J @ got.v))


def test_lower_levels_do_not_disturb_higher_ones():
    rng = np.random.default_rng(0)
    first = (rng.normal(size=(3, 7)), rng.normal(size=3) * 5)
    zero = np.zeros(7)
    alone = prioritized([first], zero, zero, WIDE, period=H)
    for _ in range(20):
        second = (rng.normal(size=(3, 7)), rng.normal(size=3) * 100)
        both = prioritized([first, second], zero, zero, WIDE, period=H)
        np.testing.assert_allclose(both.residual[:3], alone.residual, atol=1e-8)


def test_constraints_hold_in_every_formulation():
    J, V, q, _ = problem(5)
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(3, 7))
    constraints = stack_constraints([at_most(rows[:2], [0.1, 0.2]), equal(rows[2:], [0.0])])
    zero = np.zeros(7)
    given_state = {"limits": WIDE, "period": H, "constraints": constraints}
    for result in (
        limited(J, V, q, zero, **given_state),
        centered(J, V, q, zero, nominal_position=zero, **given_state),
        direction_preserving(J, V, q, zero, **given_state),
        prioritized([(J[:3], V[:3]), (J[3:], V[3:])], q, zero, **given_state),
    ):
        assert result.status == DifferentialIkStatus.OPTIMAL
        assert (rows[:2] @ result.v <= np.array([0.1, 0.2]) + 1e-9).all()
        np.testing.assert_allclose(rows[2] @ result.v, 0, atol=1e-9)


def brakes_in_time(q, v, upper, a, h):
    """Whether a joint that moves at v for one period and then brakes stays below upper."""
    q = q + h * v
    while v > 0 and q <= upper + 1e-12:
        v = max(v - a * h, 0.0)
        q = q + h * v
    return q <= upper + 1e-12


@given(
    room=st.floats(1e-6, 3.0),
    a=st.floats(0.1, 100.0),
    h=st.sampled_from([0.001, 0.005, 0.02]),
)
def test_interval_is_what_can_still_stop_and_no_less(room, a, h):
    limits = JointLimits(np.array([-9.0]), np.array([room]), np.array([np.inf]), np.array([a]))
    # At the greatest velocity that the interval allows for a joint that is fast already.
    still = velocity_interval([0.0], [0.0], limits, h)[1][0]
    fast = np.sqrt(2 * a * room)
    _, upper = velocity_interval([0.0], [fast], limits, h)
    v = upper[0] if upper[0] > fast - a * h + 1e-9 else min(still, fast)
    assert brakes_in_time(0.0, v, room, a, h)
    if upper[0] < fast + a * h - 1e-9 and upper[0] > fast - a * h + 1e-9:
        assert not brakes_in_time(0.0, upper[0] * (1 + 1e-6), room - 1e-11, a, h)


def test_a_joint_beyond_its_range_comes_back_and_rests_at_its_end():
    limits = JointLimits(np.array([-1.0]), np.array([1.0]), np.array([2.0]), np.array([5.0]))
    q, v, h = np.array([1.4]), np.array([1.0]), 0.01
    ik = compile_ik(DifferentialIkConfig(period=h), limits)
    path, speeds = [], [1.0]
    for _ in range(200):
        step = ik.step(q, v, [[1.0]], [3.0])  # Its task is to go farther out.
        v = step.v
        q = q + h * v
        path.append(q[0])
        speeds.append(v[0])
    assert (np.abs(np.diff(speeds)) <= 5.0 * h + 1e-12).all()
    # Braking takes 1² / (2 · 5) = 0.1, the way back at 5 rad/s² 2 sqrt(0.5 / 5) = 0.63 s.
    assert max(path) == pytest.approx(1.5, abs=0.01)
    assert path[int((0.2 + 0.63) / h) + 3] == pytest.approx(1.0, abs=1e-6)
    assert min(path) > 1.0 - 1e-9
    assert abs(speeds[-1]) < 1e-9


def test_bad_arguments_are_named():
    good = np.eye(2), np.ones(2)
    with pytest.raises(ValueError, match="^J: "):
        pseudo_inverse([[np.nan, 0]], [1])
    with pytest.raises(ValueError, match="^V: "):
        damped(np.eye(2), [1], damping=0.1)
    with pytest.raises(ValueError, match="^damping: "):
        damped(*good, damping=-0.1)
    with pytest.raises(ValueError, match="^formulation: "):
        DifferentialIkConfig(formulation="best")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="^velocity: "):
        JointLimits(np.zeros(2), np.ones(2), np.ones(3), np.ones(2))
    with pytest.raises(ValueError, match="^weights: "):
        stack_tasks([good], [0.0])


def planar_arm(q):
    """Tip and Jacobian of a two-link arm with links of 1 m, in x and y."""
    s, c = np.sin, np.cos
    p = np.array([c(q[0]) + c(q[0] + q[1]), s(q[0]) + s(q[0] + q[1]), 0.0])
    J = np.array([[-p[1], -s(q[0] + q[1])], [p[0], c(q[0] + q[1])], [0.0, 0.0]])
    return p, J


def test_the_tip_slides_along_a_virtual_wall():
    """The wall at x = 1.5 stops what leads into it, and nothing else."""
    q, v, h = np.array([0.9, -2.0]), np.zeros(2), 0.005
    limits = JointLimits(np.full(2, -3.0), np.full(2, 3.0), np.full(2, 2.0), np.full(2, 20.0))
    farthest, goal = -np.inf, np.array([1.7, 0.4, 0.0])
    for _ in range(1500):
        p, J = planar_arm(q)
        wall = virtual_walls([[1.0, 0, 0]], [1.5], p, J, gain=8.0)
        step = limited(J, 5 * (goal - p), q, v, limits, period=h, constraints=wall)
        assert step.status == DifferentialIkStatus.OPTIMAL
        v = step.v
        q = q + h * v
        farthest = max(farthest, planar_arm(q)[0][0])
    assert farthest < 1.5 + 1e-5
    np.testing.assert_allclose(planar_arm(q)[0], [1.5, 0.4, 0.0], atol=1e-3)


def test_a_tip_beyond_the_wall_comes_back():
    q, v = np.array([0.3, -0.2]), np.zeros(2)
    limits = JointLimits(np.full(2, -3.0), np.full(2, 3.0), np.full(2, 2.0), np.full(2, 20.0))
    goal = planar_arm(q)[0]
    statuses = set()
    for _ in range(1500):
        p, J = planar_arm(q)
        wall = virtual_walls([[1.0, 0, 0]], [1.5], p, J, gain=8.0)
        step = limited(J, 5 * (goal - p), q, v, limits, period=0.005, constraints=wall)
        statuses.add(step.status)
        v = step.v
        q = q + 0.005 * v
    assert planar_arm(q)[0][0] == pytest.approx(1.5, abs=1e-3)
    assert statuses == {DifferentialIkStatus.RELAXED, DifferentialIkStatus.OPTIMAL}


def test_point_jacobian_is_the_velocity_of_the_point():
    rng = np.random.default_rng(0)
    J, p, v = rng.normal(size=(6, 4)), rng.normal(size=3), rng.normal(size=4)
    expected = (J @ v)[3:] + np.cross((J @ v)[:3], p)
    np.testing.assert_allclose(point_jacobian(J, p) @ v, expected, atol=1e-12)


def test_a_sphere_keeps_its_distance_by_signed_distances():
    """A ball on an x-y slide, sent through a fixed one, stops at the least distance to it."""
    builder = RobotDiagramBuilder(time_step=0.0)
    plant = builder.plant()
    inertia = SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
    properties = ProximityProperties()
    bodies = [plant.AddRigidBody(name, inertia) for name in ("slide", "ball")]
    parents = [plant.world_body(), bodies[0]]
    for name, parent, child, axis in zip("xy", parents, bodies, np.eye(3)[:2], strict=True):
        plant.AddJoint(PrismaticJoint(name, parent.body_frame(), child.body_frame(), axis))
    for body, p in ((bodies[1], [0.0, 0, 0]), (plant.world_body(), [1.0, 0.02, 0])):
        plant.RegisterCollisionGeometry(body, RigidTransform(p), Sphere(0.1), "ball", properties)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    context = plant.GetMyMutableContextFromRoot(root)
    q, v, h = np.zeros(2), np.zeros(2), 0.01
    limits = JointLimits(np.full(2, -3.0), np.full(2, 3.0), np.full(2, 1.0), np.full(2, 10.0))
    least, passed = np.inf, False
    for _ in range(600):
        plant.SetPositions(context, q)
        rows = collision_constraints(plant, context, [0, 1], gain=10.0, minimum=0.03, influence=0.3)
        least = min(least, np.linalg.norm(q - [1.0, 0.02]) - 0.2)
        passed = passed or q[0] > 1.5
        step = limited(np.eye(2), 2 * ([2.0, 0.0] - q), q, v, limits, period=h, constraints=rows)
        v = step.v
        q = q + h * v
    assert 0.03 - 1e-4 < least < 0.035
    assert passed, "it goes around the fixed ball"
