"""Inverse kinematics in closed form for the arm of a plant: every solution, or why there is none.

``analytic_ik(plant, frame_G)`` finds out which type of arm carries frame G and returns its solver.
All solvers take the pose X_WG as a RigidTransform or (4, 4), a few times faster as the latter:

- ``UrArm``, ``PieperArm`` (six joints): ``solve(X_WG)`` returns up to eight solutions;
- ``SrsArm`` (seven joints): ``solve(X_WG, psi)`` returns up to eight for one arm angle psi;
  ``closest``, ``farthest_from_limits`` and ``widest_interval`` choose the arm angle, and
  ``arm_angle_intervals`` says which ones the joint limits allow.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, RevoluteJoint

from prehensile.kinematics.tree import chain_from_world
from prehensile.native.analytic_ik import (
    STATUSES,
    ArmAngleChoice,
    IkSolutions,
    PieperArm,
    SrsArm,
    UrArm,
)

__all__ = [
    "STATUSES",
    "ArmAngleChoice",
    "ArmLines",
    "IkSolutions",
    "PieperArm",
    "SrsArm",
    "UrArm",
    "analytic_ik",
    "arm_lines",
    "equivalents",
    "pieper_arm_from_plant",
    "srs_arm_from_plant",
    "ur_arm_from_plant",
]

Arm = TypeVar("Arm", SrsArm, UrArm, PieperArm)

TOLERANCE = 1e-9
"""How far (m, rad) axes may be from meeting, parallel or perpendicular."""


@dataclass(frozen=True)
class ArmLines:
    """The revolute joints between the world and a frame G, as lines at q = 0.

    Attributes:
        joints: names of the n joints, from the base to G.
        axes: (n, 3) unit vectors in W that the joints turn about, by the right-hand rule.
        points: (n, 3) a point on each line, in W (m).
        X_WG0: (4, 4) pose of G at q = 0.
        lower, upper: (n,) joint limits (rad), infinite where there are none.
    """

    joints: tuple[str, ...]
    axes: NDArray[np.float64]
    points: NDArray[np.float64]
    X_WG0: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


def arm_lines(plant: MultibodyPlant, frame_G: Frame) -> ArmLines:
    """Reads the chain of joints that carries a frame.

    Args:
        plant: finalized.
        frame_G: a frame of the plant, for example of the hand. Its pose relative to the last link
            is arbitrary.

    Raises:
        ValueError: the plant is not finalized, the frame is another plant's, or a joint between the
            world and G is movable and not revolute.
    """
    chain = [(j, outward) for j, outward in chain_from_world(plant, frame_G) if j.num_velocities()]
    context = plant.CreateDefaultContext()
    for joint, _ in chain:
        if not isinstance(joint, RevoluteJoint):
            raise ValueError(
                f"frame_G: joint {joint.name()!r} that carries it is {joint.type_name()}, "
                "not revolute"
            )
        joint.set_angle(context, 0.0)
    joints = [joint for joint, _ in chain]
    X_WJ = [joint.frame_on_parent().CalcPoseInWorld(context) for joint in joints]
    directions = [
        X.rotation() @ joint.revolute_axis() * (1.0 if outward else -1.0)
        for X, (joint, outward) in zip(X_WJ, chain, strict=True)
    ]
    axes = np.array(directions).reshape(-1, 3)
    return ArmLines(
        joints=tuple(joint.name() for joint in joints),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        points=np.array([X.translation() for X in X_WJ]).reshape(-1, 3),
        X_WG0=np.ascontiguousarray(frame_G.CalcPoseInWorld(context).GetAsMatrix4()),
        lower=np.array([joint.position_lower_limits()[0] for joint in joints]),
        upper=np.array([joint.position_upper_limits()[0] for joint in joints]),
    )


def srs_arm_from_plant(
    plant: MultibodyPlant, frame_G: Frame, *, tolerance: float = TOLERANCE
) -> SrsArm:
    """The solver for an arm with spherical shoulder, elbow and spherical wrist (KUKA iiwa).

    Args:
        plant: finalized.
        frame_G: the frame whose pose is to be reached.
        tolerance: how far (m, rad) the axes may be from the geometry of the type; the solutions are
            as exact as that.

    Raises:
        ValueError: the arm is not of this type; the message says what does not hold.
    """
    return _make(SrsArm, arm_lines(plant, frame_G), tolerance)


def ur_arm_from_plant(
    plant: MultibodyPlant, frame_G: Frame, *, tolerance: float = TOLERANCE
) -> UrArm:
    """The solver for six joints of which 2, 3 and 4 are parallel; see srs_arm_from_plant()."""
    return _make(UrArm, arm_lines(plant, frame_G), tolerance)


def pieper_arm_from_plant(
    plant: MultibodyPlant, frame_G: Frame, *, tolerance: float = TOLERANCE
) -> PieperArm:
    """The solver for six joints with a spherical wrist; see srs_arm_from_plant()."""
    return _make(PieperArm, arm_lines(plant, frame_G), tolerance)


def analytic_ik(
    plant: MultibodyPlant, frame_G: Frame, *, tolerance: float = TOLERANCE
) -> SrsArm | UrArm | PieperArm:
    """The solver for the arm that carries a frame, of the type that it is.

    Args and raises: as srs_arm_from_plant(). The message says for each type of as many joints what
    does not hold.
    """
    lines = arm_lines(plant, frame_G)
    types = {7: (SrsArm,), 6: (UrArm, PieperArm)}.get(len(lines.joints))
    if types is None:
        raise ValueError(
            f"frame_G: {len(lines.joints)} joints carry it ({', '.join(lines.joints)}); "
            "solved in closed form are 6 and 7"
        )
    reasons = []
    for kind in types:
        try:
            return _make(kind, lines, tolerance)
        except ValueError as error:
            reasons.append(f"{kind.__name__}: {error}")
    raise ValueError("frame_G: the arm is of no type that is solved here; " + "; ".join(reasons))


def equivalents(arm: SrsArm | UrArm | PieperArm, q: ArrayLike) -> NDArray[np.float64]:
    """All configurations within the limits that differ from some by whole turns of joints.

    Args:
        arm: whose limits count. A joint without limits keeps its angle.
        q: (n,) or (B, n), for example the solutions of a pose.

    Returns:
        (M, n) in the order of q, the angles of each ascending lexicographically.

    Raises:
        ValueError: q has another shape or is not finite.
    """
    rows = np.atleast_2d(np.asarray(q, dtype=float))
    if rows.ndim != 2 or rows.shape[1] != arm.num_joints:
        raise ValueError(f"q: expected shape (B, {arm.num_joints}), not {np.shape(q)}")
    if not np.isfinite(rows).all():
        raise ValueError("q: must be finite")
    lower, upper = arm.lower, arm.upper
    found = [
        values
        for row in rows
        for values in product(*(_turns(*joint) for joint in zip(row, lower, upper, strict=True)))
    ]
    return np.array(found).reshape(-1, arm.num_joints)


def _turns(q: float, lower: float, upper: float) -> Sequence[float]:
    if not (np.isfinite(lower) and np.isfinite(upper)):
        return [q]
    turn = 2.0 * np.pi
    first, last = np.ceil((lower - q) / turn - 1e-12), np.floor((upper - q) / turn + 1e-12)
    return [float(np.clip(q + turn * k, lower, upper)) for k in np.arange(first, last + 1)]


def _make(kind: type[Arm], lines: ArmLines, tolerance: float) -> Arm:
    if not tolerance >= 0.0:
        raise ValueError(f"tolerance: must not be negative, is {tolerance}")
    return kind(lines.axes, lines.points, lines.X_WG0, lines.lower, lines.upper, tolerance)
