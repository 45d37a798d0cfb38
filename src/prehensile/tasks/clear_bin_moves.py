"""The motions of clearing a bin that planning alone does not know: the drop and the nudge."""

import dataclasses as dc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from pydrake import geometry
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.grasping import ParallelGripper
from prehensile.perception import Box, PointCloud
from prehensile.planning.arm import ArmModel
from prehensile.planning.cartesian import plan_cartesian
from prehensile.planning.pick import MoveOptions, PlacePlan, drop_poses, plan_pick, plan_place
from prehensile.planning.trajectory import TimedPath, time_parameterize

# What is carried swings on its two contacts, the more the harder it is shaken.
_CARRY = MoveOptions(carry_speed=0.7, carry_acceleration=0.35)
_RIM_CLEARANCE = 0.02  # m between the finger tips and the rim of the second bin
_DROP_INSET = 0.11  # m from the walls of the second bin to where things are let go
_PRESS = 0.022  # m that a nudge is commanded into a surface; the arm yields
_DRAG = 0.15  # m that a nudge drags
_DRAG_SPEED = 0.15  # share of the joint velocity limits


@dc.dataclass(frozen=True)
class BinGeometry:
    """What is known of a bin.

    Attributes:
        X_WB: its pose; it stands upright.
        low, high: corners of its interior in its frame B (3,), up to the rim.
        walls: its floor and walls as boxes in W.
    """

    X_WB: RigidTransform
    low: np.ndarray
    high: np.ndarray
    walls: Sequence[Box]

    def region(self, *, inset: float, above_floor: float, above_rim: float) -> Box:
        """The part of the interior to look at: inset from the walls, in W (metres)."""
        low = self.low + np.array([inset, inset, above_floor])
        high = self.high + np.array([-inset, -inset, above_rim])
        return Box(self.X_WB @ RigidTransform(0.5 * (low + high)), high - low)

    @property
    def depth(self) -> float:
        """From the inner floor to the rim [m]."""
        return float(self.high[2] - self.low[2])

    @property
    def floor_height(self) -> float:
        """Height of the inner floor in W [m]."""
        return float(self.X_WB.translation()[2] + self.low[2])


def held_box(
    cloud: PointCloud,
    segments: np.ndarray,
    X_WG: RigidTransform,
    span: float,
    gripper: ParallelGripper,
    floor_height: float,
) -> Box:
    """A box around what a grasp will hold, in the hand's frame G.

    It holds the piece of the cloud that lies between the pads, and reaches down to the floor of
    the bin, below which nothing that lay there can hang. It may swing about the closing axis, so
    it reaches as far along the approach as sideways.

    Args:
        cloud: what is seen, in W.
        segments: (N,) labels of its points by piece (-1: none).
        X_WG: the hand at the grasp.
        span: extent of the object between the pads [m].
        gripper: the hand.
        floor_height: height of the bin's floor in W [m].

    Returns:
        The box, its pose being X_GB.
    """
    p_GPad = gripper.p_GPad
    p = X_WG.inverse().multiply(cloud.points.T).T - p_GPad
    between = (np.abs(p[:, 0]) < 0.5 * span + 0.005) & (np.abs(p[:, 1:]) < 0.02).all(axis=1)
    labels = segments[between & (segments >= 0)]
    hang = (X_WG @ RigidTransform(p_GPad)).translation()[2] - floor_height
    low = np.array([-0.5 * span, 0.0, -0.5 * gripper.pad_width])
    high = np.array([0.5 * span, max(hang, 0.0), 0.5 * gripper.pad_width])
    if len(labels) > 0:
        piece = p[segments == np.bincount(labels).argmax()]
        low, high = np.minimum(low, piece.min(axis=0)), np.maximum(high, piece.max(axis=0))
        high[1] = max(high[1], high[2], -low[2])
    low[1] = 0.0  # beside the fingers; the palm is above
    return Box(RigidTransform(p_GPad + 0.5 * (low + high)), high - low)


def plan_drop(
    arm: ArmModel,
    q_start: np.ndarray,
    held: Box,
    place: BinGeometry,
    gripper: ParallelGripper,
    drop_height: float,
    used: Sequence[np.ndarray],
    rng: np.random.Generator,
) -> PlacePlan:
    """Carries what is held over a bin, clear of everything on the way.

    Args:
        arm: the arm and its surroundings.
        q_start: where the arm is (n,).
        held: what it holds, in the hand's frame G.
        place: the bin to fill.
        gripper: the hand.
        drop_height: height above the bin's floor at which the lowest point is let go [m].
        used: where things were let go before, p_WG; places over which nothing hangs
            beyond the walls come first, and of these the farthest from the used ones.
        rng: of the places and of the search.

    Returns:
        The plan; the hand stays above the rim, for the bin may be full by now.
    """
    hang = held.X_WB.translation()[1] + 0.5 * held.size[1] - gripper.pad_y[1]
    tips = max(hang + drop_height, place.depth + _RIM_CLEARANCE)
    p_WDrop = place.X_WB.translation().copy()
    p_WDrop[2] = place.floor_height + tips + gripper.pad_y[1]
    half_extent = np.append(0.5 * (place.high - place.low)[:2] - _DROP_INSET, 0.0)
    poses = sorted(
        drop_poses(p_WDrop, half_extent, rng, count=30),
        key=lambda X_WG: (_overhang(held, X_WG, place), -_nearest(X_WG, used)),
    )
    return plan_place(
        arm,
        q_start,
        poses,
        approach_height=0.0,
        held=(geometry.Box(*held.size), held.X_WB),
        rng=rng,
        options=_CARRY,
    )


def _overhang(held: Box, X_WG: RigidTransform, place: BinGeometry) -> float:
    """How far what is held reaches beyond the walls of the bin, in steps of 2 cm [m]."""
    corners = (np.indices((2, 2, 2)).reshape(3, 8) - 0.5) * held.size[:, None]
    p_B = (place.X_WB.inverse() @ X_WG @ held.X_WB).multiply(corners)[:2].T
    beyond = np.maximum(place.low[:2] - p_B, p_B - place.high[:2]).max()
    return max(0.0, float(np.ceil(beyond / 0.02)) * 0.02)


def _nearest(X_WG: RigidTransform, used: Sequence[np.ndarray]) -> float:
    """Horizontal distance to the nearest of the places used before [m]."""
    p_WG = X_WG.translation()
    return min((float(np.linalg.norm((p_WG - p)[:2])) for p in used), default=0.0)


@dc.dataclass(frozen=True)
class NudgePlan:
    """Motions of a nudge: to the surface, along it, and up again."""

    approach: TimedPath
    drag: TimedPath
    lift: TimedPath


def plan_nudge(
    arm: ArmModel,
    q_start: np.ndarray,
    cloud: PointCloud,
    segments: np.ndarray,
    pick: BinGeometry,
    gripper: ParallelGripper,
    rng: np.random.Generator,
    *,
    lift_height: float,
) -> NudgePlan | None:
    """Presses the closed fingers on top of something and drags it toward the middle of the bin.

    What lies along a wall leaves no room for a finger behind it (Tedrake, Robotic Manipulation,
    section 5.5).

    Args:
        arm: the arm and its surroundings.
        q_start: where the arm is (n,).
        cloud: what is seen in the bin, in W.
        segments: (N,) labels of its points by piece (-1: none).
        pick: the bin.
        gripper: the hand.
        rng: chooses the piece and searches the way.
        lift_height: how far to rise afterwards [m].

    Returns:
        The plan; None if no piece can be reached.
    """
    upward = (segments >= 0) & (cloud.require_normals()[:, 2] > 0.8)
    pieces, areas = np.unique(segments[upward], return_counts=True)
    if len(pieces) == 0:
        return None
    # Mostly the large ones: they cover the others.
    order = rng.choice(pieces, len(pieces), replace=False, p=areas / areas.sum())
    for piece in order[:4]:
        top = upward & (segments == piece)
        if np.count_nonzero(top) < 10:
            continue
        p_WTop = np.median(cloud.points[top], axis=0)
        inward = (pick.X_WB.translation() - p_WTop) * [1.0, 1.0, 0.0]
        distance = np.linalg.norm(inward)
        if distance < 0.02:
            continue
        inward /= distance
        p_WTop[2] += gripper.pad_y[1] - _PRESS
        # Straight down; the palm is long in x, so beside a wall x must be along the wall.
        down = RotationMatrix.MakeXRotation(-0.5 * np.pi)
        R_WB = pick.X_WB.rotation()
        poses = [
            RigidTransform(R_WB @ RotationMatrix.MakeZRotation(turn) @ down, p_WTop)
            for turn in (0.0, 0.5 * np.pi)
        ]
        plan = plan_pick(arm, q_start, poses, widths=[0.0, 0.0], lift_height=0.01, rng=rng)
        if plan.approach is None or plan.X_WG is None:
            continue
        X_WEnd = RigidTransform(min(distance, _DRAG) * inward) @ plan.X_WG
        X_WUp = RigidTransform([0.0, 0.0, lift_height]) @ X_WEnd
        with _touching(arm):
            drag = plan_cartesian(arm, plan.approach.q_end, X_WEnd)
            rise = plan_cartesian(arm, drag.path[-1], X_WUp) if drag.found else drag
        if rise.found:
            return NudgePlan(
                plan.approach,
                time_parameterize(drag.path, arm.limits, speed=_DRAG_SPEED),
                time_parameterize(rise.path, arm.limits, speed=0.5),
            )
    return None


@contextmanager
def _touching(arm: ArmModel) -> Iterator[None]:
    """What was seen may be touched for a while."""
    heights = arm.heights
    arm.set_heights(None)
    try:
        yield
    finally:
        arm.set_heights(heights)
