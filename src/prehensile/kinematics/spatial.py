"""Spatial algebra on six numbers: shift, re-express, compose; exponential and logarithm of SE(3).

A spatial vector is [rotational; translational], Drake's order. V_WB_E is the spatial velocity of
frame B measured in W and expressed in E: angular velocity in rad/s, then the velocity of B's
origin in m/s. F_Bp_E is the moment about point p of B in Nm, then the force in N. A subscript E is
left out where E is the frame that the quantity is measured in.

Whatever is linear in a velocity holds for a Jacobian as well, column by column: every velocity
argument here is (6,) or (6, n), and J_V_WB takes the same verbs as V_WB. Drake's
``SpatialVelocity`` and its kin have some of these verbs as methods; they are taken as arguments
too, and the result is an array (``SpatialVelocity(array)`` goes back).

The rules: Tedrake, *Robotic Manipulation*, sections 3.3 and 3.5; Featherstone, *Rigid Body Dynamics
Algorithms*, chapter 2; Lynch and Park, *Modern Robotics*, chapter 3.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.rotations import (
    exp_so3,
    left_jacobian_inverse_so3,
    left_jacobian_so3,
    log_so3,
    skew,
)

Array = NDArray[np.float64]


def coefficients(vector: Any, name: str = "vector") -> Array:
    """The numbers of a spatial vector or of a Jacobian.

    Args:
        vector: (6,) or (6, n) array, or one of Drake's spatial vectors.
        name: of the argument, for the error.

    Returns:
        (6,) or (6, n) array.

    Raises:
        ValueError: another shape.
    """
    numbers = vector.get_coeffs() if hasattr(vector, "get_coeffs") else vector
    numbers = np.asarray(numbers, float)
    if numbers.ndim not in (1, 2) or numbers.shape[0] != 6:
        raise ValueError(f"{name} must be (6,) or (6, n), got {numbers.shape}")
    return numbers


def reexpress(R_EF: RotationMatrix, vector_F: Any) -> Array:
    """The same velocity, acceleration, force or Jacobian expressed in another frame.

    Args:
        R_EF: orientation of the frame that it is expressed in, in the new one.
        vector_F: (6,) or (6, n), expressed in F.

    Returns:
        The same, expressed in E.
    """
    numbers = coefficients(vector_F, "vector_F")
    R = R_EF.matrix()
    return np.concatenate([R @ numbers[:3], R @ numbers[3:]])


def shift_velocity(V_WB_E: Any, p_BoBq_E: ArrayLike) -> Array:
    """Velocity of another frame fixed to the same body: v_Bq = v_Bo + w x p.

    Args:
        V_WB_E: (6,) spatial velocity of B, or a Jacobian (6, n).
        p_BoBq_E: (3,) where the other frame's origin is, from B's origin, in m.

    Returns:
        V_WBq_E, of the same shape.
    """
    V = coefficients(V_WB_E, "V_WB_E").copy()
    V[3:] -= skew(p_BoBq_E) @ V[:3]
    return V


def shift_force(F_Bp_E: Any, p_BpBq_E: ArrayLike) -> Array:
    """The same load about another point: t_q = t_p - p x f.

    Args:
        F_Bp_E: (6,) spatial force about point Bp, or (6, n) of them.
        p_BpBq_E: (3,) from Bp to the other point, in m.

    Returns:
        F_Bq_E, of the same shape. It has the same power on the shifted velocity.
    """
    F = coefficients(F_Bp_E, "F_Bp_E").copy()
    F[:3] -= skew(p_BpBq_E) @ F[3:]
    return F


def shift_acceleration(A_WB_E: Any, p_BoBq_E: ArrayLike, w_WB_E: ArrayLike) -> Array:
    """Acceleration of another frame fixed to the same body: a + alpha x p + w x (w x p).

    Args:
        A_WB_E: (6,) angular acceleration, then acceleration of B's origin.
        p_BoBq_E: (3,) from B's origin to the other frame's, in m.
        w_WB_E: (3,) angular velocity of B.

    Returns:
        A_WBq_E, (6,).
    """
    A = shift_velocity(A_WB_E, p_BoBq_E)
    W = skew(w_WB_E)
    A[3:] += W @ W @ np.asarray(p_BoBq_E, float)
    return A


def compose_velocities(V_WA_E: Any, p_AB_E: ArrayLike, V_AB_E: Any) -> Array:
    """Velocity of B in W from that of A in W and that of B in A, all expressed in E.

    Args:
        V_WA_E: (6,), or a Jacobian (6, n).
        p_AB_E: (3,) from A's origin to B's, in m.
        V_AB_E: likewise, measured in A.

    Returns:
        V_WB_E, of the same shape.

    Raises:
        ValueError: the two have different shapes.
    """
    V, V_AB = shift_velocity(V_WA_E, p_AB_E), coefficients(V_AB_E, "V_AB_E")
    if V.shape != V_AB.shape:
        raise ValueError(f"V_WA_E, V_AB_E must have one shape, got {V.shape} and {V_AB.shape}")
    return V + V_AB


def compose_accelerations(
    A_WA_E: Any, w_WA_E: ArrayLike, p_AB_E: ArrayLike, V_AB_E: Any, A_AB_E: Any
) -> Array:
    """Acceleration of B in W from that of A in W and the motion of B in A, all expressed in E.

    The terms beyond the sum are the centripetal and the Coriolis acceleration.

    Args:
        A_WA_E: (6,) acceleration of A measured in W.
        w_WA_E: (3,) angular velocity of A measured in W.
        p_AB_E: (3,) from A's origin to B's, in m.
        V_AB_E: (6,) velocity of B measured in A.
        A_AB_E: (6,) acceleration of B measured in A.

    Returns:
        A_WB_E, (6,).
    """
    V_AB = coefficients(V_AB_E, "V_AB_E")
    W = skew(w_WA_E)
    A = shift_acceleration(A_WA_E, p_AB_E, w_WA_E) + coefficients(A_AB_E, "A_AB_E")
    A[:3] += W @ V_AB[:3]
    A[3:] += 2.0 * W @ V_AB[3:]
    return A


def invert_velocity(V_AB_E: Any, p_AB_E: ArrayLike) -> Array:
    """Velocity of A measured in B from that of B measured in A: not the negative alone.

    Args:
        V_AB_E: (6,) or (6, n).
        p_AB_E: (3,) from A's origin to B's, in m.

    Returns:
        V_BA_E = -(V_AB_E shifted to A's origin).
    """
    return -shift_velocity(V_AB_E, -np.asarray(p_AB_E, float))


def adjoint(X_AB: RigidTransform) -> Array:
    """Matrix that takes twists from frame B to frame A: shift and re-expression in one.

    A twist is the velocity of the body at a frame's origin, expressed in that frame.

    Returns:
        Ad = [[R, 0], [p^ R, R]], (6, 6), with Ad(X Y) = Ad(X) Ad(Y).
    """
    R = X_AB.rotation().matrix()
    Ad = np.zeros((6, 6))
    Ad[:3, :3] = Ad[3:, 3:] = R
    Ad[3:, :3] = skew(X_AB.translation()) @ R
    return Ad


def adjoint_dual(X_AB: RigidTransform) -> Array:
    """Matrix that takes wrenches from frame B to frame A.

    Returns:
        [[R, p^ R], [0, R]], (6, 6), the inverse transpose of :func:`adjoint`, so that power is the
        same in both frames.
    """
    R = X_AB.rotation().matrix()
    Ad = np.zeros((6, 6))
    Ad[:3, :3] = Ad[3:, 3:] = R
    Ad[:3, 3:] = skew(X_AB.translation()) @ R
    return Ad


def velocity_cross(V: Any) -> Array:
    """Matrix of the cross product of spatial velocities, also ad(V) or Featherstone's crm(V).

    Args:
        V: (6,) twist.

    Returns:
        (6, 6); it is the rate of :func:`adjoint` along V. The one for forces is the negative of
        its transpose.
    """
    V = _single(V, "V")
    ad = np.zeros((6, 6))
    ad[:3, :3] = ad[3:, 3:] = skew(V[:3])
    ad[3:, :3] = skew(V[3:])
    return ad


def exp_se3(S: ArrayLike) -> RigidTransform:
    """Pose after moving for one second with a constant twist: a screw motion.

    Args:
        S: (6,) twist [w; v], rad and m, in either frame: X_AB = exp(S) starts at the identity, and
            the twist of that motion has the same coordinates in A (space form) as in B (body
            form).

    Returns:
        X_AB. From a pose X_WA on, ``X_WA @ exp_se3(S)`` follows a twist expressed in the moving
        frame, ``exp_se3(S) @ X_WA`` one expressed in W at W's origin.
    """
    S = _single(S, "S")
    return RigidTransform(RotationMatrix(exp_so3(S[:3])), left_jacobian_so3(S[:3]) @ S[3:])


def log_se3(X_AB: RigidTransform) -> Array:
    """The twist whose :func:`exp_se3` is a pose.

    Returns:
        (6,) [w; v], rad and m, with an angle of 0..pi.
    """
    phi = log_so3(X_AB.rotation().matrix())
    return np.concatenate([phi, left_jacobian_inverse_so3(phi) @ X_AB.translation()])


def _single(vector: Any, name: str) -> Array:
    """The numbers of one spatial vector, (6,)."""
    numbers = coefficients(vector, name)
    if numbers.ndim != 1:
        raise ValueError(f"{name} must be (6,), got {numbers.shape}")
    return numbers
