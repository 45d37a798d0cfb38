"""Fusing depth images: against balls and floors in closed form, and against other ways."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from prehensile.errors import InputError
from prehensile.native import _core, simd_levels
from prehensile.perception import (
    Box,
    CameraModel,
    DepthConfig,
    Distortion,
    PointCloud,
    PosedCamera,
    crop,
    downsample,
    fuse,
    inside_box,
    normals_from_depth,
    unproject,
)
from prehensile.perception.depth import native_view

K = np.array([[300.0, 0.0, 159.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]])
CAMERA = CameraModel.from_K(K, 320, 240)
CENTRE, RADIUS, VOXEL = np.array([0.5, 0.1, 0.08]), 0.06, 0.005
EYES = np.array([[1.1, 0.1, 0.6], [0.2, 0.7, 0.6], [0.2, -0.5, 0.6]])
BOX = Box(RigidTransform([0.5, 0.1, 0.105]), np.array([0.2, 0.2, 0.2]))


def looking_at(eye: np.ndarray, target: np.ndarray) -> RigidTransform:
    """Pose of an optical frame at ``eye`` whose z axis points to ``target``, x horizontal."""
    z = (target - eye) / np.linalg.norm(target - eye)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.stack([x, np.cross(z, x), z], axis=1)), eye)


def sphere_on_floor(X_WC: RigidTransform, centre: np.ndarray, radius: float) -> np.ndarray:
    """Depth image of a sphere over the floor z = 0."""
    v, u = np.mgrid[0:240, 0:320]
    d_C = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(u.shape)], axis=-1)
    d, o = d_C @ X_WC.rotation().matrix().T, X_WC.translation()
    floor = np.where(d[..., 2] < 0, -o[2] / np.minimum(d[..., 2], -1e-9), np.inf)
    a, b, c = np.sum(d * d, -1), d @ (o - centre), (o - centre) @ (o - centre) - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0))
    ball = np.where(b * b > a * c, (-b - root) / a, np.inf)
    return np.minimum(floor, ball).astype(np.float32)


def test_fused_cloud_of_a_sphere_lies_on_it_with_outward_normals() -> None:
    centre, radius, voxel = np.array([0.5, 0.1, 0.08]), 0.06, 0.005
    eyes = np.array([[1.1, 0.1, 0.6], [0.2, 0.7, 0.6], [0.2, -0.5, 0.6]])
    X_WCs = [looking_at(eye, centre) for eye in eyes]
    depths = [sphere_on_floor(X, centre, radius) for X in X_WCs]
    box = Box(RigidTransform([0.5, 0.1, 0.105]), np.array([0.2, 0.2, 0.2]))
    cloud = fuse(depths, [PosedCamera(CAMERA, X) for X in X_WCs], box, voxel)
    assert inside_box(cloud.points, box).all()
    outward = cloud.points - centre
    distance = np.linalg.norm(outward, axis=1)
    assert np.abs(distance - radius).max() < 0.001
    error = np.degrees(
        np.arccos(np.clip(np.sum(outward * cloud.require_normals(), axis=1) / distance, -1, 1))
    )
    assert np.median(error) < 2
    assert error.max() < 15
    # Seen from three sides, the ball is covered down to its equator and below.
    azimuth = np.arctan2(outward[:, 1], outward[:, 0])[np.abs(outward[:, 2]) < 0.02]
    assert np.diff(np.sort(azimuth)).max() < 0.3
    # One point in each voxel.
    cells = np.floor(cloud.points / voxel)
    assert len(np.unique(cells, axis=0)) == len(cloud)


def test_fusing_does_not_depend_on_a_box_behind_the_camera() -> None:
    X_WC = looking_at(np.array([0.5, 0.0, 0.4]), np.array([0.5, 0.1, 0.0]))
    depth = sphere_on_floor(X_WC, np.array([0.5, 0.1, 0.05]), 0.05)
    camera = PosedCamera(CAMERA, X_WC)
    near = Box(RigidTransform([0.5, 0.1, 0.06]), np.array([0.2, 0.2, 0.11]))
    far = Box(RigidTransform([0.5, 0.1, 0.505]), np.array([5.0, 5.0, 1.0]))
    a = fuse([depth], [camera], near, 0.004)
    b = crop(fuse([depth], [camera], far, 0.004), near)
    inner = Box(near.X_WB, near.size - 0.02)  # the rims of the regions differ
    a, b = crop(a, inner), crop(b, inner)
    # In single precision a point on the border of two voxels may go to either.
    assert abs(len(a) - len(b)) < 0.01 * len(a)
    distance, _ = cKDTree(b.points).query(a.points)
    assert np.quantile(distance, 0.98) < 1e-5


def three_views() -> tuple[list[np.ndarray], list[PosedCamera]]:
    """A ball over the floor, from three sides."""
    cameras = [PosedCamera(CAMERA, looking_at(eye, CENTRE)) for eye in EYES]
    return [sphere_on_floor(c.X_WC, CENTRE, RADIUS) for c in cameras], cameras


def test_fusing_is_unprojecting_cropping_and_averaging() -> None:
    depths, cameras = three_views()
    shift = RigidTransform([0.0013, 0.0017, 0.0021])  # so that the floor is on no voxel's border
    cameras = [PosedCamera(CAMERA, shift @ camera.X_WC) for camera in cameras]
    turned = Box(RigidTransform(RollPitchYaw(0.1, -0.2, 0.3), BOX.X_WB.translation()), BOX.size)
    points, normals = [], []
    for depth, camera in zip(depths, cameras, strict=True):
        p = unproject(depth, CAMERA)
        X_CB = camera.X_WC.inverse() @ turned.X_WB
        inside = inside_box(p, Box(X_CB, turned.size))
        n = normals_from_depth(np.where(inside, depth, np.nan), CAMERA)
        keep = np.isfinite(n[..., 0])
        points.append(camera.X_WC.multiply(p[keep].T).T)
        normals.append(n[keep] @ camera.X_WC.rotation().matrix().T)
    expected = downsample(PointCloud(np.concatenate(points), np.concatenate(normals)), VOXEL)
    cloud = fuse(depths, cameras, turned, VOXEL)
    # In single precision a point on the border of two voxels may go to either.
    assert abs(len(cloud) - len(expected)) <= 4
    same = {tuple(c): i for i, c in enumerate(np.floor(expected.points / VOXEL).astype(int))}
    pairs = [(i, same.get(tuple(c))) for i, c in enumerate(np.floor(cloud.points / VOXEL))]
    i, j = np.array([pair for pair in pairs if pair[1] is not None]).T
    assert len(i) > 0.999 * len(cloud)
    assert np.quantile(np.abs(cloud.points[i] - expected.points[j]), 0.999) < 1e-6
    error = np.abs(cloud.require_normals()[i] - expected.require_normals()[j])
    assert np.quantile(error, 0.99) < 1e-4
    # In the same order.
    assert (np.diff(j) > 0).mean() > 0.999


def test_sensor_origins_are_of_cameras_that_see_the_point_from_the_front() -> None:
    depths, cameras = three_views()
    cloud = fuse(depths, cameras, BOX, VOXEL)
    origins = cloud.require_sensor_origins()
    positions = np.array([c.X_WC.translation() for c in cameras])
    nearest = np.linalg.norm(origins[:, None] - positions, axis=-1).min(axis=1)
    assert nearest.max() < 1e-12
    assert len(np.unique(origins.round(9), axis=0)) == 3
    facing = np.sum((origins - cloud.points) * cloud.require_normals(), axis=1)
    assert (facing > 0).all()


def test_colors_are_the_mean_over_the_voxel() -> None:
    depths, cameras = three_views()
    colors = [np.full((240, 320, 4), 255, dtype=np.uint8) for _ in cameras]
    for k in range(3):
        colors[k][..., :3] = [10, 20, 40 * (k + 1)]
    cloud = fuse(depths, cameras, BOX, VOXEL, color_images=colors)
    plain = fuse(depths, cameras, BOX, VOXEL)
    np.testing.assert_array_equal(cloud.points, plain.points)
    assert plain.colors is None
    assert cloud.colors is not None
    np.testing.assert_array_equal(cloud.colors[:, :2], np.tile([10, 20], (len(cloud), 1)))
    assert cloud.colors[:, 2].min() == 40
    assert cloud.colors[:, 2].max() == 120
    one = fuse(depths[:1], cameras[:1], BOX, VOXEL, color_images=colors[:1])
    assert one.colors is not None
    assert (one.colors[:, 2] == 40).all()


def test_threads_and_levels_agree_bit_for_bit() -> None:
    depths, cameras = three_views()
    colors = np.random.default_rng(0).integers(0, 256, (3, 240, 320, 3), dtype=np.uint8)
    for config in (DepthConfig(), DepthConfig(window=9, noise_constant=0.002)):
        views = [
            native_view(depth, CAMERA, config, c.X_WC.GetAsMatrix4(), color)
            for depth, c, color in zip(depths, cameras, colors, strict=True)
        ]
        box = (BOX.X_WB.GetAsMatrix4(), BOX.size)
        results = [
            _core.fuse_depth(views, *box, VOXEL, config.limits(), threads, level)
            for level in simd_levels()
            for threads in (1, 2, 3, 7)
        ]
        assert len(results[0][0]) > 1000
        for result in results[1:]:
            for a, b in zip(result, results[0], strict=True):
                np.testing.assert_array_equal(a, b)


def test_far_from_the_origin_nothing_is_lost() -> None:
    depths, cameras = three_views()
    near = fuse(depths, cameras, BOX, VOXEL)
    shift = RigidTransform(VOXEL * np.array([2e5, -3e5, 1e5]))  # 1000 m, -1500 m, 500 m
    moved = [PosedCamera(c.model, shift @ c.X_WC) for c in cameras]
    far = fuse(depths, moved, Box(shift @ BOX.X_WB, BOX.size), VOXEL)
    assert abs(len(far) - len(near)) < 0.01 * len(near)
    back = far.transformed(shift.inverse())
    distance = np.linalg.norm(back.points - CENTRE, axis=1)
    assert np.abs(distance - RADIUS).max() < 0.001


def test_a_lens_that_distorts_makes_no_difference_to_the_shape() -> None:
    lens = (-0.06, 0.07, -0.001, 0.0008, -0.02)
    model = dc.replace(CAMERA, distortion=Distortion.BROWN_CONRADY, coefficients=lens)
    cameras = [PosedCamera(model, looking_at(eye, CENTRE)) for eye in EYES]
    depths = []
    for camera in cameras:
        d = np.concatenate([np.moveaxis(model.rays, 0, -1), np.ones((240, 320, 1))], axis=-1)
        p = camera.X_WC.inverse().multiply(CENTRE)
        a, b, c = np.sum(d * d, -1), d @ p, p @ p - RADIUS**2
        hit = b * b > a * c
        depths.append(np.where(hit, (b - np.sqrt(np.maximum(b * b - a * c, 0))) / a, 0))
    cloud = fuse(depths, cameras, BOX, VOXEL)
    assert len(cloud) > 800
    outward = cloud.points - CENTRE
    distance = np.linalg.norm(outward, axis=1)
    assert np.abs(distance - RADIUS).max() < 0.001
    cosine = np.sum(outward * cloud.require_normals(), axis=1) / distance
    assert np.median(np.degrees(np.arccos(np.clip(cosine, -1, 1)))) < 2


def test_stated_noise_is_averaged_away() -> None:
    depths, cameras = three_views()
    rng = np.random.default_rng(1)
    noisy = [d + rng.normal(0, 0.001 + 0.002 * d**2) for d in depths]
    config = DepthConfig(window=9, noise_constant=0.001, noise_quadratic=0.002)
    cloud = fuse(noisy, cameras, BOX, VOXEL, config=config)
    outward = cloud.points - CENTRE
    distance = np.linalg.norm(outward, axis=1)
    on_ball = distance < RADIUS + 0.005
    assert on_ball.sum() > 500
    cosine = np.sum(outward * cloud.require_normals(), axis=1)[on_ball] / distance[on_ball]
    assert np.median(np.degrees(np.arccos(np.clip(cosine, -1, 1)))) < 8
    # The noise of a pixel is 2 mm, and the ball rises 0.9 mm over a window.
    assert np.sqrt(np.mean((distance[on_ball] - RADIUS) ** 2)) < 0.0015


@pytest.mark.parametrize("value", [np.nan, 0.0, np.inf, -1.0, 100.0])
def test_where_nothing_is_measured_the_cloud_is_empty(value: float) -> None:
    camera = PosedCamera(CAMERA, looking_at(EYES[0], CENTRE))
    for num_threads in (1, 2):
        cloud = fuse([np.full((240, 320), value)], [camera], BOX, VOXEL, num_threads=num_threads)
        assert len(cloud) == 0
        assert cloud.require_normals().shape == (0, 3)
        assert cloud.require_sensor_origins().shape == (0, 3)


def test_a_box_that_no_camera_sees_is_empty() -> None:
    depths, cameras = three_views()
    for p in ([0.5, 0.1, 5.0], [0.5, 0.1, -3.0], [100.0, 0.0, 0.0]):
        assert len(fuse(depths, cameras, Box(RigidTransform(p), BOX.size), VOXEL)) == 0


@settings(max_examples=30, deadline=None)
@given(
    rpy=st.tuples(*[st.floats(-3, 3)] * 3),
    p=st.tuples(*[st.floats(-2, 2)] * 3),
    size=st.tuples(*[st.floats(1e-3, 5.0)] * 3),
    voxel=st.floats(1e-3, 0.5),
    bad=st.floats(0, 1),
    threads=st.integers(1, 4),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_input_gives_finite_points_inside_the_box(
    rpy: tuple, p: tuple, size: tuple, voxel: float, bad: float, threads: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    box = Box(RigidTransform(RollPitchYaw(*rpy), p), np.array(size))
    model = CameraModel(37, 23, 20.0, 21.0, 18.0, 11.0)
    cameras = [
        PosedCamera(model, RigidTransform(RollPitchYaw(*rng.uniform(-3, 3, 3)), rng.normal(size=3)))
        for _ in range(2)
    ]
    v, u = np.mgrid[0:23, 0:37]
    depths = []
    for _ in cameras:
        a, b, c = rng.uniform(-0.01, 0.01), rng.uniform(-0.01, 0.01), rng.uniform(0.3, 2.0)
        depth = 1 / np.maximum(c + a * u + b * v, 0.1)
        depth[rng.random(depth.shape) < bad] = rng.choice([0.0, np.nan, np.inf, -1.0, 1e38])
        depths.append(depth)
    cloud = fuse(depths, cameras, box, voxel, num_threads=threads)
    assert inside_box(cloud.points, Box(box.X_WB, box.size + 1e-5)).all()
    np.testing.assert_allclose(np.linalg.norm(cloud.require_normals(), axis=1), 1, atol=1e-12)
    cells = np.floor(cloud.points / voxel)
    assert len(np.unique(cells, axis=0)) >= 0.99 * len(cloud)


def test_wrong_input_is_refused() -> None:
    depths, cameras = three_views()
    nan_pose = cameras[0].X_WC.GetAsMatrix4()
    nan_pose[0, 3] = np.nan

    def refused(message: str, *args: object, **keywords: object) -> None:
        everything = [depths, cameras, BOX, VOXEL]
        for i, value in enumerate(args):
            everything[i] = everything[i] if value is None else value
        with pytest.raises(InputError, match=message):
            fuse(*everything, **keywords)  # pyright: ignore[reportArgumentType]

    refused("depth_images is empty", [], [])
    refused("2 depth_images for 3 cameras", depths[:2])
    refused("1 color_images", color_images=[np.zeros((240, 320, 3), np.uint8)])
    refused(r"color image of depth_images\[0\]", color_images=[np.zeros((2, 2, 3), np.uint8)] * 3)
    refused(r"depth_images\[1\] has shape", [depths[0], depths[1][1:], depths[2]])
    refused("X_WC", None, [PosedCamera(CAMERA, RigidTransform(nan_pose)), *cameras[1:]])
    refused("size", None, None, Box(BOX.X_WB, np.array([0.1, 0.0, 0.1])))
    refused("size", None, None, Box(BOX.X_WB, np.array([0.1, 0.1])))
    refused("X_WB", None, None, Box(RigidTransform([np.inf, 0, 0]), BOX.size))
    refused("voxel_size", None, None, None, 0.0)
    refused("voxel_size", None, None, None, np.nan)
    refused("voxel_size.*too small", None, None, None, 1e-8)
    refused("voxel_size.*too small", None, None, Box(RigidTransform([1e9, 0, 0]), BOX.size), 1e-3)
    refused("num_threads", num_threads=0)
    refused("window", config=DepthConfig(window=2))


def test_downsampling_keeps_what_is_known() -> None:
    points = np.array([[0.001, 0.001, 0.001], [0.012, 0.0, 0.0], [0.002, 0.002, 0.002]])
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    colors = np.array([[10, 0, 0], [5, 6, 7], [21, 4, 0]], dtype=np.uint8)
    cloud = PointCloud(points, up, colors, np.array([3, 4, 5]), points + up)
    small = downsample(cloud, 0.01)
    np.testing.assert_allclose(small.points, [[0.0015] * 3, points[1]])
    np.testing.assert_array_equal(small.normals, up[:2])
    np.testing.assert_array_equal(small.colors, [[16, 2, 0], [5, 6, 7]])
    np.testing.assert_array_equal(small.labels, [3, 4])
    np.testing.assert_array_equal(small.sensor_origins, (points + up)[:2])
    bare = downsample(PointCloud(points), 0.01)
    np.testing.assert_array_equal(bare.points, small.points)
    assert bare.normals is None
    assert bare.colors is None


@settings(max_examples=20, deadline=None)
@given(voxel=st.floats(0.02, 0.5), seed=st.integers(0, 2**32 - 1))
def test_downsampled_colors_are_means_over_voxels(voxel: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.3, 0.3, (500, 3))
    colors = rng.integers(0, 256, (500, 3), dtype=np.uint8)
    cloud = downsample(PointCloud(points, colors=colors, labels=np.arange(500)), voxel)
    assert cloud.colors is not None
    assert cloud.labels is not None
    cells = np.floor(points * (1 / voxel))
    assert len(cloud) == len(np.unique(cells, axis=0))
    for i in range(0, len(cloud), 7):
        members = (cells == cells[cloud.labels[i]]).all(axis=1)
        assert cloud.labels[i] == np.nonzero(members)[0][0]
        np.testing.assert_allclose(cloud.points[i], points[members].mean(axis=0), atol=1e-12)
        np.testing.assert_array_equal(cloud.colors[i], np.rint(colors[members].mean(axis=0)))
