"""What the housings of all arms are made with: shells cut off at the joints, and rings there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from prehensile.models.shapes import Material, Mesh, Part, cylinder
from prehensile.models.shapes.implicit import Field, drum, polygonize, split, union

GAP = 0.0016
"""Half of what is between two links, m."""

FADE = 0.02
"""Width of the zone at a joint in which fillets fade out, m."""

DARK = Material("dark", (0.03, 0.031, 0.034, 1.0), metallic=0.0, roughness=0.6)

Plane = tuple[int, float, float]
"""Axis 0 to 2, a place on it in m, and the sign of the side that is kept."""


def shell(body: Field, low: ArrayLike, high: ArrayLike, step: float) -> Mesh:
    """The surface of a body in a box; the box is widened for the body to lie inside it."""
    margin = 2.0 * step
    return polygonize(body, np.asarray(low) - margin, np.asarray(high) + margin, step)


def joined(*fields: Field, blend: float, ends: Sequence[tuple[ArrayLike, ArrayLike]] = ()) -> Field:
    """The union of fields with fillets, which fade out towards the joints.

    A fillet beside a joint would make the drum there wider than that of the next link.

    Args:
        fields: the drums and tubes of a link.
        blend: width of the fillets, m.
        ends: for each joint a point of its plane and the unit vector from there into the link.
    """
    smooth, sharp = union(*fields, blend=blend), union(*fields, blend=0.0)
    planes = [(np.asarray(at, float), np.asarray(inwards, float)) for at, inwards in ends]

    def field(p: np.ndarray) -> np.ndarray:
        weight = np.ones(p.shape[:-1])
        for at, inwards in planes:
            t = np.clip((p - at) @ inwards / FADE, 0.0, 1.0)
            weight = weight * t * t * (3.0 - 2.0 * t)
        plain = sharp(p)
        return plain + weight * (smooth(p) - plain)

    return field


def kept(mesh: Mesh, body: Field, *planes: Plane) -> Mesh:
    """What of the surface of a body lies on the kept sides of planes."""
    for plane in planes:
        mesh = divided(mesh, body, plane)[0]
    return mesh


def divided(mesh: Mesh, body: Field, plane: Plane) -> tuple[Mesh, Mesh]:
    """The surface of a body on the kept side of a plane, and the rest of it.

    Raises:
        ValueError: one of the two is empty.
    """
    axis, place, sign = plane
    inner, outer = split(mesh, lambda p: sign * (place - p[..., axis]), body)
    if inner is None or outer is None:
        raise ValueError("plane: it does not cut the housing")
    return inner, outer


def parted(
    mesh: Mesh, body: Field, start: ArrayLike, end: ArrayLike, radius: float
) -> tuple[Mesh, Mesh]:
    """The surface of a body inside and outside a cylinder between two points.

    Raises:
        ValueError: one of the two is empty.
    """
    inner, outer = split(mesh, drum(start, end, radius, 0.0), body)
    if inner is None or outer is None:
        raise ValueError("radius: the cylinder does not cut the housing")
    return inner, outer


def without(mesh: Mesh, body: Field, start: ArrayLike, end: ArrayLike, radius: float) -> Mesh:
    """What of the surface of a body lies outside a cylinder, where the next link turns."""
    return parted(mesh, body, start, end, radius + 0.0005)[1]


def disc(radius: float, start: ArrayLike, end: ArrayLike, rounding: float = 0.0) -> Mesh:
    """A cylinder between two points of a link, its rims rounded."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.9 else [0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    return cylinder(radius, length, rounding=rounding).transformed(R, 0.5 * (a + b))


def ring(radius: float, at: ArrayLike, axis: int) -> Part:
    """The dark ring in the gap at a joint."""
    half = 0.006 * np.eye(3)[axis]
    return Part(disc(radius - 0.0015, np.asarray(at) - half, np.asarray(at) + half), DARK)
