"""Whether a scene bears a pose out: what should be seen, what is seen, what cannot be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud
from prehensile.perception.free_space import DepthView, free_space_violation
from prehensile.perception.registration.known_object import KnownObject


@dataclass(frozen=True)
class EvidenceConfig:
    """What counts as evidence.

    Attributes:
        voxel_fraction: the scene is thinned to voxels of this part of the object's diameter, in
            (0, 0.2].
        tolerance: how far a point of the object may lie off its surface [m], > 0: some 1.5 times
            the noise of the camera.
        max_normal_angle: how far a normal of the object, averaged over a voxel, may be off [rad].
    """

    voxel_fraction: float = 0.04
    tolerance: float = 0.002
    max_normal_angle: float = 0.45


@dataclass(frozen=True)
class Evidence:
    """How well a scene bears a pose out.

    Attributes:
        coverage: part of the object's surface in sight of a sensor that the scene shows.
        agreement: part of the scene's points near the object that lie on its surface.
        violation: part of the object's points that lie where a depth image shows nothing.
    """

    coverage: float
    agreement: float
    violation: float

    @property
    def score(self) -> float:
        """All in one number, 0 to 1."""
        return self.coverage * self.agreement * (1 - self.violation)


def weigh(
    scene: PointCloud,
    thinned: PointCloud,
    model: KnownObject,
    X_WO: NDArray[np.float64],
    views: Sequence[DepthView],
    config: EvidenceConfig,
) -> Evidence:
    """What a scene says about a pose.

    Args:
        scene: points in W.
        thinned: the scene by one point with a normal per voxel.
        model: the object.
        X_WO: (4, 4) its pose.
        views: depth images of the scene; may be none.
        config: see there.
    """
    distances = np.abs(model.field.at(in_object(scene.points, X_WO)).distances)
    near = distances < 0.1 * model.diameter
    agreement = float((distances < config.tolerance).sum() / max(int(near.sum()), 1))

    voxel = config.voxel_fraction * model.diameter
    p_OS = in_object(thinned.points, X_WO)
    n_OS = thinned.require_normals() @ X_WO[:3, :3]
    points, normals = model.cloud.points, model.cloud.require_normals()
    expected = np.zeros(len(points), dtype=bool)
    for p_OE in in_object(_sensors(scene, thinned, model), X_WO):
        expected |= _in_sight(points, normals, p_OS, p_OE, voxel)
    points, normals = points[expected], normals[expected]
    rows, gap = _nearest(p_OS, points)
    offset = np.abs(np.einsum("ij,ij->i", p_OS[rows] - points, normals))
    seen = (
        (gap < 1.1 * voxel)
        & (offset < 1.5 * config.tolerance)
        & (np.einsum("ij,ij->i", n_OS[rows], normals) > np.cos(config.max_normal_angle))
    )
    coverage = float(seen.sum() / max(len(points), 1))
    return Evidence(coverage, agreement, violation(model, X_WO, views, config))


def violation(
    model: KnownObject,
    X_WO: NDArray[np.float64],
    views: Sequence[DepthView],
    config: EvidenceConfig,
) -> float:
    """Part of the object's points that lie where a camera saw nothing; 0 without views."""
    if not views:
        return 0.0
    p_W = model.cloud.points @ X_WO[:3, :3].T + X_WO[:3, 3]
    return float(np.mean(free_space_violation(p_W, views, margin=5 * config.tolerance) > 0))


def in_object(points: NDArray[np.float64], X_WO: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (N, 3) of W expressed in O."""
    return (points - X_WO[:3, 3]) @ X_WO[:3, :3]


def _sensors(scene: PointCloud, thinned: PointCloud, model: KnownObject) -> NDArray[np.float64]:
    """Where the sensors are, (S, 3) in W; far off in the direction of the normals, if not known."""
    if scene.sensor_origins is not None:
        return np.unique(scene.sensor_origins[:: max(1, len(scene) // 64)], axis=0)
    direction = thinned.require_normals().mean(axis=0)
    direction /= max(float(np.linalg.norm(direction)), 1e-12)
    return (thinned.points.mean(axis=0) + 100 * model.diameter * direction)[None]


def _in_sight(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    others: NDArray[np.float64],
    eye: NDArray[np.float64],
    voxel: float,
) -> NDArray[np.bool_]:
    """Which points look towards an eye and have no other point well before them."""
    sight, others_sight = points - eye, others - eye
    range_ = np.linalg.norm(sight, axis=1)
    others_range = np.linalg.norm(others_sight, axis=1)
    facing = -np.einsum("ij,ij->i", sight, normals) > 0.3 * range_
    rows, angle = _nearest(others_sight / others_range[:, None], sight / range_[:, None])
    hidden = (angle * range_ < voxel) & (others_range[rows] < range_ - voxel)
    return facing & ~hidden


def _nearest(
    points: NDArray[np.float64], queries: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    rows, distances = _core.KdTree(points).nearest(queries, 1, np.inf, 1)
    return rows[:, 0], distances[:, 0]
