"""Nearest neighbours among points and on meshes, beside SciPy, closed forms and full searches."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, cKDTree

from prehensile.native.kd_tree import KdTree
from prehensile.native.surface import MeshSurface
from prehensile.native.voxel_hash import VoxelHash


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


def icosphere(levels):
    """A closed mesh near the unit sphere, and its vertices on it."""
    phi = (1 + 5**0.5) / 2
    vertices = [[-1, phi, 0], [1, phi, 0], [-1, -phi, 0], [1, -phi, 0]]
    vertices += [[z, x, y] for x, y, z in vertices[:4]] + [[y, z, x] for x, y, z in vertices[:4]]
    hull = ConvexHull(np.array(vertices))
    vertices, triangles = np.array(vertices) / np.linalg.norm(vertices[0]), hull.simplices
    for _ in range(levels):
        edges = {}
        vertices = list(vertices)

        def middle(a, b, edges=edges, vertices=vertices):
            key = (min(a, b), max(a, b))
            if key not in edges:
                m = vertices[a] + vertices[b]
                edges[key] = len(vertices)
                vertices.append(m / np.linalg.norm(m))
            return edges[key]

        finer = []
        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        vertices, triangles = np.array(vertices), np.array(finer)
    corners = vertices[triangles]
    inward = (
        np.einsum(
            "ij,ij->i", np.cross(*(corners[:, k] - corners[:, 0] for k in (1, 2))), corners[:, 0]
        )
        < 0
    )
    triangles = np.where(inward[:, None], triangles[:, ::-1], triangles)
    return vertices, triangles


def box_mesh(size, center=(0.0, 0.0, 0.0)):
    """A box of twelve triangles."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])]
    return corners * size + center, np.array(triangles)


def distance_from_box(queries, size):
    """The signed distance from an upright box at the origin, in closed form."""
    beyond = np.abs(queries) - 0.5 * np.asarray(size)
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def test_signed_distance_from_a_box_in_closed_form():
    size = np.array([0.2, 0.5, 0.3])
    surface = MeshSurface(*box_mesh(size))
    assert surface.is_closed
    assert surface.num_pieces == 1
    queries = np.random.default_rng(0).uniform(-0.5, 0.5, (4000, 3))
    # Also straight above edges and corners, where neighbouring faces disagree on the side.
    queries[:500] = np.sign(queries[:500]) * size * 0.5 + 0.2 * np.round(2 * queries[:500])
    expected = distance_from_box(queries, size)
    np.testing.assert_allclose(surface.signed_distance(queries), expected, atol=1e-15)
    nearest = surface.nearest(queries)
    np.testing.assert_allclose(nearest.distances, np.abs(expected), atol=1e-15)
    np.testing.assert_allclose(
        np.linalg.norm(queries - nearest.points, axis=1), nearest.distances, atol=1e-15
    )
    outside = expected > 1e-3
    direction = (queries - nearest.points)[outside] / expected[outside, None]
    assert (np.einsum("ij,ij->i", direction, nearest.normals[outside]) > 0.5).all()


def random_soup(rng, count):
    """Triangles of all sizes and shapes, some of them lines and points."""
    middle = rng.uniform(-1, 1, (count, 1, 3))
    corners = middle + rng.normal(size=(count, 3, 3)) * rng.choice([0.01, 0.1, 0.5], (count, 1, 1))
    corners[0] = corners[0, 0]
    corners[1, 2] = 0.3 * corners[1, 0] + 0.7 * corners[1, 1]
    corners[2, 1] = corners[2, 0]
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


@pytest.mark.parametrize("count", [3, 4, 5, 200])
def test_nearest_point_of_a_soup_minimizes_the_distance(count):
    rng = np.random.default_rng(count)
    vertices, triangles = random_soup(rng, count)
    surface = MeshSurface(vertices, triangles)
    queries = rng.uniform(-1.5, 1.5, (60, 3))
    found = surface.nearest(queries)
    corners = vertices[triangles[found.triangles]]
    assert (found.barycentric >= 0).all()
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1)
    np.testing.assert_allclose(
        np.einsum("ij,ijk->ik", found.barycentric, corners), found.points, atol=1e-14
    )
    # A convex quadratic program for each query and triangle, solved by projection onto the plane
    # or, where that is outside, onto the sides.
    for query, distance in zip(queries, found.distances, strict=True):
        best = np.inf
        for a, b, c in vertices[triangles]:
            E = np.stack([b - a, c - a], axis=1)
            s = np.linalg.lstsq(E, query - a, rcond=None)[0]
            if s.min() >= 0 and s.sum() <= 1:
                best = min(best, np.linalg.norm(a + E @ s - query))
            for p, q in ((a, b), (b, c), (c, a)):
                length = (q - p) @ (q - p)
                t = np.clip((query - p) @ (q - p) / length, 0, 1) if length else 0.0
                best = min(best, np.linalg.norm(p + t * (q - p) - query))
        assert distance == pytest.approx(best, abs=1e-12)


def test_overlapping_pieces_have_one_inside():
    first, second = box_mesh([0.2, 0.2, 0.2]), box_mesh([0.2, 0.2, 0.2], [0.1, 0.0, 0.0])
    surface = MeshSurface(
        np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1] + 8])
    )
    assert surface.is_closed
    assert surface.num_pieces == 2
    queries = np.random.default_rng(3).uniform(-0.3, 0.4, (3000, 3))
    inside = (distance_from_box(queries, [0.2] * 3) < 0) | (
        distance_from_box(queries - [0.1, 0, 0], [0.2] * 3) < 0
    )
    np.testing.assert_array_equal(surface.signed_distance(queries) < 0, inside)


def test_winding_number_is_the_solid_angle():
    vertices, triangles = icosphere(3)
    closed = MeshSurface(vertices, triangles)
    assert closed.is_closed
    half = triangles[(vertices[triangles][:, :, 2] >= -1e-12).all(axis=1)]
    opened = MeshSurface(vertices, half)
    assert not opened.is_closed
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    radii = rng.choice([0.3, 0.9, 1.1, 3.0], (500, 1))
    numbers = closed.winding_number(radii * directions)
    np.testing.assert_allclose(numbers, (radii[:, 0] < 1).astype(float), atol=0.02)
    # A hemisphere, whose edge is some 2 % below the equator's plane, seen from points of its axis.
    z = np.array([-2.0, -0.5, 0.5, 2.0])
    on_axis = np.stack([0 * z, 0 * z, z], axis=1)
    disk = 0.5 * (1 - np.abs(z) / np.hypot(1, z))  # Of 4 π, the disk that closes it.
    expected = np.where(z < 0, disk, np.where(z < 1, 1 - disk, -disk))
    np.testing.assert_allclose(opened.winding_number(on_axis), expected, atol=0.03)
    np.testing.assert_allclose(
        closed.signed_distance(radii * directions), radii[:, 0] - 1, atol=0.006
    )


def test_doubled_vertices_do_not_open_a_surface():
    vertices, triangles = box_mesh([1.0, 1.0, 1.0])
    surface = MeshSurface(vertices[triangles].reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert surface.is_closed
    assert surface.num_pieces == 1
    assert not MeshSurface(vertices, triangles[1:]).is_closed
    assert not MeshSurface(vertices, [[0, 0, 1]]).is_closed


def test_nothing_within_the_distance():
    surface = MeshSurface(*box_mesh([1.0, 1.0, 1.0]))
    found = surface.nearest([[2.0, 0, 0], [0.6, 0, 0]], max_distance=0.2)
    assert found.triangles[0] == -1
    assert np.isinf(found.distances[0])
    np.testing.assert_allclose(found.points[1], [0.5, 0, 0], atol=1e-15)


def test_bad_surfaces_are_named():
    vertices, triangles = box_mesh([1.0, 1.0, 1.0])
    for bad, name in (
        ((vertices[:, :2], triangles), "vertices"),
        ((vertices * np.nan, triangles), "vertices"),
        ((vertices * 1e200, triangles), "vertices"),
        ((vertices, np.zeros((0, 3), int)), "triangles"),
        ((vertices, triangles + 1), "triangles"),
        ((vertices, triangles - 1), "triangles"),
        ((vertices, triangles + 0.5), "triangles"),
    ):
        with pytest.raises(ValueError, match=name):
            MeshSurface(*bad)
    with pytest.raises(ValueError, match="queries"):
        MeshSurface(vertices, triangles).nearest([[np.inf, 0, 0]])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.3, 1.0, 5.0]), st.booleans())
def test_voxel_hash_agrees_with_the_tree(seed, max_distance, on_lattice):
    rng = np.random.default_rng(seed)
    points, queries = rng.uniform(-2, 2, (200, 3)), rng.uniform(-3, 3, (100, 3))
    if on_lattice:  # Points and queries on the voxels' faces, and many ties.
        points, queries = np.round(points / 0.5) * 0.5, np.round(queries / 0.5) * 0.5
    voxels = VoxelHash(max_distance)
    voxels.insert(points[:120])
    voxels.insert(points[120:])
    assert len(voxels) == 200
    indices, distances = voxels.nearest(queries)
    expected, expected_distances = KdTree(points).nearest(queries, 1, max_distance)
    np.testing.assert_array_equal(indices, expected[:, 0])
    np.testing.assert_array_equal(distances, expected_distances[:, 0])


def test_voxel_hash_names_bad_arguments():
    for distance in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="max_distance"):
            VoxelHash(distance)
    voxels = VoxelHash(1.0)
    assert voxels.nearest([[0.0, 0, 0]])[0].tolist() == [-1]
    for bad in ([[0, 0, np.nan]], [[0, 0, 0], [2e6, 0, 0]], [0, 0, 0]):
        with pytest.raises(ValueError, match="points"):
            voxels.insert(bad)
    assert len(voxels) == 0
    assert voxels.nearest([[1e150, 0, 0]])[0].tolist() == [-1]
    with pytest.raises(ValueError, match="queries"):
        voxels.nearest([[0, 0, np.inf]])


def test_voxels_may_grow_while_threads_query() -> None:
    """Every answer is that for some of the points: those inserted so far."""
    points = np.random.default_rng(5).uniform(0, 1, (20_000, 3))
    queries = points[:2000]
    voxels = VoxelHash(0.05)
    voxels.insert(queries)
    with ThreadPoolExecutor(2) as pool:
        answers = [pool.submit(voxels.nearest, queries) for _ in range(20)]
        for part in np.split(points[2000:], 90):
            voxels.insert(part)
        for answer in answers:
            indices, distances = answer.result()
            assert (indices == np.arange(2000)).all()
            assert not distances.any()
    assert len(voxels) == len(points)
