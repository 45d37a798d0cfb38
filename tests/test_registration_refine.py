"""Refinement on distance fields: true poses of solids whose field is known in closed form."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.errors import InputError
from prehensile.perception import PointCloud
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.registration import (
    RefineConfig,
    RegistrationStatus,
    RobustLoss,
    refine_pose,
    refine_poses,
)

Array = NDArray[np.float64]
Distance = Callable[[Array], Array]


def field_of(distance: Distance, half: float = 0.12, spacing: float = 0.003) -> DistanceField:
    """The field of a closed form (..., 3) -> (...), its gradient by central differences."""
    steps = np.arange(-half, half + spacing, spacing)
    nodes = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)
    h = 1e-6
    g = np.stack([distance(nodes + h * e) - distance(nodes - h * e) for e in np.eye(3)], -1)
    return DistanceField.from_values(nodes[0, 0, 0], spacing, distance(nodes), g / (2.0001 * h))


def ellipsoid_like(p: Array) -> Array:
    """Three balls of different sizes: nothing symmetric about them."""
    centres = [[0.02, 0, 0], [-0.03, 0.02, 0.01], [0, -0.04, -0.03], [0.01, 0.02, 0.05]]
    radii = [0.04, 0.03, 0.025, 0.02]
    each = [np.linalg.norm(p - c, axis=-1) - r for c, r in zip(centres, radii, strict=True)]
    return np.min(each, axis=0)


def surface_points(distance: Distance, count: int, seed: int = 0, spread: float = 0.08) -> Array:
    """Points of the zero set, by projection along the gradient."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(4 * count, 3))
    p *= spread / np.linalg.norm(p, axis=1, keepdims=True)
    h = 1e-6
    for _ in range(30):
        d = distance(p)
        g = np.stack([distance(p + h * e) - distance(p - h * e) for e in np.eye(3)], -1) / (2 * h)
        p = p - d[:, None] * g
    return p[np.abs(distance(p)) < 1e-9][:count]


def seen(p: Array, along: Array) -> Array:
    """The half of the points that lies towards a direction."""
    return p[p @ along > np.median(p @ along)]


BLOB = field_of(ellipsoid_like)
POINTS = surface_points(ellipsoid_like, 4000)
X_WO = RigidTransform(RotationMatrix(AngleAxis(1.1, [0.6, 0.0, 0.8])), [0.4, -0.2, 0.7])


def guess_off(angle: float, shift: float, seed: int) -> RigidTransform:
    """The true pose, turned about O and moved, expressed in O."""
    rng = np.random.default_rng(seed)
    axis, step = rng.normal(size=(2, 3))
    axis, step = axis / np.linalg.norm(axis), step / np.linalg.norm(step)
    return X_WO @ RigidTransform(AngleAxis(angle, axis), shift * step)


def scene_of(p_O: Array, noise: float = 0.0, seed: int = 0) -> PointCloud:
    p = (X_WO @ p_O.T).T
    return PointCloud(p + np.random.default_rng(seed).normal(0, noise, p.shape) if noise else p)


def errors(X: RigidTransform | None) -> tuple[float, float]:
    """How far off a pose is, [rad] and [m]."""
    assert X is not None
    off = X_WO.inverse() @ X
    return off.rotation().ToAngleAxis().angle(), float(np.linalg.norm(off.translation()))


@pytest.mark.parametrize("loss", RobustLoss)
def test_finds_the_pose_of_a_partial_view(loss: RobustLoss) -> None:
    scene = scene_of(seen(POINTS, np.array([0.3, 0.5, 0.8])))
    result = refine_pose(scene, BLOB, guess_off(0.4, 0.01, 1), RefineConfig(loss=loss))
    assert result.succeeded, result.message
    turn, step = errors(result.X_WO)
    assert turn < 2e-3
    assert step < 1e-4
    assert result.inliers.all()
    assert result.residual < 1e-4


def test_a_wide_basin_with_further_starts() -> None:
    scene = scene_of(seen(POINTS, np.array([0.3, 0.5, 0.8])), 0.001)
    right = {}
    for spread in (0.0, 0.7):
        config = RefineConfig(spread=spread)
        found = [refine_pose(scene, BLOB, guess_off(1.05, 0.02, k), config) for k in range(12)]
        right[spread] = sum(errors(r.X_WO)[0] < 0.05 for r in found)
    assert right[0.7] >= 8
    assert right[0.7] > right[0.0]


def test_covariance_is_that_of_the_error() -> None:
    # Over many scenes of independent noise, the error weighed by its covariance is chi-squared.
    config = RefineConfig(loss=RobustLoss.LEAST_SQUARES)
    squares = []
    for seed in range(60):
        scene = scene_of(POINTS[::8], 0.001, seed)
        result = refine_pose(scene, BLOB, X_WO, config)
        assert result.X_WO is not None
        assert result.covariance is not None
        turn = result.X_WO.rotation() @ X_WO.rotation().inverse()
        w = turn.ToAngleAxis().angle() * turn.ToAngleAxis().axis()
        e = np.concatenate([w, result.X_WO.translation() - X_WO.translation()])
        squares.append(e @ np.linalg.solve(result.covariance, e))
    assert 4.5 < np.mean(squares) < 8  # Six degrees of freedom; a deviation of the mean is 0.45.


@pytest.mark.parametrize("loss", [RobustLoss.TUKEY, RobustLoss.GEMAN_MCCLURE, RobustLoss.TRUNCATED])
def test_outliers(loss: RobustLoss) -> None:
    rng = np.random.default_rng(5)
    wrong = rng.uniform(-0.15, 0.15, (600, 3))
    wrong = wrong[np.abs(ellipsoid_like(wrong)) > 0.012]
    p = np.concatenate([POINTS[:1500], wrong])
    scene = scene_of(p, 0.0005)
    result = refine_pose(scene, BLOB, guess_off(0.3, 0.01, 2), RefineConfig(loss=loss))
    assert result.succeeded, result.message
    turn, step = errors(result.X_WO)
    assert turn < 0.015
    assert step < 1e-3
    np.testing.assert_array_equal(result.inliers, np.arange(len(p)) < 1500)


def test_trimmed_and_limited() -> None:
    rng = np.random.default_rng(6)
    wrong = rng.uniform(0.03, 0.12, (500, 3))  # All on one side: plain least squares follows.
    wrong = wrong[ellipsoid_like(wrong) > 0.03]
    scene = scene_of(np.concatenate([POINTS[:2000], wrong]))
    plain = RefineConfig(loss=RobustLoss.LEAST_SQUARES)
    assert errors(refine_pose(scene, BLOB, X_WO, plain).X_WO)[1] > 0.002
    for config in (
        RefineConfig(loss=RobustLoss.LEAST_SQUARES, kept_fraction=0.75),
        RefineConfig(loss=RobustLoss.LEAST_SQUARES, max_distance=0.01, initial_scale=0.003),
    ):
        turn, step = errors(refine_pose(scene, BLOB, X_WO, config).X_WO)
        assert turn < 2e-3
        assert step < 2e-4


def test_normals_tell_two_sides_of_a_plate_apart() -> None:
    # Points of the top of a thin plate, guessed nearer to its bottom.
    def plate(p: Array) -> Array:
        q = np.abs(p) - [0.05, 0.03, 0.004]
        outside = np.linalg.norm(np.maximum(q, 0), axis=-1)
        return outside + np.minimum(q.max(axis=-1), 0)

    field = field_of(plate, 0.08, 0.002)
    rng = np.random.default_rng(0)
    rim = [[0.05, y, z] for y, z in rng.uniform(-1, 1, (200, 2)) * [0.03, 0.004]]
    side = [[x, 0.03, z] for x, z in rng.uniform(-1, 1, (200, 2)) * [0.05, 0.004]]
    top = [[x, y, 0.004] for x, y in rng.uniform(-1, 1, (600, 2)) * [0.05, 0.03]]
    p = np.array(top + rim + side)
    n = np.array([[0, 0, 1]] * 600 + [[1, 0, 0]] * 200 + [[0, 1, 0]] * 200, dtype=float)
    scene = PointCloud(p, n).transformed(X_WO)
    guess = X_WO @ RigidTransform([0.001, 0.001, 0.0065])
    config = RefineConfig(min_normal_cosine=0.5, scale=0.002, initial_scale=0.004)
    result = refine_pose(scene, field, guess, config)
    assert result.succeeded, result.message
    assert errors(result.X_WO)[1] < 2e-4
    with pytest.raises(InputError, match="normals"):
        refine_pose(PointCloud(p), field, guess, config)


@pytest.mark.parametrize(
    ("distance", "free"),
    [
        (lambda p: np.linalg.norm(p, axis=-1) - 0.05, 3),
        (lambda p: np.linalg.norm(p[..., :2], axis=-1) - 0.05, 2),
        (lambda p: p[..., 2], 3),
    ],
    ids=["sphere", "cylinder", "plane"],
)
def test_free_motions(distance: Distance, free: int) -> None:
    p = surface_points(distance, 1000)
    field = field_of(distance)
    result = refine_pose(scene_of(p, 0.0005), field, guess_off(0.05, 0.004, 3))
    assert result.status is RegistrationStatus.DEGENERATE
    assert result.free_directions is not None
    assert result.free_directions.shape == (free, 6)
    # Nothing moved along them for want of information: what remains is where the guess put it.
    assert result.residual < 1e-3


def test_low_overlap_and_few_points() -> None:
    scene = scene_of(POINTS + [0.5, 0, 0])
    result = refine_pose(scene, BLOB, X_WO, RefineConfig(max_coarse_iterations=0, max_iterations=1))
    assert result.status is RegistrationStatus.LOW_OVERLAP
    assert not result.inliers.any()
    for count in (0, 1, 5):
        result = refine_pose(PointCloud(np.zeros((count, 3))), BLOB, X_WO)
        assert result.status is RegistrationStatus.DEGENERATE
        assert result.X_WO is None
    for p in (np.zeros((50, 3)), np.linspace([0, 0, 0], [0.1, 0, 0], 50)):  # A spot, a line.
        result = refine_pose(PointCloud(p), BLOB, RigidTransform())
        assert not result.succeeded


def test_iterations_run_out() -> None:
    scene = scene_of(POINTS)
    config = RefineConfig(max_coarse_iterations=0, max_iterations=1, tolerance=1e-9)
    result = refine_pose(scene, BLOB, guess_off(0.05, 0.004, 1), config)
    assert result.status is RegistrationStatus.NOT_CONVERGED


def test_many_starts() -> None:
    scene = scene_of(seen(POINTS, np.array([0.0, 0.0, 1.0])), 0.001)
    rng = np.random.default_rng(0)
    far = [X_WO @ RigidTransform(AngleAxis(2.5, a / np.linalg.norm(a)), [0, 0, 0])
           for a in rng.normal(size=(6, 3))]  # fmt: skip
    guesses = [*far[:3], guess_off(0.2, 0.01, 0), *far[3:]]
    one, two = (refine_poses(scene, BLOB, guesses, num_threads=n) for n in (1, 4))
    assert one.best.succeeded, one.best.message
    assert errors(one.best.X_WO)[0] < 0.02
    np.testing.assert_array_equal(one.costs, two.costs)
    assert one.best.X_WO is not None
    assert two.best.X_WO is not None
    np.testing.assert_array_equal(one.best.X_WO.GetAsMatrix4(), two.best.X_WO.GetAsMatrix4())
    assert sum(result is not None for result in one.results) == 1
    with pytest.raises(ValueError, match="^X_WO_guesses:"):
        refine_poses(scene, BLOB, [])


def test_a_box_fits_in_several_ways() -> None:
    def box(p: Array) -> Array:
        q = np.abs(p) - [0.05, 0.03, 0.02]
        return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)

    rng = np.random.default_rng(1)
    p = rng.uniform(-1, 1, (3000, 3)) * [0.05, 0.03, 0.02]
    axis = rng.integers(0, 3, 3000)
    p[np.arange(3000), axis] = np.sign(rng.normal(size=3000)) * np.array([0.05, 0.03, 0.02])[axis]
    half_turn = X_WO @ RigidTransform(AngleAxis(np.pi, [0, 0, 1]), [0, 0, 0])
    found = refine_poses(scene_of(p, 0.0005), field_of(box), [half_turn, X_WO])
    assert found.best.status is RegistrationStatus.AMBIGUOUS
    assert found.best.X_WO is not None
    assert found.best.residual < 1e-3


def test_far_from_the_origin_of_the_world() -> None:
    # A map's coordinates: a kilometre away, single precision alone would be off by 60 um.
    far = RigidTransform([1000.0, -2000.0, 300.0])
    scene = scene_of(POINTS)
    moved = PointCloud(scene.points + far.translation())
    result = refine_pose(moved, BLOB, far @ guess_off(0.2, 0.01, 4))
    assert result.succeeded
    assert result.X_WO is not None
    turn, step = errors(far.inverse() @ result.X_WO)
    assert turn < 2e-3
    assert step < 1e-4


@pytest.mark.parametrize(
    "config",
    [
        {"scale": 0.0},
        {"scale": np.nan},
        {"initial_scale": -1.0},
        {"cooling": 1.0},
        {"max_distance": 0.0},
        {"kept_fraction": 0.0},
        {"min_normal_cosine": -2.0},
        {"num_coarse_points": 0},
        {"num_finalists": 0},
        {"max_iterations": 0},
        {"tolerance": 0.0},
    ],
    ids=lambda config: next(iter(config)),
)
def test_bad_config(config: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=f"^{next(iter(config))}:"):
        refine_pose(scene_of(POINTS[:100]), BLOB, X_WO, RefineConfig(**config))  # pyright: ignore[reportArgumentType]
