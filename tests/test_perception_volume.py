"""Truncated signed distances and free space, against the shapes that were seen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.errors import InputError
from prehensile.perception import Box
from prehensile.perception.camera_model import CameraModel, PosedCamera
from prehensile.perception.free_space import DepthView
from prehensile.perception.volume import DepthVolume, Occupancy, fuse_volume
from prehensile.viz.render import look_at

K = np.array([[300.0, 0, 159.5], [0, 300.0, 119.5], [0, 0, 1]])
CAMERA = CameraModel.from_K(K, 320, 240)
CENTRE, RADIUS, FLOOR = np.array([0.02, -0.01, 0.05]), 0.05, 0.0


def depth_of_a_ball_on_the_floor(X_WC: RigidTransform) -> np.ndarray:
    """Exact depth (240, 320) of the ball and the floor z = 0, inf where a ray meets neither."""
    v, u = np.mgrid[0:240, 0:320]
    ray_C = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], -1)
    ray = ray_C @ X_WC.rotation().matrix().T
    eye = X_WC.translation()
    with np.errstate(divide="ignore", invalid="ignore"):
        floor = np.where(ray[..., 2] < 0, (FLOOR - eye[2]) / ray[..., 2], np.inf)
        a = (ray**2).sum(-1)
        b = ray @ (eye - CENTRE)
        root = b**2 - a * (np.sum((eye - CENTRE) ** 2) - RADIUS**2)
        ball = np.where(root >= 0, (-b - np.sqrt(root)) / a, np.inf)
    return np.minimum(floor, ball)


EYES = [(0.5, 0.0, 0.4), (-0.3, 0.45, 0.4), (-0.3, -0.45, 0.4)]
REGION = Box(RigidTransform(RollPitchYaw(0, 0, 0.3), [0, 0, 0.06]), np.array([0.3, 0.28, 0.2]))


def views() -> list[DepthView]:
    poses = [look_at(np.array(eye), CENTRE) for eye in EYES]
    return [DepthView(depth_of_a_ball_on_the_floor(X), PosedCamera(CAMERA, X)) for X in poses]


@pytest.fixture(scope="module")
def volume() -> DepthVolume:
    return fuse_volume(views(), REGION, 0.004)


def true_distance(p: np.ndarray) -> np.ndarray:
    return np.minimum(np.linalg.norm(p - CENTRE, axis=1) - RADIUS, p[:, 2] - FLOOR)


def test_the_surface_is_that_of_ball_and_floor(volume: DepthVolume) -> None:
    cloud = volume.surface()
    error = np.abs(true_distance(cloud.points))
    assert len(cloud) > 2000
    assert np.median(error) < 0.0005
    assert np.quantile(error, 0.95) < 0.003  # Voxels of 4 mm; worst in the crease under the ball.
    on_ball = np.linalg.norm(cloud.points - CENTRE, axis=1) < RADIUS + 0.002
    on_ball &= cloud.points[:, 2] > 0.03
    assert on_ball.sum() > 300
    outward = cloud.points[on_ball] - CENTRE
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    cosine = np.sum(outward * cloud.require_normals()[on_ball], axis=1)
    assert np.median(np.arccos(np.clip(cosine, -1, 1))) < np.deg2rad(6)
    on_floor = (cloud.points[:, 2] < 0.002) & (np.hypot(*cloud.points[:, :2].T) > 0.1)
    assert np.quantile(cloud.require_normals()[on_floor, 2], 0.1) > np.cos(np.deg2rad(5))


def test_rays_say_where_nothing_is(volume: DepthVolume) -> None:
    """What is called free lies outside ball and floor; most of the space above them is free."""
    rng = np.random.default_rng(0)
    p_B = rng.uniform(-0.5, 0.5, (20_000, 3)) * volume.region.size
    p = volume.region.X_WB.multiply(p_B.T).T
    state, distance = volume.occupancy_at(p), true_distance(p)
    assert (state[distance < -0.004] != Occupancy.FREE).all()
    assert (state[distance > 0.012] != Occupancy.OCCUPIED).mean() > 0.995
    above = (distance > 0.012) & (p[:, 2] > 0.11)  # Nothing hides this from the cameras.
    assert (state[above] == Occupancy.FREE).all()
    assert (state[p[:, 2] < -0.025] == Occupancy.UNKNOWN).all()  # Under the floor.
    deep = np.linalg.norm(p - CENTRE, axis=1) < RADIUS - 0.025
    assert (state[deep] == Occupancy.UNKNOWN).all()
    grid = volume.occupancy()
    assert {int(s) for s in np.unique(grid)} == {-1, 0, 1}


def test_distances_near_the_surface(volume: DepthVolume) -> None:
    """Along a ray distances are no smaller than true ones, and agree where it meets squarely."""
    eye = np.array(EYES[0])
    toward = (eye - CENTRE) / np.linalg.norm(eye - CENTRE)
    single = fuse_volume(views()[0], REGION, 0.004)
    offsets = np.linspace(-0.010, 0.010, 21)
    p = CENTRE + np.outer(RADIUS + offsets, toward)
    np.testing.assert_allclose(single.distance_at(p), offsets, atol=0.0008)
    assert np.isnan(volume.distance_at(np.array([[5.0, 0, 0], [np.nan, 0, 0]]))).all()


def test_one_image_after_the_other_is_the_same(volume: DepthVolume) -> None:
    first, *others = views()
    again = fuse_volume(first, REGION, 0.004)
    for view in others:
        again = again.integrated(view, num_threads=2)
    np.testing.assert_array_equal(again.distances, volume.distances)
    np.testing.assert_array_equal(again.weights, volume.weights)


def test_ignored_pixels_and_missing_returns_say_nothing() -> None:
    view = views()[0]
    everything = np.ones(view.depth.shape, dtype=bool)
    silent = fuse_volume(DepthView(view.depth, view.camera, everything), REGION, 0.01)
    assert not silent.weights.any()
    blind = fuse_volume(DepthView(np.full((240, 320), np.nan), view.camera), REGION, 0.01)
    assert not blind.weights.any()
    assert len(blind.surface()) == 0


@settings(max_examples=30, deadline=None)
@given(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(allow_nan=True, allow_infinity=True),
)
def test_wrong_numbers_are_refused(size: float, voxel_size: float, truncation: float) -> None:
    camera = PosedCamera(CameraModel.from_K(K, 4, 4), RigidTransform())
    view = DepthView(np.ones((4, 4)), camera)
    numbers = (size, voxel_size, truncation)
    if all(0 < x < np.inf for x in numbers) and size / voxel_size < 600:
        return
    with pytest.raises(InputError, match=r"region|voxel_size|truncation"):
        fuse_volume(
            view, Box(RigidTransform(), np.full(3, size)), voxel_size, truncation=truncation
        )
