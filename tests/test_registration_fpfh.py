"""Fast point feature histograms against the paper's formulas and a search by hand."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.errors import InputError
from prehensile.perception.cloud import PointCloud
from prehensile.perception.registration.fpfh import fpfh, match_features


def _bumpy_cloud(rng: np.random.Generator, n: int = 300) -> PointCloud:
    """Random points of a wavy sheet of 20 cm with its normals."""
    x, y = rng.uniform(-0.1, 0.1, (2, n))
    points = np.stack([x, y, 0.02 * np.sin(30 * x) * np.cos(25 * y)], axis=1)
    slope_x = 0.6 * np.cos(30 * x) * np.cos(25 * y)
    slope_y = -0.5 * np.sin(30 * x) * np.sin(25 * y)
    normals = np.stack([-slope_x, -slope_y, np.ones(n)], axis=1)
    return PointCloud(points, normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _angles(p: np.ndarray, n: np.ndarray, q: np.ndarray, m: np.ndarray) -> tuple[float, ...]:
    """alpha, phi, theta of the paper's equations (1) and (2) for one pair."""
    line = (q - p) / np.linalg.norm(q - p)
    if np.arccos(abs(n @ line)) > np.arccos(abs(m @ line)):
        n, m, line = m, n, -line
    v = np.cross(line, n)
    v /= np.linalg.norm(v)
    w = np.cross(n, v)
    return float(v @ m), float(n @ line), float(np.arctan2(w @ m, n @ m))


def _expected(cloud: PointCloud, radius: float) -> np.ndarray:
    points, normals = cloud.points, cloud.require_normals()
    n = len(points)
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    near = (distance <= radius) & ~np.eye(n, dtype=bool)
    simple = np.zeros((n, 33))
    for i in range(n):
        for j in np.flatnonzero(near[i]):
            alpha, phi, theta = _angles(points[i], normals[i], points[j], normals[j])
            parts = ((theta / np.pi + 1) / 2, (alpha + 1) / 2, (phi + 1) / 2)
            for k, part in enumerate(parts):
                simple[i, 11 * k + min(int(11 * part), 10)] += 100 / near[i].sum()
    weight = np.where(near, 1 / np.where(near, distance, 1) ** 2, 0)
    around = weight @ simple
    for k in range(0, 33, 11):
        total = around[:, k : k + 11].sum(axis=1, keepdims=True)
        around[:, k : k + 11] *= 100 / np.where(total > 0, total, 1)
    return simple + around


def test_features_are_those_of_the_paper() -> None:
    cloud = _bumpy_cloud(np.random.default_rng(0))
    got, expected = fpfh(cloud, 0.04), _expected(cloud, 0.04)
    assert got.shape == (300, 33)
    # An angle on the edge of two bins may fall into either: not more than a few pairs.
    off = np.abs(got - expected) > 1e-3
    assert off.mean() < 0.01
    assert np.abs(got - expected).max() < 20
    sums = got.reshape(300, 3, 11).sum(axis=2)
    np.testing.assert_allclose(sums, 200, rtol=1e-4)


def test_rigid_motion_changes_nothing_and_threads_neither() -> None:
    cloud = _bumpy_cloud(np.random.default_rng(1), 600)
    moved = cloud.transformed(RigidTransform(RollPitchYaw(0.4, -1.1, 2.0), [1, -2, 0.5]))
    features = fpfh(cloud, 0.03)
    off = np.abs(fpfh(moved, 0.03) - features) > 1e-2
    assert off.mean() < 0.01
    np.testing.assert_array_equal(fpfh(cloud, 0.03, num_threads=2), features)


def test_points_without_neighbours_or_normals() -> None:
    cloud = _bumpy_cloud(np.random.default_rng(2), 50)
    points = np.concatenate([cloud.points, [[5.0, 5.0, 5.0]], cloud.points[:1] + 1e-3])
    normals = np.concatenate([cloud.require_normals(), [[0.0, 0.0, 1.0]], np.zeros((1, 3))])
    features = fpfh(PointCloud(points, normals), 0.05)
    assert not features[50:].any()
    np.testing.assert_array_equal(features[:50], fpfh(cloud, 0.05))
    assert fpfh(PointCloud(np.zeros((0, 3)), np.zeros((0, 3))), 0.05).shape == (0, 33)


def test_matches_are_those_of_an_exhaustive_search() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.uniform(0, 100, (137, 33)), rng.uniform(0, 100, (223, 33))
    distance = np.linalg.norm(a[:, None] - b, axis=2)
    nearest, back = distance.argmin(axis=1), distance.argmin(axis=0)
    all_pairs = match_features(a, b, mutual=False)
    np.testing.assert_array_equal(all_pairs, np.stack([np.arange(137), nearest], axis=1))
    rows = np.flatnonzero(back[nearest] == np.arange(137))
    np.testing.assert_array_equal(match_features(a, b, num_threads=2)[:, 0], rows)
    ordered = np.sort(distance, axis=1)
    clear = np.flatnonzero(ordered[:, 0] <= 0.9 * ordered[:, 1])
    strict = match_features(a, b, mutual=False, max_ratio=0.9)
    np.testing.assert_array_equal(strict[:, 0], clear)


def test_matching_finds_the_same_points_in_a_moved_cloud() -> None:
    cloud = _bumpy_cloud(np.random.default_rng(4), 500)
    order = np.random.default_rng(5).permutation(500)
    moved = cloud.select(order).transformed(
        RigidTransform(RollPitchYaw(1.0, 0.3, -0.7), [0.1, 0, 0])
    )
    pairs = match_features(fpfh(cloud, 0.03), fpfh(moved, 0.03))
    assert len(pairs) > 450
    assert np.mean(order[pairs[:, 1]] == pairs[:, 0]) > 0.99


def test_bad_input_is_named() -> None:
    cloud = _bumpy_cloud(np.random.default_rng(6), 20)
    with pytest.raises(InputError, match="normals"):
        fpfh(PointCloud(cloud.points), 0.1)
    for radius in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="radius"):
            fpfh(cloud, radius)
    with pytest.raises(ValueError, match="num_threads"):
        fpfh(cloud, 0.1, num_threads=0)
    with pytest.raises(ValueError, match="a: expected shape"):
        match_features(np.zeros((3, 32)), np.zeros((3, 33)))
    with pytest.raises(ValueError, match="b: must be finite"):
        match_features(np.zeros((3, 33)), np.full((3, 33), np.nan))
    with pytest.raises(ValueError, match="max_ratio"):
        match_features(np.zeros((3, 33)), np.zeros((3, 33)), max_ratio=0.0)
    assert match_features(np.zeros((0, 33)), np.zeros((4, 33))).shape == (0, 2)
    assert match_features(np.zeros((4, 33)), np.zeros((0, 33))).shape == (0, 2)
