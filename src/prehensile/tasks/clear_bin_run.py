"""Clearing a bin in simulation, from the fall of the objects to the report and the replay."""

import dataclasses as dc
import time
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.geometry import Box as BoxShape
from pydrake.geometry import Meshcat, Role
from pydrake.math import RigidTransform
from pydrake.planning import RobotDiagram
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.sensors import CameraConfig, ImageDepth32F

from prehensile.behavior.state_machine import StateMachine
from prehensile.grasping import WSG50
from prehensile.models.registry import list_models
from prehensile.perception import Box, CameraModel
from prehensile.planning.arm import ArmModel
from prehensile.scenes.clutter import (
    BIN_INTERIOR_MAX,
    BIN_INTERIOR_MIN,
    PlacedObject,
    drop_into_bin,
    inside_bin,
    with_objects,
)
from prehensile.station.build import build
from prehensile.station.robot_plant import make_robot_diagram
from prehensile.station.scenario import Scenario
from prehensile.station.scenario_file import load_scenario
from prehensile.tasks.clear_bin import Camera, ClearBin, ClearBinConfig, Memory
from prehensile.tasks.clear_bin_moves import BinGeometry
from prehensile.tasks.report import ClearBinReport, ObjectResult

_STEP = 0.1  # simulated seconds between two looks at the clock, the display and Ctrl-C


class ClearBinRun:
    """A station with clutter in its first bin, and the task that clears it.

    Attributes:
        objects: the clutter, as it lies at the start.
        diagram: the station and the state machine.
    """

    def __init__(
        self,
        models: Sequence[str],
        *,
        seed: int,
        scenario: Scenario | None = None,
        config: ClearBinConfig | None = None,
        meshcat: Meshcat | None = None,
        progress: Callable[[float], None] = lambda fraction: None,
    ) -> None:
        """Drops the objects and builds the station around them.

        Args:
            models: names of the embedded objects, with repetition if wanted.
            seed: seed of the scene and of every choice of the task.
            scenario: a scenario with models ``iiwa``, ``wsg``, ``bin0`` and ``bin1`` and cameras
                over bin0; the shipped ``two_bins`` if None.
            config: settings of the task.
            meshcat: where to show it; nothing is shown if None.
            progress: called with the fraction of the preparation that is done.

        Raises:
            InputError: if a model is unknown or the objects do not stay in the bin.
        """
        scenario = scenario or load_scenario("two_bins")
        world = make_robot_diagram(scenario)
        pick_bin, self._place_bin = (bin_geometry(world, name) for name in ("bin0", "bin1"))
        self._pick_bin = pick_bin
        self.objects = drop_into_bin(
            models,
            pick_bin.X_WB,
            seed=seed,
            plant_config=scenario.plant_config,
            scene_graph_config=scenario.scene_graph_config,
            progress=progress,
        )
        self._seed = seed
        arm = ArmModel(world)
        cameras = [Camera(key, intrinsics(c)) for key, c in scenario.cameras.items()]
        task = ClearBin(arm, cameras, pick_bin, self._place_bin, seed=seed, config=config)
        scenario = dc.replace(scenario, directives=with_objects(scenario.directives, self.objects))
        builder = DiagramBuilder()
        self.station: Diagram = builder.AddSystem(build(scenario, meshcat=meshcat))
        images = {f"{c.name}.depth_image": AbstractValue.Make(ImageDepth32F()) for c in cameras}
        poses = {f"{c.name}.X_WC": AbstractValue.Make(RigidTransform()) for c in cameras}
        self._machine = builder.AddSystem(
            StateMachine(
                task,
                initial_position=arm.q_default,
                initial_width=WSG50.max_width,
                image_ports=images | poses,
            )
        )
        self._machine.set_name("clear_bin")
        for source, target in {
            "iiwa.position_measured": "position_measured",
            "wsg.state_measured": "hand_state",
            **{name: name for name in images | poses},
        }.items():
            builder.Connect(self.station.GetOutputPort(source), self._machine.GetInputPort(target))
        for source, target in {"position": "iiwa.position", "width": "wsg.position"}.items():
            builder.Connect(self._machine.GetOutputPort(source), self.station.GetInputPort(target))
        self.diagram = builder.Build()
        self.cameras = cameras
        self.simulator = Simulator(self.diagram)
        ApplySimulatorConfig(scenario.simulator_config, self.simulator)
        self.simulator.set_target_realtime_rate(0.0)  # as fast as can be
        self._wall = 0.0
        self._cpu = 0.0

    def advance(self) -> bool:
        """Simulates a tenth of a second; returns whether the task goes on."""
        started, cpu_started = time.perf_counter(), time.process_time()
        self.simulator.AdvanceTo(self.time + _STEP)
        self._wall += time.perf_counter() - started
        self._cpu += time.process_time() - cpu_started
        return not self.memory.finished

    @property
    def time(self) -> float:
        """Simulated seconds since the first look."""
        return self.simulator.get_context().get_time()

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per wall second up to now."""
        return self.time / self._wall if self._wall else 0.0

    @property
    def memory(self) -> Memory:
        """What the task remembers now."""
        context = self._machine.GetMyContextFromRoot(self.simulator.get_context())
        return self._machine.status(context).decision.memory

    @property
    def state(self) -> str:
        """Name of the state that the task is in."""
        context = self._machine.GetMyContextFromRoot(self.simulator.get_context())
        return self._machine.status(context).decision.state

    def station_context(self) -> Context:
        """The station's context, to read its ports."""
        return self.station.GetMyContextFromRoot(self.simulator.get_context())

    def report(self, *, interrupted: bool = False) -> ClearBinReport:
        """What has come of it up to now."""
        memory = self.memory
        attempts = memory.attempts
        if memory.pick is not None:
            attempts = (*attempts, dc.replace(memory.pick.attempt, end=self.time))
        return ClearBinReport(
            seed=self._seed,
            finished=memory.finished or ("interrupted" if interrupted else "time is up"),
            interrupted=interrupted,
            attempts=attempts,
            objects=self._results(),
            sim_time=self.time,
            wall_time=self._wall,
            cpu_time=self._cpu,
        )

    def _results(self) -> list[ObjectResult]:
        plant = self.station.GetSubsystemByName("plant")
        context = plant.GetMyContextFromRoot(self.simulator.get_context())

        def place(placed: PlacedObject) -> str:
            body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(placed.name))
            p_WO = plant.EvalBodyPoseInWorld(context, body).translation()
            for name, bin_geometry in (("bin0", self._pick_bin), ("bin1", self._place_bin)):
                if inside_bin(p_WO, bin_geometry.X_WB):
                    return name
            return "elsewhere"

        return [ObjectResult(o.name, o.model, place(o)) for o in self.objects]


def choose_models(count: int, seed: int) -> list[str]:
    """Household objects for a scene: each kind once, in random order, before any comes again."""
    names = [model.name for model in list_models() if model.category == "object"]
    rng = np.random.default_rng([seed, count])
    chosen: list[str] = []
    while len(chosen) < count:
        chosen += [names[i] for i in rng.permutation(len(names))]
    return chosen[:count]


def intrinsics(config: CameraConfig) -> CameraModel:
    """The intrinsics of the depth images of a camera's configuration."""
    _, depth_camera = config.MakeCameras()
    return CameraModel.from_drake(depth_camera.core().intrinsics())


def bin_geometry(world: RobotDiagram, name: str) -> BinGeometry:
    """Pose, interior, floor and walls of one of the station's bins."""
    plant, inspector = world.plant(), world.scene_graph().model_inspector()
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(name))
    context = plant.CreateDefaultContext()
    X_WB = plant.EvalBodyPoseInWorld(context, body)
    frame = plant.GetBodyFrameIdOrThrow(body.index())
    walls = [
        Box(X_WB @ inspector.GetPoseInFrame(geometry), np.array(shape.size()))
        for geometry in inspector.GetGeometries(frame, Role.kProximity)
        if isinstance(shape := inspector.GetShape(geometry), BoxShape)
    ]
    return BinGeometry(X_WB, BIN_INTERIOR_MIN, BIN_INTERIOR_MAX, walls)
