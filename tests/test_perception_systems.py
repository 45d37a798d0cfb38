"""Perception as Systems in a simulated station, against where things truly are."""

import dataclasses as dc
from collections.abc import Mapping
from functools import cache

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram, DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from prehensile.perception.body_evidence import Body
from prehensile.perception.camera_model import CameraModel
from prehensile.perception.cloud import Box, PointCloud
from prehensile.perception.depth import DepthConfig
from prehensile.perception.depth_noise import DepthNoiseConfig
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.model_mesh import mesh_of_model
from prehensile.perception.registration.known_object import KnownObject
from prehensile.perception.systems import CloudFusion, ObjectLocator, ObjectTracker
from prehensile.perception.tracking import ObjectState, TrackingStatus
from prehensile.scenes.clutter import PlacedObject, with_objects
from prehensile.station import build, load_scenario
from prehensile.station.scenario import Scenario

# The bin that the cameras look at, without its walls and floor, up to 30 cm above that.
REGION = Box(RigidTransform([0.57, 0.0, 0.18]), np.array([0.34, 0.52, 0.28]))
NOISY = DepthConfig(window=9, noise_quadratic=0.0026)


def scene(X_WO: RigidTransform, joints: Mapping[str, float], *names: str) -> Scenario:
    """Two bins, a bottle at a pose, the arm at other joint angles, and noisy cameras."""
    scenario = load_scenario("two_bins")
    directives = with_objects(scenario.directives, [PlacedObject("bottle", "mustard_bottle", X_WO)])
    for directive in directives:
        model = directive.add_model
        if model is not None:
            known = model.default_joint_positions
            model.default_joint_positions = {
                name: np.array([joints[name]]) if name in joints else q for name, q in known.items()
            }
    return dc.replace(
        scenario,
        directives=directives,
        cameras={name: scenario.cameras[name] for name in names},
        depth_noise={name: DepthNoiseConfig(seed=k) for k, name in enumerate(names)},
    )


def models(scenario: Scenario) -> dict[str, CameraModel]:
    result = {}
    for name, config in scenario.cameras.items():
        _, camera = config.MakeCameras()
        result[name] = CameraModel.from_drake(camera.core().intrinsics())
    return result


def connect(builder: DiagramBuilder, station: Diagram, system: LeafSystem) -> None:
    """The ports of the cameras, which have the same names."""
    for i in range(system.num_input_ports()):
        port = system.get_input_port(i)
        if "." in port.get_name():
            builder.Connect(station.GetOutputPort(port.get_name()), port)


@cache
def bottle() -> Body:
    return Body.from_mesh(mesh_of_model("mustard_bottle"))


def error(state: ObjectState, X_WO: RigidTransform) -> tuple[float, float]:
    """Distance of the origins [m] and angle [degrees]."""
    E = X_WO.inverse() @ state.X_WO
    return float(np.linalg.norm(E.translation())), float(
        np.degrees(E.rotation().ToAngleAxis().angle())
    )


class Falling:
    """A bottle that falls into the bin, before two cameras: cloud, search and track."""

    def __init__(self) -> None:
        X_WO = RigidTransform(RollPitchYaw(1.2, 0.3, 0.5), [0.57, 0.05, 0.30])
        scenario = scene(X_WO, {}, "camera0", "camera1")
        builder = DiagramBuilder()
        self.station = builder.AddSystem(build(scenario))
        self.models = models(scenario)
        self.fusion = builder.AddSystem(CloudFusion(self.models, REGION, 0.004, config=NOISY))
        known = KnownObject.from_mesh(mesh_of_model("mustard_bottle"))
        self.locator = builder.AddSystem(ObjectLocator(known))
        self.tracker = builder.AddSystem(ObjectTracker(bottle(), self.models))
        connect(builder, self.station, self.fusion)
        connect(builder, self.station, self.tracker)
        builder.Connect(self.fusion.GetOutputPort("cloud"), self.locator.get_input_port())
        builder.Connect(self.locator.get_output_port(), self.tracker.GetInputPort("found"))
        self.diagram = builder.Build()


@pytest.fixture(scope="module")
def falling() -> Falling:
    return Falling()


def follow(
    simulator: Simulator, station: Diagram, tracker: ObjectTracker, images: int
) -> list[tuple[ObjectState, RigidTransform, SpatialVelocity]]:
    """The tracker's states with the true pose and velocity when the images were taken."""
    plant = station.plant()
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("bottle"))
    context = plant.GetMyContextFromRoot(simulator.get_context())
    history = []
    for k in range(images):
        # What happens at a time happens when the time goes on.
        simulator.AdvanceTo(k / 30)
        X_WO = plant.EvalBodyPoseInWorld(context, body)
        V_WO = plant.EvalBodySpatialVelocityInWorld(context, body)
        simulator.AdvanceTo(k / 30 + 1e-4)
        state = tracker.state(tracker.GetMyContextFromRoot(simulator.get_context()))
        history.append((state, X_WO, V_WO))
    return history


def test_cloud_is_that_of_fuse_and_lies_on_the_object(falling):
    context = falling.diagram.CreateDefaultContext()
    fusion_context = falling.fusion.GetMyContextFromRoot(context)
    cloud: PointCloud = falling.fusion.GetOutputPort("cloud").Eval(fusion_context)
    assert cloud.colors is not None
    assert cloud.normals is not None
    drake = falling.fusion.GetOutputPort("point_cloud").Eval(fusion_context)
    np.testing.assert_array_equal(drake.xyzs().T, cloud.points.astype(np.float32))
    np.testing.assert_array_equal(drake.rgbs().T, cloud.colors)
    # What hangs in the air is the bottle.
    X_WO = RigidTransform(RollPitchYaw(1.2, 0.3, 0.5), [0.57, 0.05, 0.30])
    high = cloud.points[cloud.points[:, 2] > 0.22]
    assert len(high) > 300
    distances = bottle().field.at((X_WO.inverse() @ high.T).T).distances
    assert np.median(np.abs(distances)) < 0.002
    # In time with what the cameras see.
    plant = falling.station.plant()
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("bottle"))
    away = RigidTransform([0.57, 0.05, 2.0])
    plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(context), body, away)
    cloud = falling.fusion.GetOutputPort("cloud").Eval(fusion_context)
    assert (cloud.points[:, 2] < 0.22).all()


def test_falling_object_is_found_and_followed(falling):
    simulator = Simulator(falling.diagram)
    tracker = falling.tracker
    context = tracker.GetMyContextFromRoot(simulator.get_context())
    assert tracker.state(context).status is TrackingStatus.LOST
    assert np.isnan(tracker.GetOutputPort("X_WO").Eval(context).translation()).all()
    history = follow(simulator, falling.station, tracker, 7)
    for state, X_WO, _ in history:
        assert state.status is TrackingStatus.TRACKING
        distance, angle = error(state, X_WO)
        assert distance < 0.003
        assert min(angle, 180 - angle) < 3  # The bottle looks alike from front and back.
    for state, _, V_WO in history[3:6]:
        assert np.linalg.norm(state.V_WO[3:] - V_WO.translational()) < 0.25
    assert max(V_WO.translational()[2] for _, _, V_WO in history[3:6]) < -0.9
    state = history[-1][0]
    assert tracker.GetOutputPort("X_WO").Eval(context).IsExactlyEqualTo(state.X_WO)
    np.testing.assert_array_equal(tracker.GetOutputPort("V_WO").Eval(context), state.V_WO)
    assert tracker.GetOutputPort("state").Eval(context).time == state.time


def test_lost_object_is_found_again(falling):
    simulator = Simulator(falling.diagram)
    context = falling.tracker.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    falling.tracker.start(context, RigidTransform([0.57, -0.1, 0.4]))
    history = follow(simulator, falling.station, falling.tracker, 2)
    assert [state.status for state, *_ in history] == [TrackingStatus.LOST, TrackingStatus.TRACKING]
    state, X_WO, _ = history[-1]
    assert error(state, X_WO)[0] < 0.003


@pytest.mark.slow
def test_object_is_followed_in_a_moving_hand():
    """At 1 m/s and 2 rad/s; the joints tell where the hand is."""
    joints = {
        "iiwa_joint_1": 0.0,
        "iiwa_joint_2": 0.35,
        "iiwa_joint_4": -1.5,
        "iiwa_joint_6": 1.25,
        "left_finger_sliding_joint": -0.029,
        "right_finger_sliding_joint": 0.029,
    }
    X_WO = RigidTransform(RotationMatrix.MakeZRotation(np.pi / 2), [0.531, 0.0, 0.353])
    scenario = scene(X_WO, joints, "camera0", "camera1")
    builder = DiagramBuilder()
    station = builder.AddSystem(build(scenario))
    plant = station.plant()
    iiwa, wsg = (plant.GetModelInstanceByName(name) for name in ("iiwa", "wsg"))
    occluders = []
    for name in ("body", "left_finger", "right_finger"):
        mesh = mesh_of_model("wsg50", body=name)
        field = DistanceField.from_mesh(mesh, spacing=0.004, margin=0.02, signed=False)
        occluders.append((plant.GetBodyByName(name, wsg).index(), field))
    tracker = builder.AddSystem(
        ObjectTracker(bottle(), models(scenario), X_WO=X_WO, occluders=occluders)
    )
    connect(builder, station, tracker)
    builder.Connect(station.GetOutputPort("cheat.body_poses"), tracker.GetInputPort("body_poses"))
    start = plant.GetPositions(plant.CreateDefaultContext(), iiwa)
    times = np.arange(0, 1.3, 0.1)
    swing = np.sin(3 * np.clip(times - 0.1, 0, None)) * np.clip((times - 0.1) / 0.3, 0, 1)
    path = start + np.outer(swing, [0.3, 0.15, 0, 0.2, 0.2, 0.2, 0.6])
    source = builder.AddSystem(
        TrajectorySource(PiecewisePolynomial.CubicShapePreserving(times, path.T, True))
    )
    builder.Connect(source.get_output_port(), station.GetInputPort("iiwa.position"))
    for port, value in (("wsg.position", 0.03), ("wsg.force_limit", 80.0)):
        constant = builder.AddSystem(ConstantVectorSource([value]))
        builder.Connect(constant.get_output_port(), station.GetInputPort(port))
    history = follow(Simulator(builder.Build()), station, tracker, 20)
    errors = np.array([error(state, X_WO) for state, X_WO, _ in history])
    speeds = [np.linalg.norm(V_WO.translational()) for *_, V_WO in history]
    assert all(state.status is TrackingStatus.TRACKING for state, *_ in history)
    assert max(speeds) > 0.8
    assert errors[:, 0].max() < 0.002
    assert errors[:, 1].max() < 2
    assert np.median(errors[:, 0]) < 0.0005


def test_bad_input_is_named(falling):
    with pytest.raises(ValueError, match="cameras"):
        CloudFusion({}, REGION, 0.004)
    with pytest.raises(ValueError, match="period"):
        ObjectTracker(bottle(), falling.models, period=0.0)
