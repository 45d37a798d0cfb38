"""The rotation group SO(3): exponential, logarithm, their derivatives, uniform random rotations.

A rotation vector phi is a unit axis times an angle in rad. With R_AB = exp(phi) its coordinates
are the same in A and in B, because a rotation leaves its axis where it is. Formulas: Chirikjian,
*Stochastic Models, Information Theory, and Lie Groups*, volume 2, section 10.6, and Barfoot,
*State Estimation for Robotics*, section 7.1.

Accurate to rounding everywhere: series stand in for 0/0 near the identity, and the logarithm goes
through the quaternion, which is as good at half a turn as anywhere.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix

# Below this angle the two-term series are exact to rounding and the closed forms are not.
_SMALL = 1e-2


def skew(v: ArrayLike) -> NDArray[np.float64]:
    """The matrix of a cross product: ``skew(v) @ u`` is ``cross(v, u)``.

    Args:
        v: (3,).

    Returns:
        (3, 3), skew-symmetric.
    """
    x, y, z = np.asarray(v, float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def unskew(S: ArrayLike) -> NDArray[np.float64]:
    """The vector whose :func:`skew` is S; of a general matrix, that of its skew-symmetric part.

    Args:
        S: (3, 3).

    Returns:
        (3,).
    """
    S = np.asarray(S, float)
    return 0.5 * np.array([S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]])


def exp_so3(phi: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrix of a rotation vector (Rodrigues' formula).

    Args:
        phi: rotation vector, (3,), rad, of any length.

    Returns:
        R_AB, (3, 3).
    """
    K = skew(phi)
    a, b, _ = _coefficients(phi)
    return np.eye(3) + a * K + b * (K @ K)


def log_so3(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation vector of a rotation matrix: the inverse of :func:`exp_so3`.

    Args:
        R: rotation matrix R_AB, (3, 3).

    Returns:
        Rotation vector, (3,), of length 0..pi (rad). At exactly half a turn either sign of the
        axis is right, and one of them is returned.
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    # The quaternion by its largest component (Shepperd 1978), so that nothing small is divided by.
    trace = a + e + i
    if trace >= max(a, e, i):
        w, x, y, z = 1.0 + trace, h - f, c - g, d - b
    elif a >= e and a >= i:
        w, x, y, z = h - f, 1.0 + a - e - i, b + d, c + g
    elif e >= i:
        w, x, y, z = c - g, b + d, 1.0 - a + e - i, f + h
    else:
        w, x, y, z = d - b, c + g, f + h, 1.0 - a - e + i
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    # 2 atan(u) / u tends to 2 as u goes to 0.
    factor = 2.0 * math.atan2(sine, w) / sine if sine > 1e-200 else 2.0 / w
    return np.array([factor * x, factor * y, factor * z])


def left_jacobian_so3(phi: ArrayLike) -> NDArray[np.float64]:
    """What turns the rate of a rotation vector into an angular velocity.

    For R_AB = exp(phi): w_AB expressed in A is J_l(phi) phidot, and expressed in B it is
    J_r(phi) phidot with the right Jacobian J_r(phi) = J_l(-phi).

    Args:
        phi: rotation vector, (3,), rad.

    Returns:
        J_l, (3, 3).
    """
    K = skew(phi)
    _, b, c = _coefficients(phi)
    return np.eye(3) + b * K + c * (K @ K)


def left_jacobian_inverse_so3(phi: ArrayLike) -> NDArray[np.float64]:
    """The inverse of :func:`left_jacobian_so3`: angular velocity to the rate of the vector.

    Args:
        phi: rotation vector, (3,), rad; shorter than a whole turn, where the inverse ends.

    Returns:
        (3, 3).
    """
    K = skew(phi)
    angle2 = float(np.dot(phi, phi))
    if angle2 < _SMALL**2:
        c = 1.0 / 12.0 + angle2 / 720.0
    else:
        half = 0.5 * math.sqrt(angle2)
        c = (1.0 - half / math.tan(half)) / angle2
    return np.eye(3) - 0.5 * K + c * (K @ K)


def rotation_angle(R: NDArray[np.float64]) -> float:
    """Angle of a rotation in rad, 0..pi.

    Args:
        R: rotation matrix, (3, 3).
    """
    return float(np.linalg.norm(log_so3(R)))


def random_rotation(rng: np.random.Generator) -> RotationMatrix:
    """A rotation drawn uniformly: all orientations are equally likely.

    Four normal numbers point into a uniformly random direction, and unit quaternions cover the
    rotations evenly (Muller 1959; Shoemake 1992).
    """
    return RotationMatrix(Quaternion(_unit(rng.normal(size=4))))


def _unit(v: NDArray[np.float64]) -> NDArray[np.float64]:
    return v / np.linalg.norm(v)


def _coefficients(phi: ArrayLike) -> tuple[float, float, float]:
    """sin(x)/x, (1 - cos(x))/x^2 and (x - sin(x))/x^3 of the angle x of a rotation vector."""
    angle2 = float(np.dot(phi, phi))
    if angle2 < _SMALL**2:
        return (
            1.0 - angle2 / 6.0 + angle2**2 / 120.0,
            0.5 - angle2 / 24.0 + angle2**2 / 720.0,
            1.0 / 6.0 - angle2 / 120.0 + angle2**2 / 5040.0,
        )
    angle = math.sqrt(angle2)
    half_sine = math.sin(0.5 * angle)
    return (
        math.sin(angle) / angle,
        2.0 * half_sine**2 / angle2,
        (angle - math.sin(angle)) / (angle2 * angle),
    )
