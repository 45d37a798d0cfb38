"""Rotations against SciPy, against their group's axioms and against numerical differentiation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RotationMatrix
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from prehensile.kinematics.rotations import (
    exp_so3,
    left_jacobian_inverse_so3,
    left_jacobian_so3,
    log_so3,
    random_rotation,
    rotation_angle,
    skew,
    unskew,
)

components = st.floats(-1.0, 1.0)
axes = st.tuples(components, components, components).filter(lambda a: np.linalg.norm(a) > 0.1)
# Angles of every size, crowded toward the two places where formulas divide zero by zero.
tiny = st.floats(-16.0, -0.5).map(lambda e: 10.0**e)
angles = st.one_of(tiny, tiny.map(lambda a: np.pi - a), st.floats(0.0, np.pi))


def vector(axis, angle):
    axis = np.array(axis)
    return axis * (angle / np.linalg.norm(axis))


@given(axis=axes, angle=angles)
def test_exponential_is_that_of_scipy_and_of_the_matrix(axis, angle):
    phi = vector(axis, angle)
    R = exp_so3(phi)
    np.testing.assert_allclose(R, Rotation.from_rotvec(phi).as_matrix(), atol=1e-15, rtol=0)
    np.testing.assert_allclose(R, expm(skew(phi)), atol=1e-14, rtol=0)


@given(axis=axes, angle=angles)
def test_logarithm_undoes_the_exponential(axis, angle):
    phi = vector(axis, angle)
    back = log_so3(exp_so3(phi))
    if np.pi - angle < 1e-14:
        back *= np.sign(back @ phi)  # half a turn: either sign
    np.testing.assert_allclose(back, phi, rtol=1e-15, atol=max(4e-15 * angle, 1e-16))
    assert rotation_angle(exp_so3(phi)) == pytest.approx(angle, abs=4e-15)


@given(axis=axes, angle=angles)
def test_logarithm_of_drakes_rotations(axis, angle):
    unit = np.array(axis) / np.linalg.norm(axis)
    R = RotationMatrix(AngleAxis(angle, unit)).matrix()
    np.testing.assert_allclose(exp_so3(log_so3(R)), R, atol=1e-14, rtol=0)


def test_logarithm_of_half_turns_and_of_the_identity():
    for axis in np.vstack([np.eye(3), [[0.6, 0.8, 0.0], [0.6, 0.0, -0.8], [-0.48, 0.6, 0.64]]]):
        phi = log_so3(2.0 * np.outer(axis, axis) - np.eye(3))
        np.testing.assert_allclose(np.abs(phi @ axis), np.pi, atol=1e-14)
    assert np.array_equal(log_so3(np.eye(3)), np.zeros(3))


@given(axis_a=axes, a=angles, axis_b=axes, b=angles)
def test_group_axioms(axis_a, a, axis_b, b):
    R_AB, R_BC = exp_so3(vector(axis_a, a)), exp_so3(vector(axis_b, b))
    np.testing.assert_allclose(R_AB @ R_AB.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R_AB) == pytest.approx(1.0)
    np.testing.assert_allclose(exp_so3(-vector(axis_a, a)), R_AB.T, atol=1e-15)
    # Conjugation turns the rotation vector.
    phi = vector(axis_b, b)
    np.testing.assert_allclose(R_AB @ R_BC @ R_AB.T, exp_so3(R_AB @ phi), atol=1e-14)


@given(u=axes, v=axes)
def test_skew_is_the_cross_product(u, v):
    np.testing.assert_allclose(skew(u) @ v, np.cross(u, v), atol=1e-15)
    np.testing.assert_array_equal(unskew(skew(u)), u)


@given(axis=axes, angle=st.floats(0.0, 6.0), rate=axes)
def test_left_jacobian_makes_angular_velocity_of_a_rate(axis, angle, rate):
    phi, rate = vector(axis, angle), np.array(rate)
    h = 1e-5
    R_dot = (exp_so3(phi + h * rate) - exp_so3(phi - h * rate)) / (2 * h)
    w = unskew(R_dot @ exp_so3(phi).T)
    np.testing.assert_allclose(left_jacobian_so3(phi) @ rate, w, atol=1e-8)
    # In the body frame it is the right Jacobian.
    np.testing.assert_allclose(left_jacobian_so3(-phi) @ rate, exp_so3(phi).T @ w, atol=1e-8)


@given(axis=axes, angle=st.one_of(tiny, st.floats(0.0, 6.0)))
def test_left_jacobian_inverse(axis, angle):
    phi = vector(axis, angle)
    product = left_jacobian_inverse_so3(phi) @ left_jacobian_so3(phi)
    np.testing.assert_allclose(product, np.eye(3), atol=1e-11)


@pytest.mark.parametrize("function", [exp_so3, left_jacobian_so3, left_jacobian_inverse_so3])
def test_series_meet_the_closed_forms(function):
    # Across the angle where one formula takes over from the other nothing jumps.
    axis = np.array([0.36, 0.48, -0.8])
    below, above = function((1e-2 - 1e-13) * axis), function((1e-2 + 1e-13) * axis)
    np.testing.assert_allclose(below, above, atol=1e-12)


def test_random_rotations_are_uniform_and_repeat():
    rng = np.random.default_rng(0)
    R = np.array([random_rotation(rng).matrix() for _ in range(4000)])
    # Columns point everywhere alike: mean 0, covariance 1/3.
    for k in range(3):
        np.testing.assert_allclose(R[:, :, k].mean(axis=0), 0.0, atol=0.04)
        np.testing.assert_allclose(np.cov(R[:, :, k].T), np.eye(3) / 3, atol=0.03)
    # The angle of a uniform rotation has the distribution (x - sin x) / pi.
    angles = np.sort([rotation_angle(r) for r in R])
    cdf = (angles - np.sin(angles)) / np.pi
    assert np.abs(cdf - (np.arange(4000) + 0.5) / 4000).max() < 0.03
    again = random_rotation(np.random.default_rng(0)).matrix()
    assert np.array_equal(again, R[0])
