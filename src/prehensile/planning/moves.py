"""Free motions of an arm with a hand, and what is allowed close to objects."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import Shape
from pydrake.math import RigidTransform

from prehensile.planning.arm import ArmModel
from prehensile.planning.joint_path import plan_joint_path
from prehensile.planning.trajectory import TimedPath, join_paths, time_parameterize


@dataclass(frozen=True)
class MoveOptions:
    """How to move.

    Attributes:
        speed: factor on the joint velocity limits of free motions, in (0, 1].
        near_speed: the same on straight lines near objects, in (0, 1].
        carry_speed: the same with an object in the hand, in (0, 1].
        acceleration: factor on the joint acceleration limits, in (0, 1].
        carry_acceleration: the same with an object in the hand, in (0, 1].
        near_padding: clearance from the surroundings on straight lines near objects (m), checked
            three times as finely; free motions keep the arm model's own clearance where their
            ends allow it.
        deviation: how far free motions may pass from their corners (rad).
        starts: starts of inverse kinematics per pose (>= 1).
        samples: samples of a path search before it gives up (>= 1).
        max_poses: grasps or drops tried before giving up (>= 1).
    """

    speed: float = 0.8
    near_speed: float = 0.5
    carry_speed: float = 0.7
    acceleration: float = 0.9
    carry_acceleration: float = 0.6
    near_padding: float = 0.001
    deviation: float = 0.05
    starts: int = 5
    samples: int = 300
    max_poses: int = 20


DEFAULT_OPTIONS = MoveOptions()


@dataclass(frozen=True)
class MovePlan:
    """A motion to one configuration; `motion` is None where none was found."""

    motion: TimedPath | None
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether there is a motion."""
        return self.motion is not None


def plan_move(
    arm: ArmModel,
    q_start: np.ndarray,
    q_goal: np.ndarray,
    *,
    rng: np.random.Generator | None = None,
    held: tuple[Shape, RigidTransform] | None = None,
    options: MoveOptions = DEFAULT_OPTIONS,
) -> MovePlan:
    """A collision-free motion from one configuration to another, such as home.

    Args:
        arm: the arm and its surroundings.
        q_start, q_goal: ends of the motion (n,).
        rng: of the search; seed 0 if it is not given.
        held: shape of an object in the hand and its pose X_GS.
        options: how to move.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    with holding(arm, held):
        path, reason = free_path(arm, q_start, q_goal, rng, options)
        if path is None:
            return MovePlan(None, reason)
        motion, reason = timed(arm, [path], [_speed(held, options)], held, options)
        return MovePlan(motion, reason)


def free_path(
    arm: ArmModel,
    q_start: np.ndarray,
    q_goal: np.ndarray,
    rng: np.random.Generator,
    options: MoveOptions,
) -> tuple[np.ndarray | None, str]:
    """A path with the model's clearance and heights, or without where an end needs that."""
    clear = are_clear(arm, q_start, q_goal)
    with nullcontext() if clear else near(arm, options, refine_by=1.0):
        result = plan_joint_path(arm, q_start, q_goal, rng=rng, max_iterations=options.samples)
    return (result.path, "") if result.found else (None, result.reason)


def are_clear(arm: ArmModel, *ends: np.ndarray) -> bool:
    """Whether all configurations (n,) are free, with the model's clearance and heights."""
    return all(arm.is_free(q) for q in ends)


def timed(
    arm: ArmModel,
    paths: Sequence[np.ndarray],
    speeds: Sequence[float],
    held: object,
    options: MoveOptions,
) -> tuple[TimedPath | None, str]:
    """One motion along a free path and straight lines, checked again as it will be moved.

    Args:
        arm: the arm and its surroundings.
        paths: the free path, then straight lines; each (K_i, n), starting where the last ended.
        speeds: factor on the velocity limits of each.
        held: None if the hand is empty.
        options: how to move.

    Returns:
        The motion, or None and the reason.
    """
    path = join_paths(*paths)
    speed = np.concatenate(
        [np.full(len(join_paths(p)) - 1, v) for p, v in zip(paths, speeds, strict=True)]
    )
    acceleration = options.acceleration if held is None else options.carry_acceleration
    limits = arm.limits.scaled(1.0, acceleration)
    free = paths[0]
    heights = arm.heights if are_clear(arm, free[0], free[-1]) else None
    reason = ""
    for deviation in (options.deviation, 0.2 * options.deviation, 1e-3):
        motion = time_parameterize(path, limits, speed=speed, deviation=deviation)
        samples = motion.sample()
        corner = int(np.argmin(np.linalg.norm(samples - free[-1], axis=1)))
        with near(arm, replace(options, near_padding=0.5 * options.near_padding)):
            ok = arm.path_is_free(samples)
            if ok and heights is not None:
                arm.set_heights(heights)
                ok = arm.is_above_heights(samples[: corner + 1])
            if ok:
                return motion, ""
            reason = f"the motion collides: {arm.first_collision(samples) or 'on its way'}"
    return None, reason


def _speed(held: object, options: MoveOptions) -> float:
    return options.speed if held is None else options.carry_speed


@contextmanager
def near(arm: ArmModel, options: MoveOptions, refine_by: float = 3.0) -> Iterator[None]:
    """Close to objects for a while: a small clearance, checked finely, and no heights."""
    padding, step, heights = arm.padding, arm.checker.edge_step_size(), arm.heights
    arm.set_padding(min(padding, options.near_padding))
    arm.checker.set_edge_step_size(step / refine_by)
    arm.set_heights(None)
    try:
        yield
    finally:
        arm.set_padding(padding)
        arm.checker.set_edge_step_size(step)
        arm.set_heights(heights)


@contextmanager
def holding(arm: ArmModel, held: tuple[Shape, RigidTransform] | None) -> Iterator[None]:
    """An object in the hand for a while."""
    if held is None:
        yield
        return
    arm.attach(*held)
    try:
        yield
    finally:
        arm.detach()
