"""Conventions of others: against SciPy, against what velocities do, and round trips."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial.transform import Rotation

from prehensile.kinematics.conventions import (
    from_convention,
    from_scipy,
    pose_from_array,
    pose_from_matrix,
    pose_to_array,
    quaternion_from_array,
    quaternion_to_array,
    to_convention,
    to_scipy,
    twist_matrix,
)
from prehensile.kinematics.poses import random_pose
from prehensile.kinematics.rotations import log_so3, random_rotation
from prehensile.kinematics.spatial import adjoint, adjoint_dual, exp_se3

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)
CONVENTIONS = ("space", "body", "aligned", "pinocchio_local", "pinocchio_world", "mujoco")
LAYOUTS = ("wxyz_xyz", "xyz_wxyz", "xyz_xyzw")


@given(rng=rngs)
def test_rotations_agree_with_scipy(rng):
    R = random_rotation(rng)
    rotation = to_scipy(R)
    xyzw = quaternion_to_array(R, "xyzw")
    np.testing.assert_allclose(xyzw, rotation.as_quat(canonical=True), atol=1e-14)
    np.testing.assert_array_equal(np.roll(xyzw, 1), quaternion_to_array(R, "wxyz"))
    np.testing.assert_allclose(log_so3(R.matrix()), rotation.as_rotvec(), atol=1e-13)
    rpy = rotation.as_euler("xyz")
    np.testing.assert_allclose(RotationMatrix(RollPitchYaw(rpy)).matrix(), R.matrix(), atol=1e-13)
    back = [from_scipy(rotation)]
    for sign in (1.0, -1.0):
        back.append(quaternion_from_array(sign * xyzw, "xyzw"))
        back.append(quaternion_from_array(sign * np.roll(xyzw, 1), "wxyz"))
    for R_back in back:
        np.testing.assert_allclose(R_back.matrix(), R.matrix(), atol=1e-14)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_seven_numbers_and_back(layout):
    rng = np.random.default_rng(0)
    for _ in range(20):
        X = random_pose(rng)
        assert pose_from_array(pose_to_array(X, layout), layout).IsNearlyEqualTo(X, 1e-14)


def test_layouts_of_a_known_pose():
    # A quarter turn about z.
    X = RigidTransform(RotationMatrix.MakeZRotation(np.pi / 2), [1.0, 2.0, 3.0])
    h = np.sqrt(0.5)
    np.testing.assert_allclose(pose_to_array(X, "wxyz_xyz"), [h, 0, 0, h, 1, 2, 3], atol=1e-15)
    np.testing.assert_allclose(pose_to_array(X, "xyz_wxyz"), [1, 2, 3, h, 0, 0, h], atol=1e-15)
    np.testing.assert_allclose(pose_to_array(X, "xyz_xyzw"), [1, 2, 3, 0, 0, h, h], atol=1e-15)


def test_single_precision_matrices_are_mended():
    rng = np.random.default_rng(1)
    X = random_pose(rng)
    T = X.GetAsMatrix4().astype(np.float32)
    assert pose_from_matrix(T).IsNearlyEqualTo(X, 1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pose_from_matrix(np.diag([1.0, 1.0, -1.0, 1.0])), "T must hold a rotation"),
        (lambda: pose_from_matrix(np.diag([1.0, 1.0, 1.1, 1.0])), "T must hold a rotation"),
        (lambda: pose_from_matrix(2 * np.eye(4)), "last row"),
        (lambda: pose_from_matrix(np.eye(3)), "T must be"),
        (lambda: pose_from_matrix(np.full((4, 4), np.nan)), "T must be"),
        (lambda: quaternion_from_array([2.0, 0, 0, 0], "wxyz"), "unit quaternion"),
        (lambda: quaternion_from_array([1.0, 0, 0, 0], "zyxw"), "order must be one of wxyz, xyzw"),
        (lambda: pose_from_array(np.zeros(6), "xyz_xyzw"), "x must be"),
        (lambda: pose_to_array(RigidTransform(), "xyzw"), "layout must be"),
        (lambda: twist_matrix(RigidTransform(), "ros"), "convention must be"),
        (lambda: from_scipy(Rotation.from_quat(np.eye(4))), "single"),
    ],
)
def test_misuse_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@given(rng=rngs)
def test_twists_by_differentiation(rng):
    # The book's definitions: [V_b] = X^-1 Xdot, [V_s] = Xdot X^-1.
    X0, S = random_pose(rng), rng.normal(size=6)
    h = 1e-5

    def matrix(t):
        return (X0 @ exp_se3(t * S)).GetAsMatrix4()

    X_dot = (matrix(h) - matrix(-h)) / (2 * h)
    body, space = np.linalg.solve(matrix(0), X_dot), X_dot @ np.linalg.inv(matrix(0))
    R = X0.rotation().matrix()
    w = R @ S[:3]
    V_WB = np.concatenate([w, X_dot[:3, 3]])

    def numbers(T):
        return np.array([T[2, 1], T[0, 2], T[1, 0], T[0, 3], T[1, 3], T[2, 3]])

    near = {"atol": 1e-8}
    np.testing.assert_allclose(to_convention(V_WB, X0, "body"), numbers(body), **near)
    np.testing.assert_allclose(to_convention(V_WB, X0, "space"), numbers(space), **near)
    np.testing.assert_allclose(
        to_convention(V_WB, X0, "aligned"), np.concatenate([X_dot[:3, 3], w]), **near
    )
    np.testing.assert_allclose(
        to_convention(V_WB, X0, "mujoco"), np.concatenate([X_dot[:3, 3], S[:3]]), **near
    )
    for pinocchio, ours in (("pinocchio_local", "body"), ("pinocchio_world", "space")):
        np.testing.assert_array_equal(
            np.roll(to_convention(V_WB, X0, pinocchio), 3), to_convention(V_WB, X0, ours)
        )
    # Space and body twists are adjoint to each other.
    body = to_convention(V_WB, X0, "body")
    np.testing.assert_allclose(adjoint(X0) @ body, to_convention(V_WB, X0, "space"), atol=1e-12)


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_twists_jacobians_and_wrenches_there_and_back(convention):
    rng = np.random.default_rng(3)
    for _ in range(10):
        X, V, J = random_pose(rng), rng.normal(size=6), rng.normal(size=(6, 7))
        for value in (V, J):
            there = to_convention(value, X, convention)
            np.testing.assert_allclose(from_convention(there, X, convention), value, atol=1e-12)
        F = rng.normal(size=6)
        wrench = np.linalg.inv(twist_matrix(X, convention)).T @ F
        assert wrench @ to_convention(V, X, convention) == pytest.approx(F @ V)
        if convention == "space":
            R_BW = RigidTransform(X.rotation().inverse())
            F_B = adjoint_dual(R_BW) @ F  # at B's origin, in B
            np.testing.assert_allclose(wrench, adjoint_dual(X) @ F_B, atol=1e-12)
