"""Closed plane outlines (n, 2), counter-clockwise, the first point not repeated."""

import numpy as np
from numpy.typing import ArrayLike

from prehensile.errors import InputError
from prehensile.models.shapes import checks


def circle(radius: float, segments: int = 48) -> np.ndarray:
    """(segments, 2) points on a circle, the first at angle -pi."""
    return superellipse(radius, radius, 2.0, segments)


def superellipse(a: float, b: float, exponent: float = 2.0, segments: int = 48) -> np.ndarray:
    """(segments, 2) points on |x/a|^e + |y/b|^e = 1, the first at angle -pi.

    Exponent 2 is an ellipse; 4 looks like a squashed bottle; towards 20 a rectangle.
    """
    checks.positive("a", a)
    checks.positive("b", b)
    checks.in_range("exponent", exponent, 0.5, 40.0)
    checks.segments("segments", segments)
    angle = np.linspace(-np.pi, np.pi, segments, endpoint=False)
    x, y = np.cos(angle), np.sin(angle)
    radius = (np.abs(x) ** exponent + np.abs(y) ** exponent) ** (-1.0 / exponent)
    return np.column_stack([a * radius * x, b * radius * y])


def rounded_rectangle(
    width: float, height: float, radius: float, corner_segments: int = 8
) -> np.ndarray:
    """Rectangle ``width`` (x) by ``height`` (y) about the origin with rounded corners.

    Returns:
        (4 * (corner_segments + 1), 2) points, or (4, 2) for radius 0.
    """
    checks.positive("width", width)
    checks.positive("height", height)
    checks.in_range("radius", radius, 0.0, 0.5 * min(width, height))
    checks.segments("corner_segments", corner_segments, 1, 128)
    half = np.array([width, height]) / 2.0
    quarters = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
    if radius == 0.0:
        return quarters * half
    points = []
    for k, corner in enumerate(quarters):
        start = np.pi + k * np.pi / 2.0
        angle = np.linspace(start, start + np.pi / 2.0, corner_segments + 1)
        arc = np.column_stack([np.cos(angle), np.sin(angle)])
        points.append(corner * (half - radius) + radius * arc)
    outline = np.concatenate(points)
    # With full rounding two arcs meet in one point: keep it once.
    step = np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1)
    return outline[step > 1e-12]


def offset(outline: ArrayLike, distance: float) -> np.ndarray:
    """The outline moved along its outward normals (mitred); negative moves inwards."""
    points = checks.array("outline", outline, 2, 3)
    edge = np.roll(points, -1, axis=0) - points
    length = np.linalg.norm(edge, axis=1, keepdims=True)
    if not length.all():
        raise InputError("outline repeats a point")
    out = np.column_stack([edge[:, 1], -edge[:, 0]]) / length  # right of a ccw edge
    before = np.roll(out, 1, axis=0)
    mitre = out + before
    scale = np.maximum(1.0 + np.einsum("ij,ij->i", out, before), 0.2)  # limits sharp spikes
    return points + distance * mitre / scale[:, None]


def signed_area(outline: np.ndarray) -> float:
    """Area of a closed outline (n, 2), positive when counter-clockwise."""
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def triangulate(outline: ArrayLike) -> np.ndarray:
    """(n - 2, 3) counter-clockwise triangles of a simple outline, by ear clipping.

    Raises:
        InputError: the outline is clockwise or crosses itself.
    """
    points = checks.array("outline", outline, 2, 3)
    if signed_area(points) <= 0.0:
        raise InputError("outline is not counter-clockwise")
    left = list(range(len(points)))
    triangles = []
    while len(left) > 3:
        ear = _find_ear(points, left)
        if ear is None:
            raise InputError("outline crosses itself")
        triangles.append([left[ear - 1], left[ear], left[(ear + 1) % len(left)]])
        del left[ear]
    triangles.append(left)
    return np.array(triangles, dtype=np.int64)


def _find_ear(points: np.ndarray, left: list[int]) -> int | None:
    """Position in ``left`` of the best-shaped ear, or None."""
    ring = points[left]
    a, c = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)

    def turn(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        u, v = q - p, r - p
        return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    height = turn(a, ring, c)
    span = np.linalg.norm(c - a, axis=1) ** 2
    # Short diagonals first: a fan of slivers shades and collides badly. Rounded, so that the
    # choice among equals does not hang on the last digit.
    span = np.round(span / max(span.max(), 1e-300), 9)
    for k in np.argsort(np.where(height > 0.0, span, np.inf), kind="stable"):
        if height[k] <= 0.0:
            break
        inside = (
            (turn(a[k], ring[k], ring) >= 0.0)
            & (turn(ring[k], c[k], ring) >= 0.0)
            & (turn(c[k], a[k], ring) >= 0.0)
        )
        inside[[k - 1, k, (k + 1) % len(left)]] = False
        if not inside.any():
            return int(k)
    # Only collinear points are left on some side: clip one of them.
    flat = np.flatnonzero(np.abs(height) <= 1e-14)
    return int(flat[0]) if len(flat) else None
