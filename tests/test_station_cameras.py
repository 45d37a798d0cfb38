"""Cameras: what they see against plane geometry, where they are, and what they cost unread."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.common.schema import Transform
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.sensors import CameraConfig

from prehensile.errors import InputError
from prehensile.station.build import build
from prehensile.station.cameras import d415_camera_config
from prehensile.station.scenario_file import load_scenario, loads_scenario

# A block of wood, of which the top is looked at; see its scale in the test.
BLOCK = """
directives:
- add_model:
    name: table
    file: package://prehensile/table/table.sdf
- add_weld: {parent: world, child: table::base_link}
"""

DOWN = RollPitchYaw(np.pi, 0, 0).ToRotationMatrix()  # z down, x along x


def station_with(*cameras: CameraConfig):
    scenario = dc.replace(loads_scenario(BLOCK), cameras={c.name: c for c in cameras})
    station = build(scenario)
    return station, station.CreateDefaultContext()


def test_depth_of_a_plane_and_its_points():
    # The table's top is z = 0; the optical axis is tilted by 0.2 rad about x.
    X_WC = RigidTransform(RollPitchYaw(np.pi - 0.2, 0, 0).ToRotationMatrix(), [0.4, 0.0, 0.8])
    config = d415_camera_config("eye", X_WC)
    station, context = station_with(config)
    depth = station.GetOutputPort("eye.depth_image").Eval(context).data[:, :, 0]
    assert depth.shape == (480, 640)
    fx, fy = config.focal_x(), config.focal_y()
    cx, cy = config.principal_point()
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    rays_C = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones(u.shape)], axis=-1)
    rays_W = rays_C @ X_WC.rotation().matrix().T
    wanted = -0.8 / rays_W[:, :, 2]
    hits = wanted[:, :, None] * rays_W + X_WC.translation()
    inside = np.all(np.abs(hits[:, :, :2] - [0.4, 0.0]) < 0.3, axis=-1)
    assert inside.sum() > 50_000
    # The renderer's depth buffer. (Half a pixel would be 0.3 mm.)
    assert np.max(np.abs(depth - wanted)[inside]) < 5e-5
    # The cloud is in the world frame: the plane is z = 0 there.
    cloud = station.GetOutputPort("eye.point_cloud").Eval(context)
    points = cloud.xyzs().T.reshape(480, 640, 3)[inside]
    assert np.max(np.abs(points[:, 2])) < 5e-5
    assert np.max(np.abs(points - hits[inside])) < 1e-4
    assert cloud.has_rgbs()
    rgb = station.GetOutputPort("eye.rgb_image").Eval(context).data[:, :, :3]
    assert np.array_equal(cloud.rgbs().T.reshape(480, 640, 3), rgb)
    # Something is to be seen, and it is labelled.
    assert rgb[inside].std() > 1
    labels = station.GetOutputPort("eye.label_image").Eval(context).data
    assert len(np.unique(labels[inside])) == 1


def test_pose_of_a_camera_with_offsets_is_that_of_its_depth_frame():
    X_PB = RigidTransform(DOWN, [0.4, 0.1, 0.9])
    X_BD = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.01, 0.02, 0.03])
    config = CameraConfig(
        name="eye", X_PB=Transform(X_PB), X_BD=Transform(X_BD), width=64, height=48
    )
    station, context = station_with(config)
    X_WC = station.GetOutputPort("eye.X_WC").Eval(context)
    assert X_WC.IsNearlyEqualTo(X_PB @ X_BD, 1e-12)
    # Colour is seen from elsewhere, so points have none.
    assert not station.GetOutputPort("eye.point_cloud").Eval(context).has_rgbs()
    # Settings of the caller are left alone.
    assert config.X_BD.GetDeterministicValue().IsNearlyEqualTo(X_BD, 1e-12)


def test_a_camera_on_the_hand_moves_with_it():
    scenario = load_scenario("iiwa_wsg")
    X_HC = RigidTransform(RollPitchYaw(0, 0, 1.0), [0.0, 0.05, 0.02])
    wrist = d415_camera_config("wrist", X_HC, base_frame="wsg::body", width=64, height=48)
    station = build(dc.replace(scenario, cameras={"wrist": wrist}))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    plant = station.plant()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    q = np.linspace(-1, 1, 7)
    plant.SetPositions(plant_context, plant.GetModelInstanceByName("iiwa"), q)
    X_WH = plant.GetFrameByName("body", plant.GetModelInstanceByName("wsg")).CalcPoseInWorld(
        plant_context
    )
    X_WC = station.GetOutputPort("wrist.X_WC").Eval(context)
    assert X_WC.IsNearlyEqualTo(X_WH @ X_HC, 1e-12)


def test_images_change_with_the_state():
    station = build(load_scenario("iiwa_wsg"))
    context = station.CreateDefaultContext()
    port = station.GetOutputPort("camera0.rgb_image")
    before = port.Eval(context).data.copy()
    assert np.array_equal(before, port.Eval(context).data)
    plant = station.plant()
    arm = plant.GetModelInstanceByName("iiwa")
    plant.SetPositions(plant.GetMyMutableContextFromRoot(context), arm, 0.3 * np.ones(7))
    assert np.mean(before != port.Eval(context).data) > 0.01


def test_unread_cameras_render_nothing():
    station = build(load_scenario("two_bins"))
    # The scene graph that the plant asks at every step has no renderer to keep up.
    assert station.scene_graph().RendererCount() == 0
    simulator = Simulator(station)
    simulator.AdvanceTo(0.05)
    cameras = station.GetSubsystemByName("cameras")
    context = cameras.GetMyContextFromRoot(simulator.get_context())
    assert context.num_total_states() == 0

    def computed():
        ports = (cameras.get_output_port(i) for i in range(cameras.num_output_ports()))
        return {p.get_name() for p in ports if not p.cache_entry().is_out_of_date(context)}

    assert computed() == set()
    station.GetOutputPort("camera1.depth_image").Eval(simulator.get_context())
    assert computed() == {"camera1.depth_image"}
    simulator.AdvanceTo(0.1)
    assert computed() == set()


def test_two_contexts_see_their_own_states():
    station = build(load_scenario("iiwa_wsg"))
    plant = station.plant()
    arm = plant.GetModelInstanceByName("iiwa")
    port = station.GetOutputPort("camera0.depth_image")
    contexts = [station.CreateDefaultContext() for _ in range(2)]
    plant.SetPositions(plant.GetMyMutableContextFromRoot(contexts[1]), arm, 0.3 * np.ones(7))
    first, second = (port.Eval(context).data.copy() for context in contexts)
    assert not np.array_equal(first, second)
    assert np.array_equal(first, port.Eval(station.CreateDefaultContext()).data)
    assert np.array_equal(second, port.Eval(contexts[1]).data)


def test_d415_has_the_intrinsics_of_the_data_sheet():
    config = d415_camera_config("eye", RigidTransform(), width=1280, height=720)
    vertical = np.degrees(2 * np.arctan(360 / config.focal_y()))
    horizontal = np.degrees(2 * np.arctan(640 / config.focal_x()))
    assert vertical == pytest.approx(42, abs=1)
    assert horizontal == pytest.approx(69, abs=1)


def test_a_gl_camera_without_a_display_falls_back_with_a_warning(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    config = CameraConfig(name="eye", renderer_class="RenderEngineGl", width=64, height=48)
    with pytest.warns(UserWarning, match="needs a display"):
        station, context = station_with(config)
    assert station.GetOutputPort("eye.rgb_image").Eval(context).data.shape == (48, 64, 4)


def test_settings_that_do_not_fit():
    eye = CameraConfig(name="eye", width=64, height=48)
    twin = CameraConfig(name="eye", width=64, height=48)
    lost = CameraConfig(name="lost", X_PB=Transform(base_frame="nowhere::body"))
    odd = CameraConfig(name="odd", renderer_class="RenderEngineX")
    inverted = CameraConfig(name="inverted", z_near=2.0, z_far=1.0)
    for cameras, words in (
        ({"a": eye, "b": twin}, ["cameras.b.name", "eye"]),
        ({"a": lost}, ["cameras.a.X_PB.base_frame", "nowhere::body"]),
        ({"a": odd}, ["cameras.a.renderer_class", "RenderEngineVtk"]),
        ({"a": inverted}, ["cameras.a"]),
    ):
        with pytest.raises(InputError) as error:
            build(dc.replace(loads_scenario(BLOCK), cameras=cameras))
        for word in words:
            assert word in str(error.value)
