"""Normals from neighbours, beside NumPy's eigenvectors and closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from prehensile.errors import InputError
from prehensile.perception.cloud import PointCloud
from prehensile.perception.normals import estimate_normals, orient_normals, surface_variation


def principal_directions(points, neighbors):
    """Eigenvalues and least eigenvector of each neighbourhood, by NumPy: (N, 3), (N, 3)."""
    values, vectors = [], []
    for row in neighbors:
        covariance = np.cov(points[row].T, bias=True)
        w, V = np.linalg.eigh(covariance)
        values.append(w)
        vectors.append(V[:, 0])
    return np.array(values), np.array(vectors)


def degrees_between_lines(u, v):
    cross = np.linalg.norm(np.cross(u, v), axis=1)
    return np.degrees(np.arctan2(cross, np.abs(np.einsum("ij,ij->i", u, v))))


def wavy_points(count, seed=0):
    """Points on a surface with slopes up to 60°, 1 mm of noise."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.1, 0.1, (2, count))
    z = 0.03 * np.sin(40 * x) * np.cos(30 * y)
    return np.stack([x, y, z], axis=1) + rng.normal(0, 0.001, (count, 3))


@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_radius_normals_are_eigenvectors(offset):
    points = wavy_points(4000) + [offset, -offset, 0]
    radius = 0.015
    values, vectors = principal_directions(points, cKDTree(points).query_ball_point(points, radius))
    cloud = estimate_normals(PointCloud(points), radius=radius)
    clear = values[:, 1] - values[:, 0] > 0.02 * values[:, 2]
    assert clear.mean() > 0.97
    assert degrees_between_lines(cloud.normals, vectors)[clear].max() < 0.01
    np.testing.assert_allclose(
        surface_variation(PointCloud(points), radius=radius),
        values[:, 0] / values.sum(axis=1),
        atol=2e-6,
    )


@pytest.mark.parametrize("neighbors", [3, 10, 30])
def test_normals_of_nearest_are_eigenvectors(neighbors):
    points = wavy_points(3000)
    near = cKDTree(points).query(points, neighbors)[1]
    values, vectors = principal_directions(points, near)
    cloud = estimate_normals(PointCloud(points), neighbors=neighbors)
    clear = values[:, 1] - values[:, 0] > 1e-3 * values[:, 2]
    assert degrees_between_lines(cloud.normals, vectors)[clear].max() < 1e-4
    np.testing.assert_allclose(
        surface_variation(PointCloud(points), neighbors=neighbors),
        values[:, 0] / values.sum(axis=1),
        atol=1e-12,
    )


@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_normals_of_voxels_are_eigenvectors_of_the_voxels_around(offset):
    points = wavy_points(4000) + [offset, -offset, 0]
    voxel = 0.008
    cell = np.floor(points / voxel).astype(int)
    around = cKDTree(cell).query_ball_point(cell, 1, p=np.inf)
    values, vectors = principal_directions(points, around)
    cloud = estimate_normals(PointCloud(points), voxel_size=voxel)
    clear = values[:, 1] - values[:, 0] > 0.02 * values[:, 2]
    assert clear.mean() > 0.97
    assert degrees_between_lines(cloud.normals, vectors)[clear].max() < 0.01
    np.testing.assert_allclose(
        surface_variation(PointCloud(points), voxel_size=voxel, num_threads=3),
        values[:, 0] / values.sum(axis=1),
        atol=2e-6,
    )
    with pytest.raises(ValueError, match="voxel_size"):
        estimate_normals(PointCloud(points), voxel_size=0.0)
    with pytest.raises(ValueError, match="voxel_size"):
        estimate_normals(PointCloud(points + 1e9), voxel_size=voxel)


def test_a_sphere_seen_from_several_sides():
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(20000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = 0.1 * directions
    cloud = PointCloud(points, sensor_origins=directions)
    radius = 0.012
    estimated = estimate_normals(cloud, radius=radius)
    cosines = np.einsum("ij,ij->i", estimated.normals, directions)
    assert np.degrees(np.arccos(np.median(cosines))) < 0.6
    assert cosines.min() > np.cos(np.radians(5))  # All outward, too.
    variation = surface_variation(cloud, radius=radius)
    # Over a cap of height h = r² / 2R, heights are uniform: variance h² / 12 of r² / 2 in all.
    assert np.median(variation) == pytest.approx(radius**2 / (24 * 0.1**2), rel=0.1)


def test_normals_look_where_they_are_told():
    points = np.random.default_rng(2).uniform(-1, 1, (500, 3)) * [1, 1, 0]
    cloud = estimate_normals(PointCloud(points), neighbors=8)
    np.testing.assert_allclose(cloud.normals, np.tile([0.0, 0, 1], (500, 1)), atol=1e-12)
    below = orient_normals(cloud, toward=(0, 0, -3))
    np.testing.assert_allclose(below.normals[:, 2], -1)
    side = np.where(points[:, :1] > 0, [[0.0, 0, 1]], [[0.0, 0, -1]])
    np.testing.assert_allclose(orient_normals(cloud, side).normals[:, 2], side[:, 2])
    again = estimate_normals(cloud.replace(sensor_origins=side), radius=0.5)
    np.testing.assert_allclose(again.normals[:, 2], side[:, 2])


@pytest.mark.parametrize("how", [{"radius": 0.5}, {"neighbors": 20}])
def test_no_normal_where_there_is_none(how):
    def normals(points):
        return estimate_normals(PointCloud(np.asarray(points, dtype=float)), **how).normals

    assert normals(np.zeros((0, 3))).shape == (0, 3)
    assert not normals([[1, 2, 3]]).any()
    assert not normals([[1, 2, 3], [1.1, 2, 3]]).any()
    assert not normals(np.ones((30, 3))).any()
    line = np.linspace(0, 0.4, 30)[:, None] * [1.0, 2, -0.5] / 2.3 + [5, 6, 7]
    assert not normals(line).any()
    assert (surface_variation(PointCloud(line), **how) < 1e-6).all()
    three = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]]
    np.testing.assert_allclose(normals(three), np.tile([0.0, 0, 1], (3, 1)), atol=1e-6)


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 60),
    st.integers(0, 2**32 - 1),
    st.sampled_from([1e-6, 1.0, 1e6]),
    st.sampled_from([0.02, 0.3, 2.0, 20.0]),
)
def test_neighbours_within_the_radius_and_no_others(count, seed, scale, radius):
    # Few points in a box many cells wide: most columns are gaps. What tells is the variation.
    rng = np.random.default_rng(seed)
    points = (rng.uniform(-1, 1, (count, 3)) * [1, 10, 3]) * scale
    near = cKDTree(points).query_ball_point(points, radius * scale)
    values, _ = principal_directions(points, near)
    total = values.sum(axis=1)
    variation = surface_variation(PointCloud(points), radius=radius * scale)
    known = np.array([len(row) > 2 for row in near])
    expected = np.where(known, values[:, 0] / np.where(known, total, 1), 0)
    np.testing.assert_allclose(variation, np.maximum(expected, 0), atol=1e-5)


def test_neither_threads_nor_order_matter():
    points = wavy_points(20000, seed=3)
    one = estimate_normals(PointCloud(points), radius=0.01)
    two = estimate_normals(PointCloud(points), radius=0.01, num_threads=2)
    np.testing.assert_array_equal(one.normals, two.normals)
    order = np.random.default_rng(4).permutation(len(points))
    shuffled = estimate_normals(PointCloud(points[order]), radius=0.01)
    assert degrees_between_lines(shuffled.normals, one.normals[order]).max() < 0.2
    one = estimate_normals(PointCloud(points), neighbors=9)
    two = estimate_normals(PointCloud(points), neighbors=9, num_threads=2)
    np.testing.assert_array_equal(one.normals, two.normals)


def test_bad_arguments_are_named():
    cloud = PointCloud(np.random.default_rng(0).normal(size=(50, 3)))
    for keywords in ({}, {"radius": 1.0, "neighbors": 5}):
        with pytest.raises(ValueError, match="radius, neighbors"):
            estimate_normals(cloud, **keywords)
    for radius in (0.0, -1.0, np.nan, np.inf, 1e-9, 1e-320):
        with pytest.raises(ValueError, match="radius"):
            estimate_normals(cloud, radius=radius)
    with pytest.raises(ValueError, match="neighbors"):
        estimate_normals(cloud, neighbors=2)
    with pytest.raises(ValueError, match="num_threads"):
        estimate_normals(cloud, radius=1.0, num_threads=0)
    with pytest.raises(InputError, match="normals"):
        orient_normals(cloud, toward=(0, 0, 1))
    known = estimate_normals(cloud, radius=1.0)
    with pytest.raises(InputError, match="sensor_origins"):
        orient_normals(known)
    with pytest.raises(ValueError, match="toward"):
        orient_normals(known, toward=np.zeros((4, 3)))
    with pytest.raises(ValueError, match="toward"):
        orient_normals(known, toward=(0, np.nan, 0))
