"""Collision geometry of the objects: few shapes, cheap, and still at rest.

The hulls (boxes, cylinders, capsules) are rigid hydroelastic, for the grip of compliant fingers.
Between two rigid bodies Drake falls back to point contact, and that has one point for each pair of
shapes: a box on a table would stand on one point that jumps. So the objects stand on small balls
at their corners and rims. The hulls are drawn in a little behind the surface of the balls, so that
on a plane the balls carry alone.

A round can lies on its balls like a prism, which keeps it from rolling about for ever: Drake has
no rolling friction. Its hull is drawn in to that prism.
"""

import numpy as np
from numpy.typing import ArrayLike

from prehensile.models.generate.sdf_model import Collision, Contact, Shape

BALL = 0.001  # m, radius of the balls at corners and rims
INSET = 0.0003  # m, from the surface of the balls to that of the hulls
FRICTION = 0.6
STIFFNESS = 3e4  # N/m: 0.1 mm under 3 N; stiffer piles cost the solver more and shiver


def hull(
    name: str,
    kind: str,
    size: ArrayLike,
    pose: ArrayLike = (),
    *,
    mu: float = FRICTION,
    resolution: float = 0.01,
) -> Collision:
    """A rigid shape.

    Args:
        name: of the collision geometry.
        kind: as `sdf_model.Shape` has it.
        size: as `sdf_model.Shape` has it, m.
        pose: x, y, z, roll, pitch, yaw in the link; it may stop early, the rest being zero.
        mu: coefficient of friction.
        resolution: edge length of the hydroelastic mesh of a curved shape, m.
    """
    full = np.zeros(6)
    given = np.asarray(pose, dtype=float)
    full[: len(given)] = given
    x, y, z, roll, pitch, yaw = full
    contact = Contact(
        mu=mu,
        hydroelastic="rigid",
        resolution=resolution,
        relaxation_time=0.02,
        stiffness=STIFFNESS,
    )
    shape = Shape(kind, tuple(float(v) for v in np.asarray(size)))
    return Collision(name, shape, (x, y, z, roll, pitch, yaw), contact)


def balls(points: ArrayLike, *, start: int = 0, mu: float = FRICTION) -> list[Collision]:
    """Balls with their centres at the points (N, 3), numbered from ``start``."""
    return [
        hull(f"ball_{start + k}", "sphere", [BALL], point, mu=mu, resolution=BALL)
        for k, point in enumerate(np.asarray(points, dtype=float).reshape(-1, 3))
    ]


def box_collisions(size: ArrayLike, *, mu: float = FRICTION) -> list[Collision]:
    """A box about the origin on eight balls."""
    extents = np.asarray(size, dtype=float)
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return [
        hull("hull", "box", extents - 2.0 * INSET, mu=mu),
        *balls(signs * (extents / 2.0 - BALL), mu=mu),
    ]


def ring(radius: float, count: int, z: float, phase: float = 0.0) -> np.ndarray:
    """(count, 3) centres of balls whose surfaces touch the circle of the given radius.

    ``z`` is the height of the plane that the balls touch with their far side from z = 0.
    """
    angle = phase + 2.0 * np.pi * np.arange(count) / count
    level = z - np.sign(z) * BALL
    return np.column_stack(
        [
            (radius - BALL) * np.cos(angle),
            (radius - BALL) * np.sin(angle),
            np.full(count, level),
        ]
    )


def prism(radius: float, count: int) -> tuple[float, float]:
    """Corner and flat radius of a prism with ``count`` sides that stands for a round wall.

    The wall lies midway, so that neither is off by more than half of their difference.
    """
    half = 0.5 * radius * (1.0 - np.cos(np.pi / count))
    corner = radius + half
    return corner, (corner - BALL) * np.cos(np.pi / count) + BALL


def can_collisions(radius: float, height: float, count: int = 12) -> list[Collision]:
    """An upright can about the origin on two rings of ``count`` balls."""
    corner, flat = prism(radius, count)
    return [
        hull("hull", "cylinder", [flat - INSET, height - 2.0 * INSET]),
        *balls(ring(corner, count, -0.5 * height)),
        *balls(ring(corner, count, 0.5 * height), start=count),
    ]


def octagon(a: float, b: float, flat_a: float, flat_b: float, z: float) -> np.ndarray:
    """(8, 3) centres of balls at the corners of an octagon with sides along x and y.

    Args:
        a: half extent along x, outside of the balls.
        b: half extent along y.
        flat_a: half length of the two sides that run along x.
        flat_b: half length of the two sides that run along y.
        z: height of the plane that the balls touch with their far side from z = 0.
    """
    inner = [
        (sx * (u - BALL), sy * (w - BALL), z - np.sign(z) * BALL)
        for u, w in ((a, flat_b), (flat_a, b))
        for sx in (-1.0, 1.0)
        for sy in (-1.0, 1.0)
    ]
    return np.array(inner)
