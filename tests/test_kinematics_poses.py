"""Differences of poses against Drake's angle-axis, and straight lines of poses."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.poses import pose_distance, pose_error, rotation_vector, straight_line

components = st.floats(-1.0, 1.0)
axes = st.tuples(components, components, components).filter(lambda a: np.linalg.norm(a) > 0.1)


@given(axis=axes, angle=st.floats(0.0, np.pi))
def test_rotation_vector_is_the_logarithm(axis, angle):
    unit = np.array(axis) / np.linalg.norm(axis)
    R = RotationMatrix(AngleAxis(angle, unit)).matrix()
    vector = rotation_vector(R)
    size = np.linalg.norm(vector)
    assert size == pytest.approx(angle, abs=2e-8)
    back = RotationMatrix(AngleAxis(size, vector / size)) if size > 0 else RotationMatrix()
    np.testing.assert_allclose(back.matrix(), R, atol=1e-7)


def test_rotation_vector_of_half_turns():
    for axis in np.vstack([np.eye(3), [[0.6, 0.8, 0.0], [0.6, 0.0, -0.8]]]):
        vector = rotation_vector(RotationMatrix(AngleAxis(np.pi, axis)).matrix())
        np.testing.assert_allclose(np.abs(vector @ axis), np.pi, atol=1e-7)


def test_pose_error_moves_one_frame_to_the_other():
    rng = np.random.default_rng(0)
    for _ in range(50):
        X_WA, X_WB = (
            RigidTransform(RotationMatrix(_random_rotation(rng)), rng.normal(size=3))
            for _ in range(2)
        )
        error = pose_error(X_WA, X_WB)
        angle = np.linalg.norm(error[:3])
        R_AB_W = RotationMatrix(AngleAxis(angle, error[:3] / angle))
        moved = RigidTransform(R_AB_W @ X_WA.rotation(), X_WA.translation() + error[3:])
        assert moved.IsNearlyEqualTo(X_WB, 1e-9)


def test_straight_line_is_straight_even_and_bounded():
    rng = np.random.default_rng(1)
    X_WA = RigidTransform(RotationMatrix(_random_rotation(rng)), [0.1, 0.2, 0.3])
    X_WB = RigidTransform(RotationMatrix(_random_rotation(rng)), [-0.4, 0.2, 0.9])
    poses = straight_line(X_WA, X_WB, 0.01, 0.05)
    distance, angle = pose_distance(X_WA, X_WB)
    assert poses[0] is X_WA
    assert poses[-1] is X_WB
    steps = [pose_distance(a, b) for a, b in pairwise(poses)]
    np.testing.assert_allclose([s[0] for s in steps], distance / len(steps), rtol=1e-9)
    np.testing.assert_allclose([s[1] for s in steps], angle / len(steps), rtol=1e-6)
    assert max(s[0] for s in steps) <= 0.01 + 1e-12
    assert max(s[1] for s in steps) <= 0.05 + 1e-12


def test_straight_line_between_equal_poses_has_both_ends():
    X = RigidTransform([1.0, 2.0, 3.0])
    assert len(straight_line(X, X, 0.01, 0.05)) == 2


def _random_rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)
