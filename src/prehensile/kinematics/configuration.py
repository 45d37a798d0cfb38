"""Positions q and velocities v of a plant: the rate of q is not v.

A floating body has seven positions, a unit quaternion and a point, but six velocities. The two are
related by qdot = N(q) v and v = N+(q) qdot. Drake maps single vectors
(``MultibodyPlant.MapVelocityToQDot``); here are the matrices, Jacobians by either, and the step
along v that keeps quaternions of unit length.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from prehensile.kinematics.conventions import quaternion_from_array
from prehensile.kinematics.rotations import exp_so3, log_so3

Array = NDArray[np.float64]


def velocity_to_qdot_matrix(plant: MultibodyPlant, context: Context) -> Array:
    """N(q), (nq, nv): qdot = N v.

    Args:
        plant: finalized.
        context: the plant's, with its positions.
    """
    return plant.MakeVelocityToQDotMap(context).toarray()


def qdot_to_velocity_matrix(plant: MultibodyPlant, context: Context) -> Array:
    """N+(q), (nv, nq): v = N+ qdot. It is a left inverse, N+ N = 1.

    Args:
        plant: finalized.
        context: the plant's, with its positions.
    """
    return plant.MakeQDotToVelocityMap(context).toarray()


def jacobian_wrt_qdot(J_v: ArrayLike, plant: MultibodyPlant, context: Context) -> Array:
    """A Jacobian by v as one by qdot: J_qdot = J_v N+.

    Args:
        J_v: (m, nv), so that the velocity of something is J_v v.
        plant: finalized.
        context: the plant's, with its positions.

    Returns:
        (m, nq). For any qdot that keeps the quaternions of unit length J_qdot qdot = J_v v.
    """
    return np.asarray(J_v, float) @ qdot_to_velocity_matrix(plant, context)


def jacobian_wrt_v(J_qdot: ArrayLike, plant: MultibodyPlant, context: Context) -> Array:
    """A Jacobian by qdot as one by v: J_v = J_qdot N.

    Args:
        J_qdot: (m, nq), such as the derivative of a function of q by numbers or by AutoDiff.
        plant: finalized.
        context: the plant's, with its positions.

    Returns:
        (m, nv).
    """
    return np.asarray(J_qdot, float) @ velocity_to_qdot_matrix(plant, context)


def integrate(plant: MultibodyPlant, q: ArrayLike, v: ArrayLike, duration: float = 1.0) -> Array:
    """Positions after moving with constant velocities.

    Quaternions turn by the exponential map, with the angular velocity constant in the frame that
    it is expressed in; the others move on a straight line.

    Args:
        plant: finalized; its joints have qdot = v or are floating with a quaternion.
        q: (nq,), where it starts.
        v: (nv,).
        duration: s; negative is back in time.

    Returns:
        (nq,).

    Raises:
        ValueError: another shape, numbers that are not finite, or another joint without qdot = v.
    """
    q, v = _vectors(plant, q, v)
    if not np.isfinite(duration):
        raise ValueError(f"duration must be finite, got {duration}")
    out = q.copy()
    for position, velocity, size in _blocks(plant):
        if size == 1:
            out[position] += duration * v[velocity]
        else:
            R_FM = quaternion_from_array(q[position : position + 4], "wxyz").matrix()
            moved = exp_so3(duration * v[velocity : velocity + 3]) @ R_FM
            wxyz = RotationMatrix.ProjectToRotationMatrix(moved).ToQuaternion().wxyz()
            # Of the two quaternions of the rotation the one that q came from.
            out[position : position + 4] = wxyz * np.copysign(1, wxyz @ q[position : position + 4])
            out[position + 4 : position + 7] += duration * v[velocity + 3 : velocity + 6]
    return out


def difference(plant: MultibodyPlant, q_from: ArrayLike, q_to: ArrayLike) -> Array:
    """The velocities that lead from one configuration to another in one second.

    The inverse of :func:`integrate`, with rotations of at most half a turn.

    Args:
        plant: as there.
        q_from: (nq,).
        q_to: (nq,).

    Returns:
        (nv,).
    """
    q_from, _ = _vectors(plant, q_from, np.zeros(plant.num_velocities()))
    q_to, v = _vectors(plant, q_to, np.zeros(plant.num_velocities()))
    for position, velocity, size in _blocks(plant):
        if size == 1:
            v[velocity] = q_to[position] - q_from[position]
        else:
            R_FA, R_FB = (
                quaternion_from_array(q[position : position + 4], "wxyz").matrix()
                for q in (q_from, q_to)
            )
            v[velocity : velocity + 3] = log_so3(R_FB @ R_FA.T)
            v[velocity + 3 : velocity + 6] = (q_to - q_from)[position + 4 : position + 7]
    return v


def _vectors(plant: MultibodyPlant, q: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
    q, v = np.array(q, float), np.array(v, float)
    if q.shape != (plant.num_positions(),):
        raise ValueError(f"q must be ({plant.num_positions()},), got {q.shape}")
    if v.shape != (plant.num_velocities(),):
        raise ValueError(f"v must be ({plant.num_velocities()},), got {v.shape}")
    for name, values in (("q", q), ("v", v)):
        if not np.isfinite(values).all():
            raise ValueError(f"{name} must be finite, got {values}")
    return q, v


def _blocks(plant: MultibodyPlant) -> Iterator[tuple[int, int, int]]:
    """First position, first velocity and size: 1 where qdot = v, 7 for a floating quaternion."""
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.type_name() == "quaternion_floating":
            yield joint.position_start(), joint.velocity_start(), 7
        elif joint.type_name() in ("ball_rpy", "rpy_floating", "universal"):
            raise ValueError(f"plant: joint '{joint.name()}' is of type {joint.type_name()}")
        else:
            for i in range(joint.num_positions()):
                yield joint.position_start() + i, joint.velocity_start() + i, 1
