"""Running pick and place on the shipped scenario: the simulation, the report, the demonstration."""

import dataclasses as dc
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import Box, Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.behavior.state_machine import StateMachine
from prehensile.files import write_json
from prehensile.planning.arm import ArmModel
from prehensile.station.build import build
from prehensile.station.robot_plant import make_robot_diagram
from prehensile.station.scenario_file import load_scenario
from prehensile.tasks.pick_place import (
    BODY_POSES,
    BRICK_SIZE,
    OPEN_WIDTH,
    PickPlace,
    Trip,
    choose_poses,
    plan_pick_place,
)

POSITION_TOLERANCE = 0.01  # m, of the brick
ANGLE_TOLERANCE = math.radians(3.0)

_AFLOAT = 0.01  # m over the table from which the brick counts as hanging in the air
_STEP = 0.1  # simulated seconds between two looks at the clock, the display and Ctrl-C


@dc.dataclass(frozen=True)
class PickPlaceReport:
    """Result of pick and place, one trip or many.

    Attributes:
        seed: seed of the start, the goal and every choice.
        reason: what went wrong, in words ("" if nothing did).
        trips: how each trip ended.
        plan_time: wall seconds of planning the first trip.
        sim_time: simulated seconds.
        wall_time: wall seconds that these took.
        interrupted: the user stopped it.
    """

    seed: int
    reason: str
    trips: tuple[Trip, ...]
    plan_time: float
    sim_time: float
    wall_time: float
    interrupted: bool = False

    def worst(self, of_gripper: bool = False) -> tuple[float, float]:
        """Greatest distance (m) and angle (rad) from the goal over all trips; nan without any.

        Args:
            of_gripper: of the hand where it lets go, instead of the brick where it ends.
        """
        errors = [trip.gripper_error if of_gripper else trip.error for trip in self.trips]
        if not errors:
            return math.nan, math.nan
        return max(distance for distance, _ in errors), max(angle for _, angle in errors)

    @property
    def success(self) -> bool:
        """Whether the brick ended within 1 cm and 3 degrees of its goal each time."""
        distance, angle = self.worst()
        near = distance <= POSITION_TOLERANCE and angle <= ANGLE_TOLERANCE
        return near and not self.reason

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per wall second (nan if nothing was simulated)."""
        return self.sim_time / self.wall_time if self.wall_time > 0.0 else math.nan

    def to_json(self) -> dict[str, Any]:
        """The report as plain JSON values, NaN as null."""

        def number(value: float) -> float | None:
            return value if math.isfinite(value) else None

        def millimetres_and_degrees(error: tuple[float, float]) -> dict[str, float | None]:
            return {"mm": number(1e3 * error[0]), "deg": number(math.degrees(error[1]))}

        return {
            "task": "pick-place",
            "seed": self.seed,
            "success": self.success,
            "reason": self.reason,
            "interrupted": self.interrupted,
            "worst_brick_error": millimetres_and_degrees(self.worst()),
            "worst_gripper_error": millimetres_and_degrees(self.worst(of_gripper=True)),
            "plan_time": self.plan_time,
            "sim_time": self.sim_time,
            "wall_time": self.wall_time,
            "realtime_factor": number(self.realtime_factor),
            "trips": [
                {
                    "duration": trip.duration,
                    "brick_error": millimetres_and_degrees(trip.error),
                    "gripper_error": millimetres_and_degrees(trip.gripper_error),
                    "X_WStart": trip.X_WStart.GetAsMatrix4().tolist(),
                    "X_WGoal": trip.X_WGoal.GetAsMatrix4().tolist(),
                    "X_WEnd": trip.X_WEnd.GetAsMatrix4().tolist(),
                }
                for trip in self.trips
            ],
        }


def _height(X_WBrick: RigidTransform) -> float:
    """Height of the brick's lowest corner over the table in m."""
    reach = np.abs(X_WBrick.rotation().matrix()[2]) @ BRICK_SIZE
    return float(X_WBrick.translation()[2] - 0.5 * reach)


def run_pick_place(
    X_WStart: RigidTransform,
    X_WGoal: RigidTransform,
    *,
    trips: int = 1,
    seed: int = 0,
    meshcat: Meshcat | None = None,
    realtime_rate: float = 0.0,
    before_start: Callable[[], None] = lambda: None,
) -> PickPlaceReport:
    """Simulates pick and place on the shipped scenario ``pick_brick``.

    The first trip, and the way back if there is one, are planned before anything moves: what cannot
    be done is refused with its reason, and nothing is simulated. Later trips are planned when
    their turn comes, from where the brick then is.

    Args:
        X_WStart: pose of the brick, on the table (z = 0).
        X_WGoal: pose that it is to have, likewise.
        trips: how often it is carried: to the goal, back to the start, to the goal ...
        seed: of every random choice.
        meshcat: where to show it; nothing is shown if None.
        realtime_rate: simulated seconds per wall second to hold to; 0 is as fast as it goes.
        before_start: called when everything is in its place and about to move.

    Returns:
        The report; Ctrl-C ends the simulation and leaves the report of what was.

    Raises:
        ValueError: fewer than one trip, or a pose that is not finite.
    """
    if trips < 1:
        raise ValueError(f"trips must be at least 1, not {trips}")
    scenario = load_scenario("pick_brick")
    arm = ArmModel(make_robot_diagram(scenario))
    started = time.perf_counter()
    reason = plan_pick_place(arm, X_WStart, X_WGoal, seed=seed).reason
    for where, X_WBrick in (("start", X_WStart), ("goal", X_WGoal)):
        if not reason and (height := _height(X_WBrick)) > _AFLOAT:
            reason = f"{where}: the brick would hang {1e3 * height:.0f} mm over the table"
    plan_time = time.perf_counter() - started
    if not reason and trips > 1:
        reason = plan_pick_place(arm, X_WGoal, X_WStart, seed=seed + 1).reason
        reason = reason and f"on the way back, {reason}"
    if reason:
        return PickPlaceReport(seed, reason, (), plan_time, 0.0, 0.0)

    builder = DiagramBuilder()
    station = builder.AddSystem(build(scenario, meshcat=meshcat))
    plant = station.GetSubsystemByName("plant")
    brick = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("foam_brick"))
    goals = [X_WStart if k % 2 else X_WGoal for k in range(trips)]
    machine = builder.AddNamedSystem(
        "pick_place",
        StateMachine(
            PickPlace(arm, goals, brick.index(), seed=seed),
            initial_position=arm.q_default,
            initial_width=OPEN_WIDTH,
            image_ports={BODY_POSES: AbstractValue.Make([RigidTransform()])},
        ),
    )
    for source, target in {
        "iiwa.position_measured": "position_measured",
        "wsg.state_measured": "hand_state",
        "cheat.body_poses": BODY_POSES,
    }.items():
        builder.Connect(station.GetOutputPort(source), machine.GetInputPort(target))
    for source, target in {"position": "iiwa.position", "width": "wsg.position"}.items():
        builder.Connect(machine.GetOutputPort(source), station.GetInputPort(target))
    diagram = builder.Build()

    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    machine_context = machine.GetMyContextFromRoot(context)
    plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(context), brick, X_WStart)
    simulator.set_target_realtime_rate(realtime_rate)
    simulator.Initialize()
    before_start()
    interrupted = False
    started = time.perf_counter()
    try:
        while not machine.status(machine_context).decision.finished:
            simulator.AdvanceTo(context.get_time() + _STEP)
    except KeyboardInterrupt:
        interrupted = True
    memory = machine.status(machine_context).decision.memory
    return PickPlaceReport(
        seed=seed,
        reason="interrupted" if interrupted else memory.reason,
        trips=memory.trips,
        plan_time=plan_time,
        sim_time=context.get_time(),
        wall_time=time.perf_counter() - started,
        interrupted=interrupted,
    )


def run_demo(*, seed: int, trips: int = 1, browser: bool, out: Path) -> PickPlaceReport:
    """The demonstration: a random start and goal, shown, recorded and reported.

    Args:
        seed: of start, goal and every choice.
        trips: how often the brick is carried, there and back by turns.
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
    meshcat.SetObject("goal", Box(*BRICK_SIZE), Rgba(0.2, 0.7, 0.3, 0.35))
    meshcat.SetTransform("goal", X_WGoal)
    recorder = Recorder(meshcat)
    report = run_pick_place(
        X_WStart,
        X_WGoal,
        trips=trips,
        seed=seed,
        meshcat=meshcat,
        realtime_rate=1.0 if browser else 0.0,
        before_start=recorder.start,
    )
    recorder.save(out / "replay.html")
    write_json(out / "report.json", report.to_json())

    def errors(of_gripper: bool) -> str:
        distance, angle = report.worst(of_gripper)
        return f"{1e3 * distance:.1f} mm, {math.degrees(angle):.2f} deg"

    table = Table(title="pick and place", show_header=False)
    table.add_row("brick", "at its goal" if report.success else report.reason or "missed its goal")
    table.add_row("trips", str(len(report.trips)))
    table.add_row("brick from the goal, at worst", errors(of_gripper=False))
    table.add_row("hand from its goal, at worst", errors(of_gripper=True))
    table.add_row("planning the first trip", f"{report.plan_time:.2f} s")
    if report.trips:
        mean = np.mean([trip.duration for trip in report.trips])
        table.add_row("simulated time of a trip", f"{mean:.2f} s")
    table.add_row("wall time", f"{report.wall_time:.2f} s")
    table.add_row("real-time factor", f"{report.realtime_factor:.2f}")
    console.print(table)
    console.print(f"Report and replay are in {out}")
    return report
