"""Pick and place with a known pose: a brick on a table goes to where it is wanted.

The grasp is fixed in the brick's frame; before each trip the brick's pose is looked up and the
whole trip is planned (Tedrake, Robotic Manipulation, chapter 3).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import BodyIndex

from prehensile.behavior.state_machine import Decision, Senses
from prehensile.behavior.trajectory_player import Segment, SegmentPlayer
from prehensile.kinematics.poses import pose_distance
from prehensile.planning.arm import ArmModel
from prehensile.planning.pick import plan_move, plan_pick, plan_place

BRICK_SIZE = (0.05, 0.075, 0.05)
"""Size of the foam brick along its axes, in m."""

# Closing along the brick's short side x, coming from above, finger tips past its middle.
X_BrickG = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi), [0.0, 0.0, 0.11])

OPEN_WIDTH = 0.1
"""Opening of the hand before and after a trip, in m."""

BODY_POSES = "body_poses"
"""The port on which the task reads where the brick is: poses X_WB by body index."""

_GRIP_TIME = 0.5  # s for the hand to close or open
_SETTLE_TIME = 0.1  # s for the arm to come to rest before the hand closes
_PLACE_SETTLE_TIME = 0.2  # s before it opens
_RELEASE_HEIGHT = 0.002  # m between brick and table when the hand opens
_REACH = (0.42, 0.72)  # m from the arm's axis within which bricks are picked and placed
_SECTOR = math.radians(100.0)  # to either side of straight ahead
_APART = 0.2  # m between start and goal


@dataclass(frozen=True)
class TripPlan:
    """The motions of one trip of the brick.

    Attributes:
        carry: from where the arm is to the brick, grasp, lift, and to the goal.
        release: the hand opens, goes up, and the arm goes home.
        X_WRelease: pose of the hand where it is to open.
        reason: why there is no such trip, in words ("" if there is; else the rest is None).
    """

    carry: SegmentPlayer | None = None
    release: SegmentPlayer | None = None
    X_WRelease: RigidTransform | None = None
    reason: str = ""


def plan_pick_place(
    arm: ArmModel, X_WStart: RigidTransform, X_WGoal: RigidTransform, *, seed: int = 0
) -> TripPlan:
    """Plans a whole trip: to the brick, grasp, lift, carry, release, back to the default.

    Args:
        arm: the arm at a table, the brick not among its surroundings. The trip begins and ends at
            its default configuration.
        X_WStart: pose of the brick.
        X_WGoal: pose that it is to have.
        seed: of every random choice.

    Returns:
        The motions, or the reason why there are none.

    Raises:
        ValueError: a pose is not finite.
    """
    for name, X_WBrick in (("X_WStart", X_WStart), ("X_WGoal", X_WGoal)):
        if not np.isfinite(X_WBrick.GetAsMatrix4()).all():
            raise ValueError(f"{name}: must be finite")
    rng = np.random.default_rng(seed)
    home = arm.q_default
    arm.set_hand_width(OPEN_WIDTH)
    pick = plan_pick(arm, home, [X_WStart @ X_BrickG], lift_height=0.15, rng=rng)
    if pick.approach is None or pick.lift is None or pick.X_WG is None:
        return TripPlan(reason=f"picking: {pick.reason}")
    X_GBrick = pick.X_WG.inverse() @ X_WStart  # as held: fingers may have been exchanged
    X_WRelease = RigidTransform([0.0, 0.0, _RELEASE_HEIGHT]) @ X_WGoal @ X_GBrick.inverse()
    # The brick starts and ends next to the table; what is kept clear is a little smaller.
    held = Box(*(np.array(BRICK_SIZE) - 0.002)), X_GBrick
    place = plan_place(arm, pick.lift.q_end, [X_WRelease], held=held, flip=False, rng=rng)
    if place.carry is None or place.retreat is None:
        return TripPlan(reason=f"placing: {place.reason}")
    back = plan_move(arm, place.retreat.q_end, home, rng=rng)
    if back.motion is None:
        return TripPlan(reason=f"going back: {back.reason}")
    grasp, drop = pick.approach.q_end, place.carry.q_end
    carry = [
        Segment.move(pick.approach, OPEN_WIDTH, settle=_SETTLE_TIME),
        Segment.wait(grasp, 0.0, _GRIP_TIME),
        Segment.move(pick.lift, 0.0),
        Segment.move(place.carry, 0.0, settle=_PLACE_SETTLE_TIME),
    ]
    release = [
        Segment.wait(drop, OPEN_WIDTH, _GRIP_TIME),
        Segment.move(place.retreat, OPEN_WIDTH),
        Segment.move(back.motion, OPEN_WIDTH),
    ]
    return TripPlan(SegmentPlayer(carry), SegmentPlayer(release), X_WRelease)


def choose_poses(seed: int) -> tuple[RigidTransform, RigidTransform]:
    """A start and a goal for the brick on the table around the arm, well apart."""
    rng = np.random.default_rng(seed)

    def pose() -> RigidTransform:
        radius, angle = rng.uniform(*_REACH), rng.uniform(-_SECTOR, _SECTOR)
        p = [radius * math.cos(angle), radius * math.sin(angle), 0.5 * BRICK_SIZE[2]]
        return RigidTransform(RotationMatrix.MakeZRotation(rng.uniform(-np.pi, np.pi)), p)

    X_WStart, X_WGoal = pose(), pose()
    while pose_distance(X_WStart, X_WGoal)[0] < _APART:
        X_WGoal = pose()
    return X_WStart, X_WGoal


@dataclass(frozen=True)
class Trip:
    """How one trip of the brick ended.

    Attributes:
        X_WStart: where the brick was.
        X_WGoal: where it was wanted.
        X_WEnd: where it ended.
        gripper_error: distance (m) and angle (rad) of the hand from where it was to let go.
        duration: simulated seconds, from one rest of the arm to the next.
    """

    X_WStart: RigidTransform
    X_WGoal: RigidTransform
    X_WEnd: RigidTransform
    gripper_error: tuple[float, float]
    duration: float

    @property
    def error(self) -> tuple[float, float]:
        """Distance (m) and angle (rad) of the brick from its goal."""
        return pose_distance(self.X_WEnd, self.X_WGoal)


@dataclass(frozen=True)
class Memory:
    """What the task remembers: the trips that are over, and the one under way."""

    trips: tuple[Trip, ...] = ()
    reason: str = ""
    plan: TripPlan = TripPlan()
    X_WStart: RigidTransform | None = None
    started: float = 0.0
    gripper_error: tuple[float, float] = (math.nan, math.nan)


class PickPlace:
    """The task: looks where the brick is, takes it to the next goal, and so on.

    States: look, carry, release; the last decision's ``memory`` is a :class:`Memory`.
    """

    def __init__(
        self, arm: ArmModel, goals: Sequence[RigidTransform], brick: BodyIndex, *, seed: int = 0
    ) -> None:
        """Makes the task.

        Args:
            arm: plans; see :func:`plan_pick_place`.
            goals: poses that the brick is to have, one after the other.
            brick: its body, for the port :data:`BODY_POSES`.
            seed: of every random choice.
        """
        self._arm = arm
        self._goals = tuple(goals)
        self._brick = int(brick)
        self._seed = seed

    def start(self) -> Decision:
        """Looks first."""
        return Decision("look", Memory())

    def decide(
        self, state: str, memory: Memory, *, time: float, motion_done: bool, senses: Senses
    ) -> Decision | None:
        """Goes on when the motion under way is over."""
        if not motion_done:
            return None
        if state == "carry":
            X_WG, X_WRelease = self._arm.pose(senses.q), memory.plan.X_WRelease
            assert X_WRelease is not None
            memory = replace(memory, gripper_error=pose_distance(X_WG, X_WRelease))
            return Decision("release", memory, memory.plan.release)
        X_WBrick = senses.image(BODY_POSES)[self._brick]
        if state == "release":
            assert memory.X_WStart is not None
            trip = Trip(
                memory.X_WStart,
                self._goals[len(memory.trips)],
                X_WBrick,
                memory.gripper_error,
                time - memory.started,
            )
            memory = replace(memory, trips=(*memory.trips, trip))
        done = len(memory.trips)
        if done == len(self._goals):
            return Decision("done", memory, finished=True)
        plan = plan_pick_place(self._arm, X_WBrick, self._goals[done], seed=self._seed + done)
        memory = replace(memory, plan=plan, X_WStart=X_WBrick, started=time, reason=plan.reason)
        if plan.reason:
            return Decision("refused", memory, finished=True)
        return Decision("carry", memory, plan.carry)
