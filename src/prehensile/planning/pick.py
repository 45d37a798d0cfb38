"""Plans of picking and placing: to a grasp and up, to a drop and away."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Shape
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.planning.arm import ArmModel
from prehensile.planning.cartesian import plan_cartesian
from prehensile.planning.inverse_kinematics import refine, starting_points
from prehensile.planning.moves import (
    DEFAULT_OPTIONS,
    MoveOptions,
    MovePlan,
    free_path,
    holding,
    near,
    plan_move,
    timed,
)
from prehensile.planning.trajectory import TimedPath, time_parameterize

__all__ = [
    "MoveOptions",
    "MovePlan",
    "PickPlan",
    "PlacePlan",
    "X_GFlipped",
    "drop_poses",
    "plan_move",
    "plan_pick",
    "plan_place",
    "travel_time",
]

# The same grasp with the two fingers exchanged: half a turn about the approach axis.
X_GFlipped = RigidTransform(RotationMatrix.MakeYRotation(np.pi))


@dataclass(frozen=True)
class PickPlan:
    """The motions of a pick: to the grasp by way of a pose in front of it, and straight up.

    Attributes:
        index: which of the grasps it reaches (-1: none).
        X_WG: the pose of the hand at the grasp (possibly the given one with fingers exchanged).
        approach: from the start to the grasp, passing the pre-grasp pose without a stop.
        lift: from the grasp straight up.
        rejected: why each grasp before it, or every one, was passed over.
    """

    index: int
    X_WG: RigidTransform | None
    approach: TimedPath | None
    lift: TimedPath | None
    rejected: tuple[str, ...]

    @property
    def found(self) -> bool:
        """Whether a grasp can be reached."""
        return self.index >= 0

    @property
    def reason(self) -> str:
        """Why no grasp can be reached, in words ("" if one can)."""
        return "" if self.found else "; ".join(self.rejected) or "no grasps were given"


@dataclass(frozen=True)
class PlacePlan:
    """The motions of placing: to the drop from above, and back up.

    Attributes:
        index: which of the drop poses it reaches (-1: none).
        X_WG: the pose of the hand at the drop.
        carry: from the start to the drop.
        retreat: from the drop straight back up (None if the approach height is zero).
        rejected: why each drop before it, or every one, was passed over.
    """

    index: int
    X_WG: RigidTransform | None
    carry: TimedPath | None
    retreat: TimedPath | None
    rejected: tuple[str, ...]

    @property
    def found(self) -> bool:
        """Whether a drop can be reached."""
        return self.index >= 0

    @property
    def reason(self) -> str:
        """Why no drop can be reached, in words ("" if one can)."""
        return "" if self.found else "; ".join(self.rejected) or "no drops were given"


def plan_pick(
    arm: ArmModel,
    q_start: np.ndarray,
    grasps: Sequence[RigidTransform],
    *,
    widths: Sequence[float] | None = None,
    pregrasp_distance: float = 0.1,
    lift_height: float = 0.25,
    rng: np.random.Generator | None = None,
    options: MoveOptions = DEFAULT_OPTIONS,
) -> PickPlan:
    """Motions to the first of the grasps, in their order, that can be reached.

    The hand goes to the pre-grasp pose, `pregrasp_distance` behind the grasp along its approach
    axis y_G, moves in on a straight line, and afterwards straight up in the world. Both ways to
    hold the hand (fingers exchanged) are considered, nearer configurations first. Where the arm
    model has heights, the hand stays above them up to the pre-grasp pose, and backs off up to
    three times as far if that lies below them; the straight lines may go through.

    Args:
        arm: the arm and its surroundings.
        q_start: where the arm is (n,).
        grasps: poses X_WG, best first.
        widths: opening of the hand (m) at each grasp; as it is in the arm model if not given.
        pregrasp_distance: length of the straight line in (m, > 0).
        lift_height: length of the straight line up (m, > 0).
        rng: of all random choices; seed 0 if it is not given.
        options: how to move.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    rejected: list[str] = []
    for index, X_WGrasp in enumerate(grasps[: options.max_poses]):
        if widths is not None:
            arm.set_hand_width(widths[index])
        choices, reason = _configurations(
            arm, [X_WGrasp, X_WGrasp @ X_GFlipped], q_start, rng, options
        )
        for q_grasp in choices:
            X_WG = arm.pose(q_grasp)
            X_WGpre = X_WG @ RigidTransform([0.0, -pregrasp_distance, 0.0])
            X_WGlift = RigidTransform([0.0, 0.0, lift_height]) @ X_WG
            with near(arm, options):
                back = plan_cartesian(arm, q_grasp, X_WGpre)
                up = plan_cartesian(arm, q_grasp, X_WGlift) if back.found else back
            if not up.found:
                reason = ("approach: " if not back.found else "lift: ") + up.reason
                continue
            line = _back_off(arm, back.path, pregrasp_distance, options)
            path, reason = free_path(arm, q_start, line[-1], rng, options)
            if path is None:
                continue
            approach, reason = timed(
                arm, [path, line[::-1]], [options.speed, options.near_speed], None, options
            )
            lift = time_parameterize(
                up.path,
                arm.limits.scaled(1.0, options.carry_acceleration),
                speed=options.carry_speed,
            )
            if approach is not None:
                return PickPlan(index, X_WG, approach, lift, tuple(rejected))
        rejected.append(f"grasp {index}: {reason}")
    return PickPlan(-1, None, None, None, tuple(rejected))


def plan_place(
    arm: ArmModel,
    q_start: np.ndarray,
    drops: Sequence[RigidTransform],
    *,
    approach_height: float = 0.1,
    held: tuple[Shape, RigidTransform] | None = None,
    flip: bool = True,
    rng: np.random.Generator | None = None,
    options: MoveOptions = DEFAULT_OPTIONS,
) -> PlacePlan:
    """Motions to the first of the drop poses, in their order, that can be reached.

    Args:
        arm: the arm and its surroundings.
        q_start: where the arm is (n,).
        drops: poses X_WG at which the hand opens, best first.
        approach_height: length of the straight lines down to the drop and up again (m); 0 to
            drop from where the free motion ends.
        held: shape of the object in the hand and its pose X_GS; keeps clear of everything. A
            shape that touches something at the start already is an estimate too large to be
            kept clear, and is not.
        flip: whether the hand may be turned by half a turn about its approach axis.
        rng: of all random choices; seed 0 if it is not given.
        options: how to move.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    rejected: list[str] = []
    shape = held if _starts_clear(arm, q_start, held, options) else None
    for index, X_WDrop in enumerate(drops[: options.max_poses]):
        with holding(arm, shape):
            poses = [X_WDrop, X_WDrop @ X_GFlipped] if flip else [X_WDrop]
            choices, reason = _configurations(arm, poses, q_start, rng, options)
            for q_drop in choices:
                X_WG = arm.pose(q_drop)
                up = np.array([q_drop])
                if approach_height > 0.0:
                    X_WGabove = RigidTransform([0.0, 0.0, approach_height]) @ X_WG
                    with near(arm, options):
                        line = plan_cartesian(arm, q_drop, X_WGabove)
                    if not line.found:
                        reason = f"line down: {line.reason}"
                        continue
                    up = line.path
                path, reason = free_path(arm, q_start, up[-1], rng, options)
                if path is None:
                    continue
                carry, reason = timed(
                    arm, [path, up[::-1]], [options.carry_speed, options.near_speed], held, options
                )
                if carry is not None:
                    retreat = None
                    if len(up) > 1:
                        retreat = time_parameterize(
                            up, arm.limits.scaled(1.0, options.acceleration), speed=options.speed
                        )
                    return PlacePlan(index, X_WG, carry, retreat, tuple(rejected))
        rejected.append(f"drop {index}: {reason}")
    return PlacePlan(-1, None, None, None, tuple(rejected))


def drop_poses(
    center: np.ndarray,
    half_extent: np.ndarray,
    rng: np.random.Generator,
    count: int,
    R_WG: RotationMatrix | None = None,
) -> list[RigidTransform]:
    """Hand poses for drops spread over a box, pointing down, turned at random about the vertical.

    Args:
        center: centre of the box in W (3,).
        half_extent: half its size along the axes of W (3,).
        rng: of positions and turns.
        count: how many poses.
        R_WG: the orientation that is turned about the vertical; straight down if not given.
    """
    down = RotationMatrix.MakeXRotation(-0.5 * np.pi) if R_WG is None else R_WG
    poses = []
    for _ in range(count):
        p_WG = center + rng.uniform(-1.0, 1.0, 3) * half_extent
        turn = RotationMatrix.MakeZRotation(rng.uniform(-np.pi, np.pi))
        poses.append(RigidTransform(turn @ down, p_WG))
    return poses


def travel_time(arm: ArmModel, q_A: np.ndarray, q_B: np.ndarray) -> float:
    """Seconds that the slowest joint needs at its velocity limit; a distance to compare by."""
    return float(np.max(np.abs(q_B - q_A) / arm.limits.velocity))


def _configurations(
    arm: ArmModel,
    poses: Sequence[RigidTransform],
    q_start: np.ndarray,
    rng: np.random.Generator,
    options: MoveOptions,
) -> tuple[list[np.ndarray], str]:
    """Free configurations at any of the poses, the nearest first; the reason if there are none."""
    found: list[np.ndarray] = []
    reason = "out of reach"
    q_default = arm.q_default
    for X_WG in poses:
        for k, start in enumerate(starting_points(arm, q_start, rng, options.starts)):
            q, error = refine(arm, X_WG, q_default if k == 1 else start)
            if error > 1e-6 or any(np.max(np.abs(q - other)) < 0.1 for other in found):
                continue
            with near(arm, options):
                if arm.is_free(q):
                    found.append(q)
                else:
                    reason = f"collides: {arm.collisions(q)}"
    if not found and reason == "out of reach" and (why := arm.why_unreachable(poses[0])):
        reason += f": {why}"
    return sorted(found, key=lambda q: travel_time(arm, q_start, q)), reason


def _back_off(arm: ArmModel, back: np.ndarray, distance: float, options: MoveOptions) -> np.ndarray:
    """The path back from a grasp, made longer where its end is not clear, if that helps."""
    for factor in (2.0, 3.0):
        if arm.is_free(back[-1]):
            break
        X_WGpre = arm.pose(back[0]) @ RigidTransform([0.0, -factor * distance, 0.0])
        with near(arm, options):
            longer = plan_cartesian(arm, back[0], X_WGpre)
        if not longer.found:
            break
        back = longer.path
    return back


def _starts_clear(
    arm: ArmModel,
    q_start: np.ndarray,
    held: tuple[Shape, RigidTransform] | None,
    options: MoveOptions,
) -> bool:
    with holding(arm, held), near(arm, options):
        return arm.is_free(q_start)
