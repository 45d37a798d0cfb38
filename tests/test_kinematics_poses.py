"""Differences of poses against Drake's angle-axis, and straight lines of poses."""

from itertools import pairwise

import numpy as np
import pytest
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.poses import (
    pose_distance,
    pose_error,
    random_pose,
    straight_line,
    twist_error,
)
from prehensile.kinematics.rotations import random_rotation
from prehensile.kinematics.spatial import adjoint, exp_se3


def test_pose_error_moves_one_frame_to_the_other():
    rng = np.random.default_rng(0)
    for _ in range(50):
        X_WA, X_WB = (random_pose(rng) for _ in range(2))
        error = pose_error(X_WA, X_WB)
        angle = np.linalg.norm(error[:3])
        R_AB_W = RotationMatrix(AngleAxis(angle, error[:3] / angle))
        moved = RigidTransform(R_AB_W @ X_WA.rotation(), X_WA.translation() + error[3:])
        assert moved.IsNearlyEqualTo(X_WB, 1e-9)


def test_straight_line_is_straight_even_and_bounded():
    rng = np.random.default_rng(1)
    X_WA = RigidTransform(random_rotation(rng), [0.1, 0.2, 0.3])
    X_WB = RigidTransform(random_rotation(rng), [-0.4, 0.2, 0.9])
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


def test_twist_error_carries_one_frame_to_the_other_from_either_side():
    rng = np.random.default_rng(2)
    for _ in range(20):
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        twist = twist_error(X_WA, X_WB)
        assert (X_WA @ exp_se3(twist)).IsNearlyEqualTo(X_WB, 1e-12)
        assert (exp_se3(adjoint(X_WA) @ twist) @ X_WA).IsNearlyEqualTo(X_WB, 1e-12)


def test_errors_of_a_small_motion_agree_with_its_velocity():
    # Both errors are velocities to first order, each in its own frame and at its own point.
    rng = np.random.default_rng(3)
    for _ in range(20):
        X_WA = random_pose(rng)
        V_WA_A = rng.normal(size=6)
        X_WB = X_WA @ exp_se3(1e-6 * V_WA_A)
        R_WA = X_WA.rotation().matrix()
        V_WA_W = np.concatenate([R_WA @ V_WA_A[:3], R_WA @ V_WA_A[3:]])
        np.testing.assert_allclose(pose_error(X_WA, X_WB) / 1e-6, V_WA_W, atol=1e-5)
        np.testing.assert_allclose(twist_error(X_WA, X_WB) / 1e-6, V_WA_A, atol=1e-9)


def test_random_poses_lie_in_their_box_and_repeat():
    lower, upper = np.array([0.0, -1.0, 2.0]), np.array([1.0, 1.0, 2.5])
    poses = [random_pose(np.random.default_rng(k), lower, upper) for k in (0, 0, 1)]
    assert poses[0].IsExactlyEqualTo(poses[1])
    assert not poses[0].IsNearlyEqualTo(poses[2], 1e-3)
    for X in poses:
        assert np.all((X.translation() >= lower) & (X.translation() <= upper))


@pytest.mark.parametrize("steps", [(0.0, 1.0), (1.0, -1.0), (np.nan, 1.0)])
def test_steps_of_a_line_are_positive(steps):
    with pytest.raises(ValueError, match="must be positive"):
        straight_line(RigidTransform(), RigidTransform([1.0, 0.0, 0.0]), *steps)
