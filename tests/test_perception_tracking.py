"""A hammer tracked through simulated depth images: moving, in a hand, hidden, taken away."""

import time
from collections.abc import Callable

import numpy as np
import pytest
from depth_scene import boxes_mesh, d415, look_at, render_depth
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from prehensile.perception.body_evidence import Body, EvidenceConfig
from prehensile.perception.camera_model import PosedCamera
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.free_space import DepthView
from prehensile.perception.tracking import (
    ObjectState,
    TrackerConfig,
    TrackingStatus,
    predict,
    start_tracking,
    track_object,
)
from prehensile.perception.turns import rotation_of, rotation_vector

CAMERA = d415(look_at((0.6, -0.3, 0.5), (0, 0, 0.1)))
DT = 1 / 30
NOISE = 0.002  # At 1 m, growing with the square of the depth.


@pytest.fixture(scope="module")
def hammer() -> Body:
    mesh = boxes_mesh([((0, 0, 0), (0.16, 0.03, 0.025)), ((0.07, 0.01, 0), (0.04, 0.09, 0.04))])
    field = DistanceField.from_mesh(mesh, spacing=0.003, margin=0.035)
    return Body.from_mesh(mesh, field)


@pytest.fixture(scope="module")
def hand() -> DistanceField:
    """A palm before the handle with two fingers around it."""
    boxes = [
        ((0, 0, 0.035), (0.13, 0.1, 0.02)),
        ((0, 0.03, 0.005), (0.13, 0.02, 0.06)),
        ((0, -0.03, 0.005), (0.13, 0.02, 0.06)),
    ]
    return DistanceField.from_mesh(boxes_mesh(boxes), spacing=0.004, margin=0.02)


def swinging(t: float) -> RigidTransform:
    """Up to 0.5 m/s and 1.5 rad/s."""
    angle = 1.5 / 4 * np.sin(4 * t)
    R = Rotation.from_rotvec(angle * np.array([0.6, 0.64, 0.48])).as_matrix()
    return RigidTransform(RotationMatrix(R), [0.1 * np.sin(5 * t), 0.02 * t, 0.1])


def error(state: ObjectState, X_WO: RigidTransform) -> tuple[float, float]:
    """Distance of the origins [m] and angle [degrees]."""
    E = X_WO.inverse() @ state.X_WO
    angle = float(np.degrees(E.rotation().ToAngleAxis().angle()))
    return float(np.linalg.norm(E.translation())), angle


def track(
    body: Body,
    path: Callable[[float], RigidTransform],
    frames: int,
    *,
    hand: DistanceField | None = None,
    know_hand: bool = True,
    hidden: Callable[[int], bool] = lambda _: False,
    gone: Callable[[int], bool] = lambda _: False,
) -> list[tuple[ObjectState, RigidTransform]]:
    """The states and the true poses; the hand moves with the object."""
    rng = np.random.default_rng(0)
    state = start_tracking(path(0.0) @ RigidTransform([0.004, 0.003, 0.0]))
    history = []
    for k in range(1, frames + 1):
        X_WO = path(k * DT)
        bodies = [] if gone(k) else [(body.field, X_WO)]
        X_WH = X_WO @ RigidTransform([-0.03, 0, 0])
        occluders = []
        if hand is not None:
            bodies.append((hand, X_WH))
            occluders = [(hand, X_WH)] if know_hand else []
        depth = render_depth(CAMERA, bodies, noise=NOISE, rng=rng)
        if hidden(k):
            depth[:] = 0.3
        state = track_object(body, state, k * DT, DepthView(depth, CAMERA), occluders=occluders)
        history.append((state, X_WO))
    return history


@pytest.fixture(scope="module")
def swung(hammer) -> list[tuple[ObjectState, RigidTransform]]:
    return track(hammer, swinging, 30)


def test_moving_object_is_followed_at_camera_rate(hammer, swung):
    history = swung
    errors = np.array([error(*item) for item in history])
    assert all(state.status is TrackingStatus.TRACKING for state, _ in history)
    assert errors[:, 0].max() < 0.003
    assert errors[:, 1].max() < 2
    assert np.median(errors[:, 0]) < 0.0005
    # The velocity comes out of the poses alone.
    state = history[-1][0]
    t = 30 * DT
    v = (swinging(t + 1e-4).translation() - swinging(t - 1e-4).translation()) / 2e-4
    assert np.linalg.norm(state.V_WO[3:] - v) < 0.1
    # One more image, the work of one thread: a camera leaves 33 ms.
    depth = render_depth(CAMERA, [(hammer.field, swinging(t + DT))])
    view = DepthView(depth, CAMERA)
    begin = time.thread_time()
    track_object(hammer, state, t + DT, view)
    assert time.thread_time() - begin < 0.033


def test_object_in_a_hand_is_followed(hammer, hand):
    history = track(hammer, swinging, 20, hand=hand)
    errors = np.array([error(*item) for item in history])
    occluded = [state.evidence.occluded for state, _ in history if state.evidence]
    assert np.mean(occluded) > 0.4
    assert all(state.status is TrackingStatus.TRACKING for state, _ in history)
    assert errors[:, 0].max() < 0.003
    assert errors[:, 1].max() < 3


def test_covariance_tells_the_error(swung):
    """Normalized squared errors of the pose average to no more than their number, 6."""
    squares = []
    for state, X_WO in swung[3:]:
        turn = Rotation.from_matrix(
            state.X_WO.rotation().matrix() @ X_WO.rotation().matrix().T
        ).as_rotvec()
        e = np.concatenate([turn, state.X_WO.translation() - X_WO.translation()])
        squares.append(e @ np.linalg.solve(state.covariance[:6, :6], e))
    assert np.mean(squares) < 12


def test_object_hidden_for_a_moment_is_found_again(hammer):
    def gliding(t: float) -> RigidTransform:
        return RigidTransform(RotationMatrix.MakeZRotation(0.5 * t), [0.15 * t - 0.1, 0, 0.1])

    history = track(hammer, gliding, 22, hidden=lambda k: 12 < k <= 17)
    status = [state.status for state, _ in history]
    assert set(status[:12]) == {TrackingStatus.TRACKING}
    assert set(status[12:17]) == {TrackingStatus.OCCLUDED}
    assert set(status[18:]) == {TrackingStatus.TRACKING}
    assert error(*history[16])[0] < 0.02
    assert history[16][0].covariance[3, 3] > 4 * history[11][0].covariance[3, 3]
    assert error(*history[-1])[0] < 0.003


def test_object_taken_away_is_lost(hammer):
    history = track(hammer, swinging, 12, gone=lambda k: k > 8)
    status = [state.status for state, _ in history]
    assert set(status[:8]) == {TrackingStatus.TRACKING}
    assert set(status[8:]) == {TrackingStatus.LOST}


def test_object_out_of_sight_too_long_is_lost(hammer):
    history = track(hammer, swinging, 21, hidden=lambda k: k > 4)
    assert history[5][0].status is TrackingStatus.OCCLUDED
    assert history[-1][0].status is TrackingStatus.LOST
    assert history[-1][0].coasting == pytest.approx(17 * DT)


def test_tracking_repeats_bit_for_bit_and_leaves_its_state_alone(hammer):
    depth = render_depth(CAMERA, [(hammer.field, swinging(DT))])
    state = start_tracking(swinging(0))
    before = state.covariance.copy()
    a, b = (track_object(hammer, state, DT, DepthView(depth, CAMERA)) for _ in range(2))
    np.testing.assert_array_equal(a.X_WO.GetAsMatrix4(), b.X_WO.GetAsMatrix4())
    np.testing.assert_array_equal(a.covariance, b.covariance)
    np.testing.assert_array_equal(state.covariance, before)


def test_pixels_to_ignore_do_not_count(hammer):
    """A wrong surface right before the object does no harm where a mask says so."""
    depth = render_depth(CAMERA, [(hammer.field, swinging(0))])
    shown = depth < 1.5
    columns = np.arange(640)[None, :] > np.nonzero(shown)[1].mean()
    masked = shown & columns
    wrong = np.where(masked, depth - 0.015, depth)
    state = start_tracking(swinging(0))
    config = TrackerConfig(initial_pose=(0.3, 0.03))
    ignoring = track_object(hammer, state, DT, DepthView(wrong, CAMERA, masked), config=config)
    believing = track_object(hammer, state, DT, DepthView(wrong, CAMERA), config=config)
    assert error(ignoring, swinging(0))[0] < 0.002
    assert error(believing, swinging(0))[0] > 2 * error(ignoring, swinging(0))[0]


CARTON_MESH = boxes_mesh([((0, 0, 0), (0.06, 0.1, 0.19))])


@pytest.fixture(scope="module")
def carton() -> Body:
    return Body.from_mesh(CARTON_MESH, DistanceField.from_mesh(CARTON_MESH, 0.004, 0.04))


def slide(
    carton: Body, camera: PosedCamera, images: int, config: TrackerConfig
) -> list[tuple[ObjectState, float]]:
    """States and distances from the truth of a carton that slides on the table z = 0."""
    R_WC, p_WC = camera.X_WC.rotation().matrix(), camera.X_WC.translation()
    rays = np.moveaxis(np.array(camera.model.rays), 0, -1)
    down = -(rays @ R_WC[2, :2] + R_WC[2, 2])
    table = np.where(down > 0, p_WC[2] / np.where(down > 0, down, 1), np.inf)

    def path(t: float) -> RigidTransform:
        turn = RotationMatrix.MakeZRotation(0.4 * np.sin(3 * t))
        return RigidTransform(turn, [0.1 * np.sin(4 * t), 0.03 * t - 0.05, 0.095])

    rng = np.random.default_rng(0)
    state = start_tracking(path(0.0))
    history = []
    for k in range(1, images + 1):
        X_WO = path(k * DT)
        depth = np.minimum(render_depth(camera, [(carton.field, X_WO)], background=9.0), table)
        depth += NOISE * rng.standard_normal(depth.shape) * depth**2
        state = track_object(carton, state, k * DT, DepthView(depth, camera), config=config)
        history.append((state, error(state, X_WO)[0]))
    return history


def test_table_does_not_draw_on_what_slides_on_it(carton):
    """Points of the table beside a carton are not the carton's, though nobody says so."""
    camera = d415(look_at((0.4, -0.3, 0.6), (0, 0, 0)))
    blind = TrackerConfig(evidence=EvidenceConfig(max_normal_angle=np.pi))
    errors, without = (
        np.array([distance for _, distance in slide(carton, camera, 8, config)])
        for config in (TrackerConfig(), blind)
    )
    assert errors.max() < 0.0005
    assert np.median(without) > 1.5 * np.median(errors)


def test_carton_is_followed_from_above(carton):
    """Little but its top can be seen: only the top's edges say where it is on the table."""
    camera = d415(look_at((0.15, -0.1, 0.75), (0, 0, 0)))
    history = slide(carton, camera, 16, TrackerConfig())
    assert all(state.status is TrackingStatus.TRACKING for state, _ in history)
    assert max(distance for _, distance in history) < 0.005


def test_prediction_moves_with_the_velocity_and_grows_unsure():
    state = start_tracking(RigidTransform([1, 2, 3]), 1.0)
    moving = ObjectState(1.0, state.X_WO, np.array([0, 0, 0.5, 1, 0, 0.0]), state.covariance,
                         state.status)  # fmt: skip
    later = predict(moving, 1.2, TrackerConfig())
    np.testing.assert_allclose(later.X_WO.translation(), [1.2, 2, 3])
    np.testing.assert_allclose(
        later.X_WO.rotation().matrix(), RotationMatrix.MakeZRotation(0.1).matrix(), atol=1e-12
    )
    assert np.linalg.eigvalsh(later.covariance - state.covariance)[-1] > 0
    halves = predict(predict(moving, 1.1, TrackerConfig()), 1.2, TrackerConfig())
    np.testing.assert_allclose(halves.X_WO.translation(), later.X_WO.translation())


def test_no_view_at_all_is_occlusion(hammer):
    state = track_object(hammer, start_tracking(swinging(0)), DT, [])
    assert state.status is TrackingStatus.OCCLUDED
    nothing = DepthView(np.full((480, 640), np.nan, np.float32), CAMERA)
    assert track_object(hammer, state, 2 * DT, nothing).status is TrackingStatus.OCCLUDED


def test_bad_input_is_named(hammer):
    state = start_tracking(swinging(0), 1.0)
    with pytest.raises(ValueError, match="time"):
        track_object(hammer, state, 0.5, [])
    with pytest.raises(ValueError, match="depth"):
        track_object(hammer, state, 1.1, DepthView(np.zeros((3, 4)), CAMERA))
    with pytest.raises(ValueError, match="noise"):
        EvidenceConfig(noise=0)
    with pytest.raises(ValueError, match="normals"):
        Body(hammer.field, hammer.points, hammer.normals[:5])
    with pytest.raises(ValueError, match="points"):
        Body(hammer.field, hammer.points[:, :2], hammer.normals)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 3.1))
def test_rotation_vectors_are_those_of_scipy(seed, angle):
    axis = np.random.default_rng(seed).normal(size=3)
    vector = angle * axis / np.linalg.norm(axis)
    R = rotation_of(vector)
    np.testing.assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotation_vector(R), vector, atol=1e-9)
