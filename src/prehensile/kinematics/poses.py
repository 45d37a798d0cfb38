"""Small functions on poses: the difference of two, the straight line between two, random ones."""

import numpy as np
from numpy.typing import ArrayLike
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.kinematics.rotations import log_so3, random_rotation
from prehensile.kinematics.spatial import Array, log_se3


def pose_error(X_WA: RigidTransform, X_WB: RigidTransform) -> np.ndarray:
    """The motion that takes frame A to frame B, in the order of a spatial velocity.

    Its two halves do not mix: it is the velocity V_WA_W with which A's origin moves straight to
    B's while A turns about one axis, in one second. That is the error to drive to zero with
    J_V_WA. The twist of the screw motion from A to B is :func:`twist_error`.

    Returns:
        (6,): rotation vector of R_AB expressed in W (rad), then p_AB_W (m).
    """
    R_WA = X_WA.rotation().matrix()
    R_WB = X_WB.rotation().matrix()
    error = np.empty(6)
    error[:3] = log_so3(R_WB @ R_WA.T)
    error[3:] = X_WB.translation() - X_WA.translation()
    return error


def pose_distance(X_WA: RigidTransform, X_WB: RigidTransform) -> tuple[float, float]:
    """Distance of the origins (m) and angle of the rotation (rad) between two poses."""
    error = pose_error(X_WA, X_WB)
    return float(np.linalg.norm(error[3:])), float(np.linalg.norm(error[:3]))


def twist_error(X_WA: RigidTransform, X_WB: RigidTransform) -> Array:
    """The constant twist that carries frame A to frame B in one second: log(X_AB).

    Does not depend on W. Expressed in A, and, as the motion is a screw about an axis fixed in A, in
    B just the same (the body form). ``adjoint(X_WA) @ twist`` is the space form.

    Returns:
        (6,): [w; v] in rad and m.
    """
    return log_se3(X_WA.inverse() @ X_WB)


def straight_line(
    X_WA: RigidTransform, X_WB: RigidTransform, max_translation: float, max_rotation: float
) -> list[RigidTransform]:
    """Poses evenly along the straight line from A to B, with both ends.

    The origin moves on a line and the rotation about one fixed axis (slerp), both at the same
    rate.

    Args:
        max_translation: largest distance between two neighbours (m, > 0).
        max_rotation: largest angle between two neighbours (rad, > 0).

    Raises:
        ValueError: a distance or an angle that is not positive.
    """
    if not (max_translation > 0.0 and max_rotation > 0.0):
        raise ValueError("max_translation, max_rotation: must be positive")
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


def random_pose(
    rng: np.random.Generator, lower: ArrayLike = (-1, -1, -1), upper: ArrayLike = (1, 1, 1)
) -> RigidTransform:
    """A pose with a uniformly random orientation and its origin uniformly in a box.

    Args:
        rng: source of the randomness.
        lower: (3,) corner of the box, in m.
        upper: (3,) opposite corner, not below ``lower``.
    """
    return RigidTransform(
        random_rotation(rng), rng.uniform(np.asarray(lower, float), np.asarray(upper, float))
    )
