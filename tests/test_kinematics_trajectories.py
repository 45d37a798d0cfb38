"""Pose trajectories against Drake's PiecewisePose, finite differences, and closed forms."""

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePose

from prehensile.kinematics.poses import pose_distance, random_pose
from prehensile.kinematics.rotations import unskew
from prehensile.kinematics.trajectories import (
    PoseTrajectory,
    blended_trajectory,
    law_progress,
    pose_trajectory,
)

TIMES = [0.5, 1.0, 2.5, 3.0]


def random_poses(seed, number=4):
    rng = np.random.default_rng(seed)
    return [random_pose(rng) for _ in range(number)]


def assert_derivatives(trajectory, times, tolerance):
    """Velocity and acceleration are what the poses do."""
    h = 1e-5
    for t in times:
        before, now, after = (trajectory.state(t + dt) for dt in (-h, 0.0, h))
        p_dot = (after.X_WB.translation() - before.X_WB.translation()) / (2 * h)
        R_dot = (after.X_WB.rotation().matrix() - before.X_WB.rotation().matrix()) / (2 * h)
        w = unskew(R_dot @ now.X_WB.rotation().matrix().T)
        np.testing.assert_allclose(now.V_WB, np.concatenate([w, p_dot]), atol=tolerance)
        A = (after.V_WB - before.V_WB) / (2 * h)
        np.testing.assert_allclose(now.A_WB, A, atol=tolerance)


@pytest.mark.parametrize("seed", range(3))
def test_linear_law_is_drakes_piecewise_pose(seed):
    poses = random_poses(seed)
    ours, drakes = pose_trajectory(TIMES, poses, "linear"), PiecewisePose.MakeLinear(TIMES, poses)
    for t in np.random.default_rng(seed).uniform(0.5, 3.0, 50):
        assert ours.value(t).IsNearlyEqualTo(drakes.GetPose(t), 1e-12)
        V = drakes.GetVelocity(t)
        np.testing.assert_allclose(ours.velocity(t), V, atol=1e-11)
        np.testing.assert_allclose(ours.acceleration(t), drakes.GetAcceleration(t), atol=1e-11)


@pytest.mark.parametrize("law", ["linear", "cubic", "quintic"])
def test_derivatives_of_laws(law):
    trajectory = pose_trajectory(TIMES, random_poses(3), law)
    assert_derivatives(trajectory, [0.6, 0.9, 1.1, 1.7, 2.4, 2.6, 2.9], 1e-6)


@pytest.mark.parametrize("law", ["cubic", "quintic"])
def test_laws_rest_at_every_pose_on_straight_lines(law):
    poses = random_poses(4)
    trajectory = pose_trajectory(TIMES, poses, law)
    for t, X in zip(TIMES, poses, strict=True):
        assert trajectory.value(t).IsNearlyEqualTo(X, 1e-12)
        for side in (t - 1e-9, t + 1e-9):
            np.testing.assert_allclose(trajectory.velocity(side), np.zeros(6), atol=1e-6)
    if law == "quintic":
        for t in TIMES:
            np.testing.assert_allclose(trajectory.acceleration(t + 1e-9), np.zeros(6), atol=1e-5)
    start, end = poses[1].translation(), poses[2].translation()
    for t in np.linspace(1.0, 2.5, 20):
        state = trajectory.state(t)
        np.testing.assert_allclose(
            np.cross(state.X_WB.translation() - start, end - start), np.zeros(3), atol=1e-12
        )
        # Slerp: the axis stands still.
        np.testing.assert_allclose(np.cross(state.V_WB[:3], state.A_WB[:3]), 0.0, atol=1e-9)


def test_before_and_after_it_stands_still():
    poses = random_poses(5)
    trajectory = pose_trajectory(TIMES, poses, "linear")
    for t, X in ((0.0, poses[0]), (9.0, poses[-1])):
        state = trajectory.state(t)
        assert state.X_WB.IsNearlyEqualTo(X, 1e-15)
        assert not state.V_WB.any()
        assert not state.A_WB.any()
    assert (trajectory.start_time, trajectory.end_time) == (0.5, 3.0)


@pytest.mark.parametrize("blend", ["parabolic", "quintic"])
def test_blends(blend):
    poses = random_poses(6, 5)
    distances = [0.0, 0.05, 0.3, 0.02, 0.0]
    trajectory = blended_trajectory([1.0, 2.0, 1.5, 1.0], poses, distances, blend, start_time=2.0)
    times = np.linspace(2.0, trajectory.end_time, 2001)
    states = [trajectory.state(t) for t in times]
    assert states[0].X_WB.IsNearlyEqualTo(poses[0], 1e-12)
    assert states[-1].X_WB.IsNearlyEqualTo(poses[-1], 1e-12)
    for end in (states[0], states[-1]):
        np.testing.assert_allclose(end.V_WB, np.zeros(6), atol=1e-9)
    assert trajectory.end_time - 2.0 == pytest.approx(5.5 + 0.5 + 0.5)
    p = np.array([s.X_WB.translation() for s in states])
    for X, distance in zip(poses, distances, strict=True):
        nearest = np.linalg.norm(p - X.translation(), axis=1).min()
        assert nearest <= distance + 1e-3
    # A small corner is used to its whole distance, and no stop is made.
    assert np.linalg.norm(p - poses[3].translation(), axis=1).min() > 0.01
    speed = np.linalg.norm([s.V_WB[3:] for s in states], axis=1)
    assert speed[100:-100].min() > 0.05
    breaks = np.concatenate([beta.x for beta in trajectory.progress])
    inside = [t for t in times[7::83] if np.abs(t - breaks).min() > 1e-4]
    assert_derivatives(trajectory, inside, 1e-5)
    A = np.array([s.A_WB for s in states])
    jump = np.abs(np.diff(A, axis=0)).max() / np.abs(A).max()
    assert (jump < 0.1) == (blend == "quintic")


def test_deviation_of_a_right_angle_in_closed_form():
    # Speed 1 along x, then along y: the corner is passed at distance r on the diagonal.
    poses = [RigidTransform(p) for p in ([-1.0, 0, 0], [0.0, 0, 0], [0, 1.0, 0])]
    for blend in ("parabolic", "quintic"):
        trajectory = blended_trajectory([1.0, 1.0], poses, [0, 0.1, 0], blend)
        corner = trajectory.value(1.5)
        np.testing.assert_allclose(corner.translation(), [-0.1 / 2**0.5, 0.1 / 2**0.5, 0])


def test_wide_blends_do_not_overlap():
    poses = random_poses(7)
    trajectory = blended_trajectory([1.0, 0.5, 1.0], poses, [0, 9.0, 9.0, 0])
    spans = [(beta.x[0], beta.x[-1]) for beta in trajectory.progress]
    assert spans[0][1] <= spans[2][0] + 1e-12
    assert pose_distance(trajectory.value(trajectory.end_time), poses[-1])[0] < 1e-12


def test_sharp_corners_are_the_first_order_hold():
    poses = random_poses(8)
    trajectory = blended_trajectory([1.0, 0.5, 1.0], poses, np.zeros(4))
    linear = pose_trajectory([0.5, 1.5, 2.0, 3.0], poses, "linear")
    for t in (1.2, 1.7, 1.9):
        assert trajectory.value(t).IsNearlyEqualTo(linear.value(t), 1e-12)


def test_equal_poses_are_no_motion():
    X = random_poses(9)[0]
    state = pose_trajectory([0.0, 1.0], [X, X]).state(0.5)
    assert state.X_WB.IsNearlyEqualTo(X, 1e-15)
    np.testing.assert_allclose(state.V_WB, np.zeros(6), atol=1e-15)


def test_as_drake_trajectories():
    trajectory = pose_trajectory(TIMES, random_poses(10))
    poses, velocities = trajectory.drake_pose(), trajectory.drake_velocity()
    source = TrajectorySource(velocities)
    context = source.CreateDefaultContext()
    for t in (0.7, 1.3, 2.9):
        context.SetTime(t)
        V = source.get_output_port().Eval(context)
        np.testing.assert_array_equal(V, trajectory.velocity(t))
        np.testing.assert_array_equal(
            velocities.EvalDerivative(t, 1).ravel(), trajectory.acceleration(t)
        )
        np.testing.assert_array_equal(poses.value(t), trajectory.value(t).GetAsMatrix4())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda X: pose_trajectory([0.0], X), "times must be"),
        (lambda X: pose_trajectory([0.0, 0.0], X), "times must increase"),
        (lambda X: pose_trajectory([0.0, np.nan], X), "times must increase"),
        (lambda X: pose_trajectory([0.0, 1.0], X, "sine"), "law must be one of"),
        (lambda X: blended_trajectory([0.0], X, [0, 0]), "durations must be"),
        (lambda X: blended_trajectory([1.0], X, [0.0]), "distances must be"),
        (lambda X: blended_trajectory([1.0], X, [0, 0], "round"), "blend must be"),
        (lambda X: PoseTrajectory(X, []), "progress must have 1"),
    ],
)
def test_misuse_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call(random_poses(0, 2))


def test_what_is_out_of_range_is_named():
    A, B = random_poses(0, 2)
    with pytest.raises(ValueError, match="^poses"):
        PoseTrajectory([], [])
    with pytest.raises(ValueError, match="^poses"):
        blended_trajectory([], [A], [0.0])
    for bad in (np.inf, np.nan, 0.0):
        with pytest.raises(ValueError, match="^durations"):
            blended_trajectory([bad], [A, B], [0.0, 0.0])
    with pytest.raises(ValueError, match="^start_time"):
        blended_trajectory([1.0], [A, B], [0.0, 0.0], start_time=np.nan)
    for start, end in ((1.0, 1.0), (1.0, 0.0), (0.0, np.inf)):
        with pytest.raises(ValueError, match="^start, end"):
            law_progress(start, end, "cubic")
    with pytest.raises(ValueError, match="^law"):
        law_progress(0.0, 1.0, "sudden")
    with pytest.raises(ValueError, match="no second"):
        pose_trajectory([0.0, 1.0], [A, B]).drake_velocity().EvalDerivative(0.5, 2)
