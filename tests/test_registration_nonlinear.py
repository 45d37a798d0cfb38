"""Poses by general nonlinear optimization: losses of one's own, and constraints."""

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception import PointCloud
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.registration import (
    RefineConfig,
    RegistrationStatus,
    RobustLoss,
    estimate_pose_nonlinear,
    refine_pose,
)

Array = NDArray[np.float64]
HALF = np.array([0.05, 0.03, 0.02])
X_WO = RigidTransform(RotationMatrix(AngleAxis(0.8, [0.6, 0.0, 0.8])), [0.4, -0.2, 0.1])


def box_distance(p: Array) -> Array:
    q = np.abs(p) - HALF
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)


def box_field() -> DistanceField:
    steps = np.arange(-0.1, 0.1025, 0.0025)
    nodes = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)
    h = 1e-6
    g = np.stack([box_distance(nodes + h * e) - box_distance(nodes - h * e) for e in np.eye(3)], -1)
    return DistanceField.from_values(nodes[0, 0, 0], 0.0025, box_distance(nodes), g / (2.0001 * h))


FIELD = box_field()


def box_scene(count: int = 600, faces: str = "all", noise: float = 0.0) -> PointCloud:
    """Points of all faces, or of the three at positive coordinates."""
    rng = np.random.default_rng(1)
    p = rng.uniform(-1, 1, (count, 3)) * HALF
    axis = rng.integers(0, 3, count)
    sign = np.ones(count) if faces == "near" else np.sign(rng.normal(size=count))
    p[np.arange(count), axis] = sign * HALF[axis]
    p = (X_WO @ p.T).T
    return PointCloud(p + rng.normal(0, noise, p.shape) if noise else p)


def error(X: RigidTransform | None) -> tuple[float, float]:
    assert X is not None
    off = X_WO.inverse() @ X
    return off.rotation().ToAngleAxis().angle(), float(np.linalg.norm(off.translation()))


GUESS = X_WO @ RigidTransform(AngleAxis(0.25, [0.0, 0.6, 0.8]), [0.008, -0.004, 0.005])


@pytest.mark.parametrize("loss", [RobustLoss.LEAST_SQUARES, RobustLoss.HUBER])
def test_agrees_with_refinement(loss: RobustLoss) -> None:
    scene = box_scene(noise=0.001)
    found = estimate_pose_nonlinear(scene, FIELD, GUESS, loss)
    assert found.succeeded, found.message
    refined = refine_pose(scene, FIELD, GUESS, RefineConfig(loss=loss, tolerance=1e-7))
    assert found.X_WO is not None
    assert refined.X_WO is not None
    np.testing.assert_allclose(found.X_WO.GetAsMatrix4(), refined.X_WO.GetAsMatrix4(), atol=3e-4)
    assert found.covariance is not None
    assert error(found.X_WO)[1] < 3e-4


def test_a_loss_of_ones_own() -> None:
    # A smooth absolute value: its minimum is where the median residual is zero, outliers or not.
    def absolute(d: Array) -> tuple[Array, Array]:
        root = np.sqrt(d * d + 1e-8)
        return 1e-3 * root, 1e-3 * d / root

    scene = box_scene()
    wrong = np.random.default_rng(0).uniform(0.03, 0.06, (100, 3))
    scene = PointCloud(np.concatenate([scene.points, (X_WO @ wrong.T).T]))
    found = estimate_pose_nonlinear(scene, FIELD, GUESS, absolute)
    turn, step = error(found.X_WO)
    assert turn < 0.01
    assert step < 5e-4
    np.testing.assert_array_equal(found.inliers[:600], True)


def test_a_loss_that_punishes_one_side_alone() -> None:
    # Points of the near faces, pressed from within: penetration costs a hundredfold.
    def one_sided(d: Array) -> tuple[Array, Array]:
        weight = np.where(d < 0, 100.0, 1.0)
        return weight * d * d, 2 * weight * d

    scene = box_scene(faces="near", noise=0.002)
    even = estimate_pose_nonlinear(scene, FIELD, GUESS, RobustLoss.LEAST_SQUARES)
    found = estimate_pose_nonlinear(scene, FIELD, GUESS, one_sided, inlier_distance=0.02)
    depth = []
    for X in (even.X_WO, found.X_WO):
        assert X is not None
        d = box_distance((X.inverse() @ scene.points.T).T)
        depth.append(-np.minimum(d, 0).mean())
    assert depth[1] < 0.6 * depth[0]


def test_constraints() -> None:
    # The object's lowest corner must not be below a height; the data alone would put it there.
    corners = np.array(np.meshgrid(*[(-h, h) for h in HALF])).reshape(3, -1)
    floor = float((X_WO @ corners)[2].min()) + 0.004

    def above_floor(X: RigidTransform) -> Array:
        return (X @ corners)[2] - floor

    scene = box_scene(faces="near")
    free = estimate_pose_nonlinear(scene, FIELD, GUESS, RobustLoss.LEAST_SQUARES)
    assert free.X_WO is not None
    assert above_floor(free.X_WO).min() < -0.003
    held = estimate_pose_nonlinear(
        scene, FIELD, GUESS, RobustLoss.LEAST_SQUARES, [above_floor], inlier_distance=0.01
    )
    assert held.succeeded, held.message
    assert held.X_WO is not None
    assert above_floor(held.X_WO).min() > -1e-6
    assert held.residual > free.residual
    impossible = [above_floor, lambda X: np.array([floor - 0.01 - (X @ corners)[2].min()])]
    lost = estimate_pose_nonlinear(scene, FIELD, GUESS, constraints=impossible, max_iterations=20)
    assert lost.status is RegistrationStatus.INFEASIBLE


def test_bad_input() -> None:
    scene = box_scene(20)
    with pytest.raises(ValueError, match="^scale:"):
        estimate_pose_nonlinear(scene, FIELD, GUESS, scale=0)
    with pytest.raises(ValueError, match="^tolerance:"):
        estimate_pose_nonlinear(scene, FIELD, GUESS, tolerance=np.nan)
    few = estimate_pose_nonlinear(PointCloud(np.zeros((2, 3))), FIELD, GUESS)
    assert few.status is RegistrationStatus.DEGENERATE
    far = PointCloud(scene.points + 5)
    assert not estimate_pose_nonlinear(far, FIELD, GUESS, RobustLoss.TRUNCATED).succeeded
