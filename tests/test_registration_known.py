"""Closed-form registration: against SciPy, Monte Carlo and the symmetries of the problem."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from prehensile.perception.registration import (
    RegistrationStatus,
    fit_rigid,
    fit_rotation,
    fit_translation,
)

SEEDS = st.integers(0, 2**32 - 1)


def rotation(rng, dimension):
    if dimension == 2:
        c, s = np.cos(a := rng.uniform(-np.pi, np.pi)), np.sin(a)
        return np.array([[c, -s], [s, c]])
    return Rotation.random(random_state=np.random.RandomState(rng.integers(2**31))).as_matrix()


@pytest.mark.parametrize("dimension", [2, 3])
@given(seed=SEEDS, offset=st.floats(0, 100))
@settings(max_examples=50)
def test_recovers_the_motion_exactly(dimension, seed, offset):
    rng = np.random.default_rng(seed)
    R, p = rotation(rng, dimension), rng.normal(size=dimension) * offset
    model = rng.normal(size=(rng.integers(dimension, 30), dimension)) + offset
    fit = fit_rigid(model, model @ R.T + p, rng.uniform(0.1, 2, len(model)))
    assert fit.succeeded
    np.testing.assert_allclose(fit.R_WO, R, atol=1e-9 * (1 + offset))
    np.testing.assert_allclose(fit.p_WO, p, atol=1e-7 * (1 + offset))
    assert fit.residual < 1e-9 * (1 + offset)


@given(seed=SEEDS)
@settings(max_examples=50)
def test_rotation_agrees_with_scipy(seed):
    rng = np.random.default_rng(seed)
    model, scene = rng.normal(size=(2, 10, 3))
    w = rng.uniform(0.1, 2, 10)
    expected, _ = Rotation.align_vectors(scene, model, weights=w)
    np.testing.assert_allclose(fit_rotation(model, scene, w).R_WO, expected.as_matrix(), atol=1e-7)


@given(seed=SEEDS)
@settings(max_examples=30)
def test_plane_agrees_with_the_angle_formula(seed):
    rng = np.random.default_rng(seed)
    model, scene = rng.normal(size=(2, 7, 2))
    m, s = model - model.mean(axis=0), scene - scene.mean(axis=0)
    angle = np.arctan2((m[:, 0] * s[:, 1] - m[:, 1] * s[:, 0]).sum(), (m * s).sum())
    fit = fit_rigid(model, scene)
    assert np.arctan2(fit.R_WO[1, 0], fit.R_WO[0, 0]) == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_mirrored_points_give_a_rotation_that_nothing_beats(dimension):
    rng = np.random.default_rng(3)
    model = rng.normal(size=(12, dimension)) * np.array([3, 2, 1])[:dimension]
    scene = model * ([1] * (dimension - 1) + [-1])
    fit = fit_rigid(model, scene)
    assert np.linalg.det(fit.R_WO) == pytest.approx(1)
    centered = model - model.mean(axis=0), scene - scene.mean(axis=0)
    for _ in range(2000):
        R = rotation(rng, dimension)
        other = np.sqrt(((centered[0] @ R.T - centered[1]) ** 2).sum(axis=1).mean())
        assert other >= fit.residual - 1e-12


def test_a_mirrored_square_is_ambiguous():
    square = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1.0]])
    assert fit_rigid(square, square * [1, -1]).status is RegistrationStatus.DEGENERATE


@given(seed=SEEDS)
@settings(max_examples=30)
def test_line_leaves_the_turn_about_itself(seed):
    rng = np.random.default_rng(seed)
    along = rng.normal(size=3)
    along /= np.linalg.norm(along)
    R, p = rotation(rng, 3), rng.normal(size=3)
    model = rng.normal(size=3) + np.linspace(-1, 1, 6)[:, None] * along
    result = fit_rigid(model, model @ R.T + p).result()
    assert result.status is RegistrationStatus.DEGENERATE
    assert result.free_directions is not None
    (free,) = result.free_directions
    axis = free[:3] / np.linalg.norm(free[:3])
    np.testing.assert_allclose(abs(axis @ (R @ along)), 1, atol=1e-6)
    # The pose is still one of those that fit.
    np.testing.assert_allclose(result.X_WO.multiply(model.T).T, model @ R.T + p, atol=1e-9)


def test_one_point_leaves_all_turns():
    result = fit_rigid([[1, 2, 3]], [[4, 5, 6]]).result()
    assert result.status is RegistrationStatus.DEGENERATE
    assert result.free_directions.shape == (3, 6)
    np.testing.assert_allclose(result.X_WO.multiply([1, 2, 3]), [4, 5, 6])
    assert fit_rigid([[1, 2]], [[4, 5]]).status is RegistrationStatus.DEGENERATE


def test_covariance_is_that_of_repeated_measurement():
    rng = np.random.default_rng(0)
    model = rng.normal(size=(30, 3)) * [0.1, 0.05, 0.02] + [0.3, 0, 0]
    R, p, sigma = rotation(rng, 3), np.array([0.5, 0.2, 0.1]), 1e-3
    errors, last = [], None
    for _ in range(400):
        last = fit_rigid(model, model @ R.T + p + rng.normal(0, sigma, model.shape))
        turn = Rotation.from_matrix(last.R_WO @ R.T).as_rotvec()
        errors.append(np.concatenate([turn, last.p_WO - p]))
    measured = np.cov(np.array(errors).T)
    predicted = last.result().covariance
    np.testing.assert_allclose(np.sqrt(np.diag(predicted) / np.diag(measured)), 1, atol=0.35)
    # Turns and translations of a far origin go together.
    whitened = np.linalg.solve(np.linalg.cholesky(predicted), np.array(errors).T)
    np.testing.assert_allclose(np.cov(whitened), np.eye(6), atol=0.7)


def test_translation_is_the_weighted_mean():
    rng = np.random.default_rng(1)
    R, model, scene, w = rotation(rng, 3), *rng.normal(size=(2, 5, 3)), rng.uniform(size=5)
    fit = fit_translation(model, scene, R, w)
    np.testing.assert_allclose(fit.p_WO, np.average(scene - model @ R.T, axis=0, weights=w))
    assert fit_translation(model[:1], scene[:1], R).succeeded


def test_points_of_no_weight_do_not_count():
    rng = np.random.default_rng(2)
    R, model = rotation(rng, 3), rng.normal(size=(8, 3))
    scene = model @ R.T
    scene[5:] = 1e3
    result = fit_rigid(model, scene, [1, 1, 1, 1, 1, 0, 0, 0]).result()
    np.testing.assert_allclose(result.X_WO.rotation().matrix(), R, atol=1e-9)
    assert result.inliers.tolist() == [True] * 5 + [False] * 3


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((np.zeros((0, 3)), np.zeros((0, 3))), "model_points"),
        ((np.zeros((3, 4)), np.zeros((3, 4))), "model_points"),
        ((np.zeros((3, 3)), np.zeros((4, 3))), "scene_points"),
        ((np.full((3, 3), np.nan), np.zeros((3, 3))), "model_points"),
        ((np.zeros((3, 3)), np.full((3, 3), np.inf)), "scene_points"),
        ((np.ones((3, 3)), np.ones((3, 3)), [1, -1, 1]), "weights"),
        ((np.ones((3, 3)), np.ones((3, 3)), [0, 0, 0]), "weights"),
        ((np.ones((3, 3)), np.ones((3, 3)), [1, 1]), "weights"),
    ],
)
def test_bad_input_is_named(arguments, name):
    with pytest.raises(ValueError, match=name):
        fit_rigid(*arguments)
    with pytest.raises(ValueError, match=name.replace("points", "vectors")):
        fit_rotation(*arguments)


def test_translation_refuses_what_is_no_rotation():
    with pytest.raises(ValueError, match="R_WO"):
        fit_translation(np.ones((2, 3)), np.ones((2, 3)), -np.eye(3))
