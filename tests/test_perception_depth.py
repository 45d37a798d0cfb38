"""Points and normals of depth images, against planes and spheres in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prehensile.errors import InputError
from prehensile.native import _core, simd_levels
from prehensile.perception import (
    CameraModel,
    DepthConfig,
    Distortion,
    normals_from_depth,
    unproject,
)
from prehensile.perception.depth import native_view

K = np.array([[320.0, 0.0, 159.5], [0.0, 310.0, 119.5], [0.0, 0.0, 1.0]])
H, W = 240, 320
CAMERA = CameraModel.from_K(K, W, H)


def rays() -> np.ndarray:
    """(H, W, 3) directions of the pixels' lines of sight, with z = 1."""
    v, u = np.mgrid[0:H, 0:W]
    return np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones((H, W))], axis=-1)


def plane_depth(normal: np.ndarray, offset: float) -> np.ndarray:
    """Depth of the plane normal . p = offset."""
    return offset / (rays() @ normal)


def sphere_depth(centre: np.ndarray, radius: float) -> np.ndarray:
    """Depth of a sphere; infinite beside it."""
    d = rays()
    a, b, c = np.sum(d * d, axis=-1), d @ centre, centre @ centre - radius**2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    return np.where(b * b > a * c, (b - root) / a, np.inf)


def angles(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles in degrees between unit vectors."""
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1)))


def test_unprojected_points_project_back_to_their_pixels() -> None:
    depth = np.random.default_rng(0).uniform(0.3, 2.0, (H, W)).astype(np.float32)
    p = unproject(depth, CAMERA) @ K.T
    v, u = np.mgrid[0:H, 0:W]
    np.testing.assert_allclose(p[..., 0] / p[..., 2], u, atol=1e-9)
    np.testing.assert_allclose(p[..., 1] / p[..., 2], v, atol=1e-9)
    np.testing.assert_array_equal(p[..., 2], depth)


def test_pixels_without_measurement_have_no_point() -> None:
    depth = np.full((4, 5), 1.0, dtype=np.float32)
    camera = CameraModel(5, 4, 10.0, 10.0, 2.0, 1.5)
    bad = [0.0, np.inf, np.nan, -1.0, 20.0]
    depth[1] = bad
    points = unproject(depth, camera)
    assert np.isnan(points[1]).all()
    assert np.isfinite(points[[0, 2, 3]]).all()


@settings(max_examples=20, deadline=None)
@given(tilt=st.floats(0.0, 1.2), turn=st.floats(-3.1, 3.1), offset=st.floats(0.5, 1.5))
def test_normals_of_a_plane(tilt: float, turn: float, offset: float) -> None:
    normal = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    depth = plane_depth(normal, -offset)
    depth[depth <= 0] = np.inf
    n = normals_from_depth(depth.astype(np.float32), CAMERA)
    seen = np.isfinite(n[..., 0])
    d = rays() / np.linalg.norm(rays(), axis=-1, keepdims=True)
    # Everything within range and not too flat to the line of sight has a normal.
    clear = (depth > 0.06) & (depth < 9.0) & (-(d @ normal) > np.cos(np.deg2rad(80)))
    clear[:3], clear[-3:], clear[:, :3], clear[:, -3:] = False, False, False, False
    assert seen[clear].mean() > 0.99
    assert angles(n[seen & clear], normal).max() < 0.1


def test_normals_of_a_sphere_before_a_wall() -> None:
    centre, radius = np.array([0.02, -0.01, 0.6]), 0.08
    wall = plane_depth(np.array([0.2, 0.3, -0.93]), -0.8)
    ball = sphere_depth(centre, radius)
    depth = np.minimum(wall, ball).astype(np.float32)
    n = normals_from_depth(depth, CAMERA)
    seen = np.isfinite(n[..., 0])
    on_ball = ball < wall
    outward = (unproject(depth, CAMERA) - centre) / radius
    error = angles(n[on_ball & seen], outward[on_ball & seen])
    assert np.median(error) < 0.3
    # At most the tilt of the sphere over a window's half diagonal plus rounding: no normal is
    # smeared with the wall behind.
    assert error.max() < 13
    wall_normal = np.array([0.2, 0.3, -0.93]) / np.linalg.norm([0.2, 0.3, -0.93])
    assert angles(n[~on_ball & seen], wall_normal).max() < 0.5
    assert seen[on_ball].mean() > 0.9


def test_normals_keep_a_crease_sharp() -> None:
    # Two planes that meet in a right angle along a column of the image.
    left, right = np.array([1.0, 0.0, -1.0]) / np.sqrt(2), np.array([-1.0, 0.0, -1.0]) / np.sqrt(2)
    depth_left, depth_right = plane_depth(left, -0.6), plane_depth(right, -0.6)
    depth = np.maximum(
        np.where(depth_left > 0, depth_left, -np.inf),
        np.where(depth_right > 0, depth_right, -np.inf),
    )
    depth = np.where(np.arange(W) < W // 2, depth_left, depth_right)
    depth[depth <= 0] = np.inf
    n = normals_from_depth(depth.astype(np.float32), CAMERA)
    columns = slice(W // 2 - 40, W // 2 + 40)
    truth = np.where((np.arange(W) < W // 2)[None, :, None], left, right)
    truth = np.broadcast_to(truth, n.shape)
    seen = np.isfinite(n[..., 0])
    seen[:, : columns.start], seen[:, columns.stop :] = False, False
    assert angles(n[seen], truth[seen]).max() < 0.5
    assert seen[:, columns].mean() > 0.98


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_normals_are_unit_and_face_the_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = np.full((60, 80), np.inf)
    small = CameraModel(80, 60, 80.0, 80.0, 39.5, 29.5)
    v, u = np.mgrid[0:60, 0:80]
    for _ in range(8):  # tilted patches, one before the other
        a, b = rng.uniform(-0.01, 0.01, 2)
        w = rng.uniform(0.7, 2.0) + a * (u - 40) + b * (v - 30)
        u0, v0 = rng.integers(0, 60), rng.integers(0, 40)
        patch = (u >= u0) & (u < u0 + 25) & (v >= v0) & (v < v0 + 20) & (w > 0.2)
        depth[patch] = np.minimum(depth, 1 / np.maximum(w, 0.2))[patch]
    n = normals_from_depth(depth, small)
    p = unproject(depth, small)
    seen = np.isfinite(n[..., 0])
    np.testing.assert_allclose(np.linalg.norm(n[seen], axis=1), 1.0, atol=1e-12)
    assert (np.sum(n[seen] * p[seen], axis=1) < 0).all()
    assert not seen[~np.isfinite(depth)].any()


def test_whole_numbers_are_millimetres_or_what_is_said() -> None:
    depth = np.random.default_rng(0).integers(300, 2000, (H, W)).astype(np.uint16)
    depth[3, 4] = 0
    metres = np.where(depth == 0, np.nan, 0.001 * depth)
    points = unproject(depth, CAMERA)
    np.testing.assert_allclose(points[..., 2], metres, rtol=1e-12)
    fine = DepthConfig(depth_unit=0.0001, min_depth=0.01)
    np.testing.assert_allclose(unproject(depth, CAMERA, fine), 0.1 * points, rtol=1e-12)
    np.testing.assert_array_equal(unproject(depth.astype(np.int64), CAMERA), points)
    smooth = np.round(1000 * plane_depth(np.array([0.3, 0.1, -1.0]), -0.9)).astype(np.uint16)
    n = normals_from_depth(smooth, CAMERA)
    truth = np.array([0.3, 0.1, -1.0]) / np.linalg.norm([0.3, 0.1, -1.0])
    assert np.median(angles(n[np.isfinite(n[..., 0])], truth)) < 4  # a millimetre is a coarse step


@pytest.mark.parametrize("model", [Distortion.BROWN_CONRADY, Distortion.MODIFIED_BROWN_CONRADY])
def test_normals_behind_a_lens_that_distorts(model: Distortion) -> None:
    lens = (-0.06, 0.07, -0.001, 0.0008, -0.02)
    camera = CameraModel(W, H, K[0, 0], K[1, 1], K[0, 2], K[1, 2], model, lens)
    normal = np.array([0.4, -0.3, -0.8]) / np.linalg.norm([0.4, -0.3, -0.8])
    rays_C = np.moveaxis(camera.rays.astype(float), 0, -1)
    rays_C = np.concatenate([rays_C, np.ones((H, W, 1))], axis=-1)
    depth = (-0.7 / (rays_C @ normal)).astype(np.float32)
    points = unproject(depth, camera)
    np.testing.assert_allclose(points @ normal, -0.7, atol=1e-6)
    n = normals_from_depth(depth, camera)
    assert np.isfinite(n[..., 0]).mean() > 0.99
    assert angles(n[np.isfinite(n[..., 0])], normal).max() < 0.3
    # Taken for a pinhole's, the same image shows a bent surface.
    bent = normals_from_depth(depth, CAMERA)
    assert np.nanmax(angles(bent, normal)) > 0.8


def test_noise_that_is_stated_is_averaged_over_a_larger_window() -> None:
    normal = np.array([0.3, 0.2, -0.9]) / np.linalg.norm([0.3, 0.2, -0.9])
    depth = plane_depth(normal, -0.8)
    noise = np.random.default_rng(0).normal(0, 0.001 + 0.002 * depth**2)
    noisy = (depth + noise).astype(np.float32)
    plain = normals_from_depth(noisy, CAMERA)
    assert np.isfinite(plain[..., 0]).mean() < 0.6  # most windows look uneven
    stated = normals_from_depth(
        noisy, CAMERA, DepthConfig(window=11, noise_constant=0.001, noise_quadratic=0.002)
    )
    assert np.isfinite(stated[..., 0]).mean() > 0.97
    assert np.nanmedian(angles(stated, normal)) < 4


def test_normals_of_a_plane_of_which_pixels_lack() -> None:
    # A window needs some of its pixels, not all; what is there says exactly what the plane is.
    rng = np.random.default_rng(0)
    normal = np.array([0.4, -0.2, -np.sqrt(0.8)])
    depth = plane_depth(normal, -1.0).astype(np.float32)
    for lacking, window, least in ((0.2, 5, 0.95), (0.2, 9, 0.999), (0.8, 5, 0.0)):
        holed = np.where(rng.uniform(size=depth.shape) < lacking, np.nan, depth)
        n = normals_from_depth(holed.astype(np.float32), CAMERA, DepthConfig(window=window))
        known = np.isfinite(n[..., 0])
        assert not known[np.isnan(holed)].any()
        assert known[np.isfinite(holed)].mean() >= least
        if lacking > 0.5:  # Too little is left for any window.
            assert known.sum() < 0.01 * known.size
        assert angles(n[known], normal).max(initial=0.0) < 0.05


def test_levels_and_threads_agree_bit_for_bit() -> None:
    depth = np.minimum(
        plane_depth(np.array([0.2, 0.3, -0.93]), -0.8),
        sphere_depth(np.array([0.02, -0.01, 0.6]), 0.08),
    )
    depth[np.random.default_rng(0).uniform(size=depth.shape) < 0.03] = np.nan
    for config in (DepthConfig(), DepthConfig(window=7, noise_constant=0.001)):
        view = native_view(depth, CAMERA, config, np.eye(4))
        for call in (_core.depth_normals, _core.unproject_depth):
            results = [
                call(view, config.limits(), threads, level)
                for level in simd_levels()
                for threads in (1, 2, 3)
            ]
            for result in results[1:]:
                np.testing.assert_array_equal(result, results[0])


@settings(max_examples=40, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    window=st.sampled_from([3, 5, 9, 17]),
    bad=st.floats(0, 1),
    noise=st.sampled_from([0.0, 0.002]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_image_gives_unit_normals_or_none(
    shape: tuple[int, int], window: int, bad: float, noise: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    height, width = shape
    camera = CameraModel(width, height, 30.0, 30.0, width / 2, height / 2)
    depth = rng.uniform(0.5, 0.51, shape) + rng.integers(0, 2)
    depth[rng.random(shape) < bad] = rng.choice([0.0, np.nan, np.inf, -np.inf, -1.0, 1e30, 1e-30])
    n = normals_from_depth(depth, camera, DepthConfig(window=window, noise_constant=noise))
    seen = np.isfinite(n[..., 0])
    np.testing.assert_allclose(np.linalg.norm(n[seen], axis=-1), 1.0, atol=1e-12)
    p = unproject(depth, camera)
    assert np.isfinite(p[seen]).all()
    assert (np.sum(n[seen] * p[seen], axis=-1) < 0).all()


def test_wrong_input_is_refused() -> None:
    depth = np.ones((H, W), dtype=np.float32)
    for function in (unproject, normals_from_depth):
        with pytest.raises(InputError, match=r"depth has shape \(1, 240, 320\)"):
            function(depth[None], CAMERA)
        with pytest.raises(InputError, match="depth has shape"):
            function(depth[:, :-1], CAMERA)
        with pytest.raises(InputError, match="depth holds complex128"):
            function(depth.astype(complex), CAMERA)
        with pytest.raises(InputError, match="depth_unit"):
            function(depth.astype(np.uint16), CAMERA, DepthConfig(depth_unit=0.0))
        with pytest.raises(InputError, match="max_depth"):
            function(depth, CAMERA, DepthConfig(min_depth=2.0, max_depth=1.0))
        with pytest.raises(InputError, match="num_threads"):
            function(depth, CAMERA, num_threads=0)
    for change, message in [
        (DepthConfig(window=4), "window"),
        (DepthConfig(window=19), "window"),
        (DepthConfig(max_residual=np.nan), "max_residual"),
        (DepthConfig(max_incidence=2.0), "max_incidence"),
        (DepthConfig(noise_constant=-1.0), "noise"),
    ]:
        with pytest.raises(InputError, match=message):
            normals_from_depth(depth, CAMERA, change)
