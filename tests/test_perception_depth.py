"""Points and normals of depth images, against planes and spheres in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from prehensile.errors import InputError
from prehensile.perception import normals_from_depth, unproject

K = np.array([[320.0, 0.0, 159.5], [0.0, 310.0, 119.5], [0.0, 0.0, 1.0]])
H, W = 240, 320


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
    p = unproject(depth, K) @ K.T
    v, u = np.mgrid[0:H, 0:W]
    np.testing.assert_allclose(p[..., 0] / p[..., 2], u, atol=1e-9)
    np.testing.assert_allclose(p[..., 1] / p[..., 2], v, atol=1e-9)
    np.testing.assert_array_equal(p[..., 2], depth)


def test_pixels_without_measurement_have_no_point() -> None:
    depth = np.full((4, 5), 1.0, dtype=np.float32)
    bad = [0.0, np.inf, np.nan, -1.0, 20.0]
    depth[1] = bad
    points = unproject(depth, K)
    assert np.isnan(points[1]).all()
    assert np.isfinite(points[[0, 2, 3]]).all()


@settings(max_examples=20, deadline=None)
@given(tilt=st.floats(0.0, 1.2), turn=st.floats(-3.1, 3.1), offset=st.floats(0.5, 1.5))
def test_normals_of_a_plane(tilt: float, turn: float, offset: float) -> None:
    normal = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    depth = plane_depth(normal, -offset)
    depth[depth <= 0] = np.inf
    n = normals_from_depth(depth.astype(np.float32), K)
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
    n = normals_from_depth(depth, K)
    seen = np.isfinite(n[..., 0])
    on_ball = ball < wall
    outward = (unproject(depth, K) - centre) / radius
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
    n = normals_from_depth(depth.astype(np.float32), K)
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
    small = np.array([[80.0, 0, 39.5], [0, 80.0, 29.5], [0, 0, 1]])
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


def test_wrong_input_is_refused() -> None:
    depth = np.ones((10, 10), dtype=np.float32)
    with pytest.raises(InputError, match=r"\(H, W\)"):
        unproject(depth[None], K)
    with pytest.raises(InputError, match="skew"):
        unproject(depth, K + np.eye(3, k=1))
    with pytest.raises(InputError, match="pinhole"):
        normals_from_depth(depth, -K)
    with pytest.raises(InputError, match="window"):
        normals_from_depth(depth, K, window=4)
