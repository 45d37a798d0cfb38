"""Samples of meshes: where they lie, how evenly, how far apart."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.stats import chi2

from prehensile.perception.cloud import PointCloud
from prehensile.perception.mesh import TriangleMesh
from prehensile.perception.sampling import (
    farthest_point_sampling,
    sample_mesh_poisson_disc,
    sample_mesh_uniform,
)

# A ramp of 3 × 4 over the floor, 5 long, and a thin, far triangle; one has no area.
RAMP = TriangleMesh(
    [[0, 0, 0], [4, 0, 3], [4, 2, 3], [0, 2, 0], [9, 9, 9], [9, 9, 10], [9, 9.1, 9]],
    [[0, 1, 2], [0, 0, 1], [0, 2, 3], [4, 6, 5]],
)


def box(size):
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return TriangleMesh(corners, [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])


def gaps(points):
    """How far each point is from the nearest other."""
    return cKDTree(points).query(points, 2)[0][:, 1]


def test_uniform_samples_are_even_and_on_the_surface():
    cloud = sample_mesh_uniform(RAMP, 20000, seed=1)
    assert len(cloud) == 20000
    far = cloud.points[:, 0] > 5
    ramp = cloud.points[~far]
    np.testing.assert_allclose(3 * ramp[:, 0], 4 * ramp[:, 2], atol=1e-12)
    np.testing.assert_allclose(cloud.normals[~far], np.tile([-0.6, 0, 0.8], (len(ramp), 1)))
    np.testing.assert_allclose(cloud.normals[far], np.tile([1.0, 0, 0], (far.sum(), 1)))
    assert far.mean() == pytest.approx(0.05 / 10.05, rel=0.3)
    cells, _, _ = np.histogram2d(ramp[:, 0], ramp[:, 1], (10, 8), ((0, 4), (0, 2)))
    expected = len(ramp) / 80
    assert ((cells - expected) ** 2 / expected).sum() < chi2.ppf(0.999, 79)
    np.testing.assert_array_equal(sample_mesh_uniform(RAMP, 20000, seed=1).points, cloud.points)
    assert not np.array_equal(sample_mesh_uniform(RAMP, 20000, seed=2).points, cloud.points)
    assert len(sample_mesh_uniform(RAMP, 0, seed=1)) == 0


def test_poisson_disc_of_a_count():
    mesh = box([1.0, 2.0, 3.0])
    count = 800
    cloud = sample_mesh_poisson_disc(mesh, count=count, seed=3)
    assert len(cloud) == count
    greatest = np.sqrt(2 * mesh.area() / (np.sqrt(3) * count))
    assert gaps(cloud.points).min() > 0.63 * greatest
    uniform = sample_mesh_uniform(mesh, count, seed=3)
    assert gaps(uniform.points).min() < 0.1 * greatest
    # Every place is near a sample.
    places = sample_mesh_uniform(mesh, 20000, seed=4).points
    assert cKDTree(cloud.points).query(places)[0].max() < 1.1 * greatest
    distances = mesh.surface().nearest(cloud.points).distances
    assert distances.max() < 1e-12
    np.testing.assert_array_equal(
        sample_mesh_poisson_disc(mesh, count=count, seed=3).points, cloud.points
    )
    assert len(sample_mesh_poisson_disc(mesh, count=1, seed=3)) == 1


def test_poisson_disc_of_a_radius():
    mesh = box([1.0, 2.0, 3.0])
    cloud = sample_mesh_poisson_disc(mesh, radius=0.15, seed=5)
    assert gaps(cloud.points).min() >= 0.15
    places = sample_mesh_uniform(mesh, 20000, seed=6).points
    assert (cKDTree(cloud.points).query(places)[0] < 0.15).mean() > 0.998
    assert len(sample_mesh_poisson_disc(mesh, radius=50.0, seed=5)) == 1


def test_farthest_points_by_full_search():
    points = np.random.default_rng(7).normal(size=(300, 3))
    points[40] = points[41]
    chosen = [9]
    for _ in range(59):
        away = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(away)))
    np.testing.assert_array_equal(farthest_point_sampling(points, 60, start=9), chosen)
    everything = farthest_point_sampling(points, 300)
    assert sorted(everything) == list(range(300))
    lattice = np.array([[x, y, 0.0] for x in range(3) for y in range(3)])
    assert farthest_point_sampling(lattice, 4).tolist() == [0, 8, 2, 6]
    assert farthest_point_sampling(np.zeros((0, 3)), 0).tolist() == []


def test_bad_arguments_are_named():
    flat = TriangleMesh([[0, 0, 0], [1, 1, 1]], [[0, 1, 0]])
    with pytest.raises(ValueError, match="mesh"):
        sample_mesh_uniform(flat, 5, seed=0)
    with pytest.raises(ValueError, match="mesh"):
        sample_mesh_poisson_disc(flat, count=5, seed=0)
    for count in (-1, 10**9):
        with pytest.raises(ValueError, match="count"):
            sample_mesh_uniform(RAMP, count, seed=0)
    for keywords in ({}, {"count": 5, "radius": 1.0}):
        with pytest.raises(ValueError, match="count, radius"):
            sample_mesh_poisson_disc(RAMP, **keywords, seed=0)
    for radius in (0.0, -1.0, np.nan, np.inf, 1e-6):
        with pytest.raises(ValueError, match="radius"):
            sample_mesh_poisson_disc(RAMP, radius=radius, seed=0)
    with pytest.raises(ValueError, match="count"):
        sample_mesh_poisson_disc(RAMP, count=0, seed=0)
    points = np.zeros((5, 3))
    for count, start, name in (
        (6, 0, "count"),
        (-1, 0, "count"),
        (2, 5, "start"),
        (2, -1, "start"),
    ):
        with pytest.raises(ValueError, match=name):
            farthest_point_sampling(points, count, start)
    with pytest.raises(ValueError, match="points"):
        farthest_point_sampling(points * np.nan, 2)
    assert isinstance(sample_mesh_uniform(RAMP, 3, seed=0), PointCloud)
