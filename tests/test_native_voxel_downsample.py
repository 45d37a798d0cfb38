"""Voxel down-sampling against NumPy, and its promises: order, repeatability, clear errors."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from prehensile.native import _core, simd_levels, voxel_downsample

DTYPES = [np.float32, np.float64]


def reference(points, voxel_size, normals=None):
    """The same in NumPy: group rows by voxel, in the order of first occurrence."""
    points = points.astype(np.float64)
    keep = np.isfinite(points).all(axis=1)
    points = points[keep]
    index = np.floor(points * (1 / voxel_size)).astype(np.int64)
    _, first, inverse = np.unique(index, axis=0, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))[inverse.ravel()]
    counts = np.bincount(rank, minlength=len(first))
    centroids = np.zeros((len(first), 3))
    np.add.at(centroids, rank, points)
    centroids /= counts[:, None]
    if normals is None:
        return centroids, None, counts
    normals = normals.astype(np.float64)[keep]
    normals = np.where(np.isfinite(normals).all(axis=1)[:, None], normals, 0)
    means = np.zeros((len(first), 3))
    np.add.at(means, rank, normals)
    norms = np.linalg.norm(means, axis=1, keepdims=True)
    cancelled = norms <= 1e-6 * counts[:, None]
    return centroids, np.where(cancelled, 0, means / np.where(cancelled, 1, norms)), counts


def random_cloud(rng, n, dtype):
    """A wavy surface with unit normals, a few of both not finite."""
    points = rng.uniform(-0.5, 0.5, (n, 3))
    points[:, 2] = 0.1 * np.sin(8 * points[:, 0]) + rng.normal(0, 1e-3, n)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points[rng.integers(0, n, n // 50), rng.integers(0, 3, n // 50)] = np.nan
    points[rng.integers(0, n, n // 50), rng.integers(0, 3, n // 50)] = np.inf
    normals[rng.integers(0, n, n // 50)] = np.nan
    return points.astype(dtype), normals.astype(dtype)


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("n", [1, 2, 7, 255, 256, 257, 20_011, 70_001])
@pytest.mark.parametrize("with_normals", [False, True])
def test_agrees_with_numpy(dtype, n, with_normals):
    points, normals = random_cloud(np.random.default_rng(n), n, dtype)
    cloud = voxel_downsample(points, 0.02, normals=normals if with_normals else None)
    expected = reference(points, 0.02, normals if with_normals else None)
    # Half a unit in the last place of the result's type, and a little for the order of division.
    eps = np.finfo(dtype).eps
    np.testing.assert_array_equal(cloud.counts, expected[2])
    np.testing.assert_allclose(cloud.points, expected[0], rtol=2 * eps, atol=1e-15)
    assert cloud.points.dtype == dtype
    assert cloud.counts.dtype == np.int32
    if with_normals:
        assert cloud.normals is not None
        assert cloud.normals.dtype == dtype
        np.testing.assert_allclose(cloud.normals, expected[1], atol=2 * eps)
    else:
        assert cloud.normals is None


@pytest.mark.parametrize("dtype", DTYPES)
def test_same_bits_for_every_level_and_number_of_threads(dtype):
    points, normals = random_cloud(np.random.default_rng(1), 90_001, dtype)
    want = _core.voxel_downsample(points, 0.01, normals, 1, "baseline")
    for level in simd_levels():
        for num_threads in (1, 2, 3, 5):
            got = _core.voxel_downsample(points, 0.01, normals, num_threads, level)
            for a, b in zip(want, got, strict=True):
                assert a.tobytes() == b.tobytes(), (level, num_threads)


coordinates = hnp.arrays(
    np.float64,
    st.tuples(st.integers(0, 60), st.just(3)),
    elements=st.floats(-2, 2, allow_subnormal=False),
)


@settings(max_examples=150, deadline=None)
@given(points=coordinates, voxel_size=st.floats(1e-3, 5))
def test_invariants(points, voxel_size):
    cloud = voxel_downsample(points, voxel_size)
    assert cloud.counts.sum() == len(points)
    # Voxels have different indices; a centroid lies in its voxel, up to rounding at the border.
    index = np.floor(points * (1 / voxel_size))
    voxels = list(dict.fromkeys(map(tuple, index)))
    assert len(cloud.points) == len(voxels)
    lower = np.array(voxels).reshape(-1, 3) * voxel_size
    slack = 1e-9
    assert (cloud.points >= lower - slack).all()
    assert (cloud.points <= lower + voxel_size + slack).all()
    # The mean of the cloud is kept.
    np.testing.assert_allclose(
        (cloud.points * cloud.counts[:, None]).sum(axis=0), points.sum(axis=0), atol=1e-9
    )


@settings(max_examples=60, deadline=None)
@given(points=coordinates, seed=st.integers(0, 2**32 - 1))
def test_order_of_points_changes_only_the_order_of_voxels(points, seed):
    def by_voxel(points):
        voxels = dict.fromkeys(map(tuple, np.floor(points * 4)))
        cloud = voxel_downsample(points, 0.25)
        return dict(zip(voxels, zip(cloud.points, cloud.counts, strict=True), strict=True))

    want = by_voxel(points)
    got = by_voxel(points[np.random.default_rng(seed).permutation(len(points))])
    assert want.keys() == got.keys()
    for voxel, (centroid, count) in want.items():
        np.testing.assert_allclose(got[voxel][0], centroid, atol=1e-12)
        assert got[voxel][1] == count


def test_grid_is_tied_to_the_origin():
    # One voxel each side of the origin, whatever else is in the cloud.
    points = np.array([[0.01, 0.01, 0.01], [-0.01, 0.01, 0.01], [0.09, 0.09, 0.09]])
    cloud = voxel_downsample(points, 0.1)
    np.testing.assert_array_equal(cloud.counts, [2, 1])
    np.testing.assert_allclose(cloud.points, [[0.05, 0.05, 0.05], [-0.01, 0.01, 0.01]])


def test_normals_that_cancel_give_zero():
    points = np.full((2, 3), 0.5)
    normals = np.array([[0.0, 0.6, 0.8], [0.0, -0.6, -0.8]])
    cloud = voxel_downsample(points, 1, normals=normals)
    np.testing.assert_array_equal(cloud.normals, np.zeros((1, 3)))


@pytest.mark.parametrize("num_threads", [1, 4])
def test_nothing_in_nothing_out(num_threads):
    empty = np.zeros((0, 3), np.float32)
    for points in (empty, np.full((5, 3), np.nan, np.float32)):
        cloud = voxel_downsample(points, 0.1, normals=points, num_threads=num_threads)
        assert cloud.points.shape == (0, 3)
        assert cloud.normals is not None
        assert cloud.normals.shape == (0, 3)
        assert cloud.counts.shape == (0,)


def test_strided_input_is_read_as_numpy_reads_it():
    wide = np.random.default_rng(0).uniform(-1, 1, (500, 6))
    for view in (wide[:, 1:4], wide[::-2, ::2]):
        cloud = voxel_downsample(view, 0.3)
        np.testing.assert_array_equal(cloud.points, voxel_downsample(view.copy(), 0.3).points)


def test_result_outlives_its_input():
    points = np.random.default_rng(0).uniform(-1, 1, (1000, 3))
    cloud = voxel_downsample(points, 0.3)
    before = cloud.points.copy()
    points[:] = 0
    np.testing.assert_array_equal(cloud.points, before)


@pytest.mark.parametrize("voxel_size", [0.0, -0.1, np.nan, np.inf, 1e-310, 1e-9])
@pytest.mark.parametrize("num_threads", [1, 4])
def test_absurd_voxel_sizes(voxel_size, num_threads):
    points = np.ones((100_000, 3))
    with pytest.raises(ValueError, match="^voxel_size: "):
        voxel_downsample(points, voxel_size, num_threads=num_threads)


def test_index_range_is_what_the_message_says():
    limit = 2.0**20
    voxel_downsample(np.array([[-limit, 0, np.nextafter(limit, 0)]]), 1)
    for x in (limit, np.nextafter(-limit, -np.inf), 1e300):
        with pytest.raises(ValueError, match="point 1 lies more than 2\\^20 voxels"):
            voxel_downsample(np.array([[0, 0, 0], [0, x, 0]]), 1)


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"points": np.zeros((4, 2))}, ValueError, r"points: .*\(4, 2\)"),
        ({"points": np.zeros(3)}, ValueError, "points: "),
        ({"points": np.zeros((4, 3), int)}, TypeError, "points: .*int"),
        ({"points": "cloud"}, TypeError, "points: "),
        ({"normals": np.zeros((3, 3))}, ValueError, "normals: 3 rows for 4 points"),
        ({"normals": np.zeros((4, 4))}, ValueError, "normals: "),
        ({"num_threads": 0}, ValueError, "num_threads: "),
    ],
)
def test_bad_arguments_are_named(arguments, error, match):
    with pytest.raises(error, match=match):
        voxel_downsample(**{"points": np.zeros((4, 3)), "voxel_size": 1.0, **arguments})


def test_unknown_simd_level():
    with pytest.raises(ValueError, match="simd: .*'mmx'"):
        _core.voxel_downsample(np.zeros((1, 3)), 1.0, None, 1, "mmx")


def test_python_runs_meanwhile():
    """The GIL is released: another thread counts while a large cloud is worked on."""
    points = np.random.default_rng(0).uniform(-1, 1, (1_000_000, 3))
    done = threading.Event()
    ticks = 0

    def work():
        for _ in range(3):
            voxel_downsample(points, 0.01)
        done.set()

    thread = threading.Thread(target=work)
    thread.start()
    while not done.wait(0.001):
        ticks += 1
    thread.join()
    assert ticks > 20
