"""Consistency graphs, cliques and votes against brute force."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RollPitchYaw

from prehensile.native import _core, simd_levels
from prehensile.perception.registration import (
    ConsistencyGraph,
    consistency_graph,
    match_by_distances,
    maximum_clique,
    vote,
    vote_for_scale,
)


def _random_graph(rng: np.random.Generator, n: int, density: float) -> ConsistencyGraph:
    upper = np.triu(rng.uniform(size=(n, n)) < density, 1)
    return ConsistencyGraph.from_edges(n, np.argwhere(upper))


def _largest_by_enumeration(graph: ConsistencyGraph) -> int:
    """Bron and Kerbosch, without pivots: every clique is visited."""
    neighbors = [set() for _ in range(graph.num_vertices)]
    for i, j in graph.edges():
        neighbors[i].add(int(j))
        neighbors[j].add(int(i))

    def grow(size: int, candidates: set[int]) -> int:
        best = size
        for v in sorted(candidates):
            best = max(best, grow(size + 1, {u for u in candidates & neighbors[v] if u > v}))
        return best

    return grow(0, set(range(graph.num_vertices)))


@pytest.mark.parametrize("simd", simd_levels())
@pytest.mark.parametrize("n", [1, 2, 63, 64, 65, 511, 513, 700])
def test_graph_is_the_comparison_of_all_distances(n, simd):
    rng = np.random.default_rng(n)
    model = rng.uniform(-1, 1, (n, 3)) * [1, 2, 0.1] + [50, 0, -7]
    scene = rng.uniform(-1, 1, (n, 3)) + [0, 1e3, 0]
    distances = [np.linalg.norm(p[:, None] - p[None], axis=2) for p in (model, scene)]
    difference = np.abs(distances[1] - 1.5 * distances[0])
    # A tolerance that single precision cannot tell from one of the differences.
    tolerance = 0.1 if n < 3 else np.sort(difference[np.triu_indices(n, 1)])[n] + 1e-11
    expected = np.argwhere(np.triu(difference <= tolerance, 1))
    graph = _core.consistency_graph(model, scene, tolerance, 1.5, 0, simd)
    assert np.array_equal(graph.edges(), expected)
    assert graph.num_edges == len(expected)
    assert np.array_equal(graph.degrees(), np.bincount(expected.ravel(), minlength=n))


def test_points_without_number_or_partner_are_named():
    good = np.zeros((4, 3))
    with pytest.raises(ValueError, match="scene_points"):
        consistency_graph(good, good + np.nan, 0.1)
    with pytest.raises(ValueError, match="model_points, scene_points"):
        consistency_graph(good, good[:3], 0.1)
    with pytest.raises(ValueError, match="tolerance"):
        consistency_graph(good, good, -1)
    with pytest.raises(ValueError, match="edges"):
        ConsistencyGraph.from_edges(3, [[1, 1]])
    with pytest.raises(ValueError, match="vertex"):
        ConsistencyGraph.from_edges(3, [[1, 3]])
    assert consistency_graph(good[:0], good[:0], 0.1).num_vertices == 0


def test_huge_and_tiny_clouds_have_the_same_graph():
    rng = np.random.default_rng(1)
    model, scene = rng.normal(size=(2, 200, 3))
    expected = consistency_graph(model, scene, 0.25).edges()
    for factor in (2.0**-300, 2.0**300):
        graph = consistency_graph(model * factor, scene * factor, 0.25 * factor)
        assert np.array_equal(graph.edges(), expected)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.floats(0, 1))
def test_clique_is_as_large_as_enumeration_finds(seed, n, density):
    density = min(density, 30 / n) if n > 25 else density
    if n > 16:
        density = min(density, 0.7)
    graph = _random_graph(np.random.default_rng(seed), n, density)
    clique = maximum_clique(graph)
    assert clique.proven
    assert all(graph.adjacent(i, j) for i, j in combinations(clique.vertices, 2))
    size = len(clique.vertices)
    assert size == _largest_by_enumeration(graph)
    greedy = maximum_clique(graph, exact=False)
    assert 1 <= len(greedy.vertices) <= size
    assert not greedy.proven or len(greedy.vertices) == size
    assert all(graph.adjacent(i, j) for i, j in combinations(greedy.vertices, 2))
    assert len(maximum_clique(graph, min_size=size).vertices) == size
    too_large = maximum_clique(graph, min_size=size + 1)
    assert too_large.proven
    assert len(too_large.vertices) == 0


@pytest.mark.parametrize(("n", "density", "planted"), [(300, 0.3, 20), (1000, 0.1, 14)])
def test_planted_clique_is_found_and_proven(n, density, planted):
    rng = np.random.default_rng(n)
    edges = np.argwhere(np.triu(rng.uniform(size=(n, n)) < density, 1))
    chosen = np.sort(rng.choice(n, planted, replace=False))
    inside = np.array(list(combinations(chosen, 2)))
    graph = ConsistencyGraph.from_edges(n, np.concatenate([edges, inside]))
    clique = maximum_clique(graph)
    assert clique.proven
    assert np.array_equal(clique.vertices, chosen)


def test_limits_end_the_search_with_the_best_so_far():
    graph = _random_graph(np.random.default_rng(0), 400, 0.8)
    few = maximum_clique(graph, max_nodes=50)
    assert not few.proven
    assert few.nodes <= 51
    timed = maximum_clique(graph, max_nodes=10**12, time_limit=0.05)
    assert not timed.proven
    assert len(timed.vertices) >= 10
    assert all(graph.adjacent(i, j) for i, j in combinations(timed.vertices, 2))


def test_triangle_is_found_beside_a_pyramid_with_the_same_lengths():
    # A triangle with sides 3, 4 and 5; in the scene the same triangle, elsewhere, and a pyramid
    # with three edges of length 3 that meet in its apex, and a base of length 4.
    model = np.array([[0, 0, 0], [3, 0, 0], [0, 4, 0]], float)
    R = RollPitchYaw(0.3, -0.5, 2.0).ToRotationMatrix().matrix()
    triangle = model @ R.T + [10, 2, 1]
    radius = 4 / np.sqrt(3)
    angles = np.arange(3) * 2 * np.pi / 3
    base = np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(3)], axis=1)
    scene = np.concatenate([[[0, 0, np.sqrt(9 - radius**2)]], base, triangle])
    matches, proven = match_by_distances(model, scene, 1e-6)
    assert proven
    assert matches.tolist() == [[0, 4], [1, 5], [2, 6]]


def test_planar_squares_match_in_all_their_points():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    matches, proven = match_by_distances(square, square[::-1] + 5, 1e-9)
    assert proven
    assert len(matches) == 4
    assert len(set(matches[:, 0])) == len(set(matches[:, 1])) == 4
    with pytest.raises(ValueError, match="pairs"):
        match_by_distances(square, square, 1e-9, pairs=[[0, 4]])


def _cost(x: np.ndarray, values: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    return np.minimum(((x[:, None] - values) / bounds) ** 2, 1).sum(axis=1)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 30))
def test_vote_beats_a_dense_sampling(seed, n):
    rng = np.random.default_rng(seed)
    values, bounds = rng.normal(size=n) + 1e3, rng.uniform(0.05, 1, n)
    grid = np.linspace(values.min() - 1, values.max() + 1, 4001)
    result = vote(values, bounds)
    assert result.cost <= _cost(grid, values, bounds).min() + 1e-9
    assert result.cost == pytest.approx(_cost(np.array([result.estimate]), values, bounds)[0])
    most = vote(values, bounds, most_inliers=True)
    counts = (np.abs(grid[:, None] - values) <= bounds).sum(axis=1)
    assert most.inliers.sum() >= counts.max()
    # The set found shares a point.
    chosen = most.inliers
    assert (values - bounds)[chosen].max() <= (values + bounds)[chosen].min()


def test_vote_wants_numbers_and_positive_bounds():
    for values, bounds, name in [([], [], "values"), ([1.0, np.nan], 1, "values"), ([1.0], 0, "b")]:
        with pytest.raises(ValueError, match=name):
            vote(values, bounds)


def test_scale_is_voted_for_despite_wrong_partners():
    rng = np.random.default_rng(2)
    model = rng.uniform(-1, 1, (200, 3))
    scene = 0.37 * model + rng.uniform(-1e-3, 1e-3, model.shape) + [1, 2, 3]
    scene[:120] = rng.uniform(-1, 1, (120, 3))
    assert vote_for_scale(model, scene, 2e-3).estimate == pytest.approx(0.37, abs=2e-4)
    with pytest.raises(ValueError, match="model_points"):
        vote_for_scale(model[:1], scene[:1], 1e-3)
    with pytest.raises(ValueError, match="model_points"):
        vote_for_scale(np.zeros((3, 3)), scene[:3], 1e-3)
