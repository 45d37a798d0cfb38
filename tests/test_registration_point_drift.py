"""Coherent point drift and its filter form, against the textbook's dense sums."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.native import _core
from prehensile.perception import PointCloud
from prehensile.perception.registration import (
    FilterRegConfig,
    PointDriftConfig,
    RegistrationStatus,
    coherent_point_drift,
    filter_registration,
    planar_pose,
    point_drift_2d,
)

X_TRUE = RigidTransform(RollPitchYaw(0.3, -0.2, 0.4), [0.05, 0.02, -0.03])


def shape(count, seed):
    """Points and normals on an uneven egg, 20 cm long."""
    rng = np.random.default_rng(seed)
    u = rng.normal(size=(count, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    radii = np.array([0.1, 0.07, 0.045])
    n = u / radii
    points = u * radii
    bump = u[:, 0] > 0.2
    points[bump] += (u[bump, :1] - 0.2) * [0.0, 0.04, 0.03]
    return points, n / np.linalg.norm(n, axis=1, keepdims=True)


def dense_drift(scene, model, w, volume, iterations):
    """Myronenko and Song's figure 2, without scale, in double precision."""
    D = scene.shape[1]
    R, t = np.eye(D), np.zeros(D)
    variance = ((scene[:, None] - model) ** 2).sum() / (D * len(scene) * len(model))
    for _ in range(iterations):
        moved = model @ R.T + t
        squares = ((scene[:, None] - moved) ** 2).sum(axis=2)
        k = np.exp(-squares / (2 * variance))
        uniform = (2 * np.pi * variance) ** (D / 2) * w / (1 - w) * len(model) / volume
        P = k / (k.sum(axis=1, keepdims=True) + uniform)
        total = P.sum()
        mean_x = P.sum(axis=1) @ scene / total
        mean_y = P.sum(axis=0) @ model / total
        A = (scene - mean_x).T @ P @ (model - mean_y)
        U, _, Vt = np.linalg.svd(A)
        R = U @ np.diag([1] * (D - 1) + [np.linalg.det(U @ Vt)]) @ Vt
        t = mean_x - R @ mean_y
        residuals = ((scene[:, None] - model @ R.T - t) ** 2).sum(axis=2)
        variance = (P * residuals).sum() / (total * D)
    return R, t, np.sqrt(variance)


def errors(X, expected=X_TRUE):
    E = expected.inverse() @ X
    return E.rotation().ToAngleAxis().angle(), np.linalg.norm(E.translation())


@given(
    seed=st.integers(0, 2**32 - 1),
    sigma=st.floats(-4, 1).map(lambda x: 10.0**x),
    offset=st.floats(0, 1),
)
@settings(max_examples=60, deadline=None)
def test_sums_of_gaussians(seed, sigma, offset):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(rng.integers(1, 200), 3))
    queries = rng.normal(size=(rng.integers(1, 50), 3)) + offset
    shift, k, *kd, kd2 = _core.GaussianSums(points).at(queries, sigma, 0.0, np.inf, 1).T
    d = points - queries[:, None]
    squares = (d**2).sum(axis=2)
    # Ratios decide; single precision blurs an exponent by a part of its size.
    nearest = squares.min(axis=1)
    weights = np.exp(-(squares - nearest[:, None]) / (2 * sigma**2))
    scale = np.exp((shift - nearest) / (2 * sigma**2))
    blur = 1e-5 + 4e-6 * (squares.max() if sigma > 1 else nearest + 40 * sigma**2) / sigma**2
    blur = np.minimum(blur, 1.0)
    assert (np.abs(k / (scale * weights.sum(axis=1)) - 1) <= blur).all() or sigma < 1e-3
    expected = (weights[:, :, None] * d).sum(axis=1) / weights.sum(axis=1)[:, None]
    size = np.sqrt((weights * squares).sum(axis=1) / weights.sum(axis=1))
    gap = np.linalg.norm(np.stack(kd, axis=1) / k[:, None] - expected, axis=1)
    assert (gap <= (blur * size + 1e-6) * 2).all() or sigma < 1e-3
    np.testing.assert_array_less(0, k)
    np.testing.assert_array_less(kd2 / k, squares.max(axis=1) * (1 + 1e-5) + 1e-12)


@pytest.mark.parametrize("w", [0.0, 0.1, 0.5])
def test_agrees_with_dense_sums_in_double_precision(w):
    model, _ = shape(150, 0)
    rng = np.random.default_rng(2)
    scene = X_TRUE.multiply(shape(180, 1)[0].T).T
    scene[:8] += rng.normal(0, 0.1, (8, 3))
    config = PointDriftConfig(outlier_weight=w, outlier_volume=0.01, max_iterations=25)
    result = coherent_point_drift(PointCloud(scene), PointCloud(model), config=config)
    R, t, sigma = dense_drift(scene, model, w, 0.01, result.iterations)
    np.testing.assert_allclose(result.X_WO.rotation().matrix(), R, atol=1e-6)
    np.testing.assert_allclose(result.X_WO.translation(), t, atol=1e-7)
    assert result.residual == pytest.approx(np.sqrt(3) * sigma, rel=1e-5)


def test_agrees_with_dense_sums_in_the_plane():
    rng = np.random.default_rng(0)
    model = rng.uniform(-1, 1, (30, 2))
    X = planar_pose(0.5, [0.3, -0.2])
    scene = (model + rng.normal(0, 0.01, model.shape)) @ X[:2, :2].T + X[:2, 2]
    config = PointDriftConfig(outlier_weight=0.2, outlier_volume=5.0, tolerance=1e-8)
    result = point_drift_2d(scene, model, config=config)
    R, t, _sigma = dense_drift(scene, model, 0.2, 5.0, result.iterations)
    np.testing.assert_allclose(result.X_WO[:2, :2], R, atol=1e-5)
    np.testing.assert_allclose(result.X_WO[:2, 2], t, atol=1e-5)
    assert result.succeeded
    assert len(result.history) == result.iterations + 1
    np.testing.assert_allclose(result.X_WO, X, atol=0.02)
    mirrored = point_drift_2d(model * [1, -1], model)
    assert np.linalg.det(mirrored.X_WO[:2, :2]) == pytest.approx(1)


def test_finds_the_pose_amid_outliers_and_does_not_depend_on_threads():
    model = PointCloud(shape(800, 0)[0])
    rng = np.random.default_rng(1)
    points = X_TRUE.multiply(shape(700, 2)[0].T).T + rng.normal(0, 1e-3, (700, 3))
    stray = rng.uniform(-0.2, 0.25, (200, 3))
    scene = PointCloud(np.concatenate([points, stray]))
    config = PointDriftConfig(outlier_weight=0.2)
    history = []
    one = coherent_point_drift(scene, model, config=config, history=history)
    two = coherent_point_drift(scene, model, config=config, num_threads=2)
    assert one.succeeded, one.message
    angle, way = errors(one.X_WO)
    assert angle < 0.05
    assert way < 2e-3
    assert np.array_equal(one.X_WO.GetAsMatrix4(), two.X_WO.GetAsMatrix4())
    assert len(history) == one.iterations + 1
    assert one.inliers[:700].mean() > 0.97
    assert one.inliers[700:].mean() < 0.2


@pytest.mark.parametrize("point_to_plane", [False, True])
def test_filter_form_finds_what_drift_finds(point_to_plane):
    model = PointCloud(*shape(1500, 0))
    scene = PointCloud(X_TRUE.multiply(shape(1500, 2)[0].T).T)
    config = FilterRegConfig(point_to_plane=point_to_plane)
    by_filter = filter_registration(scene, model, RigidTransform(), config)
    by_drift = coherent_point_drift(scene, model)
    assert by_filter.succeeded, by_filter.message
    angle, way = errors(by_filter.X_WO, by_drift.X_WO)
    assert angle < 0.02
    assert way < 1e-3
    assert errors(by_filter.X_WO)[0] < 0.02


def test_filter_form_on_a_partial_view():
    model = PointCloud(*shape(2000, 0))
    points, normals = shape(3000, 2)
    seen = normals @ np.array([0.3, 0.4, 0.866]) > 0.1
    scene = PointCloud(X_TRUE.multiply(points[seen].T).T)
    start = X_TRUE @ RigidTransform(RollPitchYaw(0.1, -0.1, 0.15), [0.01, 0, 0.01])
    result = filter_registration(scene, model, start, FilterRegConfig(point_to_plane=True))
    angle, way = errors(result.X_WO)
    assert angle < 0.05
    assert way < 3e-3


def test_a_plane_leaves_the_filter_form_free():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.1, 0.1, (1000, 3)) * [1, 1, 0]
    plane = PointCloud(points, normals=np.tile([0.0, 0, 1], (1000, 1)))
    result = filter_registration(
        plane, plane, RigidTransform([0, 0, 0.01]), FilterRegConfig(point_to_plane=True)
    )
    assert result.status is RegistrationStatus.DEGENERATE
    assert result.free_directions.shape == (3, 6)


def test_hopeless_clouds_are_told():
    model = PointCloud(shape(200, 0)[0])
    line = PointCloud(np.linspace([0, 0, 0], [0.1, 0.2, 0.05], 30))
    for scene, other in ((line, line), (PointCloud(np.zeros((1, 3))), model)):
        result = coherent_point_drift(scene, other)
        assert not result.succeeded
    # Narrow Gaussians far off explain nothing.
    far = PointCloud(model.points + 5)
    config = PointDriftConfig(sigma=0.001, outlier_weight=0.3)
    result = coherent_point_drift(far, model, config=config)
    assert result.status is RegistrationStatus.LOW_OVERLAP
    assert result.X_WO is None
    result = filter_registration(far, model, RigidTransform(), FilterRegConfig(sigma=0.01))
    assert result.status is RegistrationStatus.LOW_OVERLAP
    assert result.X_WO is None


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"outlier_weight": 1.0}, "outlier_weight"),
        ({"outlier_weight": -0.1}, "outlier_weight"),
        ({"outlier_volume": 0.0}, "outlier_volume"),
        ({"sigma": -1.0}, "sigma"),
        ({"sigma": np.nan}, "sigma"),
        ({"max_iterations": 0}, "max_iterations"),
    ],
)
def test_bad_settings_are_named(changes, name):
    cloud = PointCloud(shape(50, 0)[0])
    with pytest.raises(ValueError, match=name):
        coherent_point_drift(cloud, cloud, config=PointDriftConfig(**changes))
    with pytest.raises(ValueError, match=name):
        filter_registration(cloud, cloud, RigidTransform(), FilterRegConfig(**changes))


def test_empty_clouds_are_named():
    cloud, empty = PointCloud(shape(50, 0)[0]), PointCloud(np.zeros((0, 3)))
    with pytest.raises(ValueError, match="scene"):
        coherent_point_drift(empty, cloud)
    with pytest.raises(ValueError, match="model"):
        coherent_point_drift(cloud, empty)
    with pytest.raises(ValueError, match="scene"):
        filter_registration(empty, cloud, RigidTransform())
    with pytest.raises(ValueError, match="model"):
        filter_registration(cloud, empty, RigidTransform())
    with pytest.raises(ValueError, match="X_WO_guess"):
        coherent_point_drift(cloud, cloud, RigidTransform([np.nan, 0, 0]))
