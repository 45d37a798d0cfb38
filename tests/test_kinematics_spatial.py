"""Spatial algebra against Drake's classes, the axioms of the group, and differentiation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialAcceleration, SpatialForce, SpatialVelocity
from scipy.linalg import expm

from prehensile.kinematics.poses import random_pose
from prehensile.kinematics.rotations import random_rotation, skew
from prehensile.kinematics.spatial import (
    adjoint,
    adjoint_dual,
    compose_accelerations,
    compose_velocities,
    exp_se3,
    invert_velocity,
    log_se3,
    reexpress,
    shift_acceleration,
    shift_force,
    shift_velocity,
    velocity_cross,
)

rngs = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@given(rng=rngs)
def test_verbs_agree_with_drake(rng):
    V, A, F = rng.normal(size=(3, 6))
    p, w = rng.normal(size=(2, 3))
    R = random_rotation(rng)
    near = {"rtol": 1e-12, "atol": 1e-12}
    velocity, acceleration = SpatialVelocity(V), SpatialAcceleration(A)
    np.testing.assert_allclose(shift_velocity(V, p), velocity.Shift(p).get_coeffs(), **near)
    np.testing.assert_allclose(shift_velocity(velocity, p), velocity.Shift(p).get_coeffs(), **near)
    np.testing.assert_allclose(shift_force(F, p), SpatialForce(F).Shift(p).get_coeffs(), **near)
    np.testing.assert_allclose(
        shift_acceleration(A, p, w), acceleration.Shift(p, w).get_coeffs(), **near
    )
    np.testing.assert_allclose(reexpress(R, V), velocity.Rotate(R).get_coeffs(), **near)
    np.testing.assert_allclose(
        compose_velocities(V, p, A),
        velocity.ComposeWithMovingFrameVelocity(p, SpatialVelocity(A)).get_coeffs(),
        **near,
    )
    np.testing.assert_allclose(
        compose_accelerations(A, w, p, V, F),
        acceleration.ComposeWithMovingFrameAcceleration(
            p, w, velocity, SpatialAcceleration(F)
        ).get_coeffs(),
        **near,
    )


@given(rng=rngs)
def test_verbs_on_jacobians_are_verbs_on_their_velocities(rng):
    J, qdot, p = rng.normal(size=(6, 4)), rng.normal(size=4), rng.normal(size=3)
    R = random_rotation(rng)
    for verb in (
        lambda V: shift_velocity(V, p),
        lambda V: reexpress(R, V),
        lambda V: invert_velocity(V, p),
    ):
        np.testing.assert_allclose(verb(J) @ qdot, verb(J @ qdot), rtol=1e-12, atol=1e-12)


@given(rng=rngs)
def test_velocity_there_and_back_adds_up_to_rest(rng):
    V_AB, p_AB = rng.normal(size=6), rng.normal(size=3)
    V_BA = invert_velocity(V_AB, p_AB)
    np.testing.assert_allclose(compose_velocities(V_AB, -p_AB, V_BA), np.zeros(6), atol=1e-14)
    np.testing.assert_allclose(invert_velocity(V_BA, -p_AB), V_AB, atol=1e-14)


@given(rng=rngs)
def test_velocities_by_differentiation(rng):
    # Two frames move on known screws; what the composition says is what the poses do.
    S_WA, S_AB = rng.normal(size=(2, 6))
    X_WA0, X_AB0 = random_pose(rng), random_pose(rng)

    def poses(t):
        return X_WA0 @ exp_se3(t * S_WA), X_AB0 @ exp_se3(t * S_AB)

    h = 1e-5
    (X_WA, X_AB), X_WB = poses(0.0), (lambda t: poses(t)[0] @ poses(t)[1])
    V_WA = reexpress(X_WA.rotation(), S_WA)
    V_AB_W = reexpress(X_WA.rotation() @ X_AB.rotation(), S_AB)
    p_AB_W = X_WA.rotation() @ X_AB.translation()
    V_WB = compose_velocities(V_WA, p_AB_W, V_AB_W)
    p_dot = (X_WB(h).translation() - X_WB(-h).translation()) / (2 * h)
    R_dot = (X_WB(h).rotation().matrix() - X_WB(-h).rotation().matrix()) / (2 * h)
    np.testing.assert_allclose(p_dot, V_WB[3:], atol=1e-8)
    np.testing.assert_allclose(R_dot @ X_WB(0).rotation().matrix().T, skew(V_WB[:3]), atol=1e-8)


@given(rng=rngs)
def test_adjoint_is_a_homomorphism_and_keeps_power(rng):
    X_AB, X_BC = random_pose(rng), random_pose(rng)
    near = {"rtol": 1e-11, "atol": 1e-12}
    np.testing.assert_allclose(adjoint(X_AB) @ adjoint(X_BC), adjoint(X_AB @ X_BC), **near)
    np.testing.assert_allclose(adjoint(X_AB.inverse()), np.linalg.inv(adjoint(X_AB)), **near)
    np.testing.assert_allclose(adjoint_dual(X_AB), np.linalg.inv(adjoint(X_AB)).T, **near)
    V_B, F_B = rng.normal(size=(2, 6))
    power_A = (adjoint(X_AB) @ V_B) @ (adjoint_dual(X_AB) @ F_B)
    assert power_A == pytest.approx(V_B @ F_B, abs=1e-11)
    # The adjoint is re-expression and shift, one after the other.
    V_A = shift_velocity(reexpress(X_AB.rotation(), V_B), -X_AB.translation())
    np.testing.assert_allclose(adjoint(X_AB) @ V_B, V_A, **near)


@given(rng=rngs)
def test_shifted_force_has_the_power_of_the_shifted_velocity(rng):
    V, F, p = rng.normal(size=6), rng.normal(size=6), rng.normal(size=3)
    assert shift_velocity(V, p) @ shift_force(F, p) == pytest.approx(V @ F, abs=1e-11)


@given(rng=rngs)
def test_velocity_cross_is_the_rate_of_the_adjoint(rng):
    V, U = rng.normal(size=(2, 6))
    h = 1e-5
    rate = (adjoint(exp_se3(h * V)) - adjoint(exp_se3(-h * V))) / (2 * h)
    np.testing.assert_allclose(velocity_cross(V), rate, atol=1e-8)
    # Bracket of the Lie algebra: antisymmetric, and Jacobi's identity.
    np.testing.assert_allclose(velocity_cross(V) @ U, -velocity_cross(U) @ V, atol=1e-14)
    bracket = velocity_cross(V) @ velocity_cross(U) - velocity_cross(U) @ velocity_cross(V)
    np.testing.assert_allclose(bracket, velocity_cross(velocity_cross(V) @ U), atol=1e-12)


@given(rng=rngs, exponent=st.floats(-9.0, 0.4))
def test_exponential_of_a_screw_is_the_matrix_exponential(rng, exponent):
    S = rng.normal(size=6)
    S[:3] *= 10.0**exponent / np.linalg.norm(S[:3])
    T = np.zeros((4, 4))
    T[:3, :3], T[:3, 3] = skew(S[:3]), S[3:]
    X = exp_se3(S)
    np.testing.assert_allclose(X.GetAsMatrix4(), expm(T), atol=1e-13)
    np.testing.assert_allclose(log_se3(X), S, atol=1e-13)
    assert (X @ exp_se3(-S)).IsNearlyIdentity(1e-13)
    assert exp_se3(0.3 * S).multiply(exp_se3(0.7 * S)).IsNearlyEqualTo(X, 1e-13)
    # Body and space form coincide for the motion from the identity.
    np.testing.assert_allclose(adjoint(X) @ S, S, atol=1e-13)


@given(rng=rngs, gap=st.floats(-15.0, -1.0))
def test_logarithm_of_a_screw_near_half_a_turn(rng, gap):
    S = rng.normal(size=6)
    S[:3] *= (np.pi - 10.0**gap) / np.linalg.norm(S[:3])
    assert exp_se3(log_se3(exp_se3(S))).IsNearlyEqualTo(exp_se3(S), 1e-13)


def test_pure_translation():
    np.testing.assert_array_equal(log_se3(RigidTransform([1.0, 2.0, 3.0])), [0, 0, 0, 1, 2, 3])


@pytest.mark.parametrize("shape", [(5,), (3, 6), (6, 2, 2), ()])
def test_other_shapes_are_refused_by_name(shape):
    with pytest.raises(ValueError, match="V_WB_E must be"):
        shift_velocity(np.zeros(shape), np.zeros(3))


def test_velocities_of_two_shapes_do_not_compose():
    with pytest.raises(ValueError, match="one shape"):
        compose_velocities(np.ones((6, 1)), np.zeros(3), np.ones(6))
    for call in (exp_se3, velocity_cross):
        with pytest.raises(ValueError, match=r"must be \(6,\)"):
            call(np.ones((6, 2)))
