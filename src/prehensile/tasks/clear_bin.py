"""Clearing a bin of objects never met before: look, choose a grasp, pick, carry, release, again.

The task of Tedrake, Robotic Manipulation, chapter 5, as the states of a
:class:`~prehensile.behavior.state_machine.StateMachine`. It knows the arm, the bins and the
calibrated cameras of its station, and of the objects only what the depth images show.
"""

import dataclasses as dc
import time
from collections.abc import Sequence

import numpy as np

from prehensile.behavior.state_machine import Decision, Senses
from prehensile.behavior.trajectory_player import Segment, SegmentPlayer
from prehensile.grasping import (
    WSG50,
    Grasp,
    GraspConfig,
    ParallelGripper,
    select_grasps,
)
from prehensile.perception import CameraModel, PointCloud, PosedCamera, convex_segments, fuse
from prehensile.planning.arm import ArmModel
from prehensile.planning.obstacles import HeightMap
from prehensile.planning.pick import (
    plan_move,
    plan_pick,
)
from prehensile.planning.trajectory import TimedPath
from prehensile.tasks.clear_bin_moves import BinGeometry, held_box, plan_drop, plan_nudge
from prehensile.tasks.report import Attempt


@dc.dataclass(frozen=True)
class ClearBinConfig:
    """Settings of the task."""

    # Time that one look, its choice and its plan take on the robot's clock [s]; the arm waits.
    think_time: float = 0.4
    # Time for the fingers to close and for the grip to settle [s]; above 0.
    close_time: float = 0.7
    # Time for the fingers to let go [s]; above 0.
    open_time: float = 0.3
    # A closed hand narrower than this holds nothing [m]; above 0.
    empty_width: float = 0.004
    # Points left in the bin below which it counts as empty; 1 or more.
    min_points: int = 40
    # Failures in a row after which the task gives up; 1 or more.
    max_failures: int = 8
    # Attempts in all after which the task gives up; 1 or more.
    max_attempts: int = 60
    # Straight line into the grasp [m]; above 0.
    pregrasp_distance: float = 0.08
    # Straight line up out of the bin [m]; above 0.
    lift_height: float = 0.24
    # Around the grasp, what is seen is taken to be lifted with it [m]; 0 or more.
    lifted_radius: float = 0.09
    # Grasps within this distance of one that failed are tried last [m]; 0 or more.
    failed_distance: float = 0.03
    # Height above the floor of the second bin at which the lowest point held is let go [m].
    drop_height: float = 0.08
    # Settings of grasp selection.
    grasp: GraspConfig = dc.field(default_factory=GraspConfig)


@dc.dataclass(frozen=True)
class Camera:
    """A calibrated camera: the prefix of its ports and its intrinsics."""

    name: str
    model: CameraModel


@dc.dataclass(frozen=True)
class Pick:
    """A pick under way: what is known of it so far, and the motions that are left."""

    attempt: Attempt
    lift: TimedPath
    carry: TimedPath


@dc.dataclass(frozen=True)
class Memory:
    """What the task remembers.

    Attributes:
        q: where the arm will be when the motion under way has ended (n,).
        attempts: those that are over.
        pick: the one under way.
        failures: number of failures in a row.
        failed: where grasps failed since the last success, p_WG.
        drops: where things were let go over the second bin, p_WG.
        finished: why the task ended ("" while it goes on).
    """

    q: np.ndarray
    attempts: tuple[Attempt, ...] = ()
    pick: Pick | None = None
    failures: int = 0
    failed: tuple[np.ndarray, ...] = ()
    drops: tuple[np.ndarray, ...] = ()
    finished: str = ""


class ClearBin:
    """States: look, pick, lift, carry, release, retreat, nudge, done."""

    def __init__(
        self,
        arm: ArmModel,
        cameras: Sequence[Camera],
        pick_bin: BinGeometry,
        place_bin: BinGeometry,
        *,
        seed: int,
        config: ClearBinConfig | None = None,
        gripper: ParallelGripper = WSG50,
    ) -> None:
        """Makes the task.

        Args:
            arm: kinematics and collision geometry of the arm, the hand and the fixed things.
            cameras: the cameras that look into the first bin.
            pick_bin: the bin to clear.
            place_bin: the bin to fill.
            seed: seed of every random choice.
            config: settings; ``ClearBinConfig()`` if None.
            gripper: shape of the hand.
        """
        self.config = config or ClearBinConfig()
        self._arm = arm
        self._cameras = cameras
        self._pick_bin = pick_bin
        self._place_bin = place_bin
        self._seed = seed
        self._gripper = gripper
        self._q_home = arm.q_default

    def start(self) -> Decision:
        """Stands at home and looks."""
        return Decision("look", Memory(self._q_home))

    def decide(
        self, state: str, memory: Memory, *, time: float, motion_done: bool, senses: Senses
    ) -> Decision | None:
        """See :class:`~prehensile.behavior.state_machine.Task`."""
        pick = memory.pick
        holding = senses.width > self.config.empty_width
        if state == "carry" and pick is not None and not holding:
            # It fell on the way. Go on to the second bin, where the view of the first is free.
            reason = "the object fell out of the hand"
            return Decision("carry", _settle(memory, pick.attempt, time, "dropped", reason))
        if not motion_done:
            return None
        if state == "look":
            return self._look(memory, time, senses)
        if pick is None:  # after a failure or a nudge
            return self._next(memory)
        if state == "pick" and holding:
            return self._move("lift", memory, pick.lift)
        if state == "pick":
            reason = "the fingers closed on nothing"
            memory = _settle(memory, pick.attempt, time, "empty", reason)
            return self._retreat(memory, pick, lifted=False)
        if state == "lift" and holding:
            return self._move("carry", memory, pick.carry)
        if state == "lift":
            reason = "the object slipped while it was lifted"
            memory = _settle(memory, pick.attempt, time, "dropped", reason)
            return self._retreat(memory, pick, lifted=True)
        if state == "carry":
            return Decision("release", memory, self._open(memory.q, self.config.open_time))
        # Released.
        memory = _settle(memory, pick.attempt, time, "moved", "")
        p_WG = self._arm.pose(memory.q).translation()
        return self._next(dc.replace(memory, drops=(*memory.drops, p_WG)))

    def _move(self, state: str, memory: Memory, motion: TimedPath) -> Decision:
        """Moves with the hand closed."""
        memory = dc.replace(memory, q=motion.q_end)
        return Decision(state, memory, SegmentPlayer([Segment.move(motion, 0.0)]))

    def _open(self, q: np.ndarray, duration: float) -> SegmentPlayer:
        """Waits with the hand wide open."""
        return SegmentPlayer([Segment.wait(q, self._gripper.max_width, duration)])

    def _next(self, memory: Memory, motion: SegmentPlayer | None = None) -> Decision:
        """Looks again, or gives up."""
        config = self.config
        reason = ""
        if memory.failures >= config.max_failures:
            last = memory.attempts[-1]
            reason = f"gave up after {memory.failures} failures in a row, the last: {last.reason}"
        elif len(memory.attempts) >= config.max_attempts:
            reason = f"gave up after {len(memory.attempts)} attempts"
        if reason:
            return Decision("done", dc.replace(memory, finished=reason), motion, finished=True)
        return Decision("look", memory, motion)

    def _look(self, memory: Memory, now: float, senses: Senses) -> Decision:
        """Perceives, chooses and plans one pick; the arm waits `think_time` before it moves."""
        started = time.perf_counter()
        config = self.config
        cloud = self._see(senses)
        if len(cloud) < config.min_points:
            memory = dc.replace(memory, finished="the bin is empty")
            return Decision("done", memory, finished=True)
        number = len(memory.attempts) + 1
        rng = np.random.default_rng([self._seed, number])
        attempt = Attempt(number, now, now, "unfinished", "the run ended", points=len(cloud))

        segments = convex_segments(cloud, config.grasp.voxel_size)
        heights = HeightMap(cloud.points)
        self._arm.set_heights(heights)

        def give_up(outcome: str, reason: str) -> Decision:
            failed = dc.replace(attempt, think_wall=time.perf_counter() - started)
            again = _settle(memory, failed, now, outcome, reason)
            return self._nudge(again, cloud, segments, rng)

        result = select_grasps(
            cloud, self._gripper, self._pick_bin.walls, config.grasp, rng, segments=segments
        )
        if not result.success:
            return give_up("no grasp", result.status.value)
        grasps = self._untried_first(result.grasps, memory.failed)
        attempt = dc.replace(attempt, candidates=len(grasps))
        plan = plan_pick(
            self._arm,
            memory.q,
            [grasp.X_WG for grasp in grasps],
            widths=[grasp.width for grasp in grasps],
            pregrasp_distance=config.pregrasp_distance,
            lift_height=config.lift_height,
            rng=rng,
        )
        if plan.approach is None or plan.lift is None or plan.X_WG is None:
            return give_up("no path", plan.reason)
        grasp = grasps[plan.index]
        p_WPad = plan.X_WG.multiply(self._gripper.p_GPad)
        self._arm.set_heights(heights.cut(p_WPad, config.lifted_radius))
        floor_height = self._pick_bin.floor_height
        held = held_box(cloud, segments, plan.X_WG, grasp.span, self._gripper, floor_height)
        place = plan_drop(
            self._arm,
            plan.lift.q_end,
            held,
            self._place_bin,
            self._gripper,
            config.drop_height,
            memory.drops,
            rng,
        )
        if place.carry is None:
            return give_up("no path", place.reason)
        attempt = dc.replace(
            attempt,
            X_WG=plan.X_WG,
            width=grasp.width,
            score=grasp.score,
            think_wall=time.perf_counter() - started,
        )
        motion = SegmentPlayer(
            [
                Segment.wait(memory.q, grasp.width, config.think_time),
                Segment.move(plan.approach, grasp.width),
                Segment.wait(plan.approach.q_end, 0.0, config.close_time),
            ]
        )
        pick = Pick(attempt, plan.lift, place.carry)
        return Decision("pick", dc.replace(memory, pick=pick, q=plan.approach.q_end), motion)

    def _see(self, senses: Senses) -> PointCloud:
        """What the cameras see in the first bin, without its floor and walls."""
        return fuse(
            [senses.image(f"{c.name}.depth_image").data[:, :, 0] for c in self._cameras],
            [PosedCamera(c.model, senses.image(f"{c.name}.X_WC")) for c in self._cameras],
            self._pick_bin.region(inset=0.003, above_floor=0.005, above_rim=0.1),
            self.config.grasp.voxel_size,
        )

    def _untried_first(self, grasps: Sequence[Grasp], failed: Sequence[np.ndarray]) -> list[Grasp]:
        """The grasps in their order, but those near a recent failure at the end."""

        def tried(grasp: Grasp) -> bool:
            p_WG = grasp.X_WG.translation()
            return any(np.linalg.norm(p_WG - p) < self.config.failed_distance for p in failed)

        return sorted(grasps, key=tried)

    def _nudge(
        self, memory: Memory, cloud: PointCloud, segments: np.ndarray, rng: np.random.Generator
    ) -> Decision:
        """Nothing can be picked as it lies: moves something, then goes home and looks again."""
        config = self.config
        if memory.failures >= config.max_failures:
            return self._next(memory)
        nudge = plan_nudge(
            self._arm,
            memory.q,
            cloud,
            segments,
            self._pick_bin,
            self._gripper,
            rng,
            lift_height=config.lift_height,
        )
        if nudge is None:
            return self._next(memory, self._open(memory.q, config.think_time))
        motions = [nudge.approach, nudge.drag, nudge.lift]
        segments_played = [Segment.wait(memory.q, 0.0, config.think_time)]
        segments_played += [Segment.move(motion, 0.0) for motion in motions]
        home, q = self._go_home(nudge.lift.q_end, rng)
        return Decision("nudge", dc.replace(memory, q=q), SegmentPlayer([*segments_played, home]))

    def _retreat(self, memory: Memory, pick: Pick, *, lifted: bool) -> Decision:
        """Lets go of what may be left, rises out of the bin and goes home, out of the view."""
        width = pick.attempt.width
        segments = []
        if not lifted:
            segments.append(Segment.wait(memory.q, width, self.config.open_time))
            segments.append(Segment.move(pick.lift, width))
        rng = np.random.default_rng([self._seed, len(memory.attempts), 1])
        home, q = self._go_home(pick.lift.q_end, rng)
        return Decision("retreat", dc.replace(memory, q=q), SegmentPlayer([*segments, home]))

    def _go_home(self, q: np.ndarray, rng: np.random.Generator) -> tuple[Segment, np.ndarray]:
        """Home with an open hand, and where that ends: there, or here if there is no way."""
        width = self._gripper.max_width
        home = plan_move(self._arm, q, self._q_home, rng=rng).motion
        if home is None:
            return Segment.wait(q, width, self.config.open_time), q
        return Segment.move(home, width), home.q_end


def _settle(memory: Memory, attempt: Attempt, now: float, outcome: str, reason: str) -> Memory:
    """The attempt is over."""
    attempt = dc.replace(attempt, end=now, outcome=outcome, reason=reason)
    moved = outcome == "moved"
    failed = () if moved else memory.failed
    if not moved and attempt.X_WG is not None:
        failed = (*failed, attempt.X_WG.translation())
    return dc.replace(
        memory,
        attempts=(*memory.attempts, attempt),
        pick=None,
        failures=0 if moved else memory.failures + 1,
        failed=failed,
    )
