"""Uncertainty of a pose from the information about a point that the data surround."""

import numpy as np
from numpy.typing import NDArray

from prehensile.perception.registration.result import MIN_EIGENVALUE_RATIO, pose_uncertainty


def uncertainty_about(
    information: NDArray[np.float64],
    variance: float,
    length_scale: float,
    p_CO_W: NDArray[np.float64],
    min_eigenvalue_ratio: float = MIN_EIGENVALUE_RATIO,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance and free directions of a pose, judged about a point C amid the data.

    Turns about an origin O far from the data look like translations; whether the data determine
    the pose is therefore judged about C (their centroid), and then moved to O.

    Args:
        information: (6, 6) Gauss-Newton matrix by [rotation vector; translation of the body's
            point at C], expressed in W.
        variance: variance of one residual [m^2].
        length_scale: the data's root mean square distance from C [m], > 0.
        p_CO_W: (3,) from C to O's origin [m].
        min_eigenvalue_ratio: see
            :func:`~prehensile.perception.registration.pose_uncertainty`.

    Returns:
        The covariance (6, 6) of [rotation vector; translation of O's origin] in W, and the free
        directions (k, 6), unit rows [rotation vector * length_scale; translation of O's origin].
    """
    covariance_C, free_C = pose_uncertainty(
        information, variance, length_scale, min_eigenvalue_ratio=min_eigenvalue_ratio
    )
    # The origin moves by v_O = v_C + w x p_CO.
    x, y, z = p_CO_W
    shift = np.eye(6)
    shift[3:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    scale = np.array([1 / length_scale] * 3 + [1.0] * 3)
    free = (free_C * scale) @ shift.T / scale
    free /= np.maximum(np.linalg.norm(free, axis=1, keepdims=True), 1e-300)
    return shift @ covariance_C @ shift.T, free
