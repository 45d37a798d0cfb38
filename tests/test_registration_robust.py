"""Poses from correspondences with outliers: right, or a status that says why not."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.spatial.transform import Rotation

from prehensile.perception.registration import (
    RegistrationStatus,
    RobustConfig,
    gnc_rotation,
    register_correspondences,
)

NOISE_BOUND = 0.004


def _problem(seed, count=200, wrong=0.0, shape=(0.2, 0.15, 0.1), noise=0.001):
    """Points of a box; wrong partners are other points of the object in its true pose."""
    rng = np.random.default_rng(seed)
    model = rng.uniform(-0.5, 0.5, (count, 3)) * shape
    X_WO = RigidTransform(
        RollPitchYaw(rng.uniform(-np.pi, np.pi, 3)), rng.uniform(-1, 1, 3)
    ).GetAsMatrix4()
    scene = model @ X_WO[:3, :3].T + X_WO[:3, 3] + rng.normal(0, noise, model.shape)
    outliers = rng.permutation(count)[: round(wrong * count)]
    scene[outliers] = scene[rng.permutation(outliers)]
    return model, scene, X_WO, outliers


def _angle(result, X_WO):
    R = result.X_WO.rotation().matrix()
    return Rotation.from_matrix(R.T @ X_WO[:3, :3]).magnitude()


@pytest.mark.parametrize("wrong", [0.0, 0.5, 0.9, 0.97])
@pytest.mark.parametrize("seed", range(5))
def test_pose_is_found_among_wrong_partners(seed, wrong):
    model, scene, X_WO, outliers = _problem(seed, 600, wrong)
    result = register_correspondences(model, scene, NOISE_BOUND)
    assert result.status is RegistrationStatus.SUCCESS
    assert result.clique_proven
    assert _angle(result, X_WO) < 0.02
    assert np.linalg.norm(result.X_WO.translation() - X_WO[:3, 3]) < 1e-3
    right = np.setdiff1d(np.arange(600), outliers)
    assert result.inliers[right].mean() > 0.95
    # A permutation may leave some points their own, and put others near them.
    assert result.inliers[outliers].sum() <= max(5, 0.02 * len(outliers))


def test_teasers_experiment_two_hundred_times():
    errors = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        ways = rng.normal(size=(1000, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        model = 0.5 * ways * (1 + 0.5 * np.sin(3 * ways[:, :1]) * ways[:, 1:2])
        R = Rotation.random(random_state=seed).as_matrix()
        scene = model @ R.T + [0.3, -0.6, 0.9] + rng.normal(0, 0.01, model.shape)
        scene[10:] = 5 * ways[rng.permutation(990)] * rng.uniform(size=(990, 1)) ** (1 / 3)
        result = register_correspondences(model, scene, 0.0554)
        assert result.succeeded
        errors.append(Rotation.from_matrix(result.X_WO.rotation().matrix().T @ R).magnitude())
    assert np.max(errors) < np.radians(5)


@pytest.mark.parametrize("count", [3, 10, 100, 500])
def test_noise_is_no_consensus(count):
    for seed in range(20):
        rng = np.random.default_rng(seed)
        model, scene = rng.uniform(-0.1, 0.1, (2, count, 3))
        result = register_correspondences(model, scene, NOISE_BOUND)
        assert result.status is RegistrationStatus.NO_CONSENSUS
        assert result.X_WO is None
        assert not result.inliers.any()


def test_two_objects_of_one_shape_are_ambiguous():
    model, scene, X_WO, _ = _problem(0, 100)
    moved = scene @ RollPitchYaw(1, 0, 2).ToRotationMatrix().matrix().T + [0.5, 0, 0]
    result = register_correspondences(
        np.concatenate([model, model[:95]]), np.concatenate([scene, moved[:95]]), NOISE_BOUND
    )
    assert result.status is RegistrationStatus.AMBIGUOUS
    assert result.num_inliers_second >= 90
    assert _angle(result, X_WO) < 0.02
    fewer = register_correspondences(
        np.concatenate([model, model[:50]]), np.concatenate([scene, moved[:50]]), NOISE_BOUND
    )
    assert fewer.status is RegistrationStatus.SUCCESS


def test_line_leaves_a_turn_free():
    model, scene, X_WO, _ = _problem(1, 100, shape=(0.3, 0.0, 0.0))
    result = register_correspondences(model, scene, NOISE_BOUND)
    assert result.status is RegistrationStatus.DEGENERATE
    assert len(result.free_directions) == 1
    turn = result.free_directions[0, :3] / np.linalg.norm(result.free_directions[0, :3])
    assert abs(turn @ X_WO[:3, 0]) > 0.99


def test_mirror_image_is_no_pose():
    # All distances agree, so the clique is perfect; no rotation makes the points agree.
    model, scene, _, _ = _problem(2, 60)
    result = register_correspondences(model * [-1, 1, 1], scene, NOISE_BOUND)
    assert result.status is RegistrationStatus.NO_CONSENSUS or result.inliers.sum() < 20


def test_scale_is_estimated():
    model, scene, X_WO, _ = _problem(3, 300, 0.5)
    config = RobustConfig(estimate_scale=True)
    result = register_correspondences(model / 2.5, scene, NOISE_BOUND, config)
    assert result.succeeded
    assert result.scale == pytest.approx(2.5, rel=0.02)
    assert _angle(result, X_WO) < 0.02


def test_covariance_is_that_of_the_errors():
    ratios = []
    for seed in range(40):
        model, scene, X_WO, _ = _problem(seed, 60, 0.3)
        result = register_correspondences(model, scene, 0.005)
        error = result.X_WO.translation() - X_WO[:3, 3]
        ratios.append(error @ np.linalg.solve(result.covariance[3:, 3:], error))
    # Chi-squared with three degrees of freedom has the mean 3.
    assert 2 < np.mean(ratios) < 4.5


def test_same_input_same_answer():
    model, scene, _, _ = _problem(4, 300, 0.9)
    first, second = (register_correspondences(model, scene, NOISE_BOUND) for _ in range(2))
    assert np.array_equal(first.X_WO.GetAsMatrix4(), second.X_WO.GetAsMatrix4())


def test_bad_input_is_named():
    good = np.random.default_rng(0).normal(size=(5, 3))
    for model, scene, bound, name in [
        (good, good[:4], 0.1, "scene_points"),
        (good * np.nan, good, 0.1, "model_points"),
        (good, good[:, :2], 0.1, "scene_points"),
        (good, good, 0.0, "noise_bound"),
    ]:
        with pytest.raises(ValueError, match=name):
            register_correspondences(model, scene, bound)
    with pytest.raises(ValueError, match="ambiguity_ratio"):
        RobustConfig(ambiguity_ratio=0)
    nothing = register_correspondences(good[:0], good[:0], 0.1)
    assert nothing.status is RegistrationStatus.NO_CONSENSUS


@pytest.mark.parametrize("wrong", [0.0, 0.3, 0.6])
def test_rotation_by_graduated_non_convexity(wrong):
    rng = np.random.default_rng(7)
    model = rng.normal(size=(100, 3))
    R = RollPitchYaw(2, 1, -2).ToRotationMatrix().matrix()
    scene = model @ R.T + rng.uniform(-0.01, 0.01, model.shape)
    count = round(wrong * 100)
    scene[:count] = rng.normal(size=(count, 3))
    result = gnc_rotation(model, scene, 0.02)
    assert result.converged
    assert np.linalg.norm(result.R_WO - R) < 0.01
    assert result.inliers[count:].all()
    residuals = np.linalg.norm(scene - model @ result.R_WO.T, axis=1)
    assert result.cost == pytest.approx(np.minimum((residuals / 0.02) ** 2, 1).sum())
    assert np.linalg.det(result.R_WO) == pytest.approx(1)
