"""Small functions on poses: the difference of two, and the straight line between two."""

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """Logarithm of a rotation: unit axis times angle.

    Args:
        R: rotation matrix R_AB, (3, 3).

    Returns:
        Rotation vector in A, (3,), of length 0..pi (rad).
    """
    twice_sine_axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = 0.5 * float(np.sqrt(twice_sine_axis @ twice_sine_axis))
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if sine > 1e-6:
        return twice_sine_axis * (0.5 * angle / sine)
    if cosine > 0.0:
        return 0.5 * twice_sine_axis
    # At half a turn R = 2 a a^T - I: the axis is the largest column of (R + I) / 2, normalized.
    aaT = 0.5 * (R + np.eye(3))
    column = aaT[:, int(np.argmax(np.diag(aaT)))]
    return column * (angle / float(np.linalg.norm(column)))


def pose_error(X_WA: RigidTransform, X_WB: RigidTransform) -> np.ndarray:
    """The motion that takes frame A to frame B, in the order of a spatial velocity.

    Returns:
        (6,): rotation vector of R_AB expressed in W (rad), then p_AB_W (m).
    """
    R_WA = X_WA.rotation().matrix()
    R_WB = X_WB.rotation().matrix()
    error = np.empty(6)
    error[:3] = rotation_vector(R_WB @ R_WA.T)
    error[3:] = X_WB.translation() - X_WA.translation()
    return error


def pose_distance(X_WA: RigidTransform, X_WB: RigidTransform) -> tuple[float, float]:
    """Distance of the origins (m) and angle of the rotation (rad) between two poses."""
    error = pose_error(X_WA, X_WB)
    return float(np.linalg.norm(error[3:])), float(np.linalg.norm(error[:3]))


def straight_line(
    X_WA: RigidTransform, X_WB: RigidTransform, max_translation: float, max_rotation: float
) -> list[RigidTransform]:
    """Poses evenly along the straight line from A to B, with both ends.

    The origin moves on a line and the rotation about one fixed axis (slerp), both at the same
    rate.

    Args:
        max_translation: largest distance between two neighbours (m, > 0).
        max_rotation: largest angle between two neighbours (rad, > 0).
    """
    distance, angle = pose_distance(X_WA, X_WB)
    steps = max(1, int(np.ceil(max(distance / max_translation, angle / max_rotation) - 1e-9)))
    q_A: Quaternion = X_WA.rotation().ToQuaternion()
    q_B: Quaternion = X_WB.rotation().ToQuaternion()
    p_A, p_B = X_WA.translation(), X_WB.translation()
    poses = [X_WA]
    for k in range(1, steps):
        u = k / steps
        poses.append(RigidTransform(RotationMatrix(q_A.slerp(u, q_B)), (1.0 - u) * p_A + u * p_B))
    poses.append(X_WB)
    return poses
