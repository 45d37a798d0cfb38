"""Inverse kinematics against forward kinematics."""

import numpy as np
import pytest
from arm_scene import BIN0, make_arm
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.planning.inverse_kinematics import solve_ik


@pytest.fixture(scope="module")
def arm():
    return make_arm()


def test_reachable_poses_are_solved_within_limits(arm):
    rng = np.random.default_rng(3)
    solved = 0
    for _ in range(200):
        X_WG = arm.pose(rng.uniform(arm.limits.lower, arm.limits.upper))
        result = solve_ik(arm, X_WG, arm.q_default, rng=rng, collision_free=False)
        if result.solved:
            solved += 1
            assert np.all(result.q >= arm.limits.lower)
            assert np.all(result.q <= arm.limits.upper)
            assert arm.pose(result.q).IsNearlyEqualTo(X_WG, 1e-5)
    assert solved >= 196


def test_jacobian_is_the_derivative_of_the_pose(arm):
    rng = np.random.default_rng(0)
    q = rng.uniform(-1.0, 1.0, arm.num_joints)
    qdot = rng.normal(size=arm.num_joints)
    _, J = arm.pose_and_jacobian(q)
    h = 1e-5
    ahead, behind = arm.pose(q + h * qdot), arm.pose(q - h * qdot)
    v = (ahead.translation() - behind.translation()) / (2.0 * h)
    np.testing.assert_allclose(J[3:] @ qdot, v, atol=1e-8)
    R = ahead.rotation().matrix() @ behind.rotation().matrix().T
    w = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * h)
    np.testing.assert_allclose(J[:3] @ qdot, w, atol=1e-8)


def test_a_pose_out_of_reach_says_so(arm):
    result = solve_ik(arm, RigidTransform([2.0, 0.0, 0.3]), arm.q_default)
    assert result.status == "unreachable"
    assert "out of reach" in result.reason


def test_a_pose_inside_the_bin_wall_names_the_bin(arm):
    down = RotationMatrix.MakeXRotation(-0.5 * np.pi)
    X_WG = RigidTransform(down, [BIN0[0], BIN0[1], 0.08])
    result = solve_ik(arm, X_WG, arm.q_default)
    assert result.status == "collision"
    assert "bin0" in result.reason
    assert not arm.is_free(result.q)


def test_a_pose_beyond_the_joint_limits_names_the_joints(arm):
    q = arm.q_default
    q[6] = arm.limits.upper[6] + 0.1
    # Stretched straight up, only the sum of joints 1, 3, 5, 7 counts; all but 7 are locked.
    q[[1, 3, 5]] = 0.0
    free = arm.limits
    locked = type(free)(q - 1e-4, q + 1e-4, free.velocity, free.acceleration)
    locked.upper[6] = free.upper[6]
    locked.lower[6] = free.lower[6]
    arm.limits = locked
    try:
        result = solve_ik(arm, arm.pose(q), np.clip(q, locked.lower, locked.upper))
    finally:
        arm.limits = free
    assert result.status == "limits"
    assert "iiwa_joint" in result.reason


def test_same_seed_same_solution(arm):
    X_WG = arm.pose(np.array([1.0, 0.5, -0.4, -1.6, 0.3, 0.9, -0.2]))
    results = [solve_ik(arm, X_WG, np.zeros(7), rng=np.random.default_rng(5)) for _ in range(2)]
    np.testing.assert_array_equal(results[0].q, results[1].q)
