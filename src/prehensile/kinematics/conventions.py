"""Poses and velocities to and from the conventions of other libraries and books.

Orientation needs no function where two libraries agree: roll, pitch, yaw of Drake's
``RollPitchYaw`` are those of URDF, ROS and PyBullet (fixed axes x, y, z in this order, in SciPy
``Rotation.from_euler("xyz", rpy)``, lower case). Axis times angle is
:func:`~prehensile.kinematics.rotations.log_so3`, which is SciPy's ``as_rotvec``.
"""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from prehensile.kinematics.spatial import Array, coefficients, skew

QuaternionOrder = Literal["wxyz", "xyzw"]
"""``wxyz``: Drake, Eigen's constructor, MuJoCo. ``xyzw``: ROS, PyBullet, SciPy, Eigen's coeffs."""

PoseLayout = Literal["wxyz_xyz", "xyz_wxyz", "xyz_xyzw"]
"""``wxyz_xyz``: positions of a floating body in Drake. ``xyz_wxyz``: free joint of MuJoCo.
``xyz_xyzw``: ROS (tf, geometry_msgs), PyBullet, free flyer of Pinocchio."""

TwistConvention = Literal[
    "space", "body", "aligned", "pinocchio_local", "pinocchio_world", "mujoco"
]
"""How a velocity of frame B in W is written, see :func:`twist_matrix`."""


def quaternion_to_array(R: RotationMatrix, order: QuaternionOrder) -> NDArray[np.float64]:
    """The unit quaternion of a rotation as numbers, the one of the two with w >= 0.

    Returns:
        (4,).
    """
    wxyz = R.ToQuaternion().wxyz()
    wxyz = -wxyz if wxyz[0] < 0.0 else wxyz
    _checked(order, QuaternionOrder, "order")
    return wxyz if order == "wxyz" else np.roll(wxyz, -1)


def quaternion_from_array(q: ArrayLike, order: QuaternionOrder) -> RotationMatrix:
    """The rotation of a unit quaternion given as numbers.

    Args:
        q: (4,); it may be off unit length by 1 %, as printed numbers are.
        order: of its numbers. Nothing in them tells: a wrong order gives a wrong rotation.

    Raises:
        ValueError: not four finite numbers, or not of length 1.
    """
    q = _finite(q, (4,), "q")
    length = float(np.linalg.norm(q))
    if not 0.99 < length < 1.01:
        raise ValueError(f"q must be a unit quaternion, its length is {length:.4g}")
    _checked(order, QuaternionOrder, "order")
    wxyz = q if order == "wxyz" else np.roll(q, 1)
    return RotationMatrix(Quaternion(wxyz / length))


def pose_to_array(X: RigidTransform, layout: PoseLayout) -> NDArray[np.float64]:
    """A pose as seven numbers, position in m and unit quaternion (w >= 0).

    Returns:
        (7,).
    """
    _checked(layout, PoseLayout, "layout")
    p, R = X.translation(), X.rotation()
    if layout == "wxyz_xyz":
        return np.concatenate([quaternion_to_array(R, "wxyz"), p])
    return np.concatenate([p, quaternion_to_array(R, "wxyz" if layout == "xyz_wxyz" else "xyzw")])


def pose_from_array(x: ArrayLike, layout: PoseLayout) -> RigidTransform:
    """The pose of seven numbers: the inverse of :func:`pose_to_array`.

    Raises:
        ValueError: not seven finite numbers, or the quaternion is not of length 1.
    """
    x = _finite(x, (7,), "x")
    _checked(layout, PoseLayout, "layout")
    if layout == "wxyz_xyz":
        return RigidTransform(quaternion_from_array(x[:4], "wxyz"), x[4:])
    return RigidTransform(
        quaternion_from_array(x[3:], "wxyz" if layout == "xyz_wxyz" else "xyzw"), x[:3]
    )


def pose_from_matrix(T: ArrayLike, tolerance: float = 1e-4) -> RigidTransform:
    """The pose of a 4x4 matrix that may carry rounding, such as one of single precision.

    Args:
        T: (4, 4), with a rotation matrix up to ``tolerance`` (Frobenius norm of R^T R - I) and
            the last row 0, 0, 0, 1. The nearest rotation is taken.
        tolerance: largest error to mend silently.

    Raises:
        ValueError: T is no pose.
    """
    T = _finite(T, (4, 4), "T")
    R = T[:3, :3]
    if not np.allclose(T[3], [0, 0, 0, 1], atol=tolerance, rtol=0.0):
        raise ValueError(f"T must have the last row 0, 0, 0, 1, got {T[3]}")
    error = float(np.linalg.norm(R.T @ R - np.eye(3)))
    if error > tolerance or np.linalg.det(R) < 0.0:
        mirrors = ", and it mirrors" if np.linalg.det(R) < 0.0 else ""
        raise ValueError(f"T must hold a rotation: |R^T R - I| is {error:.2g}{mirrors}")
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), T[:3, 3])


def to_scipy(R: RotationMatrix) -> Rotation:
    """The same rotation as SciPy has it."""
    return Rotation.from_matrix(R.matrix())


def from_scipy(rotation: Rotation) -> RotationMatrix:
    """A single rotation of SciPy as Drake has it.

    Raises:
        ValueError: a stack of rotations.
    """
    if not rotation.single:
        raise ValueError("rotation must be a single one, index the stack")
    return RotationMatrix.ProjectToRotationMatrix(rotation.as_matrix())


def twist_matrix(X_WB: RigidTransform, convention: TwistConvention) -> Array:
    """The matrix that takes Drake's V_WB (w, then v of B's origin, in W) to another convention.

    ========================= ================================== ===============================
    convention                its six numbers                    who
    ========================= ================================== ===============================
    ``space``                 w_W, velocity of the body's point  spatial twist of Lynch and Park,
                              at W's origin                      Featherstone in W coordinates
    ``body``                  w_B, v_B                           body twist of Lynch and Park,
                                                                 Featherstone in B coordinates
    ``aligned``               v_W, w_W                           Pinocchio LOCAL_WORLD_ALIGNED,
                                                                 ROS Twist with frame_id W, PyBullet
    ``pinocchio_local``       v_B, w_B                           Pinocchio LOCAL, ROS Odometry
    ``pinocchio_world``       as ``space``, w last               Pinocchio WORLD
    ``mujoco``                v_W, w_B                           qvel of MuJoCo's free joint
    ========================= ================================== ===============================

    A Jacobian is taken column by column: ``twist_matrix(X_WB, c) @ J_V_WB``. The way back is the
    inverse matrix, and wrenches take the inverse transpose, which keeps power.

    Args:
        X_WB: pose of the moving frame.
        convention: the one to go to.

    Returns:
        (6, 6), always invertible.
    """
    _checked(convention, TwistConvention, "convention")
    R_BW = X_WB.rotation().matrix().T
    one, zero = np.eye(3), np.zeros((3, 3))
    to_origin = skew(X_WB.translation())  # v at W's origin is v - w x p = v + p x w
    if convention == "space":
        return np.block([[one, zero], [to_origin, one]])
    if convention == "body":
        return np.block([[R_BW, zero], [zero, R_BW]])
    if convention == "aligned":
        return np.block([[zero, one], [one, zero]])
    if convention == "pinocchio_local":
        return np.block([[zero, R_BW], [R_BW, zero]])
    if convention == "pinocchio_world":
        return np.block([[to_origin, one], [one, zero]])
    return np.block([[zero, one], [R_BW, zero]])


def to_convention(V_WB: ArrayLike, X_WB: RigidTransform, convention: TwistConvention) -> Array:
    """A velocity or Jacobian of Drake in another convention, see :func:`twist_matrix`.

    Args:
        V_WB: (6,) or (6, n), measured and expressed in W, rotational rows first.
        X_WB: pose of the moving frame.
        convention: the one to go to.
    """
    return twist_matrix(X_WB, convention) @ coefficients(V_WB, "V_WB")


def from_convention(twist: ArrayLike, X_WB: RigidTransform, convention: TwistConvention) -> Array:
    """The inverse of :func:`to_convention`: V_WB, (6,) or (6, n), as Drake has it."""
    T = twist_matrix(X_WB, convention)
    return np.asarray(np.linalg.solve(T, coefficients(twist, "twist")), float)


def _finite(values: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    values = np.asarray(values, float)
    if values.shape != shape or not np.all(np.isfinite(values)):
        raise ValueError(f"{name} must be {shape} finite numbers, got {values!r}")
    return values


def _checked(value: str, kind: object, name: str) -> None:
    if value not in get_args(kind):
        raise ValueError(f"{name} must be one of {', '.join(get_args(kind))}, got {value!r}")
