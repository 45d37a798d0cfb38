"""Rotation vectors, in the few microseconds that a tracker's inner loop has for them."""

from math import atan2, cos, sin, sqrt

import numpy as np
from numpy.typing import NDArray


def rotation_of(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) rotation by a rotation vector (3,) [rad] (Rodrigues' formula)."""
    x, y, z = vector.tolist()
    angle = sqrt(x * x + y * y + z * z)
    if angle < 1e-8:
        a, b = 1.0, 0.5
    else:
        a, b = sin(angle) / angle, (1 - cos(angle)) / (angle * angle)
    return np.array(
        [
            [1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)],
        ]
    )


def rotation_vector(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) rotation vector [rad] of a rotation (3, 3) by less than half a turn.

    Within 1e-6 of a half turn, where the axis cannot be told this way, the vector is wrong.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = R.tolist()
    x, y, z = 0.5 * (r21 - r12), 0.5 * (r02 - r20), 0.5 * (r10 - r01)
    sine = sqrt(x * x + y * y + z * z)
    factor = atan2(sine, 0.5 * (r00 + r11 + r22 - 1)) / sine if sine > 1e-12 else 1.0
    return np.array([factor * x, factor * y, factor * z])
