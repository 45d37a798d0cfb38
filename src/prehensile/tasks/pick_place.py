"""Pick and place with a known pose: a brick on a table goes to where it is wanted.

The grasp is fixed in the brick's frame, so that everything can be planned before anything moves
(Tedrake, Robotic Manipulation, chapter 3).
"""

import dataclasses as dc
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Box, Meshcat
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.behavior.state_machine import Decision, Senses, StateMachine
from prehensile.behavior.trajectory_player import Segment, SegmentPlayer
from prehensile.files import write_json
from prehensile.kinematics.poses import pose_distance
from prehensile.planning.arm import ArmModel
from prehensile.planning.pick import plan_move, plan_pick, plan_place
from prehensile.station.build import build
from prehensile.station.robot_plant import make_robot_diagram
from prehensile.station.scenario_file import load_scenario

BRICK_SIZE = (0.05, 0.075, 0.05)
"""Size of the foam brick along its axes, in m."""

# Closing along the brick's short side x, coming from above, finger tips past its middle.
X_BrickG = RigidTransform(RotationMatrix.MakeXRotation(-0.5 * np.pi), [0.0, 0.0, 0.11])

POSITION_TOLERANCE = 0.01  # m
ANGLE_TOLERANCE = math.radians(3.0)

_OPEN = 0.1  # m, of the hand before and after
_GRIP_TIME = 0.5  # s for the hand to close or open
_SETTLE_TIME = 0.1  # s for the arm to come to rest before the hand moves
_RELEASE_HEIGHT = 0.002  # m between brick and table when the hand opens
_STEP = 0.1  # simulated seconds between two looks at the clock, the display and Ctrl-C
_REACH = (0.42, 0.65)  # m from the arm's axis within which bricks are picked and placed
_SECTOR = math.radians(55.0)  # to either side of straight ahead
_APART = 0.2  # m between start and goal


@dc.dataclass(frozen=True)
class PickPlaceReport:
    """Result of a pick and place.

    Attributes:
        seed: seed of the start, the goal and every choice.
        reason: what went wrong, in words ("" if nothing did).
        X_WStart: where the brick was.
        X_WGoal: where it was wanted.
        X_WEnd: where it ended.
        position_error: distance from the goal, in m.
        angle_error: angle from the goal, in rad.
        plan_time: wall seconds of planning.
        sim_time: simulated seconds.
        wall_time: wall seconds that these took.
        interrupted: the user stopped it.
    """

    seed: int
    reason: str
    X_WStart: RigidTransform
    X_WGoal: RigidTransform
    X_WEnd: RigidTransform
    plan_time: float
    sim_time: float
    wall_time: float
    interrupted: bool = False

    @property
    def position_error(self) -> float:
        """Distance of the brick from its goal, in m."""
        return pose_distance(self.X_WEnd, self.X_WGoal)[0]

    @property
    def angle_error(self) -> float:
        """Angle of the brick from its goal, in rad."""
        return pose_distance(self.X_WEnd, self.X_WGoal)[1]

    @property
    def success(self) -> bool:
        """Whether the brick lies within 1 cm and 3 degrees of its goal."""
        near = self.position_error <= POSITION_TOLERANCE and self.angle_error <= ANGLE_TOLERANCE
        return near and not self.reason

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per wall second (nan if nothing was simulated)."""
        return self.sim_time / self.wall_time if self.wall_time > 0.0 else math.nan

    def to_json(self) -> dict[str, Any]:
        """The report as plain JSON values, NaN as null."""
        factor = self.realtime_factor
        return {
            "task": "pick-place",
            "seed": self.seed,
            "success": self.success,
            "reason": self.reason,
            "interrupted": self.interrupted,
            "position_error_mm": 1e3 * self.position_error,
            "angle_error_deg": math.degrees(self.angle_error),
            "plan_time": self.plan_time,
            "sim_time": self.sim_time,
            "wall_time": self.wall_time,
            "realtime_factor": factor if math.isfinite(factor) else None,
            "X_WStart": self.X_WStart.GetAsMatrix4().tolist(),
            "X_WGoal": self.X_WGoal.GetAsMatrix4().tolist(),
            "X_WEnd": self.X_WEnd.GetAsMatrix4().tolist(),
        }


def plan_pick_place(
    arm: ArmModel, X_WStart: RigidTransform, X_WGoal: RigidTransform, *, seed: int = 0
) -> tuple[SegmentPlayer | None, str]:
    """Plans the whole sequence: to the brick, grasp, lift, carry, release, back to the default.

    Args:
        arm: the arm at a table, the brick not among its surroundings.
        X_WStart: pose of the brick.
        X_WGoal: pose that it is to have.
        seed: of every random choice.

    Returns:
        The sequence, or None and the reason.
    """
    rng = np.random.default_rng(seed)
    home = arm.q_default
    arm.set_hand_width(_OPEN)
    pick = plan_pick(arm, home, [X_WStart @ X_BrickG], lift_height=0.15, rng=rng)
    if pick.approach is None or pick.lift is None or pick.X_WG is None:
        return None, f"picking: {pick.reason}"
    X_GBrick = pick.X_WG.inverse() @ X_WStart  # as held: fingers may have been exchanged
    X_WRelease = RigidTransform([0.0, 0.0, _RELEASE_HEIGHT]) @ X_WGoal @ X_GBrick.inverse()
    # The brick starts and ends next to the table; what is kept clear is a little smaller.
    held = Box(*(np.array(BRICK_SIZE) - 0.002)), X_GBrick
    place = plan_place(arm, pick.lift.q_end, [X_WRelease], held=held, flip=False, rng=rng)
    if place.carry is None or place.retreat is None:
        return None, f"placing: {place.reason}"
    back = plan_move(arm, place.retreat.q_end, home, rng=rng)
    if back.motion is None:
        return None, f"going back: {back.reason}"
    grasp, drop = pick.approach.q_end, place.carry.q_end
    segments = [
        Segment.move(pick.approach, _OPEN, settle=_SETTLE_TIME),
        Segment.wait(grasp, 0.0, _GRIP_TIME),
        Segment.move(pick.lift, 0.0),
        Segment.move(place.carry, 0.0, settle=_SETTLE_TIME),
        Segment.wait(drop, _OPEN, _GRIP_TIME),
        Segment.move(place.retreat, _OPEN),
        Segment.move(back.motion, _OPEN),
    ]
    return SegmentPlayer(segments), ""


def choose_poses(seed: int) -> tuple[RigidTransform, RigidTransform]:
    """A start and a goal for the brick on the table in front of the arm, well apart."""
    rng = np.random.default_rng(seed)

    def pose() -> RigidTransform:
        radius, angle = rng.uniform(*_REACH), rng.uniform(-_SECTOR, _SECTOR)
        p = [radius * math.cos(angle), radius * math.sin(angle), 0.5 * BRICK_SIZE[2]]
        return RigidTransform(RotationMatrix.MakeZRotation(rng.uniform(-np.pi, np.pi)), p)

    X_WStart, X_WGoal = pose(), pose()
    while pose_distance(X_WStart, X_WGoal)[0] < _APART:
        X_WGoal = pose()
    return X_WStart, X_WGoal


def run_pick_place(
    X_WStart: RigidTransform,
    X_WGoal: RigidTransform,
    *,
    seed: int = 0,
    meshcat: Meshcat | None = None,
    realtime_rate: float = 0.0,
    before_start: Callable[[], None] = lambda: None,
) -> PickPlaceReport:
    """Simulates one pick and place on the shipped scenario ``pick_brick``.

    Args:
        X_WStart: pose of the brick, known to the planner.
        X_WGoal: pose that it is to have.
        seed: of every random choice.
        meshcat: where to show it; nothing is shown if None.
        realtime_rate: simulated seconds per wall second to hold to; 0 is as fast as it goes.
        before_start: called when everything is in its place and about to move.

    Returns:
        The report; Ctrl-C ends the simulation and leaves the report of what was.
    """
    scenario = load_scenario("pick_brick")
    arm = ArmModel(make_robot_diagram(scenario))
    started = time.perf_counter()
    sequence, reason = plan_pick_place(arm, X_WStart, X_WGoal, seed=seed)
    plan_time = time.perf_counter() - started

    builder = DiagramBuilder()
    station = builder.AddSystem(build(scenario, meshcat=meshcat))
    machine = builder.AddNamedSystem(
        "pick_place",
        StateMachine(
            _PlayOnce(sequence),
            initial_position=arm.q_default,
            initial_width=_OPEN,
            image_ports={},
        ),
    )
    for source, target in {
        "iiwa.position_measured": "position_measured",
        "wsg.state_measured": "hand_state",
    }.items():
        builder.Connect(station.GetOutputPort(source), machine.GetInputPort(target))
    for source, target in {"position": "iiwa.position", "width": "wsg.position"}.items():
        builder.Connect(machine.GetOutputPort(source), station.GetInputPort(target))
    diagram = builder.Build()

    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    plant = station.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    brick = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("foam_brick"))
    plant.SetFreeBodyPose(plant_context, brick, X_WStart)
    simulator.set_target_realtime_rate(realtime_rate)
    simulator.Initialize()
    before_start()
    interrupted = False
    duration = sequence.duration if sequence is not None else 0.0
    started = time.perf_counter()
    try:
        while context.get_time() < duration:
            simulator.AdvanceTo(min(duration, context.get_time() + _STEP))
    except KeyboardInterrupt:
        interrupted, reason = True, "interrupted"
    return PickPlaceReport(
        seed=seed,
        reason=reason,
        X_WStart=X_WStart,
        X_WGoal=X_WGoal,
        X_WEnd=plant.EvalBodyPoseInWorld(plant_context, brick),
        plan_time=plan_time,
        sim_time=context.get_time(),
        wall_time=time.perf_counter() - started,
        interrupted=interrupted,
    )


def run_demo(*, seed: int, browser: bool, out: Path) -> PickPlaceReport:
    """The demonstration: a random start and goal, shown, recorded and reported.

    Args:
        seed: of start, goal and every choice.
        browser: open the page, and hold to real time.
        out: folder of ``report.json`` and ``replay.html``.
    """
    from rich.console import Console
    from rich.table import Table

    from prehensile.viz.meshcat import start_meshcat
    from prehensile.viz.replay import Recorder

    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    meshcat = start_meshcat(open_browser=browser)
    console.print(f"Watch at {meshcat.web_url()}")
    X_WStart, X_WGoal = choose_poses(seed)
    _show_goal(meshcat, X_WGoal)
    recorder = Recorder(meshcat)
    report = run_pick_place(
        X_WStart,
        X_WGoal,
        seed=seed,
        meshcat=meshcat,
        realtime_rate=1.0 if browser else 0.0,
        before_start=recorder.start,
    )
    recorder.save(out / "replay.html")
    write_json(out / "report.json", report.to_json())

    table = Table(title="pick and place", show_header=False)
    table.add_row("brick", "at its goal" if report.success else report.reason or "missed its goal")
    table.add_row("distance from the goal", f"{1e3 * report.position_error:.1f} mm")
    table.add_row("angle from the goal", f"{math.degrees(report.angle_error):.2f} deg")
    table.add_row("planning", f"{report.plan_time:.2f} s")
    table.add_row("simulated time", f"{report.sim_time:.2f} s")
    table.add_row("wall time", f"{report.wall_time:.2f} s")
    table.add_row("real-time factor", f"{report.realtime_factor:.2f}")
    console.print(table)
    console.print(f"Report and replay are in {out}")
    return report


def _show_goal(meshcat: Meshcat, X_WGoal: RigidTransform) -> None:
    from pydrake.geometry import Rgba

    meshcat.SetObject("goal", Box(*BRICK_SIZE), Rgba(0.2, 0.7, 0.3, 0.35))
    meshcat.SetTransform("goal", X_WGoal)


class _PlayOnce:
    """A task with one motion, or none."""

    def __init__(self, motion: SegmentPlayer | None) -> None:
        self._motion = motion

    def start(self) -> Decision:
        return Decision("play", None, self._motion)

    def decide(
        self, state: str, memory: Any, *, time: float, motion_done: bool, senses: Senses
    ) -> Decision | None:
        return Decision("done", None, finished=True) if motion_done else None
