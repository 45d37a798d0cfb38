"""Steps of differential inverse kinematics: optimal as a reference solver's, and never a limit
violated, whatever comes in."""

import functools
import zlib
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from iiwa_plant import make_iiwa
from pydrake.math import RigidTransform
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SolverOptions

from prehensile.kinematics.differential_ik import (
    DifferentialIkConfig,
    FrameTask,
    JointLimits,
    compile_frame_ik,
    compile_ik,
)
from prehensile.kinematics.poses import pose_error
from prehensile.kinematics.tree import PlantTree, tree_from_plant

RELAXED, BRAKING = 2, 3


@functools.cache
def iiwa() -> PlantTree:
    """With the frames of its links 7 and 4."""
    plant = make_iiwa()
    return tree_from_plant(plant, [plant.GetFrameByName(f"iiwa_link_{i}") for i in (7, 4)])


def reference(J, V, lower, upper, *, damping=0.0, rows=None):
    """min |J v − V|² + λ² |v|² by Clarabel, as exactly as it can."""
    program = MathematicalProgram()
    v = program.NewContinuousVariables(J.shape[1])
    stacked = np.vstack([J, damping * np.eye(len(v))])
    program.Add2NormSquaredCost(stacked, np.concatenate([V, np.zeros(len(v))]), v)
    program.AddBoundingBoxConstraint(lower, upper, v)
    if rows is not None:
        program.AddLinearConstraint(rows[0], rows[1], rows[2], v)
    options = SolverOptions()
    for name in ("tol_gap_abs", "tol_gap_rel", "tol_feas"):
        options.SetOption(ClarabelSolver.id(), name, 1e-13)
    result = ClarabelSolver().Solve(program, None, options)
    return result.GetSolution(v) if result.is_success() else None


@pytest.mark.parametrize("n", [1, 3, 7, 16, 32])
def test_optimum_with_bounds_and_rows(n):
    rng = np.random.default_rng(n)
    limits = JointLimits(np.full(n, -1.0), np.full(n, 2.0), np.full(n, 1.5), np.full(n, 20.0))
    ik = compile_ik(DifferentialIkConfig(period=0.02, damping=0.1), limits)
    compared = relaxed = 0
    for _ in range(60 if n < 20 else 25):
        J, V = rng.normal(size=(6, n)), rng.normal(size=6) * rng.choice([0.1, 1.0, 10.0])
        q, v = rng.uniform(-0.9, 1.9, n), rng.uniform(-0.2, 0.2, n)
        m = int(rng.integers(0, 5))
        A = rng.normal(size=(m, n))
        sides = np.sort(rng.normal(size=(2, m)) * 0.3, axis=0)
        if m > 2:
            sides[0, 0] = -np.inf
            sides[:, 1] = sides[0, 1]  # An equality.
        step = ik.step(q, v, J, V, None, None, A, *sides)
        best = reference(J, V, step.lower, step.upper, damping=0.1, rows=(A, *sides) if m else None)
        assert (step.v <= step.upper).all()
        assert (step.v >= step.lower).all()
        if step.status == RELAXED:
            relaxed += 1
            assert best is None
            continue
        assert step.status == 0
        assert step.violation < 1e-9
        assert best is not None
        np.testing.assert_allclose(step.v, best, atol=1e-7)
        compared += 1
    assert compared > 15
    assert n > 1 or relaxed


def test_relaxed_constraints_are_violated_as_little_as_possible():
    limits = JointLimits(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 1.0), np.full(2, np.inf))
    ik = compile_ik(DifferentialIkConfig(damping=1e-3), limits)
    # v1 >= 1.5 and v1 <= 1 contradict; v1 + v2 = 0 holds with it.
    A, lower = np.array([[1.0, 0.0], [1.0, 1.0]]), np.array([1.5, 0.0])
    step = ik.step([0, 0], [0, 0], np.eye(2), [0, 0], None, None, A, lower, [np.inf, np.inf])
    assert step.status == RELAXED
    np.testing.assert_allclose(step.v[0], 1.0, atol=1e-6)
    assert step.violation == pytest.approx(0.5, abs=1e-6)


def test_singular_jacobians_make_no_noise():
    """The regularization decides between solutions; it leaves the task and repeats itself."""
    rng = np.random.default_rng(4)
    ik = compile_ik(DifferentialIkConfig(), JointLimits.unlimited(7))
    for _ in range(100):
        J = rng.normal(size=(6, 3)) @ rng.normal(size=(3, 7))
        V = J @ rng.normal(size=7)
        v = ik.step(np.zeros(7), np.zeros(7), J, V).v
        np.testing.assert_allclose(v, np.linalg.pinv(J, rcond=1e-9) @ V, atol=1e-6)


def test_what_is_no_number_is_refused_by_name():
    ik = compile_ik(DifferentialIkConfig(), JointLimits.unlimited(3))
    J, V, zero, nan = np.eye(3), np.ones(3), np.zeros(3), np.array([0.0, np.nan, 0.0])
    good = {"q": zero, "v": zero, "J": J, "V": V, "A": J, "lower": -V, "upper": V}
    assert ik.step(**good).status == 0
    for name in good:
        bad = np.where(np.arange(9).reshape(3, 3) == 4, np.inf, J) if name in "JA" else nan
        with pytest.raises(ValueError, match=f"^{name}: "):
            ik.step(**{**good, name: bad})
        with pytest.raises(ValueError, match=f"^{name}: "):
            ik.step(**{**good, name: np.zeros((2, 2))})
    with pytest.raises(ValueError, match="^lower: above upper"):
        ik.step(zero, zero, J, V, None, None, J, V, -V)
    with pytest.raises(ValueError, match="^level_sizes: "):
        ik.step(zero, zero, J, V, None, [2, 2])
    with pytest.raises(ValueError, match="^limits: a position range"):
        compile_ik(DifferentialIkConfig(), JointLimits(V, zero, V, V))
    with pytest.raises(ValueError, match="^period: "):
        compile_ik(DifferentialIkConfig(period=0.0), JointLimits.unlimited(3))
    with pytest.raises(ValueError, match="^nominal_position: "):
        compile_ik(DifferentialIkConfig(centering="posture"), JointLimits.unlimited(3))


def test_batches_repeat_single_steps_on_any_number_of_threads():
    tree, rng = iiwa(), np.random.default_rng(1)
    limits = JointLimits.of_tree(tree)
    q, v = rng.uniform(limits.lower, limits.upper, (50, 7)), rng.normal(size=(50, 7)) * 0.3
    J, V = tree.tree.jacobians(q), rng.normal(size=(50, 6))
    A, upper = rng.normal(size=(50, 2, 7)), rng.normal(size=(50, 2))
    for formulation in ("least_squares", "direction", "priorities", "pseudo_inverse"):
        ik = compile_ik(DifferentialIkConfig(formulation=formulation), limits)
        many = [
            ik.step_batch(q, v, J, V, None, [3, 3], A, None, upper, num_threads=k) for k in (1, 3)
        ]
        for batch, status in many:
            for i in range(50):
                one = ik.step(q[i], v[i], J[i], V[i], None, [3, 3], A[i], None, upper[i])
                np.testing.assert_array_equal(batch[i], one.v)
                assert status[i] == one.status


def test_threads_may_share_one_object():
    tree, rng = iiwa(), np.random.default_rng(5)
    limits = JointLimits.of_tree(tree)
    ik = compile_frame_ik(DifferentialIkConfig(), limits, tree, [FrameTask()])
    q = rng.uniform(limits.lower, limits.upper, (200, 1, 7))
    X_WD = tree.tree.poses(rng.uniform(limits.lower, limits.upper, (200, 7)))[:, None, None]

    def one(i: int):
        # The first lets go of the interpreter, the second does not.
        return ik.rollout(q[i], 0 * q[i], X_WD[i], 20)[0][0], ik.step(q[i, 0], q[i, 0] * 0).v

    alone = [one(i) for i in range(200)]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(one, range(200)))
    np.testing.assert_array_equal(together, alone)


def test_rollouts_repeat_single_steps():
    tree, rng = iiwa(), np.random.default_rng(2)
    limits = JointLimits.of_tree(tree)
    config = DifferentialIkConfig(period=0.01, damping=0.05)
    ik = compile_frame_ik(config, limits, tree, [FrameTask(weights=(0, 0, 2, 1, 1, 1))])
    starts, goals = rng.uniform(-1, 1, (2, 4, 7))
    X_WD = tree.tree.poses(goals)[:, None]
    q_end, v_end, status, path = ik.rollout(
        starts, np.zeros((4, 7)), X_WD, 300, keep_path=True, num_threads=2
    )
    for i in range(4):
        q, v = starts[i], np.zeros(7)
        for k in range(300):
            v = ik.step(q, v, X_WD[i, 0]).v
            q = q + 0.01 * v
            np.testing.assert_allclose(path[i, k], q, atol=1e-12)
        np.testing.assert_allclose(v_end[i], v, atol=1e-12)
    assert (status <= 1).all()
    reached = tree.tree.poses(q_end)
    np.testing.assert_allclose(reached[:, :3, 3], X_WD[:, 0, :3, 3], atol=2e-3)


def test_frame_tasks_are_rows_of_their_jacobians():
    """Weights, axes, gains, greatest speeds and priorities by the definitions, from poses."""
    tree, rng = iiwa(), np.random.default_rng(3)
    limits = JointLimits.of_tree(tree)
    tasks = [
        FrameTask(frame=1, weights=(0, 0, 0, 1, 0, 3), axes="frame", priority=1, max_linear=0.05),
        FrameTask(frame=0, weights=(2, 1, 0, 1, 1, 0.5), gain=4.0, max_angular=0.3),
    ]
    for formulation in ("least_squares", "priorities"):
        config = DifferentialIkConfig(formulation=formulation, period=0.01)
        frames = compile_frame_ik(config, limits, tree, tasks)
        joints = compile_ik(config, limits)
        for _ in range(20):
            q = 0.8 * rng.uniform(limits.lower, limits.upper)
            v, near = 0.05 * rng.normal(size=7), q + 0.1 * rng.normal(size=7)
            goals = [RigidTransform(tree.tree.pose(near, task.frame)) for task in tasks]
            V_extra = 0.1 * rng.normal(size=(2, 6))
            parts = []
            for task, goal, extra in zip(tasks, goals, V_extra, strict=True):
                X, J = tree.tree.pose_and_jacobian(q, task.frame)
                V = task.gain * pose_error(RigidTransform(X), goal) + extra
                for part, most in ((V[:3], task.max_angular), (V[3:], task.max_linear)):
                    part *= min(1.0, most / np.linalg.norm(part))
                if task.axes == "frame":
                    turn = np.kron(np.eye(2), X[:3, :3].T)
                    J, V = turn @ J, turn @ V
                used = np.array(task.weights) > 0
                parts.append((J[used], V[used], np.array(task.weights)[used]))
            J, V, w = (np.concatenate(each) for each in zip(*parts[::-1], strict=True))
            expected = joints.step(q, v, J, V, w, [5, 2]).v
            X_WD = np.array([goal.GetAsMatrix4() for goal in goals])
            np.testing.assert_allclose(frames.step(q, v, X_WD, V_extra).v, expected, atol=1e-9)


# Limits, whatever comes in.


def stopping_distance(speed, acceleration, period):
    """Way of a joint that moves for one period at this speed and then brakes in every further."""
    change = acceleration * period
    k = np.floor(speed / change)
    return period * ((k + 1) * speed - change * k * (k + 1) / 2)


CONFIGS = {
    "least_squares": {},
    "damped, posture": {"damping": 0.05, "centering": "posture"},
    "centered": {"centering": "nullspace", "centering_weight": 0.01},
    "direction": {"formulation": "direction", "centering": "nullspace"},
    "priorities": {"formulation": "priorities", "centering": "nullspace"},
    "pseudo_inverse": {"formulation": "pseudo_inverse"},
}


def drive(name: str, seed: int, trajectories: int, steps: int) -> int:
    """Drives so many random trajectories, and checks every step by the definitions of the limits.

    Period, limits and desired configuration are random, too, and the same for all of them.

    Returns:
        The number of steps.
    """
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    tree = iiwa()
    N, n = trajectories, 7
    h = float(rng.choice([0.001, 0.005, 0.02, 0.1]))
    narrow = rng.uniform(size=n) < 0.2
    lower = np.where(narrow, -0.05, tree.lower)
    upper = np.where(narrow, 0.03, tree.upper)
    speed = tree.velocity * rng.uniform(0.3, 1.0, n)
    acceleration = speed * 10.0 ** rng.uniform(0.0, 2.0, n)
    ik = compile_ik(
        DifferentialIkConfig(
            period=h, nominal_position=tuple(rng.uniform(lower, upper)), **CONFIGS[name]
        ),
        JointLimits(lower, upper, speed, acceleration),
    )
    q = rng.uniform(lower, upper, (N, n))
    kind = rng.integers(0, 5, N)
    q[kind == 0] = np.clip(0.0, lower, upper)  # Stretched out: singular.
    at_limit = rng.uniform(size=(N, n)) < 0.5
    q = np.where((kind == 1)[:, None] & at_limit, np.where(q > 0, upper, lower), q)
    v = rng.uniform(-speed, speed, (N, n))
    # Slow enough to stop within the range, by bisection of the definition.
    room = np.where(v > 0, upper - q, q - lower)
    least, most = np.zeros((N, n)), np.abs(v)
    for _ in range(60):
        middle = 0.5 * (least + most)
        stops = stopping_distance(middle, acceleration, h) <= room
        least, most = np.where(stops, middle, least), np.where(stops, most, middle)
    v = np.copysign(least, v)
    outside = kind == 2  # Outside the range, or too fast to stop within it.
    q[outside] += rng.normal(size=(outside.sum(), n)) * 0.3
    v[outside] = rng.uniform(-speed, speed, (outside.sum(), n))
    overshoot = np.maximum(q - upper, lower - q)
    overshoot = np.maximum(overshoot, 0.0) + stopping_distance(np.abs(v), acceleration, h)
    overshoot[~outside] = 0.0
    braking = 0
    scale = 10.0 ** rng.uniform(-3, 6, (N, 1))
    V = rng.normal(size=(N, 6)) * scale
    for k in range(steps):
        if k % 10 == 0:
            V = np.where(rng.uniform(size=(N, 1)) < 0.3, rng.normal(size=(N, 6)) * scale, V)
            constrained = rng.uniform() < 0.5
            A = rng.normal(size=(N, 3, n))
            b = rng.normal(size=(N, 3)) * 0.3
        rows = (A, None, b) if constrained else ()
        J = tree.tree.jacobians(q)
        v_next, status = ik.step_batch(q, v, J, V, None, [3, 3], *rows)
        assert np.isfinite(v_next).all()
        assert (np.abs(v_next) <= speed + 1e-9).all()
        assert (np.abs(v_next - v) / h <= acceleration + 1e-9).all()
        q, v = q + h * v_next, v_next
        assert (np.maximum(q - upper, lower - q) <= overshoot + 1e-9).all()
        braking += int((status == BRAKING).sum())
        if rows and name not in ("pseudo_inverse",):
            held = (np.einsum("kmn,kn->km", A, v) <= b + 1e-6).all(axis=1)
            assert (held | (status >= RELAXED)).all()
    if steps * h > 5:
        assert (np.maximum(q - upper, lower - q) <= 1e-9).all(), "all are back"
    # Only directions may be impossible.
    assert name == "direction" or braking <= max(1, 1e-4 * N * steps)
    return N * steps


@pytest.mark.parametrize("name", CONFIGS)
def test_no_limit_is_ever_violated(name):
    for seed in range(4):
        drive(name, seed, 50, 90)


@pytest.mark.slow
@pytest.mark.parametrize("name", CONFIGS)
def test_no_limit_is_violated_in_ten_million_steps(name):
    """Of all formulations together: 6 × 20 × 85 thousand, each time with other limits."""
    done = sum(drive(name, seed, 170, 500) for seed in range(20))
    assert done * len(CONFIGS) >= 10_000_000
