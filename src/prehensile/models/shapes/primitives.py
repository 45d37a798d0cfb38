"""Boxes, cylinders, spheres and capsules."""

import itertools

import numpy as np
from numpy.typing import ArrayLike

from prehensile.errors import Finding, InputError
from prehensile.models.shapes import checks
from prehensile.models.shapes.mesh import Mesh, merge
from prehensile.models.shapes.surfaces import lathe

# Each face of a box: the axes of its picture (to the right, upwards) as seen from outside.
_BOX_FACES = {
    "+x": ((0, 1, 0), (0, 0, 1)),
    "+y": ((-1, 0, 0), (0, 0, 1)),
    "-x": ((0, -1, 0), (0, 0, 1)),
    "-y": ((1, 0, 0), (0, 0, 1)),
    "+z": ((0, 1, 0), (-1, 0, 0)),
    "-z": ((0, 1, 0), (1, 0, 0)),
}


def box_atlas(size: ArrayLike) -> tuple[tuple[float, float], dict[str, tuple[float, ...]]]:
    """Where each face of a box lies on one flat picture, to scale.

    The four sides stand in the upper row, top and bottom in the lower one.

    Args:
        size: (3,) of the box, m.

    Returns:
        Width and height of the picture in m, and for each face ("+x", "-x", ... "-z") its
        rectangle (u0, v0, u1, v1), v upwards, in fractions of the picture.
    """
    x, y, z = checks.vector("size", size, 3)
    rects, right = {}, 0.0
    for name, width in (("+x", y), ("+y", x), ("-x", y), ("-y", x)):
        rects[name] = (right, x, right + width, x + z)
        right += width
    rects["+z"] = (0.0, 0.0, y, x)
    rects["-z"] = (y, 0.0, 2.0 * y, x)
    width, height = right, x + z
    return (width, height), {
        name: (u0 / width, v0 / height, u1 / width, v1 / height)
        for name, (u0, v0, u1, v1) in rects.items()
    }


def box(size: ArrayLike) -> Mesh:
    """A box of the given size (3,) about the origin, textured as in ``box_atlas``."""
    return rounded_box(size, 0.0)


def rounded_box(size: ArrayLike, radius: float, segments: int = 4) -> Mesh:
    """A box about the origin with rounded edges and corners, textured as in ``box_atlas``.

    Args:
        size: (3,) outer extents, m.
        radius: m, of the edges; 0 to half the smallest extent.
        segments: even number of faces across a quarter-round edge, 2 to 64.
    """
    extents = checks.vector("size", size, 3)
    for extent in extents:
        checks.positive("size", extent)
    checks.in_range("radius", radius, 0.0, 0.5 * extents.min())
    checks.segments("segments", segments, 2, 64)
    if segments % 2:
        raise InputError(Finding(f"segments is {segments}", "give an even number", key="segments"))
    rects = box_atlas(extents)[1]
    half = extents / 2.0
    # Along one axis of a face: the slope of the normal, and the end of the flat part it is at.
    slope = np.tan(np.linspace(-np.pi / 4, 0.0, segments // 2 + 1)) if radius else np.zeros(1)
    slopes = np.r_[slope, -slope[::-1]]
    ends = np.repeat([-1.0, 1.0], len(slope))
    n = len(slopes)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * n + j)[:-1, :-1].reshape(-1)
    quads = np.stack(
        [np.column_stack([a, a + n, a + n + 1]), np.column_stack([a, a + n + 1, a + 1])]
    )
    faces = quads.reshape(-1, 3)

    parts = []
    for name, (right, up) in _BOX_FACES.items():
        s, t = np.array(right, float), np.array(up, float)
        out = np.cross(s, t)
        inner = half - radius
        flat = (
            out * (inner @ np.abs(out))
            + (ends[i.reshape(-1), None] * s) * (inner @ np.abs(s))
            + (ends[j.reshape(-1), None] * t) * (inner @ np.abs(t))
        )
        normals = out + slopes[i.reshape(-1), None] * s + slopes[j.reshape(-1), None] * t
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        vertices = flat + radius * normals
        u0, v0, u1, v1 = rects[name]
        extent_s, extent_t = extents @ np.abs(s), extents @ np.abs(t)
        u = u0 + (u1 - u0) * (vertices @ s / extent_s + 0.5)
        v = v0 + (v1 - v0) * (vertices @ t / extent_t + 0.5)
        # A wide rounding may make the flat part vanish; then its faces have no area.
        corners = vertices[faces]
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        parts.append(Mesh(vertices, faces[area > 1e-14], normals, np.column_stack([u, v])))
    return merge(parts)


def cylinder(radius: float, length: float, segments: int = 48, *, rounding: float = 0.0) -> Mesh:
    """A cylinder along z about the origin, its two rims rounded by ``rounding`` (m)."""
    checks.positive("radius", radius)
    checks.positive("length", length)
    checks.in_range("rounding", rounding, 0.0, min(radius, 0.5 * length))
    top = 0.5 * length
    if rounding == 0.0:
        side = [[radius, -top], [radius, top]]
    else:
        angle = np.linspace(0.0, np.pi / 2.0, 5)
        lower = np.column_stack(
            [radius - rounding + rounding * np.sin(angle), -top + rounding * (1 - np.cos(angle))]
        )
        side = [*lower, *(lower * [1.0, -1.0])[::-1]]
        if rounding == 0.5 * length:
            del side[len(lower)]
    profile = [[0.0, -top], *side, [0.0, top]]
    if rounding == radius:
        profile = profile[1:-1]
    return lathe(profile, segments)


def sphere(radius: float, segments: int = 48) -> Mesh:
    """A sphere about the origin; u is longitude, v latitude."""
    return capsule(radius, 0.0, segments)


def capsule(radius: float, length: float, segments: int = 48) -> Mesh:
    """A cylinder along z of the given length (0 or more) between two half spheres."""
    checks.positive("radius", radius)
    checks.in_range("length", length, 0.0, 1e3)
    checks.segments("segments", segments)
    angle = np.linspace(-np.pi / 2.0, 0.0, max(2, segments // 4) + 1)
    lower = np.column_stack([radius * np.cos(angle), radius * np.sin(angle) - 0.5 * length])
    lower[0, 0] = 0.0
    upper = (lower * [1.0, -1.0])[::-1]
    profile = np.concatenate([lower, upper if length > 0.0 else upper[1:]])
    return lathe(profile, segments, crease=np.pi)


def box_corners(size: ArrayLike) -> np.ndarray:
    """(8, 3) corners of a box of the given size (3,) about the origin."""
    half = checks.vector("size", size, 3) / 2.0
    return half * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
