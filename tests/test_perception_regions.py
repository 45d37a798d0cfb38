"""Planes, clusters, what a sensor sees, and what known solids account for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from synthetic_clouds import VOXEL, box_cloud, sphere_cloud

from prehensile.errors import InputError
from prehensile.perception import Box, PointCloud, merge
from prehensile.perception.planes import plane_regions, ransac_plane
from prehensile.perception.segmentation import euclidean_clusters, nearest_segment, subtract
from prehensile.perception.visibility import visible_points


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.02, 1.0), st.integers(1, 200))
def test_clusters_are_the_connected_components_of_near_pairs(
    seed: int, tolerance: float, count: int
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (count, 3)) * rng.choice([0.2, 1.0])
    pairs = KDTree(points).query_pairs(tolerance, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count))
    _, expected = connected_components(graph, directed=False)
    labels = euclidean_clusters(points, tolerance)
    assert len(set(zip(labels, expected, strict=True))) == len(set(expected)) == labels.max() + 1
    sizes = np.bincount(labels)
    assert (np.diff(sizes) <= 0).all()
    fewer = euclidean_clusters(points, tolerance, min_points=3)
    np.testing.assert_array_equal(fewer, np.where(sizes[labels] >= 3, labels, -1))


def test_clusters_of_nothing_and_of_bad_input() -> None:
    assert euclidean_clusters(np.zeros((0, 3)), 0.1).shape == (0,)
    with pytest.raises(ValueError, match="tolerance"):
        euclidean_clusters(np.zeros((2, 3)), 0.0)
    with pytest.raises(ValueError, match="tolerance: too small"):
        euclidean_clusters(np.full((2, 3), 1e9), 0.01)
    with pytest.raises(ValueError, match="points"):
        euclidean_clusters(np.full((2, 3), np.nan), 0.1)
    with pytest.raises(ValueError, match="points"):
        euclidean_clusters(np.zeros((2, 2)), 0.1)


@pytest.mark.parametrize("seed", range(5))
def test_ransac_finds_a_plane_among_outliers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X_WP = RigidTransform(RollPitchYaw(rng.uniform(-1, 1, 3)), rng.uniform(-1, 1, 3))
    count = 1000
    flat = np.column_stack([rng.uniform(-0.5, 0.5, (count, 2)), rng.normal(0, 0.001, count)])
    on_plane = X_WP.multiply(flat.T).T
    points = np.concatenate([on_plane, rng.uniform(-2, 2, (2 * count, 3))])
    normal = X_WP.rotation().matrix()[:, 2]
    sensor = X_WP.translation() - normal  # On the far side.
    found = ransac_plane(PointCloud(points, sensor_origins=sensor), 0.004, seed=seed)
    assert found.plane is not None
    # 1000 points at 1 mm over 1 m: the slope is known to 1e-4, the height to 3e-5 (standard
    # deviations); outliers within 4 mm, some 0.4 % of 2000, disturb little more.
    np.testing.assert_allclose(found.plane.normal, -normal, atol=1e-3)
    assert abs(found.plane.offset + normal @ X_WP.translation()) < 1.5e-3
    assert found.inliers[:count].mean() > 0.99
    heights = found.plane.heights(points)
    np.testing.assert_array_equal(found.inliers, np.abs(heights) <= 0.004)
    again = ransac_plane(PointCloud(points, sensor_origins=sensor), 0.004, seed=seed)
    assert again.plane is not None
    np.testing.assert_array_equal(again.plane.normal, found.plane.normal)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 3)),
        np.zeros((2, 3)),
        np.outer(np.arange(50.0), [1, 2, 3]),
        np.ones((50, 3)),
    ],
    ids=["empty", "two", "collinear", "coincident"],
)
def test_no_plane_where_the_points_span_none(points: np.ndarray) -> None:
    found = ransac_plane(PointCloud(points), 0.01, max_iterations=200)
    assert found.plane is None
    assert not found.inliers.any()


def test_the_faces_of_a_box_are_its_plane_regions() -> None:
    X_WB = RigidTransform(RollPitchYaw(0.3, 0.2, 0.1), [1, 2, 3])
    size = [0.10, 0.14, 0.18]
    cloud = merge([box_cloud(size, X_WB, faces="xXyYzZ"), sphere_cloud(0.05, [1, 2, 3.5])])
    labels, planes = plane_regions(cloud, 2 * VOXEL, max_distance=0.002, min_points=200)
    p_B = X_WB.inverse().multiply(cloud.points.T).T
    flat = [k for k, plane in enumerate(planes) if (labels == k).sum() > 400]
    assert len(flat) == 6
    seen = set()
    for k in flat:
        n_B = X_WB.rotation().inverse().matrix() @ planes[k].normal
        axis = int(np.argmax(np.abs(n_B)))
        seen.add((axis, n_B[axis] > 0))
        assert abs(n_B[axis]) > 1 - 1e-4
        own = p_B[labels == k]
        # Voxels on a box's edges average both faces; they may lie inside by half a voxel.
        inside = size[axis] / 2 - np.abs(own[:, axis])
        assert np.median(np.abs(inside)) < 1e-4
        assert inside.max() < VOXEL
    assert len(seen) == 6


def test_a_sphere_shows_its_near_side() -> None:
    """Visible are the points p whose normal looks toward the sensor: closed form for a ball."""
    centre, sensor = [0.1, 0.2, 0.3], np.array([0.9, 0.1, 0.5])
    cloud = sphere_cloud(0.1, centre)
    toward = np.sum(cloud.require_normals() * (sensor - cloud.points), axis=1)
    seen = visible_points(cloud.points, sensor, radius_factor=100)
    rim = np.abs(toward) < 0.05 * np.linalg.norm(sensor - cloud.points, axis=1)
    assert (seen == (toward > 0))[~rim].mean() > 0.999


def test_a_board_hides_what_is_behind_it() -> None:
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 60), np.linspace(-1, 1, 60)), -1).reshape(-1, 2)
    near = np.column_stack([0.5 * grid, np.full(len(grid), 1.0)])
    far = np.column_stack([grid, np.full(len(grid), 2.0)])
    seen = visible_points(np.concatenate([near, far]), [0, 0, 0], radius_factor=1000)
    assert seen[: len(near)].all()
    hidden = np.abs(grid).max(axis=1) < 0.97  # The shadow of the board reaches to 1.
    assert not seen[len(near) :][hidden].any()


def test_visibility_of_bad_input() -> None:
    assert visible_points(np.zeros((0, 3)), [0, 0, 0]).shape == (0,)
    assert visible_points(np.array([[1.0, 0, 0]]), [0, 0, 0]).all()
    line = np.outer(np.arange(1, 10.0), [1, 0, 0])
    assert visible_points(line, [0, 0, 0]).all()
    with pytest.raises(ValueError, match="points"):
        visible_points(np.full((5, 3), np.nan), [0, 0, 0])
    with pytest.raises(ValueError, match="where the sensor is"):
        visible_points(np.zeros((5, 3)), [0, 0, 0])
    with pytest.raises(ValueError, match="p_WS"):
        visible_points(np.ones((5, 3)), [0, 0])
    with pytest.raises(ValueError, match="radius_factor"):
        visible_points(np.ones((5, 3)), [0, 0, 0], radius_factor=1.0)


def test_subtracting_the_table_leaves_the_object() -> None:
    table = Box(RigidTransform([0, 0, -0.05]), np.array([1.0, 1.0, 0.1]))
    board = box_cloud([0.5, 0.5, 0.02], RigidTransform([0, 0, -0.01]))
    thing = sphere_cloud(0.04, [0.1, 0.1, 0.06])
    other = sphere_cloud(0.03, [-0.1, -0.1, 0.06])
    left = subtract(merge([board, thing, other]), [table], margin=0.003)
    assert len(left) == len(thing) + len(other)
    labels = euclidean_clusters(left.points, 3 * VOXEL)
    assert labels.max() == 1
    chosen = nearest_segment(left, labels, np.array([-0.1, -0.1, 0.0]))
    np.testing.assert_array_equal(chosen.points, other.points)
    assert len(nearest_segment(left, np.full(len(left), -1), np.zeros(3))) == 0
    with pytest.raises(ValueError, match="margin"):
        subtract(left, [table], margin=-1.0)


def test_planes_need_normals() -> None:
    with pytest.raises(InputError, match="normals"):
        plane_regions(PointCloud(np.zeros((3, 3))), 0.01)
