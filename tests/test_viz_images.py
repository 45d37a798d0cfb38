"""Camera pictures: projection against Drake's renderer, drawings where they belong."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    RenderLabel,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, RgbdSensor

from prehensile.viz.images import (
    as_rgb,
    colorize_depth,
    colorize_labels,
    draw_grasp,
    draw_points,
    project,
    save_png,
    side_by_side,
)

K = np.array([[500.0, 0, 320.0], [0, 500.0, 240.0], [0, 0, 1.0]])
# A camera 1 m above the origin that looks straight down, image right along x of the world.
X_WC = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0, 0, 1.0])


def test_project_agrees_with_the_renderer() -> None:
    """A small ball rendered by Drake has its centre of mass of pixels where we project it."""
    p_WB = np.array([0.11, -0.07, 0.05])
    X_WC = RigidTransform(RollPitchYaw(-2.3, 0.1, 0.4), [0.4, -0.9, 0.9])
    info = CameraInfo(640, 480, 600.0, 580.0, 310.0, 250.0)
    builder = DiagramBuilder()
    scene_graph = builder.AddSystem(SceneGraph())
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    ball = GeometryInstance(RigidTransform(p_WB), Sphere(0.01), "ball")
    properties = PerceptionProperties()
    properties.AddProperty("label", "id", RenderLabel(7))
    ball.set_perception_properties(properties)
    source = scene_graph.RegisterSource("test")
    scene_graph.RegisterAnchoredGeometry(source, ball)
    core = RenderCameraCore("vtk", info, ClippingRange(0.01, 10), RigidTransform())
    camera = builder.AddSystem(
        RgbdSensor(
            scene_graph.world_frame_id(), X_WC, ColorRenderCamera(core),
            DepthRenderCamera(core, DepthRange(0.1, 5)),
        )
    )  # fmt: skip
    builder.Connect(scene_graph.get_query_output_port(), camera.query_object_input_port())
    diagram = builder.Build()
    context = camera.GetMyContextFromRoot(root := diagram.CreateDefaultContext())
    assert root is not None
    labels = camera.label_image_output_port().Eval(context).data[:, :, 0]
    rows, columns = np.nonzero(labels == 7)
    assert rows.size > 20
    # Pixel centres are at half pixels.
    seen = [columns.mean() + 0.5, rows.mean() + 0.5]
    assert_allclose(project(info.intrinsic_matrix(), X_WC, p_WB)[0], seen, atol=0.6)


def test_project_of_known_points() -> None:
    uv = project(K, X_WC, [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0.5], [0, 0, 2.0]])
    assert_allclose(uv[:3], [[320, 240], [370, 240], [320, 140]], atol=1e-9)
    assert np.isnan(uv[3]).all(), "a point behind the camera has no pixel"


def test_draw_grasp_touches_only_the_hand_and_keeps_its_argument() -> None:
    image = np.full((480, 640, 3), 128, np.uint8)
    # Hand pointing down at the origin: y of G is -z of W, x of G is x of W.
    X_WG = RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2), [0, 0, 0.15])
    drawn = draw_grasp(image, K, X_WC, X_WG, 0.08, color=(255, 0, 0))
    assert (image == 128).all()
    rows, columns = np.nonzero((drawn == (255, 0, 0)).all(axis=2))
    # The pads are 0.08 m apart; the tips are at z = 0.15 - 0.118 = 0.032, the palm at 0.114.
    tip_half, palm_half = 500 * 0.04 / (1 - 0.032), 500 * 0.04 / (1 - 0.114)
    assert columns.min() == pytest.approx(320 - palm_half, abs=3)
    assert columns.max() == pytest.approx(320 + palm_half, abs=3)
    assert rows.max() - rows.min() == pytest.approx(2 * 500 * 0.01 / (1 - 0.114), abs=4)
    assert tip_half < palm_half
    far_away = np.ones((480, 640), bool)
    far_away[210:270, 280:360] = False
    assert (drawn[far_away] == 128).all()


def test_draw_grasp_behind_the_camera_draws_nothing() -> None:
    image = np.zeros((48, 64, 3), np.uint8)
    X_WG = RigidTransform([0, 0, 3.0])
    assert (draw_grasp(image, K, X_WC, X_WG, 0.05, label="1") == 0).all()


def test_label_stays_in_the_picture() -> None:
    image = np.zeros((480, 640, 4), np.uint8)
    X_WG = RigidTransform([0.64, 0, 0])
    bare = draw_grasp(image, K, X_WC, X_WG, 0.05)
    labelled = draw_grasp(image, K, X_WC, X_WG, 0.05, label="grasp 1")
    assert labelled.shape == (480, 640, 3)
    _, columns = np.nonzero((bare != labelled).any(axis=2))
    # The hand is at the right edge: the plate is moved inwards until its text is whole.
    assert 550 < columns.min() < 600


def test_draw_points_puts_dots_on_projections() -> None:
    drawn = draw_points(np.zeros((480, 640, 3), np.uint8), K, X_WC, [[0.1, 0, 0], [0, 0, 5.0]])
    rows, columns = np.nonzero(drawn.any(axis=2))
    assert columns.mean() == pytest.approx(370, abs=1.1)
    assert rows.mean() == pytest.approx(240, abs=1.1)


def test_colorize_depth() -> None:
    depth = np.array([[0.5, 1.0, 2.0], [0.0, np.nan, np.inf]], np.float32)
    colors = colorize_depth(depth[:, :, None])
    assert (colors[1] == 96).all(), "no return is grey"
    brightness = colors[0].sum(axis=1, dtype=int)
    assert brightness[0] > brightness[1] > brightness[2]
    assert (colorize_depth(np.zeros((2, 2))) == 96).all()


def test_colorize_labels() -> None:
    labels = np.array([[0, 1, 1, 32766]], np.int16)
    colors = colorize_labels(labels)
    assert (colors[0, 1] == colors[0, 2]).all()
    assert (colors[0, 0] != colors[0, 1]).any()
    assert (colors[0, 3] == 255).all()


def test_side_by_side_and_png_round_trip(tmp_path) -> None:
    left = np.full((4, 3, 3), 10, np.uint8)
    right = np.full((2, 5, 4), 20, np.uint8)
    row = side_by_side([left, right], gap=2)
    assert row.shape == (4, 10, 3)
    save_png(tmp_path / "new" / "row.png", row)
    assert (np.asarray(Image.open(tmp_path / "new" / "row.png")) == row).all()
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["row.png"]


@pytest.mark.parametrize(("shape", "kind"), [((4, 4), np.uint8), ((4, 4, 3), float)])
def test_wrong_images_are_refused(shape: tuple[int, ...], kind: type) -> None:
    with pytest.raises(ValueError, match="image must be"):
        as_rgb(np.zeros(shape, kind))
