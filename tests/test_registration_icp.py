"""Iterative closest points on shapes whose poses, normals and freedoms are known."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.spatial import cKDTree

from prehensile.perception import PointCloud
from prehensile.perception.registration import (
    IcpConfig,
    IcpDirection,
    IcpKind,
    IcpModel,
    RegistrationStatus,
    RobustLoss,
    fit_rigid,
    icp,
    icp_2d,
    icp_many_starts,
    planar_pose,
)

X_TRUE = RigidTransform(RollPitchYaw(0.3, -0.2, 0.4), [0.5, 0.1, -0.2])


def boxes(count, rng, *sizes_and_centers):
    """Points (N, 3) and outward normals on the surfaces of boxes."""
    points, normals = [], []
    for size, center in sizes_and_centers:
        half = 0.5 * np.array(size)
        areas = np.repeat([half[1] * half[2], half[0] * half[2], half[0] * half[1]], 2)
        faces = rng.choice(6, count // len(sizes_and_centers), p=areas / areas.sum())
        n = np.zeros((len(faces), 3))
        n[np.arange(len(faces)), faces // 2] = 1 - 2.0 * (faces % 2)
        x = rng.uniform(-half, half, (len(faces), 3))
        points.append(np.where(n != 0, n * half, x) + center)
        normals.append(n)
    return np.concatenate(points), np.concatenate(normals)


def bracket(count, rng):
    """An object without symmetry, 20 cm long."""
    return boxes(
        count, rng, ([0.2, 0.05, 0.03], [0, 0, 0]), ([0.03, 0.12, 0.07], [0.06, 0.05, 0.05])
    )


def placed(points, normals=None, X=X_TRUE, colors=None):
    cloud = PointCloud(points, normals=normals, colors=colors)
    return cloud.transformed(X)


def nudged(angle=0.15, shift=0.01, X=X_TRUE):
    axis = np.array([1, 2, -1]) / np.sqrt(6)
    small = RigidTransform(RollPitchYaw(*(angle * axis)), shift * axis[::-1])
    center = RigidTransform(X.translation())
    return center @ small @ center.inverse() @ X


def error(X, expected=X_TRUE):
    """Largest distance between the places of the bracket's corners in two poses."""
    corners = 0.1 * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
    return np.linalg.norm(X.multiply(corners) - expected.multiply(corners), axis=0).max()


@pytest.fixture(scope="module")
def model():
    return IcpModel(PointCloud(*bracket(4000, np.random.default_rng(0))))


@pytest.fixture(scope="module")
def scene():
    points, normals = bracket(1500, np.random.default_rng(1))
    seen = points[:, 2] > -0.014  # Not the underside.
    return placed(points[seen], normals[seen])


@pytest.mark.parametrize(
    ("kind", "tolerance"),
    [
        (IcpKind.POINT_TO_POINT, 1.5e-3),
        (IcpKind.POINT_TO_PLANE, 5e-4),
        (IcpKind.GENERALIZED, 5e-4),
    ],
)
def test_every_kind_finds_the_pose(model, scene, kind, tolerance):
    result = icp(scene, model, nudged(), IcpConfig(kind, max_iterations=300))
    assert result.succeeded, result.message
    assert error(result.X_WO) < tolerance
    assert result.inliers.all()


def test_point_to_point_ends_where_no_partner_changes(model, scene):
    """The fixed point, checked by SciPy's tree and the closed form; and the way there."""
    history = []
    config = IcpConfig(IcpKind.POINT_TO_POINT, coarse_points=0, tolerance=1e-12, max_iterations=500)
    result = icp(scene, model, nudged(), config, history=history)
    assert result.succeeded
    assert len(history) == result.iterations + 1
    np.testing.assert_allclose(history[0].GetAsMatrix4(), nudged().GetAsMatrix4(), atol=1e-12)
    tree, points = cKDTree(model.cloud.points), model.cloud.points
    sums = []
    for X in history:
        distances, _ = tree.query(X.inverse().multiply(scene.points.T).T)
        sums.append((distances**2).sum())
    assert (np.diff(sums) <= 1e-12).all()
    _, partner = tree.query(result.X_WO.inverse().multiply(scene.points.T).T)
    fit = fit_rigid(points[partner], scene.points)
    np.testing.assert_allclose(fit.R_WO, result.X_WO.rotation().matrix(), atol=1e-9)
    np.testing.assert_allclose(fit.p_WO, result.X_WO.translation(), atol=1e-9)
    assert result.residual == pytest.approx(np.sqrt(sums[-1] / len(scene)), rel=1e-9)


def test_first_steps_with_few_points_lead_to_the_same_pose(model, scene):
    """But for partners at edges, which may settle on either side."""
    poses = [icp(scene, model, nudged(), IcpConfig(coarse_points=n)).X_WO for n in (0, 200)]
    assert error(*poses) < 1e-4


def with_outliers(scene, rng, fraction):
    count = int(fraction * len(scene))
    stray = X_TRUE.multiply(rng.uniform([-0.1, 0.05, 0.0], [0.05, 0.15, 0.1], (count, 3)).T).T
    return PointCloud(np.concatenate([scene.points, stray]))


@pytest.mark.parametrize(
    "config",
    [
        IcpConfig(max_distance=0.01),
        IcpConfig(kept_fraction=0.7),
        IcpConfig(loss=RobustLoss.TUKEY, loss_scale=0.01),
        IcpConfig(loss=RobustLoss.GEMAN_MCCLURE, loss_scale=0.005),
        IcpConfig(loss=RobustLoss.GEMAN_MCCLURE, loss_scale=0.003, graduated=True),
        IcpConfig(loss=RobustLoss.TRUNCATED, loss_scale=0.005, graduated=True),
    ],
)
def test_outliers_do_not_matter_to_robust_forms(model, scene, config):
    messy = with_outliers(scene, np.random.default_rng(2), 0.3)
    start = nudged(0.08, 0.005)
    plain = icp(messy, model, start)
    robust = icp(messy, model, start, config)
    assert robust.X_WO is not None
    assert plain.X_WO is not None
    assert error(robust.X_WO) < 3e-3 < error(plain.X_WO)
    assert robust.inliers[: len(scene)].mean() > 0.85


def test_both_directions_agree_on_full_views(model):
    points, normals = bracket(3000, np.random.default_rng(5))
    for direction in IcpDirection:
        result = icp(placed(points, normals), model, nudged(), IcpConfig(direction=direction))
        assert result.succeeded, direction
        assert error(result.X_WO) < 1e-3


def test_model_to_scene_ignores_what_stands_around(model):
    rng = np.random.default_rng(6)
    points, _ = bracket(3000, rng)
    wall = np.stack(
        [rng.uniform(-0.3, 0.3, 3000), np.full(3000, -0.06), rng.uniform(-0.1, 0.2, 3000)]
    )
    cluttered = placed(np.concatenate([points, wall.T]))
    start = nudged(0.05, 0.004)
    result = icp(cluttered, model, start, IcpConfig(direction=IcpDirection.MODEL_TO_SCENE))
    other = icp(cluttered, model, start)
    assert error(result.X_WO) < 3e-3 < error(other.X_WO)


def plate(rng, count=1500):
    points = rng.uniform(-0.1, 0.1, (count, 3)) * [1, 1, 0]
    return points, np.tile([0.0, 0, 1], (count, 1))


def sphere(rng, count=1500):
    n = rng.normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return 0.1 * n, n


def cylinder(rng, count=1500):
    angle = rng.uniform(-np.pi, np.pi, count)
    n = np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    return 0.05 * n + rng.uniform(-0.1, 0.1, (count, 1)) * [0, 0, 1], n


@pytest.mark.parametrize(("shape", "num_free"), [(plate, 3), (sphere, 3), (cylinder, 2)])
@pytest.mark.parametrize("kind", IcpKind)
def test_free_motions_are_told(shape, num_free, kind):
    rng = np.random.default_rng(0)
    model = PointCloud(*shape(rng, 6000))
    result = icp(placed(*shape(rng)), model, nudged(0.02, 0.002), IcpConfig(kind))
    assert result.status is RegistrationStatus.DEGENERATE
    assert result.free_directions.shape == (num_free, 6)
    # Along a free motion, seen in O, the surface's points move in their tangent planes.
    points, normals = shape(rng)
    R = X_TRUE.rotation().matrix()
    spread = np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean())
    for free in result.free_directions:
        w, v = R.T @ free[:3] / spread, R.T @ free[3:]
        across = ((np.cross(w, points) + v) * normals).sum(axis=1)
        assert np.sqrt((across**2).mean()) < 0.1


def test_colour_fixes_a_slide_along_a_plate():
    rng = np.random.default_rng(1)

    def paint(points):
        grey = 127 + 60 * np.sin(40 * points[:, 0]) + 60 * np.cos(35 * points[:, 1] + 1)
        return np.repeat(grey[:, None], 3, axis=1).astype(np.uint8)

    points, normals = plate(rng, 6000)
    model = IcpModel(PointCloud(points, normals=normals, colors=paint(points)))
    inner, n = plate(rng, 1000)
    inner = 0.8 * inner
    scene = placed(inner, n, colors=paint(inner))
    start = X_TRUE @ RigidTransform([0.008, -0.006, 0.002])
    coloured = icp(scene, model, start, IcpConfig(color_weight=0.05))
    plain = icp(scene, model, start)
    assert error(coloured.X_WO) < 1e-3 < error(plain.X_WO)
    with pytest.raises(ValueError, match="color_weight"):
        icp(PointCloud(scene.points), model, start, IcpConfig(color_weight=0.05))


def test_normals_part_the_sides_of_a_thin_sheet():
    """Points of the upper side must not be matched with the lower one."""
    rng = np.random.default_rng(2)
    size = ([0.2, 0.15, 0.004], [0, 0, 0])
    model = IcpModel(PointCloud(*boxes(6000, rng, size)))
    points, normals = boxes(3000, rng, size)
    top = normals[:, 2] > 0.5
    scene = placed(points[top], normals[top])
    start = X_TRUE @ RigidTransform([0, 0, 0.0035])  # Seen from the model: nearer to the lower.
    parted = icp(scene, model, start, IcpConfig(max_normal_angle=1.0))
    blind = icp(scene, model, start)
    up = X_TRUE.rotation().matrix()[:, 2]
    assert abs(up @ (parted.X_WO.translation() - X_TRUE.translation())) < 1e-4
    assert abs(up @ (blind.X_WO.translation() - X_TRUE.translation())) > 3e-3


def test_nothing_in_reach_is_no_pose(model, scene):
    away = RigidTransform([5, 5, 5])
    result = icp(scene, model, away, IcpConfig(max_distance=0.05))
    assert result.status is RegistrationStatus.LOW_OVERLAP
    assert result.X_WO is None
    assert not result.inliers.any()


def test_little_overlap_is_told(model, scene):
    rng = np.random.default_rng(3)
    far = X_TRUE.multiply(rng.uniform(0.5, 1, (4 * len(scene), 3)).T).T
    cloud = PointCloud(np.concatenate([scene.points, far]))
    result = icp(cloud, model, nudged(0.05, 0.005), IcpConfig(max_distance=0.02))
    assert result.status is RegistrationStatus.LOW_OVERLAP
    assert result.X_WO is not None
    assert result.inliers.mean() < 0.25


def test_covariance_is_that_of_repeated_measurement(model):
    rng = np.random.default_rng(4)
    points, _ = bracket(400, rng)
    p_WO, spreads = [], []
    for _ in range(60):
        noisy = placed(points + rng.normal(0, 1e-3, points.shape))
        result = icp(noisy, model, X_TRUE)
        p_WO.append(result.X_WO.translation())
        spreads.append(np.sqrt(np.diag(result.covariance)[3:]))
    # Points are matched with what is nearest, which hides a part of the noise.
    ratio = np.std(p_WO, axis=0) / np.mean(spreads, axis=0)
    assert (ratio > 0.4).all()
    assert (ratio < 2.5).all()


def test_many_starts_find_the_pose_and_do_not_depend_on_threads(model, scene):
    rng = np.random.default_rng(0)
    guesses = [
        X_TRUE @ RigidTransform(RollPitchYaw(*rng.uniform(-np.pi, np.pi, 3)), [0, 0, 0.01])
        for _ in range(12)
    ]
    config = IcpConfig(loss=RobustLoss.GEMAN_MCCLURE, loss_scale=0.01, graduated=True)
    results = [icp_many_starts(scene, model, guesses, config, num_threads=n) for n in (1, 2)]
    assert results[0].succeeded
    assert error(results[0].X_WO) < 1e-3
    assert np.array_equal(results[0].X_WO.GetAsMatrix4(), results[1].X_WO.GetAsMatrix4())


def test_symmetric_objects_are_ambiguous():
    rng = np.random.default_rng(0)
    brick = ([0.2, 0.12, 0.06], [0, 0, 0])
    model = IcpModel(PointCloud(*boxes(4000, rng, brick)))
    scene = placed(*boxes(1000, rng, brick))
    half_turn = X_TRUE @ RigidTransform(RollPitchYaw(0, 0, np.pi), [0, 0, 0])
    result = icp_many_starts(scene, model, [nudged(), nudged(X=half_turn)])
    assert result.status is RegistrationStatus.AMBIGUOUS
    assert icp_many_starts(scene, model, [nudged(), X_TRUE]).succeeded


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"max_distance": 0.0}, "max_distance"),
        ({"max_distance": np.nan}, "max_distance"),
        ({"max_normal_angle": 4.0}, "max_normal_angle"),
        ({"kept_fraction": 0.0}, "kept_fraction"),
        ({"kept_fraction": 1.1}, "kept_fraction"),
        ({"loss_scale": 0.0}, "loss_scale"),
        ({"graduated": True}, "graduated"),
        ({"color_weight": 1.0}, "color_weight"),
        ({"coarse_points": -1}, "coarse_points"),
        ({"max_iterations": 0}, "max_iterations"),
        ({"tolerance": np.nan}, "tolerance"),
        ({"min_overlap": 2.0}, "min_overlap"),
    ],
)
def test_bad_settings_are_named(model, scene, changes, name):
    with pytest.raises(ValueError, match=name):
        icp(scene, model, X_TRUE, IcpConfig(**changes))


def test_bad_clouds_are_named_or_told(model, scene):
    empty = PointCloud(np.zeros((0, 3)))
    with pytest.raises(ValueError, match="scene"):
        icp(empty, model, X_TRUE)
    with pytest.raises(ValueError, match="model"):
        icp(scene, empty, X_TRUE)
    with pytest.raises(ValueError, match="guesses"):
        icp_many_starts(scene, model, [])
    with pytest.raises(ValueError, match="num_threads"):
        icp_many_starts(scene, model, [X_TRUE], num_threads=0)
    nan = RigidTransform(X_TRUE.rotation(), [np.nan, 0, 0])
    with pytest.raises(ValueError, match="X_WO_guess"):
        icp(scene, model, nan)
    one = PointCloud(scene.points[:1])
    line = PointCloud(np.linspace([0, 0, 0], [0.1, 0, 0], 20))
    for cloud in (one, line):
        for kind in IcpKind:
            for pair in ((cloud, model), (scene, cloud), (cloud, cloud)):
                assert not icp(*pair, X_TRUE, IcpConfig(kind)).succeeded


def test_icp_in_the_plane():
    rng = np.random.default_rng(0)
    model = rng.uniform(-1, 1, (40, 2))
    X = planar_pose(0.7, [0.5, -0.3])
    scene = model[:25] @ X[:2, :2].T + X[:2, 2]
    guess = planar_pose(0.6, [0.45, -0.25])
    result = icp_2d(scene, model, guess)
    assert result.succeeded
    assert result.residual < 1e-12
    np.testing.assert_allclose(result.X_WO, X, atol=1e-12)
    assert np.array_equal(result.history[-1].correspondences, np.arange(25))
    # With strays, only what is trimmed finds it.
    messy = np.concatenate([scene, rng.uniform(2, 3, (8, 2))])
    trimmed = icp_2d(messy, model, guess, kept_fraction=25 / 33)
    np.testing.assert_allclose(trimmed.X_WO, X, atol=1e-12)
    assert trimmed.inliers.tolist() == [True] * 25 + [False] * 8
    assert not np.allclose(icp_2d(messy, model, guess).X_WO, X, atol=1e-2)


def test_icp_in_the_plane_answers_bad_input():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    far = icp_2d(square + 50, square, np.eye(3), max_distance=1)
    assert far.status is RegistrationStatus.LOW_OVERLAP
    assert far.X_WO is None
    one = icp_2d(square, square[:1], np.eye(3))
    assert one.status is RegistrationStatus.DEGENERATE
    for arguments, name in [
        ((square[:1], square, np.eye(3)), "scene"),
        ((square, square[:0], np.eye(3)), "model"),
        ((square, square, np.diag([1, -1, 1])), "X_WO_guess"),
        ((square * np.nan, square, np.eye(3)), "scene"),
    ]:
        with pytest.raises(ValueError, match=name):
            icp_2d(*arguments)
