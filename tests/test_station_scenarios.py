"""The scenario files that ship: what their comments promise."""

import itertools

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.sensors import CameraConfig

from prehensile.station.robot_plant import add_models, finalize, make_robot_diagram
from prehensile.station.scenario_file import list_scenarios, load_scenario


def pose(plant: MultibodyPlant, model: str, frame: str) -> RigidTransform:
    context = plant.CreateDefaultContext()
    instance = plant.GetModelInstanceByName(model)
    return plant.GetFrameByName(frame, instance).CalcPoseInWorld(context)


def plant_of(name: str) -> MultibodyPlant:
    scenario = load_scenario(name)
    plant = MultibodyPlant(scenario.plant_config.time_step)
    add_models(scenario, plant)
    finalize(scenario, plant)
    return plant


@pytest.mark.parametrize("camera", ["camera0", "camera1", "camera2"])
def test_every_camera_over_the_bins_has_the_whole_interior_of_bin0_in_its_picture(camera):
    scenario = load_scenario("two_bins")
    plant = plant_of("two_bins")
    config = scenario.cameras[camera]
    assert isinstance(config.focal, CameraConfig.FocalLength)
    assert config.focal.x is not None
    assert config.X_PB.base_frame == f"{camera}::color_optical_frame"
    X_CW = pose(plant, camera, "color_optical_frame").inverse()
    X_WB = pose(plant, "bin0", "base_link")
    corners_B = np.array(list(itertools.product((-0.28, 0.28), (-0.19, 0.19), (0.03, 0.19))))
    x, y, z = X_CW @ (X_WB @ corners_B.T)
    assert (z > config.z_near).all()
    assert (z < config.z_far).all()
    u = config.focal.x * x / z + config.width / 2
    v = config.focal.x * y / z + config.height / 2
    assert ((u > 0) & (u < config.width)).all()
    assert ((v > 0) & (v < config.height)).all()


@pytest.mark.parametrize("name", list_scenarios())
def test_nothing_but_what_is_mounted_touches_at_the_start(name):
    diagram = make_robot_diagram(load_scenario(name))
    context = diagram.CreateDefaultContext()
    query = (
        diagram.scene_graph()
        .GetOutputPort("query")
        .Eval(diagram.scene_graph().GetMyContextFromRoot(context))
    )
    inspector = query.inspector()
    pairs = {
        tuple(inspector.GetName(i).split("::")[0] for i in (contact.id_A, contact.id_B))
        for contact in query.ComputePointPairPenetration()
        if contact.depth > 1e-4
    }
    moving = {m for pair in pairs for m in pair if m.startswith(("iiwa", "wsg", "allegro"))}
    assert not moving, pairs


@pytest.mark.parametrize("name", list_scenarios())
def test_hands_point_down_at_the_start(name):
    plant = plant_of(name)
    fingers = {"wsg": 1, "wsg_left": 1, "wsg_right": 1, "allegro": 2}  # axis along them
    hands = [hand for hand in fingers if plant.HasModelInstanceNamed(hand)]
    assert hands
    for hand in hands:
        body = "hand_root" if hand == "allegro" else "body"
        axis = pose(plant, hand, body).rotation().matrix()[:, fingers[hand]]
        np.testing.assert_allclose(axis, [0, 0, -1], atol=1e-3)


def test_the_planar_station_moves_in_the_plane_y_0_and_closes_in_it():
    plant = plant_of("planar")
    context = plant.CreateDefaultContext()
    hand = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg"))
    rng = np.random.default_rng(0)
    for _ in range(5):
        for joint in (2, 4, 6):
            plant.GetJointByName(f"iiwa_joint_{joint}").set_angle(context, rng.uniform(-1, 1))
        X_WH = hand.CalcPoseInWorld(context)
        assert abs(X_WH.translation()[1]) < 1e-9
        # The closing direction is x of the hand's body.
        assert abs(X_WH.rotation().matrix()[1, 0]) < 1e-5
    for brick in ("brick0", "brick1"):
        assert pose(plant, brick, "base_link").translation()[1] == 0


def test_both_hands_of_the_bimanual_station_are_as_far_from_the_box():
    plant = plant_of("bimanual")
    box = pose(plant, "cracker_box", "base_link").translation()
    left, right = (pose(plant, f"wsg_{s}", "body").translation() for s in ("left", "right"))
    assert np.linalg.norm(left - box) == pytest.approx(np.linalg.norm(right - box))
    assert left[1] > 0 > right[1]
