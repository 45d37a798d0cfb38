"""Pose-pick in simulation: the scene, the run, and what came of it against the ground truth."""

import dataclasses as dc
import math
import time

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from pydrake.systems.sensors import ImageDepth32F

from prehensile.behavior.state_machine import MachineStatus, Senses, StateMachine
from prehensile.grasping import WSG50
from prehensile.planning.arm import ArmModel
from prehensile.scenes.clutter import PlacedObject, with_objects
from prehensile.station.build import build
from prehensile.station.robot_plant import make_robot_diagram
from prehensile.station.scenario import Scenario
from prehensile.station.scenario_file import load_scenario
from prehensile.tasks.clear_bin_moves import BinGeometry
from prehensile.tasks.clear_bin_run import bin_geometry, intrinsics
from prehensile.tasks.pose_pick import Finder, Look, Memory, PosePick, Sight
from prehensile.tasks.pose_pick_finder import CameraFinder
from prehensile.tasks.pose_pick_moves import TransferPlanner
from prehensile.tasks.pose_pick_object import PreparedObject, prepare_object
from prehensile.tasks.pose_pick_report import PosePickReport, SeenPose, adds
from prehensile.tasks.pose_pick_scene import random_rest_pose

BODY_POSES = "body_poses"
GRIP_FORCE = 80.0  # N, the most that the hand can
GOAL_YAW = math.radians(135.0)
_AT_REST = 0.01  # m/s and rad/s
_FIND, _CHECK = ("camera0", "camera1", "camera2"), ("camera3",)
_STEP = 0.1  # simulated seconds between two looks at the clock, the display and Ctrl-C

# Noise of the three cameras over the first bin, each with a seed of its own; and a fourth camera,
# which checks the second bin.
_OVERLAY = """
depth_noise:
  camera0: { seed: 0 }
  camera1: { seed: 1 }
  camera2: { seed: 2 }
  camera3: { seed: 3 }
cameras:
  camera3:
    name: camera3
    width: 640
    height: 480
    focal: !FocalLength { x: 615.0, y: 615.0 }
    z_near: 0.16
    z_far: 10.0
    depth: true
    X_PB:
      translation: [-0.42, 1.15, 0.75]
      rotation: !Rpy { deg: [-131.34, 0.0, -144.09] }
    renderer_class: !RenderEngineVtkParams { force_to_pbr: true }
"""


class TrueFinder:
    """Knows where the object is without looking; for tests of the rest."""

    def __init__(self, body: int) -> None:
        """Makes it, for the body with an index."""
        self._body = body

    def find(self, senses: Senses) -> Sight:
        """The true pose."""
        return Sight(senses.image(BODY_POSES)[self._body])

    def check(self, senses: Senses, X_WGuess: RigidTransform) -> Sight:
        """The true pose."""
        return self.find(senses)

    def in_hand(self, senses: Senses, X_WGuess: RigidTransform, X_WG: RigidTransform) -> Sight:
        """The true pose."""
        return self.find(senses)


def load_pose_pick_scenario() -> Scenario:
    """The shipped station ``two_bins`` with noisy cameras, and a fourth one over the second bin."""
    return load_scenario("two_bins", data=_OVERLAY)


class PosePickRun:
    """A station with one object in its first bin, and the task that sets it into the second.

    Attributes:
        start: the object as it lies at the start.
        diagram: the station and the state machine.
        cameras: intrinsic matrices K (3, 3) of the cameras over the first bin, by name.
    """

    def __init__(
        self,
        *,
        seed: int,
        X_WGoal: RigidTransform | None = None,
        thing: PreparedObject | None = None,
        cheat: bool = False,
        scenario: Scenario | None = None,
        meshcat: Meshcat | None = None,
    ) -> None:
        """Lets the object settle and builds the station around it.

        Args:
            seed: of the scene, the cameras' noise and every choice of the task.
            X_WGoal: upright pose on the floor of ``bin1`` that the object is to have; in the
                middle, turned by 135 degrees, if None.
            thing: the object, which many runs may share; :func:`prepare_object`'s if None.
            cheat: tell the task the true pose instead of letting it look.
            scenario: a scenario like :func:`load_pose_pick_scenario`'s, which is the default.
            meshcat: where to show it; nothing is shown if None.

        Raises:
            InputError: the object does not stay in the bin.
            ValueError: X_WGoal is not upright on the floor of the second bin.
        """
        scenario = scenario or load_pose_pick_scenario()
        noise = {
            key: dc.replace(config, seed=config.seed + 1000 * seed)
            for key, config in scenario.depth_noise.items()
        }
        scenario = dc.replace(scenario, depth_noise=noise)
        world = make_robot_diagram(scenario)
        pick_bin, place_bin = (bin_geometry(world, name) for name in ("bin0", "bin1"))
        thing = thing or prepare_object()
        model, vertices, shape = thing.model, thing.vertices, thing.shape
        self._seed = seed
        self.start = random_rest_pose(model, vertices, pick_bin.X_WB, scenario, seed=seed)
        placed = PlacedObject(f"{model}_0", model, self.start.X_WO)
        scenario = dc.replace(scenario, directives=with_objects(scenario.directives, [placed]))
        builder = DiagramBuilder()
        self.station: Diagram = builder.AddSystem(build(scenario, meshcat=meshcat))
        plant = self.station.GetSubsystemByName("plant")
        self._plant = plant
        self._body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(placed.name))

        self.X_WGoal = X_WGoal or default_goal(place_bin, vertices)
        check_goal(self.X_WGoal, place_bin, vertices)
        arm = ArmModel(world)
        walls = [*pick_bin.walls, *place_bin.walls]
        planner = TransferPlanner(arm, thing.grasps, vertices, WSG50, walls)
        finder: Finder = TrueFinder(int(self._body.index()))
        if not cheat:
            models = {name: intrinsics(config) for name, config in scenario.cameras.items()}
            finder = CameraFinder(
                thing.known, models, _FIND, _CHECK, pick_bin, place_bin, shape.symmetries, WSG50
            )
        task = PosePick(arm, planner, finder, shape, pick_bin, self.X_WGoal, WSG50, seed=seed)
        self.cameras = {name: intrinsics(scenario.cameras[name]).K for name in _FIND}
        names = list(scenario.cameras)
        inputs = {f"{name}.depth_image": AbstractValue.Make(ImageDepth32F()) for name in names}
        inputs |= {f"{name}.X_WC": AbstractValue.Make(RigidTransform()) for name in names}
        sources = {name: name for name in inputs}
        if cheat:
            inputs[BODY_POSES] = AbstractValue.Make([RigidTransform()])
            sources["cheat.body_poses"] = BODY_POSES
        self._machine = builder.AddNamedSystem(
            "pose_pick",
            StateMachine(
                task,
                initial_position=arm.q_default,
                initial_width=WSG50.max_width,
                image_ports=inputs,
            ),
        )
        force = builder.AddNamedSystem("grip_force", ConstantVectorSource([GRIP_FORCE]))
        builder.Connect(force.get_output_port(), self.station.GetInputPort("wsg.force_limit"))
        sources |= {
            "iiwa.position_measured": "position_measured",
            "wsg.state_measured": "hand_state",
        }
        for source, target in sources.items():
            builder.Connect(self.station.GetOutputPort(source), self._machine.GetInputPort(target))
        for source, target in {"position": "iiwa.position", "width": "wsg.position"}.items():
            builder.Connect(self._machine.GetOutputPort(source), self.station.GetInputPort(target))
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        ApplySimulatorConfig(scenario.simulator_config, self.simulator)
        self.simulator.set_target_realtime_rate(0.0)  # as fast as can be
        self._model_points = shape.cloud_O.points
        self._wall = 0.0
        self._seen: list[SeenPose] = []

    def advance(self) -> bool:
        """Simulates a tenth of a second; returns whether the task goes on."""
        started = time.perf_counter()
        X_WO = self.X_WO
        self.simulator.AdvanceTo(self.time + _STEP)
        self._wall += time.perf_counter() - started
        for look in self.memory.looks[len(self._seen) :]:
            self._seen.append(self._against_truth(look, X_WO))
        return not self.memory.finished

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self.simulator.get_context().get_time()

    @property
    def X_WO(self) -> RigidTransform:
        """Where the object truly is."""
        context = self._plant.GetMyContextFromRoot(self.simulator.get_context())
        return self._plant.EvalBodyPoseInWorld(context, self._body)

    @property
    def memory(self) -> Memory:
        """What the task remembers now."""
        return self._status().decision.memory

    @property
    def state(self) -> str:
        """Name of the state that the task is in."""
        return self._status().decision.state

    @property
    def phases(self) -> tuple[tuple[float, str], ...]:
        """(time, state) of all states up to now."""
        return self._status().history

    @property
    def found_points(self) -> NDArray[np.float64] | None:
        """(N, 3) the object's surface where the last look that found it says it is, in W."""
        for look in reversed(self.memory.looks):
            if look.sight.X_WO is not None:
                return look.sight.X_WO.multiply(self._model_points.T).T
        return None

    def _status(self) -> MachineStatus:
        context = self._machine.GetMyContextFromRoot(self.simulator.get_context())
        return self._machine.status(context)

    def station_context(self) -> Context:
        """The station's context, to read its ports."""
        return self.station.GetMyContextFromRoot(self.simulator.get_context())

    def _against_truth(self, look: Look, X_WO: RigidTransform) -> SeenPose:
        sight = look.sight
        error = math.nan
        if sight.X_WO is not None:
            error = adds(self._model_points, X_WO, sight.X_WO)
        return SeenPose(look.time, look.plan, sight.reason, error, sight.seconds, look.plan_wall)

    def report(self, *, interrupted: bool = False) -> PosePickReport:
        """What has come of it up to now."""
        memory, X_WEnd = self.memory, self.X_WO
        context = self._plant.GetMyContextFromRoot(self.simulator.get_context())
        V_WO = self._plant.EvalBodySpatialVelocityInWorld(context, self._body).get_coeffs()
        offset = X_WEnd.translation() - self.X_WGoal.translation()
        R = self.X_WGoal.rotation().matrix().T @ X_WEnd.rotation().matrix()
        yaw = math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
        hand = self._plant.GetBodyByName("body", self._plant.GetModelInstanceByName("wsg"))
        p_WG = self._plant.EvalBodyPoseInWorld(context, hand).translation()
        apart = float(np.linalg.norm(X_WEnd.translation() - p_WG))
        return PosePickReport(
            seed=self._seed,
            start=self.start.start,
            X_WStart=self.start.X_WO,
            X_WGoal=self.X_WGoal,
            X_WEnd=X_WEnd,
            finished=memory.finished or ("interrupted" if interrupted else "time is up"),
            accepted=memory.placed,
            failures=memory.failures,
            looks=tuple(self._seen),
            phases=self.phases,
            attempts=memory.attempts,
            distance=float(np.linalg.norm(offset)),
            tilt=float(np.arccos(np.clip(R[2, 2], -1.0, 1.0))),
            yaw=abs((yaw + 0.5 * math.pi) % math.pi - 0.5 * math.pi),
            at_rest=bool(np.abs(V_WO).max() < _AT_REST),
            released=apart > 0.25,
            sim_time=self.time,
            wall_time=self._wall,
            interrupted=interrupted,
        )


def default_goal(place_bin: BinGeometry, vertices: NDArray[np.float64]) -> RigidTransform:
    """An upright pose in the middle of a bin, turned so that hands can come from many sides."""
    p_WGoal = place_bin.X_WB.translation().copy()
    p_WGoal[2] = place_bin.floor_height - vertices[:, 2].min()
    return RigidTransform(RotationMatrix.MakeZRotation(GOAL_YAW), p_WGoal)


def check_goal(
    X_WGoal: RigidTransform, place_bin: BinGeometry, vertices: NDArray[np.float64]
) -> None:
    """Refuses goals in the air, in a wall, or not upright.

    Args:
        X_WGoal: the goal.
        place_bin: the bin that it is to be in.
        vertices: (V, 3) of the object, in O [m].

    Raises:
        ValueError: saying what is wrong with X_WGoal.
    """
    matrix = np.asarray(X_WGoal.GetAsMatrix4(), dtype=float)
    if not np.isfinite(matrix).all() or matrix[2, 2] < 1.0 - 1e-6:
        raise ValueError("X_WGoal: must be finite and upright")
    p_B = (place_bin.X_WB.inverse() @ X_WGoal).multiply(vertices.T).T
    within = np.all(p_B[:, :2] > place_bin.low[:2]) and np.all(p_B[:, :2] < place_bin.high[:2])
    if not within or abs(p_B[:, 2].min() - place_bin.low[2]) > 1e-3:
        raise ValueError("X_WGoal: must be on the floor of the second bin, clear of its walls")
