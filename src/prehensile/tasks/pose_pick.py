"""A known object is found, picked and set upright where it is wanted: look, pick, place, check.

The task of Tedrake, Robotic Manipulation, chapter 4, as the states of a
:class:`~prehensile.behavior.state_machine.StateMachine`. It knows the arm, the bins, the calibrated
cameras and the object's shape; where the object is, it has to find out, and afterwards whether it
stands where it should.
"""

import dataclasses as dc
import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.behavior.state_machine import Decision, Senses
from prehensile.behavior.trajectory_player import Segment, SegmentPlayer
from prehensile.grasping import ParallelGripper
from prehensile.perception.cloud import PointCloud
from prehensile.planning.arm import ArmModel
from prehensile.planning.moves import plan_move
from prehensile.tasks.clear_bin_moves import BinGeometry, plan_nudge
from prehensile.tasks.pose_pick_grasps import lying_poses
from prehensile.tasks.pose_pick_moves import Transfer, TransferPlanner


@dc.dataclass(frozen=True)
class Sight:
    """What one look told.

    Attributes:
        X_WO: pose of the object; None if it was not found.
        reason: why it was not found, or why not to believe it, in words ("" if all is well).
        seconds: wall seconds from the images to this.
    """

    X_WO: RigidTransform | None
    reason: str = ""
    seconds: float = 0.0


class Finder(Protocol):
    """Finds the object by the cameras."""

    def find(self, senses: Senses) -> Sight:
        """Where the object is in the first bin."""
        ...

    def check(self, senses: Senses, X_WGuess: RigidTransform) -> Sight:
        """Where the object is near a pose in the second bin."""
        ...

    def in_hand(self, senses: Senses, X_WGuess: RigidTransform, X_WG: RigidTransform) -> Sight:
        """Where the object is near a pose, in the closed hand at X_WG over the first bin."""
        ...


@dc.dataclass(frozen=True)
class PosePickConfig:
    """Settings of the task."""

    # Time that a look with all planning takes on the robot's clock [s]; the arm waits.
    think_time: float = 0.4
    # Time to the next look after one that told nothing [s]; above 0.
    look_again: float = 0.2
    # Time for the fingers to close and for the grip to settle [s]; above 0.
    close_time: float = 0.8
    # Time to come to rest before the fingers let go [s]; 0 or more.
    settle_time: float = 0.3
    # Time for the fingers to let go [s]; above 0.
    open_time: float = 0.4
    # A closed hand narrower than this holds nothing [m]; above 0.
    empty_width: float = 0.015
    # Grasps with lower scores may let the object slip; it is rather laid down first and looked at
    # again.
    good_grasp: float = 0.5
    # Height above the floor at which the object is let go [m]; 0 or more.
    release_height: float = 0.001
    # Looks in a row that tell nothing after which the task gives up; 1 or more.
    max_looks: int = 6
    # Attempts to move the object after which the task gives up; 1 or more.
    max_attempts: int = 8
    # The check accepts the object within this of its goal [m]; above 0.
    position_tolerance: float = 0.02
    # The check accepts the object upright within this angle [rad]; above 0.
    upright_tolerance: float = float(np.deg2rad(5))


@dc.dataclass(frozen=True)
class KnownShape:
    """What the task knows of the object.

    Attributes:
        cloud_O: its surface as points with normals, in O, z_O being upward when it stands.
        half_extent: half its size along its axes (3,) [m].
        symmetries: rotations of O that leave its shape as it is, the identity among them.
    """

    cloud_O: PointCloud
    half_extent: np.ndarray
    symmetries: Sequence[RotationMatrix]


@dc.dataclass(frozen=True)
class Look:
    """One look.

    Attributes:
        time: when, in simulated seconds.
        sight: what it told.
        plan_wall: wall seconds of planning what to do about it.
        plan: that, in words.
    """

    time: float
    sight: Sight
    plan_wall: float = 0.0
    plan: str = ""


@dc.dataclass(frozen=True)
class Memory:
    """What the task remembers.

    Attributes:
        q: where the arm will be when the motion under way has ended (n,).
        looks: all looks so far.
        blind: number of looks in a row that told nothing.
        attempts: how often the object was to be moved.
        transfer: the one under way.
        to_goal: whether that ends at the goal.
        avoid: grasps X_OG that failed.
        failures: what went wrong, in words.
        finished: why the task ended ("" while it goes on).
        placed: whether the last check accepted the object.
    """

    q: np.ndarray
    looks: tuple[Look, ...] = ()
    blind: int = 0
    attempts: int = 0
    transfer: Transfer | None = None
    to_goal: bool = False
    avoid: tuple[RigidTransform, ...] = ()
    failures: tuple[str, ...] = ()
    finished: str = ""
    placed: bool = False


class PosePick:
    """States: look, pick, lift, carry, lower, release; nudge, back; done."""

    def __init__(
        self,
        arm: ArmModel,
        planner: TransferPlanner,
        finder: Finder,
        shape: KnownShape,
        pick_bin: BinGeometry,
        X_WGoal: RigidTransform,
        gripper: ParallelGripper,
        *,
        seed: int,
        config: PosePickConfig | None = None,
    ) -> None:
        """Makes the task.

        Args:
            arm: kinematics and collision geometry of the arm, the hand and the fixed things.
            planner: plans transfers of the object.
            finder: finds it.
            shape: what is known of it.
            pick_bin: the bin that it is in.
            X_WGoal: the upright pose that it is to have, on the floor of the second bin.
            gripper: shape of the hand.
            seed: of every random choice.
            config: settings; ``PosePickConfig()`` if None.
        """
        self.config = config or PosePickConfig()
        self._arm, self._planner, self._finder, self._shape = arm, planner, finder, shape
        self._pick_bin, self._gripper, self._seed = pick_bin, gripper, seed
        up = RigidTransform([0.0, 0.0, self.config.release_height])
        self._X_WGoal = X_WGoal
        self._goals = [up @ X_WGoal @ RigidTransform(R) for R in shape.symmetries]

    def start(self) -> Decision:
        """Stands at home and looks."""
        return Decision("look", Memory(self._arm.q_default))

    def decide(
        self, state: str, memory: Memory, *, time: float, motion_done: bool, senses: Senses
    ) -> Decision | None:
        """See :class:`~prehensile.behavior.state_machine.Task`."""
        transfer, config = memory.transfer, self.config
        holding = senses.width > config.empty_width
        if state == "carry" and transfer is not None and not holding:
            return self._drop(memory, senses, "the object fell on the way")
        if not motion_done:
            return None
        if state == "look" or transfer is None:
            return self._look(memory, time, senses)
        if state == "pick" and holding:
            return self._move("lift", memory, transfer.lift, config.settle_time)
        if state == "pick":
            memory = dc.replace(memory, avoid=(*memory.avoid, transfer.grasp.X_OG))
            return self._drop(memory, senses, "the fingers closed on nothing")
        if state == "lift" and holding and memory.to_goal:
            return self._inspect(memory, transfer, time, senses)
        if state == "lift" and holding:
            return self._move("carry", memory, transfer.carry)
        if state == "lift":
            memory = dc.replace(memory, avoid=(*memory.avoid, transfer.grasp.X_OG))
            return self._drop(memory, senses, "the object slipped while it was lifted")
        if state == "carry":
            return self._move("lower", memory, transfer.lower, config.settle_time)
        if state == "lower":
            width = transfer.release_width
            home = transfer.home
            motion = SegmentPlayer(
                [
                    Segment.wait(memory.q, width, config.open_time),
                    Segment.move(transfer.retreat, width),
                    Segment.move(home, self._gripper.max_width, settle=0.1),
                ]
            )
            return Decision("release", dc.replace(memory, q=home.q_end), motion)
        # Released, and home.
        memory = dc.replace(memory, transfer=None)
        if not memory.to_goal:
            return self._look(memory, time, senses)
        return self._check(memory, time, senses)

    def _move(self, state: str, memory: Memory, motion, settle: float = 0.0) -> Decision:
        """Moves with the hand closed."""
        memory = dc.replace(memory, q=motion.q_end)
        return Decision(state, memory, SegmentPlayer([Segment.move(motion, 0.0, settle=settle)]))

    def _done(self, memory: Memory, reason: str) -> Decision:
        return Decision("done", dc.replace(memory, finished=reason), finished=True)

    def _drop(self, memory: Memory, senses: Senses, reason: str) -> Decision:
        """Nothing is in the hand: goes home, opening it, to look again."""
        memory = dc.replace(memory, transfer=None, failures=(*memory.failures, reason))
        rng = np.random.default_rng([self._seed, memory.attempts, 1])
        q = np.array(senses.q)
        width = self._gripper.max_width
        segments = [Segment.wait(q, width, self.config.open_time)]
        self._arm.set_hand_width(width)
        home = plan_move(self._arm, q, self._arm.q_default, rng=rng).motion
        if home is not None:
            segments.append(Segment.move(home, width, settle=0.1))
            q = home.q_end
        return Decision("back", dc.replace(memory, q=q), SegmentPlayer(segments))

    def _look(self, memory: Memory, now: float, senses: Senses) -> Decision:
        """Finds the object and plans what to do with it; the arm waits meanwhile."""
        config = self.config
        if memory.attempts >= config.max_attempts:
            return self._done(memory, f"gave up after {memory.attempts} attempts")
        sight = self._finder.find(senses)
        seen = time.perf_counter()
        look = Look(now, sight)
        if sight.X_WO is None or sight.reason:
            memory = dc.replace(memory, looks=(*memory.looks, look), blind=memory.blind + 1)
            if memory.blind >= config.max_looks:
                return self._done(memory, f"the object is not found: {sight.reason}")
            wait = Segment.wait(memory.q, self._gripper.max_width, config.look_again)
            return Decision("look", memory, SegmentPlayer([wait]))
        memory = dc.replace(memory, blind=0, attempts=memory.attempts + 1)
        rng = np.random.default_rng([self._seed, memory.attempts])
        decision, what = self._act(memory, sight.X_WO, rng)
        look = dc.replace(look, plan_wall=time.perf_counter() - seen, plan=what)
        looks = (*decision.memory.looks, look)
        return dc.replace(decision, memory=dc.replace(decision.memory, looks=looks))

    def _act(
        self, memory: Memory, X_WO: RigidTransform, rng: np.random.Generator
    ) -> tuple[Decision, str]:
        """Takes the object to its goal, or else lays it into the open, or else nudges it."""
        config = self.config
        planner, avoid = self._planner, memory.avoid
        plan = planner.plan(
            memory.q, X_WO, self._goals, rng, min_score=config.good_grasp, avoid=avoid
        )
        what, to_goal, reason = "to the goal", True, plan.reason
        if plan.transfer is None:
            center = self._pick_bin.X_WB.translation().copy()
            center[2] = self._pick_bin.floor_height + config.release_height
            lying = [
                X
                for X in lying_poses(center, float(self._shape.half_extent[0]), rng)
                if planner.has_grasp(X, self._goals)
            ]
            plan = planner.plan(memory.q, X_WO, lying, rng, avoid=avoid)
            what, to_goal = f"laid down first: {reason}", False
        if plan.transfer is None:
            plan = planner.plan(memory.q, X_WO, self._goals, rng, avoid=avoid)
            what, to_goal = "to the goal by a poor grasp", True
        transfer = plan.transfer
        if transfer is None:
            return self._nudge(memory, X_WO, rng, plan.reason)
        grasp = transfer.grasp
        motion = SegmentPlayer(
            [
                Segment.wait(memory.q, grasp.width, config.think_time),
                Segment.move(transfer.approach, grasp.width, settle=0.1),
                Segment.wait(transfer.approach.q_end, 0.0, config.close_time),
            ]
        )
        memory = dc.replace(memory, transfer=transfer, to_goal=to_goal, q=transfer.approach.q_end)
        return Decision("pick", memory, motion), what

    def _inspect(self, memory: Memory, transfer: Transfer, now: float, senses: Senses) -> Decision:
        """Looks how the hand holds the object, and plans the rest for that.

        Closing fingers move what they close on. Where the look tells nothing, or nothing that can
        be, the plan stays as it is.
        """
        X_WG = self._arm.pose(senses.q)
        X_WGuess = X_WG @ transfer.X_OG.inverse()
        sight = self._finder.in_hand(senses, X_WGuess, X_WG)
        seen = time.perf_counter()
        what = "held as planned"
        if sight.X_WO is not None and not sight.reason:
            rng = np.random.default_rng([self._seed, memory.attempts, 2])
            X_OG = sight.X_WO.inverse() @ X_WG
            rest = self._planner.plan_rest(memory.q, transfer, X_OG, self._goals, rng)
            if rest is not None:
                transfer, what = rest, "held as seen"
        look = Look(now, sight, time.perf_counter() - seen, what)
        memory = dc.replace(
            memory, transfer=transfer, q=transfer.carry.q_end, looks=(*memory.looks, look)
        )
        wait = Segment.wait(transfer.lift.q_end, 0.0, self.config.think_time)
        return Decision("carry", memory, SegmentPlayer([wait, Segment.move(transfer.carry, 0.0)]))

    def _nudge(
        self, memory: Memory, X_WO: RigidTransform, rng: np.random.Generator, reason: str
    ) -> tuple[Decision, str]:
        """No grasp as it lies: drags it toward the middle of the bin."""
        config, width = self.config, self._gripper.max_width
        memory = dc.replace(memory, failures=(*memory.failures, f"no grasp: {reason}"), avoid=())
        cloud = self._shape.cloud_O.transformed(X_WO)
        segments = np.zeros(len(cloud), dtype=np.int64)
        nudge = plan_nudge(
            self._arm,
            memory.q,
            cloud,
            segments,
            self._pick_bin,
            self._gripper,
            rng,
            lift_height=0.2,
        )
        if nudge is None:
            wait = Segment.wait(memory.q, width, config.look_again)
            return Decision("look", memory, SegmentPlayer([wait])), f"nothing: {reason}"
        motions = [nudge.approach, nudge.drag, nudge.lift]
        played = [Segment.wait(memory.q, 0.0, config.think_time)]
        played += [Segment.move(motion, 0.0) for motion in motions]
        q = nudge.lift.q_end
        home = plan_move(self._arm, q, self._arm.q_default, rng=rng).motion
        if home is not None:
            played.append(Segment.move(home, width, settle=0.1))
            q = home.q_end
        return Decision("nudge", dc.replace(memory, q=q), SegmentPlayer(played)), "nudged"

    def _check(self, memory: Memory, now: float, senses: Senses) -> Decision:
        """Looks whether the object stands where it should."""
        config = self.config
        sight = self._finder.check(senses, self._X_WGoal)
        look = Look(now, sight, plan="check")
        memory = dc.replace(memory, looks=(*memory.looks, look))
        if sight.X_WO is not None:
            distance, tilt = placement_error(sight.X_WO, self._X_WGoal)
            if distance <= config.position_tolerance and tilt <= config.upright_tolerance:
                memory = dc.replace(memory, placed=True)
                return self._done(memory, "the object stands where it should")
            said = f"it is {1e3 * distance:.0f} mm off and tilted by {np.rad2deg(tilt):.0f} degrees"
            return self._done(memory, f"the check refuses: {said}")
        # Not there: it fell on the way, perhaps back into the first bin.
        failures = (*memory.failures, f"not at its goal: {sight.reason}")
        memory = dc.replace(memory, failures=failures)
        wait = Segment.wait(memory.q, self._gripper.max_width, config.look_again)
        return Decision("look", memory, SegmentPlayer([wait]))


def placement_error(X_WO: RigidTransform, X_WGoal: RigidTransform) -> tuple[float, float]:
    """Distance of the origins [m] and angle between the upward axes [rad]."""
    distance = np.linalg.norm(X_WO.translation() - X_WGoal.translation())
    cosine = X_WO.rotation().matrix()[:, 2] @ X_WGoal.rotation().matrix()[:, 2]
    return float(distance), float(np.arccos(np.clip(cosine, -1.0, 1.0)))
