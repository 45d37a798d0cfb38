"""Trajectories in Meshcat and as plots: what is drawn is where the motion is."""

import numpy as np
import pytest
from pydrake.geometry import Box, MeshcatVisualizer, Rgba
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import PiecewisePolynomial, PiecewisePose

from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.replay import Recorder
from prehensile.viz.trajectories import (
    animate,
    draw_pose_trajectory,
    draw_triad,
    plot_joint_trajectory,
    plot_pose_trajectory,
    plot_pose_trajectory_3d,
    shown_by_diagram,
)

KEYFRAMES = {
    "start": RigidTransform([0.4, 0.0, 0.3]),
    "middle": RigidTransform(RollPitchYaw(0.3, -0.4, 2.0), [0.6, 0.2, 0.4]),
    "end": RigidTransform(RollPitchYaw(0.2, 0.1, 3.6), [0.5, -0.3, 0.2]),
}
TIMES = {"start": 0.0, "middle": 1.0, "end": 2.5}
MOTION = PiecewisePose.MakeLinear(list(TIMES.values()), list(KEYFRAMES.values()))


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


def transform(meshcat, path) -> np.ndarray:
    """The 4x4 matrix that Meshcat was told for a path: the end of a packed message."""
    packed = meshcat._GetPackedTransform(path)
    # An array of 16 float64 (type 0xcb each).
    numbers = []
    at = len(packed)
    while len(numbers) < 16:
        at -= 9
        assert packed[at] == 0xCB
        numbers.append(np.frombuffer(packed[at + 1 : at + 9], ">f8")[0])
    return np.array(numbers[::-1]).reshape(4, 4).T


def test_triads_point_along_the_axes(meshcat):
    X_WF = KEYFRAMES["middle"]
    draw_triad(meshcat, "triad", X_WF, length=0.1)
    np.testing.assert_allclose(transform(meshcat, "triad"), X_WF.GetAsMatrix4(), atol=1e-15)
    for k, axis in enumerate("xyz"):
        T = transform(meshcat, f"triad/{axis}")
        # A cylinder's z is its axis; its middle is half a length out.
        np.testing.assert_allclose(T[:3, 2], np.eye(3)[k], atol=1e-15)
        np.testing.assert_allclose(T[:3, 3], 0.05 * np.eye(3)[k], atol=1e-15)


def test_lines_and_keyframes_are_drawn_and_replaced(meshcat):
    draw_pose_trajectory(meshcat, "plan", MOTION.GetPose, 0.0, 2.5, keyframes=KEYFRAMES, triads=5)
    assert meshcat.HasPath("plan/line")
    for name, X in KEYFRAMES.items():
        T = transform(meshcat, f"plan/keyframes/{name}")
        np.testing.assert_allclose(T, X.GetAsMatrix4(), atol=1e-15)
    T = transform(meshcat, "plan/triads/2")
    np.testing.assert_allclose(T, MOTION.GetPose(1.25).GetAsMatrix4(), atol=1e-14)
    draw_pose_trajectory(meshcat, "plan", MOTION.GetPose, 0.0, 2.5)
    assert meshcat.HasPath("plan/line")
    assert not meshcat.HasPath("plan/keyframes/start")


def test_animation_visits_whole_frames_and_both_ends(meshcat):
    seen = []
    animate(meshcat, seen.append, 0.0, 1.01, frames_per_second=16.0)
    np.testing.assert_allclose(seen, [*np.arange(17) / 16, 1.01])
    seen.clear()
    animate(meshcat, seen.append, 0.5, 0.5)
    assert seen == [0.5]
    with pytest.raises(ValueError, match="end not before start"):
        animate(meshcat, seen.append, 1.0, 0.0)


def test_recorded_animation_is_a_replay(meshcat, tmp_path):
    meshcat.SetObject("hand", Box(0.1, 0.1, 0.1), Rgba(1, 0, 0))
    with Recorder(meshcat, tmp_path / "hand.html"):
        animate(meshcat, lambda t: meshcat.SetTransform("hand", MOTION.GetPose(t), t), 0.0, 2.5)
    assert (tmp_path / "hand.html").stat().st_size > 100_000
    T = transform(meshcat, "hand")  # shown live as well, where it ends
    np.testing.assert_allclose(T, KEYFRAMES["end"].GetAsMatrix4(), atol=1e-12)


def test_a_diagram_shows_the_state_that_was_set(meshcat):
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    body = plant.AddRigidBody("brick", SpatialInertia.SolidCubeWithDensity(1000.0, 0.1))
    shape = Box(0.1, 0.1, 0.1)
    plant.RegisterVisualGeometry(body, RigidTransform(), shape, "brick", np.array([1, 0, 0, 1.0]))
    plant.Finalize()
    MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()

    def update(t, root):
        plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(root), body, MOTION.GetPose(t))

    animate(meshcat, shown_by_diagram(diagram, context, update), 0.0, 2.5)
    path = next(
        p
        for p in ("visualizer/brick", "visualizer/DefaultModelInstance/brick")
        if meshcat.HasPath(p)
    )
    np.testing.assert_allclose(
        transform(meshcat, path), KEYFRAMES["end"].GetAsMatrix4(), atol=1e-12
    )
    assert context.get_time() == 2.5


def test_plotted_velocities_are_the_slopes_of_what_is_plotted_above():
    figure = plot_pose_trajectory(MOTION.GetPose, MOTION.GetVelocity, 0.0, 2.5, TIMES)
    position, orientation, translational, _ = figure.axes
    for k in range(3):
        t, p = position.lines[k].get_data()
        _, v = translational.lines[k].get_data()
        slope = np.gradient(p, t)
        away = np.abs(t - 1.0) > 0.02  # from the corner
        np.testing.assert_allclose(v[away], slope[away], atol=1e-6)
    # Angles go on beyond half a turn.
    yaw = orientation.lines[2].get_ydata()
    assert np.abs(np.diff(yaw)).max() < 0.1
    assert {t.get_text() for t in position.texts} == set(TIMES)


def test_joints_are_plotted_as_fractions_of_their_limits():
    times = np.linspace(0.0, 2.0, 9)
    q = np.vstack([np.sin(times), 0.5 * np.cos(times), times])
    trajectory = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(times, q)
    figure = plot_joint_trajectory(
        trajectory, ["a", "b", "free"],
        lower=[-2.0, 0.0, -np.inf], upper=[2.0, 1.0, np.inf],
        velocity=[2.0, 4.0, np.inf], acceleration=[5.0, np.inf, 1.0],
    )  # fmt: skip
    position, velocity, acceleration = figure.axes

    def value(ax, joint, t):
        return np.interp(t, *ax.lines[joint].get_data())

    assert value(position, 0, 1.0) == pytest.approx(np.sin(1.0) / 2.0, abs=1e-3)
    assert value(position, 1, 0.0) == pytest.approx(0.0, abs=1e-3)  # the middle of 0..1
    assert value(position, 2, 1.3) == pytest.approx(1.3, abs=1e-3)  # no limit: in rad
    assert value(velocity, 0, 1.0) == pytest.approx(np.cos(1.0) / 2.0, abs=1e-2)
    assert value(acceleration, 1, 1.0) == pytest.approx(-0.5 * np.cos(1.0), abs=5e-2)
    assert "free (no limit)" in [line.get_label() for line in velocity.lines]
    dashed = [line.get_ydata()[0] for line in velocity.lines if line.get_linestyle() == "--"]
    assert dashed == [-1.0, 1.0]
    limits = {"lower": [0, 0, 0], "upper": [1, 1, 1], "velocity": [1, 1, 1], "acceleration": [1, 1]}
    with pytest.raises(ValueError, match="^acceleration must be"):
        plot_joint_trajectory(trajectory, ["a", "b", "free"], **limits)


def test_path_in_space_has_a_name_for_each_place():
    keyframes = {**KEYFRAMES, "again": KEYFRAMES["start"]}
    (ax,) = plot_pose_trajectory_3d(MOTION.GetPose, 0.0, 2.5, keyframes).axes
    assert {t.get_text().strip() for t in ax.texts} == {"start, again", "middle", "end"}
    x, y, z = (np.asarray(a) for a in ax.lines[0].get_data_3d())
    np.testing.assert_allclose([x[0], y[0], z[0]], KEYFRAMES["start"].translation())
    np.testing.assert_allclose([x[-1], y[-1], z[-1]], KEYFRAMES["end"].translation())


def test_what_cannot_be_drawn_is_named():
    meshcat = start_meshcat(open_browser=False)
    for sizes in ({"length": 0.0}, {"radius": np.nan}):
        with pytest.raises(ValueError, match="^length, radius"):
            draw_triad(meshcat, "frame", RigidTransform(), **sizes)
    for start, end in ((0.0, np.inf), (1.0, 0.0), (np.nan, 1.0)):
        with pytest.raises(ValueError, match="^start, end"):
            draw_pose_trajectory(meshcat, "line", lambda t: RigidTransform(), start, end)
    with pytest.raises(ValueError, match="finite"):
        animate(meshcat, lambda t: None, 0.0, np.inf)
