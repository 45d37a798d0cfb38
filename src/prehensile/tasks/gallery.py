"""The gallery: robots that hold still and follow, each under a controller, and what that gives.

A demonstration is a scenario and a track for each robot; :func:`run` simulates it, and measures
how well the tracks are followed and whether every joint limit was kept.
"""

import dataclasses as dc
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import Trajectory

from prehensile.files import write_atomic, write_json
from prehensile.station.build import build
from prehensile.station.guard import GuardStatus
from prehensile.station.scenario import Scenario
from prehensile.tasks.gallery_motions import HOLD

TOLERANCE = 0.1
"""Greatest error (rad or m) with which a track counts as followed."""

_STEP = 0.01  # s between two samples of what the robots do
_MARGIN = 1e-3  # rad, m, rad/s or m/s by which a limit may be missed in contact with it
_TAIL = 0.5  # s after the last track has ended


@dc.dataclass(frozen=True)
class Track:
    """What one robot of a station is to do.

    Attributes:
        model: name of the robot.
        trajectory: values for the port ``MODEL.position`` over time; it begins where the robot is.
        start: when the motion begins, in s; until then the robot holds still.
        measured: port whose first values are those commanded, ``MODEL.measured``.
    """

    model: str
    trajectory: Trajectory
    start: float = HOLD
    measured: str = "position_measured"

    def value(self, t: float) -> NDArray[np.float64]:
        """The command at a time, held before the start and after the end."""
        t = min(max(t, self.trajectory.start_time()), self.trajectory.end_time())
        return self.trajectory.value(t).ravel()


@dc.dataclass(frozen=True)
class Followed:
    """How a robot followed its track.

    Attributes:
        model: name of the robot.
        joints: number of values that were commanded.
        hold_error: greatest distance of a joint from its command while it was to hold still, in
            rad or m.
        follow_error: the same while it moved.
        end_error: the same at the end.
        speed: greatest speed of a joint as a part of its limit; 0 if the model states none.
        effort: greatest effort of a joint as a part of its limit.
        outside: how far a joint was out of its range, in rad or m; 0 if never.
        guard: the worst that the guard did with a command (name of a ``GuardStatus``).
        finite: whether every position and velocity was a number.
    """

    model: str
    joints: int
    hold_error: float
    follow_error: float
    end_error: float
    speed: float
    effort: float
    outside: float
    guard: str
    finite: bool

    @property
    def limits_kept(self) -> bool:
        """Whether every joint stayed within its position, velocity and effort limits."""
        within = self.outside <= _MARGIN and max(self.speed, self.effort) <= 1.0 + _MARGIN
        return self.finite and within

    @property
    def success(self) -> bool:
        """Whether the track was followed within :data:`TOLERANCE` and the limits."""
        error = max(self.hold_error, self.follow_error, self.end_error)
        return self.limits_kept and error <= TOLERANCE


@dc.dataclass(frozen=True)
class GalleryReport:
    """Result of a demonstration of the gallery.

    Attributes:
        demo: its name.
        controller: kind of controller of the arms, or what the scenario says.
        robots: how each robot did.
        still: names of those that have nothing to move.
        measures: further figures, by name with unit.
        sim_time: simulated seconds.
        wall_time: wall seconds that these took.
        interrupted: the user stopped it.
    """

    demo: str
    controller: str
    robots: tuple[Followed, ...]
    still: tuple[str, ...] = ()
    measures: Mapping[str, float] = dc.field(default_factory=dict)
    sim_time: float = 0.0
    wall_time: float = 0.0
    interrupted: bool = False

    @property
    def success(self) -> bool:
        """Whether every robot followed its track within the limits."""
        return not self.interrupted and all(robot.success for robot in self.robots)

    def to_json(self) -> dict[str, Any]:
        """The report as plain JSON values, NaN as null."""
        robots = [
            {**dc.asdict(r), "limits_kept": r.limits_kept, "success": r.success}
            for r in self.robots
        ]
        plain = {**dc.asdict(self), "robots": robots, "success": self.success, "task": "gallery"}
        return _finite(plain)


@dc.dataclass(frozen=True)
class Show:
    """A demonstration: a scene, what moves in it, and where it is watched from.

    Attributes:
        scenario: the scene.
        tracks: what the robots do.
        eye: (3,) p_WC where it is watched from, in m.
        target: (3,) p_WT of what is in the middle, in m.
        still: names of robots that have nothing to move.
        controller: for the report.
        text: YAML of the scene if it is none that ships, to be kept beside the report.
        measure: figures by name with unit of the present state, each kept at its greatest.
    """

    scenario: Scenario
    tracks: Sequence[Track]
    eye: Sequence[float]
    target: Sequence[float]
    still: Sequence[str] = ()
    controller: str = ""
    text: str = ""
    measure: Callable[[MultibodyPlant, Context], Mapping[str, float]] | None = None


def run(
    show: Show,
    demo: str,
    *,
    duration: float | None = None,
    meshcat: Meshcat | None = None,
    realtime_rate: float = 0.0,
    before_start: Callable[[], None] = lambda: None,
) -> GalleryReport:
    """Simulates a demonstration and measures it.

    Args:
        show: the demonstration.
        demo: its name.
        duration: simulated seconds; default: until all tracks have ended.
        meshcat: where to show it; nothing is shown if None.
        realtime_rate: simulated seconds per wall second to hold to; 0 is as fast as it goes.
        before_start: called when everything is in its place and about to move.

    Returns:
        The report; Ctrl-C ends the simulation and leaves the report of what was.
    """
    builder = DiagramBuilder()
    station = builder.AddSystem(build(show.scenario, meshcat=meshcat))
    for track in show.tracks:
        source = builder.AddNamedSystem(f"{track.model}.track", TrajectorySource(track.trajectory))
        builder.Connect(source.get_output_port(), station.GetInputPort(f"{track.model}.position"))
    simulator = Simulator(builder.Build())
    ApplySimulatorConfig(show.scenario.simulator_config, simulator)
    simulator.set_target_realtime_rate(realtime_rate)
    context = simulator.get_context()
    simulator.Initialize()
    before_start()
    end = duration or max(track.trajectory.end_time() for track in show.tracks) + _TAIL
    watches = [_Watch(station, track) for track in show.tracks]
    plant = station.plant()
    measures: dict[str, float] = {}
    interrupted = False
    started = time.perf_counter()
    try:
        while context.get_time() < end - 1e-9:
            simulator.AdvanceTo(min(end, context.get_time() + _STEP))
            for watch in watches:
                watch.look(context)
            if show.measure is not None:
                now = show.measure(plant, plant.GetMyContextFromRoot(context))
                measures = {
                    name: max(value, measures.get(name, value)) for name, value in now.items()
                }
    except KeyboardInterrupt:
        interrupted = True
    return GalleryReport(
        demo=demo,
        controller=show.controller,
        robots=tuple(watch.result() for watch in watches),
        still=tuple(show.still),
        measures=measures,
        sim_time=context.get_time(),
        wall_time=time.perf_counter() - started,
        interrupted=interrupted,
    )


class _Watch:
    """Looks at one robot from time to time."""

    def __init__(self, station: Diagram, track: Track) -> None:
        self._station, self._track = station, track
        self._plant: MultibodyPlant = station.plant()
        self._instance: ModelInstanceIndex = self._plant.GetModelInstanceByName(track.model)
        plant, instance = self._plant, self._instance
        self._lower = plant.GetPositionsFromArray(instance, plant.GetPositionLowerLimits())
        self._upper = plant.GetPositionsFromArray(instance, plant.GetPositionUpperLimits())
        self._velocity = plant.GetVelocitiesFromArray(instance, plant.GetVelocityUpperLimits())
        self._effort = np.array(
            [
                plant.get_joint_actuator(i).effort_limit()
                for i in plant.GetJointActuatorIndices(instance)
            ]
        )
        self._rows: list[tuple[float, ...]] = []
        self._status = GuardStatus.OK

    def look(self, root: Context) -> None:
        """Notes how the robot does now."""
        t = root.get_time()
        context = self._station.GetMyContextFromRoot(root)
        plant_context = self._plant.GetMyContextFromRoot(root)
        command = self._track.value(t)
        port = self._station.GetOutputPort(f"{self._track.model}.{self._track.measured}")
        q = self._plant.GetPositions(plant_context, self._instance)
        v = self._plant.GetVelocities(plant_context, self._instance)
        effort = self._plant.get_net_actuation_output_port(self._instance).Eval(plant_context)
        outside = np.maximum(self._lower - q, q - self._upper)
        self._rows.append(
            (
                t,
                float(np.max(np.abs(port.Eval(context)[: len(command)] - command))),
                float(np.max(np.abs(v) / self._velocity)),
                float(np.max(np.abs(effort) / self._effort)),
                float(np.max(outside, initial=0.0)),
            )
        )
        status = self._station.GetOutputPort(f"{self._track.model}.guard_status").Eval(context)
        self._status = max(self._status, GuardStatus(int(status[0])))

    def result(self) -> Followed:
        """What was seen."""
        rows = np.array(self._rows).reshape(-1, 5)
        t, error, speed, effort, outside = rows.T
        moving = (t > self._track.start) & (t <= self._track.trajectory.end_time())

        def worst(values: NDArray[np.float64]) -> float:
            return float(np.max(values, initial=0.0))

        return Followed(
            model=self._track.model,
            joints=self._track.trajectory.rows(),
            hold_error=worst(error[t <= self._track.start]),
            follow_error=worst(error[moving]),
            end_error=float(error[-1]) if len(error) else 0.0,
            speed=worst(speed),
            effort=worst(effort),
            outside=worst(outside),
            guard=self._status.name,
            finite=bool(np.isfinite(rows).all()),
        )


def run_demo(show: Show, demo: str, *, browser: bool, out: Path) -> GalleryReport:
    """A demonstration, shown, recorded and reported.

    Args:
        show: the demonstration.
        demo: its name.
        browser: open the page, and hold to real time.
        out: folder of ``report.json``, ``replay.html`` and, unless it ships, ``scenario.yaml``.
    """
    from rich.console import Console
    from rich.table import Table

    from prehensile.viz.meshcat import start_meshcat
    from prehensile.viz.replay import Recorder

    console = Console()
    out.mkdir(parents=True, exist_ok=True)
    meshcat = start_meshcat(open_browser=browser)
    meshcat.SetCameraPose(np.array(show.eye), np.array(show.target))
    console.print(f"Watch at {meshcat.web_url()}")
    recorder = Recorder(meshcat)
    report = run(
        show,
        demo,
        meshcat=meshcat,
        realtime_rate=1.0 if browser else 0.0,
        before_start=recorder.start,
    )
    recorder.save(out / "replay.html")
    write_json(out / "report.json", report.to_json())
    if show.text:
        write_atomic(out / "scenario.yaml", show.text)

    title = f"{demo}, {report.controller}; errors in mrad, or mm where joints slide"
    table = Table(title=title, title_justify="left")
    for column in ("robot", "joints", "holds", "follows", "ends", "speed", "effort", "limits"):
        table.add_column(column, justify="left" if column in ("robot", "limits") else "right")
    for r in report.robots:
        errors = (f"{1e3 * e:.2f}" for e in (r.hold_error, r.follow_error, r.end_error))
        # Nothing moves at exactly none of its limit: the model states no limit.
        parts = (f"{100 * part:.0f} %" if part else "-" for part in (r.speed, r.effort))
        kept = "kept" if r.limits_kept else "broken"
        table.add_row(r.model, str(r.joints), *errors, *parts, kept)
    console.print(table)
    for name in report.still:
        console.print(f"{name} has nothing to move")
    for name, value in report.measures.items():
        console.print(f"{name}: {value:.4g}")
    console.print(
        f"Simulated {report.sim_time:.1f} s in {report.wall_time:.1f} s. "
        f"Report and replay are in {out}"
    )
    return report


def _finite(value: Any) -> Any:
    """The same plain values with None for what is no number."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
