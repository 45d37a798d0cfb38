"""Nearest neighbours among points, beside SciPy's and a search through all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from prehensile.native.kd_tree import KdTree


def brute_force(points, query, k):
    """The k nearest by distance, then index: (indices, distances)."""
    squared = ((points - query) ** 2).sum(axis=1)
    order = np.lexsort((np.arange(len(points)), squared))[:k]
    return order, np.sqrt(squared[order])


@pytest.mark.parametrize("count", [1, 2, 15, 16, 17, 33, 5000])
@pytest.mark.parametrize("k", [1, 8, 40])
def test_k_nearest_agree_with_scipy(count, k):
    rng = np.random.default_rng(count)
    points = rng.normal(size=(count, 3))
    queries = rng.normal(size=(300, 3)) * 1.5
    indices, distances = KdTree(points).nearest(queries, k)
    expected_distances, expected = cKDTree(points).query(queries, np.arange(1, k + 1))
    missing = expected == count
    np.testing.assert_array_equal(indices, np.where(missing, -1, expected))
    np.testing.assert_allclose(distances, expected_distances, rtol=1e-14)


def test_all_within_a_radius_agree_with_scipy():
    rng = np.random.default_rng(1)
    points, queries = rng.uniform(size=(4000, 3)), rng.uniform(size=(500, 3))
    found = KdTree(points).within_radius(queries, 0.1)
    expected = cKDTree(points).query_ball_point(queries, 0.1)
    for i in range(len(queries)):
        mine = found.indices[found.start[i] : found.start[i + 1]]
        assert sorted(mine) == sorted(expected[i])
        gaps = np.linalg.norm(points[mine] - queries[i], axis=1)
        np.testing.assert_allclose(found.distances[found.start[i] : found.start[i + 1]], gaps)
        assert (np.diff(gaps) >= -1e-12).all()


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(-2, 2)] * 3), min_size=1, max_size=80),
    st.tuples(*[st.integers(-3, 3)] * 3),
    st.integers(1, 90),
    st.sampled_from([1e-160, 1e-3, 1.0, 1e150]),
)
def test_ties_go_to_the_smaller_index(rows, query, k, scale):
    # Points on a coarse lattice: many coincide, and many more lie at equal distances.
    points, query = np.array(rows) * scale, np.array(query) * scale
    indices, distances = KdTree(points).nearest(query[None], k)
    expected, expected_distances = brute_force(points, query, k)
    found = len(expected)
    np.testing.assert_array_equal(indices[0, :found], expected)
    np.testing.assert_allclose(distances[0, :found], expected_distances, rtol=1e-12)
    assert (indices[0, found:] == -1).all()
    assert np.isinf(distances[0, found:]).all()


def test_a_point_at_the_limit_of_distance_counts():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    tree = KdTree(points)
    indices, distances = tree.nearest([[0.0, 0, 0]], 4, max_distance=2.0)
    assert indices.tolist() == [[0, 1, 2, -1]]
    assert distances.tolist() == [[0.0, 1.0, 2.0, np.inf]]
    assert tree.within_radius([[0.0, 0, 0]], 1.0).indices.tolist() == [0, 1]


def test_the_number_of_threads_does_not_change_the_answer():
    rng = np.random.default_rng(2)
    points = rng.normal(size=(3000, 3))
    tree = KdTree(points)
    one, two = tree.nearest(points, 5), tree.nearest(points, 5, num_threads=2)
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
    one = tree.within_radius(points, 0.3)
    two = tree.within_radius(points, 0.3, num_threads=2)
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))


def test_nothing_is_found_among_no_points():
    tree = KdTree(np.zeros((0, 3)))
    assert len(tree) == 0
    assert tree.nearest([[0.0, 0, 0]], 2)[0].tolist() == [[-1, -1]]
    assert len(tree.within_radius([[0.0, 0, 0]], 1.0).indices) == 0
    assert tree.nearest(np.zeros((0, 3)))[0].shape == (0, 1)


@pytest.mark.parametrize("bad", [np.zeros((4, 2)), np.zeros(3), [[0, np.nan, 0]], "no"])
def test_bad_points_and_queries_are_named(bad):
    with pytest.raises(ValueError, match="points"):
        KdTree(bad)
    tree = KdTree(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="queries"):
        tree.nearest(bad)
    with pytest.raises(ValueError, match="queries"):
        tree.within_radius(bad, 1.0)


def test_bad_numbers_are_named():
    tree = KdTree(np.zeros((2, 3)))
    query = np.zeros((1, 3))
    with pytest.raises(ValueError, match="k: "):
        tree.nearest(query, 0)
    with pytest.raises(ValueError, match="max_distance"):
        tree.nearest(query, max_distance=np.nan)
    with pytest.raises(ValueError, match="radius"):
        tree.within_radius(query, -1.0)
    with pytest.raises(ValueError, match="num_threads"):
        tree.nearest(query, num_threads=0)
