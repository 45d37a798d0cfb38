"""An iiwa with biased encoders, seen by Drake's renderer."""

import numpy as np
import pytest
from arm_views import ArmScene, links
from depth_scene import d415, look_at

from prehensile.perception.articulated_tracking import (
    ArmState,
    start_arm_tracking,
    track_arm,
)
from prehensile.perception.free_space import DepthView
from prehensile.perception.tracking import TrackingStatus

CAMERA = d415(look_at((1.5, 0.6, 1.0), (0.2, 0.1, 0.5)))
Q = np.array([0.3, 0.6, 0.2, -1.2, 0.4, 0.9, 0.3])
BIAS = np.radians([3, -4, 2.5, 4, -3, 3, 2])


@pytest.fixture(scope="module")
def scene() -> ArmScene:
    return ArmScene()


def view_of(scene: ArmScene, q: np.ndarray, rng: np.random.Generator) -> DepthView:
    """1 mm of noise at 1 m."""
    depth = scene.depth(q, CAMERA)
    seen = np.isfinite(depth)
    depth[seen] += 0.001 * rng.standard_normal(seen.sum()) * depth[seen] ** 2
    return DepthView(depth.astype(np.float32), CAMERA)


@pytest.fixture(scope="module")
def tracked(scene) -> list[tuple[ArmState, np.ndarray]]:
    """States and true joint angles while the arm moves and its encoders are off."""
    rng = np.random.default_rng(0)
    state = start_arm_tracking(Q + BIAS)
    history = []
    for k in range(5):
        q = Q + 0.1 * np.sin(0.5 * k) * np.array([1, -1, 1, 1, 1, 1, 1])
        state = track_arm(
            links(),
            scene.kinematics,
            state,
            (k + 1) / 30,
            q + BIAS,
            view_of(scene, q, rng),
            limits=scene.limits,
        )
        history.append((state, q))
    return history


def test_bias_of_the_encoders_is_found(tracked):
    for state, q in tracked:
        assert state.status is TrackingStatus.TRACKING
        np.testing.assert_allclose(state.q + state.bias, q + BIAS)
    state, q = tracked[-1]
    assert np.degrees(np.abs(state.q - q))[:6].max() < 0.25
    np.testing.assert_allclose(state.bias[:6], BIAS[:6], atol=np.radians(0.25))


def test_joint_that_turns_a_round_flange_is_known_to_be_unknown(tracked):
    state, _ = tracked[-1]
    assert state.observable[:6].all()
    assert not state.observable[6]
    errors = np.array([state.q - q for state, q in tracked])
    deviations = np.array([np.sqrt(np.diag(state.covariance)) for state, _ in tracked])
    assert (np.abs(errors) < 3 * deviations).all()


def test_jacobians_of_the_scene_are_right(scene):
    """The test's own kinematics: a step of the joints moves the links as J says."""
    X, J = scene.kinematics(Q)
    step = 1e-6 * np.arange(1, 8)
    moved, _ = scene.kinematics(Q + step)
    np.testing.assert_allclose(moved[:, :3, 3] - X[:, :3, 3], (J @ step)[:, 3:], atol=1e-9)


def test_estimate_keeps_the_joint_limits(scene):
    """An encoder that reads 8 degrees past a limit, at which the joint stands."""
    low, high = scene.limits
    q = np.clip(Q, low, high)
    q[3] = low[3]
    state = track_arm(
        links(),
        scene.kinematics,
        start_arm_tracking(q),
        0.03,
        q - np.radians([0, 0, 0, 8, 0, 0, 0]),
        view_of(scene, q, np.random.default_rng(1)),
        limits=scene.limits,
    )
    assert state.q[3] >= low[3]
    assert np.degrees(abs(state.q[3] - q[3])) < 0.5


def test_arm_that_is_not_there_is_lost(scene):
    state = start_arm_tracking(Q)
    empty = DepthView(np.full((480, 640), 3.0, np.float32), CAMERA)
    after = track_arm(links(), scene.kinematics, state, 0.1, Q, empty)
    assert after.status is TrackingStatus.LOST
    np.testing.assert_array_equal(after.bias, state.bias)
    covered = DepthView(np.full((480, 640), 0.3, np.float32), CAMERA)
    after = track_arm(links(), scene.kinematics, state, 0.1, Q, covered)
    assert after.status is TrackingStatus.OCCLUDED
    assert (np.diag(after.covariance) > np.diag(state.covariance)).all()


def test_bad_input_is_named(scene):
    state = start_arm_tracking(Q, 1.0)
    limits = (np.ones(7), np.zeros(7))
    for time, q, name in (
        (0.5, Q, "time"),
        (1.1, Q[:6], "q_measured"),
        (1.1, np.full(7, np.nan), "q_measured"),
    ):
        with pytest.raises(ValueError, match=name):
            track_arm(links(), scene.kinematics, state, time, q, [])
    with pytest.raises(ValueError, match="limits"):
        track_arm(links(), scene.kinematics, state, 1.1, Q, [], limits=limits)
