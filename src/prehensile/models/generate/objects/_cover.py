"""Covers collision geometry by few spheres, for planners."""

from collections.abc import Sequence

import numpy as np

from prehensile.models.generate.sdf_model import Collision

_SAMPLES = 1500  # points, roughly, by which the volume is known
_STICK_OUT = (0.005, 0.014)  # m, how far a sphere may reach out of the geometry
_LOOK_OUT = 0.0025  # m, how far the geometry may reach out of the spheres


def cover(collisions: Sequence[Collision]) -> np.ndarray:
    """Spheres (K, 4), rows x, y, z, radius, whose union contains the geometry but for 2.5 mm.

    Greedy set cover: candidates are sample points of the geometry, each with the radius that
    sticks out by what is allowed (a quarter of the thickness, 5 to 14 mm).
    """
    placed = [(_placement(c), c) for c in collisions]
    corners = np.concatenate([_samples(c, 1.0) @ R.T + p for (R, p), c in placed])
    extent = np.ptp(corners, axis=0)
    stick_out = float(np.clip(0.25 * extent.min(), *_STICK_OUT))
    spacing = float(np.prod(extent) / _SAMPLES) ** (1.0 / 3.0)
    points = np.concatenate([_samples(c, spacing) @ R.T + p for (R, p), c in placed])
    # Rounded off their ties, so that every machine chooses the same spheres.
    radii = np.round(stick_out - signed_distance(collisions, points) + 1e-9, 5)
    # The space between the samples must be covered too; a corner may look out a little.
    reach = radii - 0.3 * spacing + _LOOK_OUT
    norms = (points**2).sum(axis=1)
    squares = norms[:, None] + norms - 2.0 * points @ points.T
    covers = squares <= np.maximum(reach, 1e-4)[:, None] ** 2 + 1e-10
    gains = covers.sum(axis=1)
    chosen = []
    open_points = np.ones(len(points), dtype=bool)
    while open_points.any():
        best = int(np.argmax(gains))
        chosen.append(best)
        newly = covers[best] & open_points
        gains -= covers[:, newly].sum(axis=1)
        open_points &= ~newly
    return np.column_stack([points[chosen], radii[chosen]])


def _samples(collision: Collision, spacing: float) -> np.ndarray:
    """Points (N, 3) in and on a shape, in its own frame, about ``spacing`` m apart."""

    def steps(length: float) -> int:
        return max(1, round(length / spacing + 1e-6))

    kind, size = collision.shape.kind, collision.shape.size
    if kind == "box":
        axes = [np.linspace(-s / 2.0, s / 2.0, steps(s) + 1) for s in size]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    # The others are bodies of revolution about z.
    radius = size[0]
    straight = size[1] / 2.0 if len(size) > 1 else 0.0
    cap = 0.0 if kind == "cylinder" else radius
    points = []
    for z in np.linspace(-straight - cap, straight + cap, max(2, steps(2 * (straight + cap))) + 1):
        over = max(0.0, abs(z) - straight)
        wide = round(float(np.sqrt(max(0.0, radius**2 - over**2))), 6)  # 0 at the poles
        for r in np.linspace(0.0, wide, steps(wide) + 1):
            turn = np.linspace(0.0, 2.0 * np.pi, max(6, steps(2.0 * np.pi * r)), endpoint=False)
            ring = [r * np.cos(turn), r * np.sin(turn), np.full(len(turn), z)]
            points.append(np.column_stack(ring) if r > 0.0 else np.array([[0.0, 0.0, z]]))
    return np.concatenate(points)


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
