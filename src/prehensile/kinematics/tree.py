"""A Drake plant's joints and frames as a native kinematic tree."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Frame, Joint, PrismaticJoint, RevoluteJoint

from prehensile.native.kinematic_tree import KinematicTree


@dataclass(frozen=True)
class PlantTree:
    """The kinematics of some joints and frames of a plant, by a native tree.

    Attributes:
        tree: answers for joint positions (n,) in the order of ``joints``, and for frames by their
            number.
        joints: names of the n joints.
        frames: names of the frames, in their order.
        position_indices: (n,) where the joints' positions are in the plant's q.
        velocity_indices: (n,) where their velocities are in the plant's v.
        prismatic: (n,) whether it slides (m) instead of turning (rad).
        lower, upper: (n,) position limits (rad or m), infinite where there is none.
        velocity: (n,) largest speed (rad/s or m/s): the smaller of the two directions' limits.
        acceleration: (n,) largest acceleration (rad/s² or m/s²), likewise.
    """

    tree: KinematicTree
    joints: tuple[str, ...]
    frames: tuple[str, ...]
    position_indices: NDArray[np.intp]
    velocity_indices: NDArray[np.intp]
    prismatic: NDArray[np.bool_]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]


def tree_from_plant(
    plant: MultibodyPlant,
    frames: Sequence[Frame],
    *,
    joints: Sequence[Joint] | None = None,
    q_locked: ArrayLike | None = None,
) -> PlantTree:
    """Compiles the kinematics of a plant's joints and frames.

    Args:
        plant: finalized.
        frames: F0, F1, ...: frames of the plant whose poses and Jacobians are wanted.
        joints: the joints that move, revolute or prismatic, in the order of the result's positions;
            default: all of the plant's that have a degree of freedom and are not locked by weld.
        q_locked: (nq,) positions of the plant at which every other joint is held; default: the
            plant's default positions.

    Raises:
        ValueError: naming the argument: the plant is not finalized; a frame or a joint is of
            another plant; a joint is neither revolute nor prismatic or given twice;
            q_locked has another size or is not finite.
    """
    _check(plant, frames)
    if joints is None:
        joints = [joint for joint in _all_joints(plant) if joint.num_velocities() > 0]
        mend = "; name the joints that move"
    else:
        mend = ""
    for joint in joints:
        if joint.GetParentPlant() is not plant:
            raise ValueError(f"joints: {joint.name()} is of another plant")
        if not isinstance(joint, (RevoluteJoint, PrismaticJoint)):
            kind = joint.type_name()
            raise ValueError(f"joints: {joint.name()} is {kind}, not revolute or prismatic{mend}")
    number = {joint.index(): i for i, joint in enumerate(joints)}
    if len(number) != len(joints):
        raise ValueError("joints: one is given twice")

    context = plant.CreateDefaultContext()
    q = plant.GetPositions(context)
    if q_locked is not None:
        q = np.array(q_locked, dtype=float)
        if q.shape != (plant.num_positions(),) or not np.isfinite(q).all():
            raise ValueError(f"q_locked: expected {plant.num_positions()} finite numbers")
    position_indices = np.array([joint.position_start() for joint in joints], dtype=np.intp)
    q[position_indices] = 0.0  # Where J and the frame that it is mounted on coincide.
    plant.SetPositions(context, q)

    mover: dict[BodyIndex, int] = {plant.world_body().index(): -1}
    X_WL = {-1: RigidTransform()}
    parents = np.full(len(joints), -1)
    X_PJ = np.empty((len(joints), 4, 4))
    axes = np.empty((len(joints), 3))
    for joint, inboard, outboard in _outward(plant):
        i = number.get(joint.index())
        if i is None:
            mover[outboard] = mover[inboard]
            continue
        mover[outboard] = i
        parents[i] = mover[inboard]
        X_WL[i] = joint.frame_on_parent().CalcPoseInWorld(context)
        X_PJ[i] = (X_WL[parents[i]].inverse() @ X_WL[i]).GetAsMatrix4()
        revolute = isinstance(joint, RevoluteJoint)
        axis = joint.revolute_axis() if revolute else joint.translation_axis()
        # A joint that carries its own parent moves it the other way.
        axes[i] = axis if outboard == joint.child_body().index() else -axis

    frame_parents = np.array([mover[frame.body().index()] for frame in frames], dtype=int)
    X_PF = [
        (X_WL[parent].inverse() @ frame.CalcPoseInWorld(context)).GetAsMatrix4()
        for parent, frame in zip(frame_parents, frames, strict=True)
    ]
    prismatic = np.array([isinstance(joint, PrismaticJoint) for joint in joints], dtype=bool)
    tree = KinematicTree(
        parents,
        X_PJ,
        axes,
        prismatic.astype(float),
        frame_parents,
        np.reshape(X_PF, (-1, 4, 4)),
    )

    def limits(lower: str, upper: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        both = [(getattr(j, lower)()[0], getattr(j, upper)()[0]) for j in joints]
        array = np.array(both, dtype=float).reshape(-1, 2)
        return array[:, 0], array[:, 1]

    def largest(lower: str, upper: str) -> NDArray[np.float64]:
        low, high = limits(lower, upper)
        return np.minimum(-low, high)

    position = limits("position_lower_limits", "position_upper_limits")
    return PlantTree(
        tree=tree,
        joints=tuple(joint.name() for joint in joints),
        frames=tuple(frame.name() for frame in frames),
        position_indices=position_indices,
        velocity_indices=np.array([j.velocity_start() for j in joints], dtype=np.intp),
        prismatic=prismatic,
        lower=position[0],
        upper=position[1],
        velocity=largest("velocity_lower_limits", "velocity_upper_limits"),
        acceleration=largest("acceleration_lower_limits", "acceleration_upper_limits"),
    )


def joints_that_move(plant: MultibodyPlant, frame: Frame) -> list[Joint]:
    """The revolute and prismatic joints between the world and a frame, from the world outward.

    Args:
        plant: finalized.
        frame: one of its frames.

    Raises:
        ValueError: the plant is not finalized, or the frame is another plant's.
    """
    return [
        joint
        for joint, _ in chain_from_world(plant, frame)
        if isinstance(joint, (RevoluteJoint, PrismaticJoint))
    ]


def chain_from_world(plant: MultibodyPlant, frame: Frame) -> list[tuple[Joint, bool]]:
    """The joints of every kind between the world and a frame, from the world outward.

    Args:
        plant: finalized.
        frame: one of its frames.

    Returns:
        Each joint, and whether it is its child body that it carries on the way outward; it moves
        the other way where it carries its parent.

    Raises:
        ValueError: the plant is not finalized, or the frame is another plant's.
    """
    _check(plant, [frame])
    into = {outboard: (joint, inboard) for joint, inboard, outboard in _outward(plant)}
    joints = []
    body = frame.body().index()
    while body in into:
        joint, inboard = into[body]
        joints.append((joint, body == joint.child_body().index()))
        body = inboard
    return joints[::-1]


def _check(plant: MultibodyPlant, frames: Sequence[Frame]) -> None:
    if not plant.is_finalized():
        raise ValueError("plant: must be finalized")
    for frame in frames:
        if frame.GetParentPlant() is not plant:
            raise ValueError(f"frames: {frame.name()} is of another plant")


def _all_joints(plant: MultibodyPlant) -> list[Joint]:
    return [plant.get_joint(index) for index in plant.GetJointIndices()]


def _outward(plant: MultibodyPlant) -> Iterator[tuple[Joint, BodyIndex, BodyIndex]]:
    """All joints from the world outward, each with its body nearer to the world and the other."""
    joints_of: dict[BodyIndex, list[Joint]] = {}
    for joint in _all_joints(plant):
        for body in (joint.parent_body(), joint.child_body()):
            joints_of.setdefault(body.index(), []).append(joint)
    world = plant.world_body().index()
    reached, waiting = {world}, deque([world])
    while waiting:
        inboard = waiting.popleft()
        for joint in joints_of.get(inboard, ()):
            parent, child = joint.parent_body().index(), joint.child_body().index()
            outboard = child if parent == inboard else parent
            if outboard not in reached:
                reached.add(outboard)
                waiting.append(outboard)
                yield joint, inboard, outboard
