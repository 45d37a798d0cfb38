"""Pictures of a scene: the camera looks where it is told, and sees things where they are."""

import numpy as np
import pytest
from PIL import Image, ImageSequence
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.tree import SpatialInertia
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource
from pydrake.systems.sensors import CameraInfo

from prehensile.viz.figures import save_animation, save_figure
from prehensile.viz.images import project
from prehensile.viz.render import look_at, render, render_depth


@pytest.fixture
def scene():
    """A red cube of 10 cm that floats."""
    builder = RobotDiagramBuilder(time_step=0.0)
    plant = builder.plant()
    cube = plant.AddRigidBody("cube", SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
    plant.RegisterVisualGeometry(cube, RigidTransform(), Box(0.1, 0.1, 0.1), "cube", [1, 0, 0, 1])
    plant.Finalize()
    return builder.Build(), cube


def red_center(picture: np.ndarray) -> np.ndarray:
    """Mean column and row of the red pixels."""
    rgb = picture.astype(int)
    rows, columns = np.nonzero(rgb[..., 0] > rgb[..., 1] + 40)
    assert len(rows) > 20
    return np.array([columns.mean(), rows.mean()])


def test_the_target_is_in_the_middle_and_up_is_up():
    X_WC = look_at([1.0, 2.0, 3.0], [0.0, 0.5, 0.2])
    p_CT = X_WC.inverse() @ np.array([0.0, 0.5, 0.2])
    np.testing.assert_allclose(p_CT[:2], 0.0, atol=1e-12)
    assert p_CT[2] > 0.0
    assert (X_WC.inverse() @ np.array([0.0, 0.5, 0.3]))[1] < 0.0  # y is down in a picture


@pytest.mark.parametrize(
    ("eye", "target"),
    [([0, 0, 1], [0, 0, 0]), ([1, 1, 1], [1, 1, 1]), ([np.nan, 1, 1], [0, 0, 0])],
    ids=["along up", "same", "nowhere"],
)
def test_there_must_be_a_line_of_sight_that_differs_from_up(eye, target):
    with pytest.raises(ValueError, match="line of sight"):
        look_at(eye, target)


def test_things_are_seen_where_they_are_from_the_first_picture_on(scene):
    diagram, cube = scene
    context = diagram.CreateDefaultContext()
    plant = diagram.GetSubsystemByName("plant")
    plant_context = plant.GetMyMutableContextFromRoot(context)
    X_WC = look_at([2.0, 0.0, 0.5], [0.0, 0.0, 0.0])
    focal = 0.5 * 240 / np.tan(0.35)
    K = np.array([[focal, 0.0, 159.5], [0.0, focal, 119.5], [0.0, 0.0, 1.0]])
    for p_WB in ([0.0, 0.3, 0.2], [0.0, -0.3, -0.1]):
        plant.SetFreeBodyPose(plant_context, cube, RigidTransform(p_WB))
        # Poses that somebody asked for before are no reason to show old ones.
        query = plant.get_geometry_query_input_port().Eval(plant_context)
        query.ComputeSignedDistanceToPoint([0.0, 0.0, 0.0])
        picture = render(diagram, context, X_WC, width=320, height=240)
        assert picture.shape == (240, 320, 3)
        wanted = project(K, X_WC, [p_WB])[0]
        np.testing.assert_allclose(red_center(picture), wanted[:2], atol=4.0)


def test_a_diagram_without_a_scene_is_said():
    builder = DiagramBuilder()
    builder.AddSystem(ConstantVectorSource([1.0]))
    diagram = builder.Build()
    with pytest.raises(ValueError, match="SceneGraph"):
        render(diagram, diagram.CreateDefaultContext(), look_at([1, 0, 0], [0, 0, 0]))


def test_figures_go_where_the_environment_says(tmp_path, monkeypatch):
    monkeypatch.setenv("PREHENSILE_FIGURES", str(tmp_path / "there"))
    picture = np.zeros((4, 6, 3), np.uint8)
    assert save_figure(picture, "black") == tmp_path / "there" / "black.png"
    assert (tmp_path / "there" / "black.png").read_bytes().startswith(b"\x89PNG")
    assert save_figure(picture, "black", tmp_path).parent == tmp_path


def test_an_animation_holds_every_picture_in_order(tmp_path):
    shades = [0, 90, 180, 250]
    pictures = (np.full((8, 10, 3), shade, np.uint8) for shade in shades)
    path = save_animation(pictures, "fade", tmp_path, period=0.2)
    assert path == tmp_path / "fade.gif"
    with Image.open(path) as gif:
        frames = [np.asarray(f.convert("L"), float) for f in ImageSequence.Iterator(gif)]
    assert [round(f.mean()) for f in frames] == shades
    with pytest.raises(ValueError, match="pictures"):
        save_animation([], "none", tmp_path)


def test_depth_is_that_along_the_optical_axis_and_fits_the_intrinsics(scene):
    diagram, _ = scene
    context = diagram.CreateDefaultContext()
    info = CameraInfo(320, 240, 1000.0, 1000.0, 150.0, 110.0)
    depth = render_depth(diagram, context, look_at([1.0, 0, 0], [0, 0, 0]), info)
    # The face toward the camera lies 0.95 m away.
    hit = np.isfinite(depth)
    np.testing.assert_allclose(depth[hit], 0.95, atol=1e-3)
    assert np.isinf(depth[0, 0])
    rows, columns = np.nonzero(hit)
    np.testing.assert_allclose([columns.mean(), rows.mean()], [150.0, 110.0], atol=0.05)
    assert np.isclose(np.ptp(columns) + 1, 1000 * 0.1 / 0.95, atol=1.0)
