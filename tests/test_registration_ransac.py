"""RANSAC over correspondences."""

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from prehensile.perception.registration import (
    RegistrationStatus,
    ransac_pose,
    register_correspondences,
)

R_WO = RollPitchYaw(1, -2, 3).ToRotationMatrix().matrix()
p_WO = np.array([0.4, 0.1, -0.3])


def _problem(seed, wrong, count=200):
    rng = np.random.default_rng(seed)
    model = rng.uniform(-0.1, 0.1, (count, 3))
    scene = model @ R_WO.T + p_WO + rng.normal(0, 0.001, model.shape)
    outliers = round(wrong * count)
    scene[:outliers] = rng.uniform(-0.2, 0.2, (outliers, 3)) + p_WO
    return model, scene, outliers


@pytest.mark.parametrize("wrong", [0.0, 0.5, 0.85])
def test_pose_is_that_of_the_right_partners(wrong):
    model, scene, outliers = _problem(0, wrong)
    result = ransac_pose(model, scene, 0.005, seed=3)
    assert result.succeeded
    X_WO = result.X_WO.GetAsMatrix4()
    assert np.linalg.norm(X_WO[:3, :3] - R_WO) < 0.02
    assert np.linalg.norm(X_WO[:3, 3] - p_WO) < 0.001
    assert result.inliers[outliers:].mean() > 0.97
    assert result.inliers[:outliers].mean() < 0.03 if outliers else True
    # Both end at the least squares of the same inliers.
    other = register_correspondences(model, scene, 0.005)
    assert np.array_equal(result.inliers, other.inliers)
    assert np.allclose(X_WO, other.X_WO.GetAsMatrix4(), atol=1e-9)


def test_samples_grow_as_the_right_ones_become_fewer():
    samples = [ransac_pose(*_problem(1, wrong)[:2], 0.005).iterations for wrong in (0.0, 0.5, 0.8)]
    assert samples[0] < 5
    # log(0.001) / log(1 - w^3), a little more or less as inliers are counted.
    assert samples[1] == pytest.approx(6.9 / 0.5**3, rel=0.3)
    assert samples[2] == pytest.approx(6.9 / 0.2**3, rel=0.4)


def test_seed_decides():
    model, scene, _ = _problem(2, 0.8)
    poses = [ransac_pose(model, scene, 0.005, seed=seed, max_samples=300).X_WO for seed in (1, 1)]
    assert (poses[0] is None) == (poses[1] is None)
    if poses[0] is not None:
        assert np.array_equal(poses[0].GetAsMatrix4(), poses[1].GetAsMatrix4())
    # So few samples hold a right triple by luck only.
    lucky = {
        ransac_pose(model, scene, 0.005, seed=seed, max_samples=100).X_WO is None
        for seed in range(12)
    }
    assert lucky == {True, False}


def test_noise_is_no_consensus():
    for seed in range(10):
        rng = np.random.default_rng(seed)
        model, scene = rng.uniform(-0.1, 0.1, (2, 150, 3))
        result = ransac_pose(model, scene, 0.004, seed=seed, max_samples=20_000)
        assert result.status is RegistrationStatus.NO_CONSENSUS
        assert result.X_WO is None


def test_limit_on_samples_is_told():
    model, scene, _ = _problem(3, 0.9, 400)
    result = ransac_pose(model, scene, 0.005, max_samples=2500)
    assert result.iterations == 2500
    assert result.status in (RegistrationStatus.NOT_CONVERGED, RegistrationStatus.NO_CONSENSUS)
    assert result.message


def test_bad_input_is_named():
    good = np.random.default_rng(0).normal(size=(5, 3))
    for arguments, name in [
        ({"scene_points": good[:4]}, "scene_points"),
        ({"model_points": good * np.inf}, "model_points"),
        ({"max_distance": -1}, "max_distance"),
        ({"max_samples": 0}, "max_samples"),
        ({"confidence": 1.0}, "confidence"),
    ]:
        call = {"model_points": good, "scene_points": good, "max_distance": 0.1} | arguments
        with pytest.raises(ValueError, match=name):
            ransac_pose(**call)
    assert ransac_pose(good[:2], good[:2], 0.1).status is RegistrationStatus.NO_CONSENSUS
