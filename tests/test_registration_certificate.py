"""The semidefinite relaxation of rotation search against dense sampling."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from prehensile.perception.registration import certify_rotation
from prehensile.perception.registration.certificate import _quaternion_forms


def _problem(seed, count, wrong):
    rng = np.random.default_rng(seed)
    model = rng.normal(size=(count, 3))
    R = Rotation.random(random_state=seed).as_matrix()
    scene = model @ R.T + rng.normal(0, 0.01, model.shape)
    scene[:wrong] = rng.normal(size=(wrong, 3))
    return model, scene, R


def test_quaternion_forms_are_the_squared_residuals():
    model, scene, _ = _problem(0, 5, 2)
    rotation = Rotation.random(random_state=1)
    q = np.roll(rotation.as_quat(), 1)
    squares = ((scene - rotation.apply(model)) ** 2).sum(axis=1)
    assert np.allclose(q @ _quaternion_forms(model, scene) @ q, squares)


@pytest.mark.parametrize(("seed", "count", "wrong"), [(1, 5, 2), (2, 6, 2)])
def test_true_rotation_is_certified(seed, count, wrong):
    model, scene, R = _problem(seed, count, wrong)
    certificate = certify_rotation(model, scene, 0.05)
    assert certificate.solved
    assert certificate.tight
    assert certificate.rank_ratio < 1e-3
    assert np.linalg.norm(certificate.R_WO - R) < 0.05
    assert certificate.inliers[wrong:].all()
    rotations = Rotation.random(20_000, random_state=seed).as_matrix()
    squares = ((np.einsum("rij,nj->rni", rotations, model) - scene) ** 2).sum(axis=2)
    sampled = np.minimum(squares / 0.05**2, 1).sum(axis=1).min()
    assert certificate.lower_bound <= sampled + 1e-4


def test_wrong_candidate_is_found_out_and_replaced():
    model, scene, R = _problem(3, 5, 1)
    wrong = R @ Rotation.from_rotvec([0.5, 0, 0]).as_matrix()
    certificate = certify_rotation(model, scene, 0.05, wrong)
    assert certificate.tight
    assert np.linalg.norm(certificate.R_WO - R) < 0.05


def test_bad_input_is_named():
    good = np.eye(3)
    with pytest.raises(ValueError, match="scene_vectors"):
        certify_rotation(good, good[:2], 0.1)
    with pytest.raises(ValueError, match="bound"):
        certify_rotation(good, good, 0)
    with pytest.raises(ValueError, match="R_WO"):
        certify_rotation(good, good, 0.1, 2 * good)
