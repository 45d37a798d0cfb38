"""Covers collision geometry by few spheres, for planners."""

from collections.abc import Sequence

import numpy as np

from prehensile.models.generate.sdf_model import Collision

_SAMPLES = 3000  # points by which the volume is known
_STICK_OUT = (0.005, 0.012)  # m, how far a sphere may reach out of the geometry


def cover(collisions: Sequence[Collision]) -> np.ndarray:
    """Spheres (K, 4), rows x, y, z, radius, whose union contains the collision geometry.

    Greedy set cover: candidates are the points of a lattice in the geometry, each with the radius
    that sticks out by what is allowed (a quarter of the thickness, 5 to 12 mm).
    """
    lower, upper = _bounds(collisions)
    extent = upper - lower
    stick_out = float(np.clip(0.25 * extent.min(), *_STICK_OUT))
    spacing = (np.prod(extent) / _SAMPLES) ** (1.0 / 3.0)
    axes = [
        np.linspace(lo, hi, max(5, round((hi - lo) / spacing) + 1))
        for lo, hi in zip(lower, upper, strict=True)
    ]
    lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    depth = -signed_distance(collisions, lattice)
    points, depth = lattice[depth >= -1e-9], depth[depth >= -1e-9]
    radii = np.round(depth + stick_out, 5)
    # Space between the points of the lattice must be covered too.
    reach = radii - 0.3 * max(axis[1] - axis[0] for axis in axes)
    norms = (points**2).sum(axis=1)
    squares = norms[:, None] + norms - 2.0 * points @ points.T
    covers = squares <= np.maximum(reach, 1e-4)[:, None] ** 2
    chosen = []
    open_points = np.ones(len(points), dtype=bool)
    while open_points.any():
        best = int(np.argmax(covers @ open_points.astype(np.float32)))
        chosen.append(best)
        open_points &= ~covers[best]
    return np.column_stack([points[chosen], radii[chosen]])


def signed_distance(collisions: Sequence[Collision], points: np.ndarray) -> np.ndarray:
    """(N,) distance of points (N, 3) to the union of the shapes, negative inside.

    Inside it is the depth in the shape where that is greatest, which is a lower bound.
    """
    return np.min([_distance(c, points) for c in collisions], axis=0)


def _distance(collision: Collision, points: np.ndarray) -> np.ndarray:
    rotation, position = _placement(collision)
    local = (points - position) @ rotation
    kind, size = collision.shape.kind, collision.shape.size
    if kind == "sphere":
        return np.linalg.norm(local, axis=1) - size[0]
    if kind == "capsule":
        along = np.clip(local[:, 2], -size[1] / 2.0, size[1] / 2.0)
        local = local - np.column_stack([np.zeros((len(local), 2)), along])
        return np.linalg.norm(local, axis=1) - size[0]
    if kind == "box":
        outside = np.abs(local) - np.asarray(size) / 2.0
    else:  # cylinder
        radial = np.linalg.norm(local[:, :2], axis=1) - size[0]
        outside = np.column_stack([radial, np.abs(local[:, 2]) - size[1] / 2.0])
    far = np.linalg.norm(np.maximum(outside, 0.0), axis=1)
    return far + np.minimum(outside.max(axis=1), 0.0)


def _placement(collision: Collision) -> tuple[np.ndarray, np.ndarray]:
    """Rotation (3, 3) and position (3,) of the shape in its link."""
    x, y, z, roll, pitch, yaw = collision.pose
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return rotation, np.array([x, y, z])


def _bounds(collisions: Sequence[Collision]) -> tuple[np.ndarray, np.ndarray]:
    """Corners of a box that contains all shapes."""
    lows, highs = [], []
    for collision in collisions:
        rotation, position = _placement(collision)
        kind, size = collision.shape.kind, collision.shape.size
        if kind == "box":
            half = np.abs(rotation) @ (np.asarray(size) / 2.0)
        elif kind == "sphere":
            half = np.full(3, size[0])
        else:
            axis = np.abs(rotation[:, 2])
            if kind == "capsule":
                half = size[0] + axis * size[1] / 2.0
            else:
                half = size[0] * np.sqrt(np.maximum(1.0 - axis**2, 0.0)) + axis * size[1] / 2.0
        lows.append(position - half)
        highs.append(position + half)
    return np.min(lows, axis=0), np.max(highs, axis=0)
