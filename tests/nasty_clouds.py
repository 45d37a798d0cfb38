"""A box to be found, and what a new user may give instead of a cloud of it."""

import functools
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.models.shapes import primitives
from prehensile.perception import (
    Body,
    Box,
    CameraModel,
    DepthView,
    PointCloud,
    PosedCamera,
    TriangleMesh,
    estimate_normals,
)
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.registration import (
    KnownObject,
)

NAN, INF = float("nan"), float("inf")
X_GUESS = RigidTransform(RollPitchYaw(0.05, -0.03, 0.04), [0.003, -0.002, 0.004])
X_NAN = RigidTransform([NAN, 0, 0])
SIZE = np.array([0.1, 0.06, 0.04])


def box_cloud(count: int = 200, seed: int = 0) -> PointCloud:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    axis, side = rng.integers(0, 3, count), rng.choice([-0.5, 0.5], count)
    normals = np.zeros((count, 3))
    rows = np.arange(count)
    points[rows, axis] = side
    normals[rows, axis] = 2 * side
    return PointCloud(points * SIZE, normals, sensor_origins=np.array([0, 0, 1.0]))


@functools.cache
def box_mesh() -> TriangleMesh:
    solid = primitives.box(SIZE)
    return TriangleMesh(solid.vertices, solid.faces)


@functools.cache
def box_field() -> DistanceField:
    return DistanceField.from_mesh(box_mesh(), 0.004)


@functools.cache
def box_body() -> Body:
    return Body.from_mesh(box_mesh(), box_field(), num_samples=100)


@functools.cache
def known_box() -> KnownObject:
    return KnownObject.from_cloud(box_cloud(1500), num_points=120, field_spacing=0.004)


CLOUD, MODEL = box_cloud(), box_cloud(seed=1)
POINTS = CLOUD.points
CAMERA = CameraModel(32, 24, 30.0, 30.0, 15.5, 11.5)
POSED = PosedCamera(CAMERA, RigidTransform())
DEPTH = np.full((24, 32), 0.5, dtype=np.float32)
VIEW = DepthView(DEPTH, POSED)
REGION = Box(RigidTransform([0, 0, 0.5]), np.array([0.3, 0.3, 0.2]))


def unusable_arrays(columns: int = 3) -> dict[str, Any]:
    """What is no (N, columns) array of places."""
    good = POINTS[:, :columns]
    spoiled = {}
    for name, value in (("nan", NAN), ("inf", INF), ("1e300", 1e300)):
        spoiled[name] = good.copy()
        spoiled[name][7, 1] = value
    return spoiled | {
        "all nan": np.full_like(good, NAN),
        "a column too many": np.zeros((9, 4)),
        "one column": good[:, 0],
        "a single row": good[0],
        "too many axes": good[None],
    }


def nasty_points() -> dict[str, np.ndarray]:
    """Places that are allowed, but of which little can be said."""
    far = POINTS.copy()
    far[3] = 1e9
    return {
        "none": POINTS[:0],
        "one": POINTS[:1],
        "two": POINTS[:2],
        "coincident": np.tile(POINTS[:1], (50, 1)),
        "on a line": np.linspace(0, 0.2, 50)[:, None] * [0.6, 0.0, 0.8],
        "flat": POINTS * [1, 1, 0],
        "one far off": far,
        "all far off": POINTS + 1e9,
        "tiny": POINTS * 1e-160,
    }


def cloud_of(points: np.ndarray) -> PointCloud:
    """With normals that the points tell, all seen from above."""
    cloud = PointCloud(points, sensor_origins=np.array([0, 0, 5.0]))
    return estimate_normals(cloud, neighbors=12)
