"""Poses from known correspondences inside half-spaces, against Drake's SNOPT and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.solvers import MathematicalProgram, SnoptSolver
from pydrake.symbolic import cos, sin

from prehensile.perception.registration import RegistrationStatus
from prehensile.perception.registration.constraints import HalfSpaces, fit_rigid_constrained
from prehensile.perception.registration.convex_constraints import fit_rigid_convex
from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.sequential_qp import nearest_in_polyhedron

BOX = np.array([[-0.5, -0.25], [0.5, -0.25], [0.5, 0.25], [-0.5, 0.25]])
QUADRANT = HalfSpaces.box([0, 0], [np.inf, np.inf])
FLOOR = HalfSpaces([[0, 0, 2.0]], [0.0])


def turned(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def cloud(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of a solid, and those points turned, noisy, around W's origin."""
    rng = np.random.default_rng(seed)
    model = rng.uniform(-1, 1, (30, 3)) * [0.1, 0.06, 0.15]
    R = RotationMatrix(RollPitchYaw(rng.uniform(-3, 3, 3))).matrix()
    return model, model @ R.T + rng.normal(0, 0.003, model.shape)


def snopt_cost(model: np.ndarray, scene: np.ndarray, guesses: int = 12) -> float:
    """The smallest sum of squares in the first quadrant that SNOPT finds from many angles."""
    program = MathematicalProgram()
    x, y, angle = program.NewContinuousVariables(3)
    c, s = cos(angle), sin(angle)
    cost = 0.0
    for m, q in zip(model, scene, strict=True):
        u, v = x + c * m[0] - s * m[1], y + s * m[0] + c * m[1]
        program.AddConstraint(u >= 0)
        program.AddConstraint(v >= 0)
        cost = cost + (u - q[0]) ** 2 + (v - q[1]) ** 2
    program.AddCost(cost)
    found = []
    for guess in np.linspace(0, 2 * np.pi, guesses, endpoint=False):
        result = SnoptSolver().Solve(program, np.array([0.6, 0.6, guess]), None)
        if result.is_success():
            found.append(result.get_optimal_cost())
    return min(found)


def squares(model: np.ndarray, scene: np.ndarray, X_WO: RigidTransform) -> float:
    pad = np.zeros((len(model), 3))
    pad[:, : model.shape[1]] = model
    moved = (X_WO @ pad.T).T[:, : model.shape[1]]
    return float(((moved - scene) ** 2).sum())


def test_half_spaces_that_hold_change_nothing():
    model, scene = cloud(0)
    free = fit_rigid(model, scene).result()
    for answer in (
        fit_rigid_constrained(model, scene, HalfSpaces([[0, 0, 1.0]], [-1.0])),
        fit_rigid_convex(
            model, scene, HalfSpaces([[0, 0, 1.0]], [-1.0]), objective="correlation"
        ).registration,
    ):
        assert answer.succeeded
        assert answer.X_WO is not None
        assert answer.X_WO.IsNearlyEqualTo(free.X_WO, 1e-4)
    answer = fit_rigid_constrained(model, scene, HalfSpaces([[0, 0, 1.0]], [-1.0]))
    assert answer.covariance is not None
    assert free.covariance is not None
    # Gauss-Newton here, the exact second derivative there.
    np.testing.assert_allclose(answer.covariance, free.covariance, rtol=0.03, atol=1e-6)


@pytest.mark.parametrize("offset", [(0.6, 0.35), (0.3, 0.05), (0.2, 0.2), (-0.3, -0.2)])
def test_planar_optimum_is_the_one_of_snopt(offset):
    scene = BOX @ turned(0.5).T + offset
    answer = fit_rigid_constrained(BOX, scene, QUADRANT)
    assert answer.succeeded
    assert answer.X_WO is not None
    corners = (answer.X_WO @ np.pad(BOX, ((0, 0), (0, 1))).T).T
    assert corners[:, :2].min() > -1e-6
    assert corners[:, 2] == pytest.approx(0)
    assert squares(BOX, scene, answer.X_WO) == pytest.approx(snopt_cost(BOX, scene), rel=1e-5)
    assert answer.residual**2 * 4 == pytest.approx(squares(BOX, scene, answer.X_WO), rel=1e-9)


def test_relaxation_is_tight_where_points_pull_gently_and_shrinks_where_they_pull_hard():
    gentle = BOX @ turned(0.5).T + [0.61, 0.55]
    fit = fit_rigid_convex(BOX, gentle, QUADRANT)
    assert fit.registration.succeeded
    assert fit.rotation_error < 1e-4
    assert fit.R_WO is not None
    np.testing.assert_allclose(fit.R_WO, turned(0.5), atol=1e-4)

    hard = BOX @ turned(0.5).T + [0.2, 0.1]
    fit = fit_rigid_convex(BOX, hard, QUADRANT)
    assert fit.registration.status is RegistrationStatus.NOT_CONVERGED
    assert fit.R_WO is not None
    assert 0.1 < np.linalg.det(fit.R_WO) < 0.9  # The object became smaller.
    assert fit.gap > 0.1 * fit.cost
    assert fit.registration.X_WO is not None
    assert fit.registration.X_WO.rotation().IsValid()
    corners = (fit.registration.X_WO @ np.pad(BOX, ((0, 0), (0, 1))).T).T
    assert corners[:, :2].min() > -1e-6


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.15))
def test_bounds_are_ordered_and_certify_the_nonlinear_optimum(seed, height):
    model, scene = cloud(seed)
    scene = scene + [0, 0, height]
    local = fit_rigid_constrained(model, scene, FLOOR)
    assert local.X_WO is not None
    cost = squares(model, scene, local.X_WO)
    hull = fit_rigid_convex(model, scene, FLOOR)
    linear = fit_rigid_convex(model, scene, FLOOR, objective="correlation")
    columns = fit_rigid_convex(model, scene, FLOOR, relaxation="columns")
    small = 1e-5 * cost + 1e-9
    assert columns.lower_bound <= hull.lower_bound + small
    assert hull.lower_bound <= linear.lower_bound + small
    assert linear.lower_bound <= cost + small
    for fit in (hull, linear, columns):
        assert fit.cost >= fit.lower_bound - small
        assert fit.registration.X_WO is not None
        assert (fit.registration.X_WO @ model.T)[2].min() > -1e-6
    if linear.registration.succeeded:
        assert cost == pytest.approx(linear.cost, rel=1e-3, abs=1e-8)


def test_relaxed_matrix_lies_in_the_convex_hull_of_rotations():
    model, scene = cloud(3)
    fit = fit_rigid_convex(model, scene, FLOOR)
    assert fit.R_WO is not None
    # The support function of the rotations: tr(A^T R) <= s1 + s2 + sign(det A) s3 for every A.
    rng = np.random.default_rng(1)
    for A in rng.normal(size=(200, 3, 3)):
        s = np.linalg.svd(A, compute_uv=False)
        assert np.sum(A * fit.R_WO) <= s[0] + s[1] + np.sign(np.linalg.det(A)) * s[2] + 1e-6


def test_table_determines_what_points_on_a_line_do_not():
    """A rod's points leave the turn about it free; the status says so, with the right axis."""
    model = np.linspace([-0.1, 0, 0], [0.1, 0, 0], 9)
    answer = fit_rigid_constrained(model, model + [0, 0, -0.01], FLOOR)
    assert answer.status is RegistrationStatus.DEGENERATE
    assert answer.free_directions is not None
    turn = answer.free_directions[0, :3] / np.linalg.norm(answer.free_directions[0, :3])
    assert abs(turn[0]) == pytest.approx(1, abs=1e-3)
    assert answer.X_WO is not None
    np.testing.assert_allclose(answer.X_WO.translation(), 0, atol=1e-6)


def test_what_cannot_be_is_infeasible():
    model, scene = cloud(1)
    slit = HalfSpaces.box([0, -np.inf, -np.inf], [0.01, np.inf, np.inf])
    nowhere = HalfSpaces([[1.0, 0, 0], [-1.0, 0, 0]], [1.0, 1.0])
    for half_spaces in (slit, nowhere):
        answer = fit_rigid_constrained(model, scene, half_spaces, num_starts=3)
        assert answer.status is RegistrationStatus.INFEASIBLE
        assert answer.X_WO is None
    for half_spaces in (slit, nowhere):
        assert not fit_rigid_convex(model, scene, half_spaces).registration.succeeded
    assert fit_rigid_convex(model, scene, nowhere).R_WO is None


def test_object_turns_to_fit_into_a_slot():
    """A plank 0.2 m long fits a slot of 0.08 m only along it, whatever the points say."""
    model = np.array([[-0.1, -0.02], [0.1, -0.02], [0.1, 0.02], [-0.1, 0.02]])
    slot = HalfSpaces.box([-0.04, -np.inf], [0.04, np.inf])
    answer = fit_rigid_constrained(model, model @ turned(0.4).T, slot)
    assert answer.succeeded
    assert answer.X_WO is not None
    assert np.abs((answer.X_WO @ np.pad(model, ((0, 0), (0, 1))).T)[0]).max() < 0.04 + 1e-6


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 100_000))
def test_nearest_in_polyhedron_meets_the_optimality_conditions(seed):
    rng = np.random.default_rng(seed)
    A, x0, point = rng.normal(size=(6, 3)), rng.normal(size=3), 3 * rng.normal(size=3)
    c = A @ x0 - rng.exponential(size=6)
    found = nearest_in_polyhedron(point, A, c)
    assert found is not None
    x, multipliers = found
    assert (A @ x - c).min() > -1e-7
    assert multipliers.min() >= 0
    np.testing.assert_allclose(x - point, A.T @ multipliers, atol=1e-7)
    assert multipliers @ (A @ x - c) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"model_points": np.zeros((3, 3))}, "scene_points"),
        ({"scene_points": np.full((4, 2), np.nan)}, "scene_points"),
        ({"half_spaces": HalfSpaces([[1.0, 0, 0]], [0])}, "half_spaces"),
        ({"half_spaces": HalfSpaces([[0.0, 0]], [0])}, "half_spaces"),
        ({"half_spaces": HalfSpaces([[np.inf, 0]], [0])}, "half_spaces"),
        ({"constrained_points": np.zeros((0, 2))}, "constrained_points"),
        ({"weights": [1, 1, 1, -1]}, "weights"),
    ],
)
def test_bad_input_is_named(change, name):
    arguments = {"model_points": BOX, "scene_points": BOX, "half_spaces": QUADRANT, **change}
    for fit in (fit_rigid_constrained, fit_rigid_convex):
        with pytest.raises(ValueError, match=name):
            fit(**arguments)
