"""Surfaces that follow an outline or a profile: lathe, loft, sweep, extrude."""

import numpy as np
from numpy.typing import ArrayLike

from prehensile.errors import Finding, InputError
from prehensile.models.shapes import checks
from prehensile.models.shapes.mesh import Mesh, merge, shade
from prehensile.models.shapes.outlines import offset, signed_area, triangulate

CREASE = np.radians(35.0)  # faces that meet at more than this keep a sharp edge


def lathe(
    profile: ArrayLike,
    segments: int = 48,
    *,
    crease: float = CREASE,
    start_angle: float = -np.pi,
) -> Mesh:
    """Revolves a profile about the z axis.

    The mesh is closed when the profile starts and ends on the axis. Texture: u goes once round,
    counter-clockwise seen from above, with its middle facing +x; v follows the profile's length
    from its first point to its last.

    Args:
        profile: (m, 2) points (r, z) with r >= 0; from bottom to top along the outer side (inner
            sides follow from top to bottom), so that the surface looks outwards.
        segments: faces round the axis, 3 to 512.
        crease: rad, edges sharper than this stay sharp.
        start_angle: rad, angle about z of the texture's seam.
    """
    points = checks.array("profile", profile, 2, 2)
    checks.segments("segments", segments)
    checks.segments("profile points", len(points), 2, 4 * checks.MAX_SEGMENTS)
    if points[:, 0].min() < 0.0:
        raise InputError(Finding("profile has a negative radius", "give r >= 0", key="profile"))
    angle = start_angle + np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(segments)])
    rings = points[:, :1, None] * ring + points[:, 1:, None] * np.array([0.0, 0.0, 1.0])
    return skin(rings, v=_fractions(points), crease=crease)


def loft(
    outlines: ArrayLike,
    heights: ArrayLike,
    *,
    caps: bool = True,
    crease: float = CREASE,
) -> Mesh:
    """Joins outlines, one above the other, by a smooth skin.

    Args:
        outlines: (m, n, 2) counter-clockwise outlines with equal numbers of points.
        heights: (m,) z of each, not decreasing where the skin looks outwards.
        caps: whether the first and last outline are closed by plane faces. The texture of a cap
            is its outline's bounding box laid over the whole picture.
        crease: rad, edges sharper than this stay sharp.
    """
    sections = np.asarray(outlines, dtype=float)
    if sections.ndim != 3 or sections.shape[2] != 2:
        raise InputError(Finding(f"outlines has shape {sections.shape}", "give (m, n, 2)"))
    z = checks.vector("heights", heights, len(sections))
    rings = np.concatenate(
        [sections, np.broadcast_to(z[:, None, None], (*sections.shape[:2], 1))], axis=2
    )
    return skin(rings, caps=caps, crease=crease)


def sweep(
    path: ArrayLike,
    outline: ArrayLike,
    scale: ArrayLike = 1.0,
    *,
    up: ArrayLike = (0.0, 0.0, 1.0),
    caps: bool = True,
    crease: float = CREASE,
) -> Mesh:
    """Carries an outline along a curve, turning as little as possible.

    Args:
        path: (m, 3) points of the curve.
        outline: (n, 2) counter-clockwise section, or (m, n, 2) one for each point of the path.
            Its y axis starts along ``up``, its x axis along (tangent's normal) up x tangent.
        scale: size of the section along the path, a number or (m,).
        up: (3,) direction that the section's y axis should have at the start.
        caps: whether the ends are closed.
        crease: rad, edges sharper than this stay sharp.
    """
    curve = checks.array("path", path, 3, 2)
    sections = np.asarray(outline, dtype=float)
    sections = np.broadcast_to(sections, (len(curve), *sections.shape[-2:]))
    size = checks.vector("scale", np.broadcast_to(scale, len(curve)), len(curve))
    x_axes, y_axes = _minimal_turn_frames(curve, checks.vector("up", up, 3))
    rings = curve[:, None, :] + size[:, None, None] * (
        sections[:, :, :1] * x_axes[:, None, :] + sections[:, :, 1:] * y_axes[:, None, :]
    )
    return skin(rings, caps=caps, crease=crease)


def extrude(
    outline: ArrayLike, depth: float, *, bevel: float = 0.0, crease: float = CREASE
) -> Mesh:
    """A plate with the given outline between z = 0 and z = depth.

    Args:
        outline: (n, 2) counter-clockwise simple outline; it need not be convex.
        depth: m.
        bevel: m, width of the 45 degree chamfer on the two rims (0 for none).
        crease: rad, edges sharper than this stay sharp.
    """
    points = checks.array("outline", outline, 2, 3)
    checks.segments("outline points", len(points))
    checks.positive("depth", depth)
    if signed_area(points) <= 0.0:
        raise InputError(Finding("outline is not counter-clockwise", "reverse it", key="outline"))
    checks.in_range("bevel", bevel, 0.0, 0.499 * depth)
    if bevel == 0.0:
        return loft([points, points], [0.0, depth], crease=crease)
    inner = offset(points, -bevel)
    return loft([inner, points, points, inner], [0.0, bevel, depth - bevel, depth], crease=crease)


def skin(
    rings: ArrayLike,
    *,
    v: ArrayLike | None = None,
    caps: bool = False,
    crease: float = CREASE,
) -> Mesh:
    """Joins closed rings of points, in order, by triangles.

    The surface looks outwards when each ring is counter-clockwise seen from the next.

    Args:
        rings: (m, n, 3).
        v: (m,) texture coordinate of each ring; by default its way along the surface.
        caps: whether the first and last ring are closed by plane faces.
        crease: rad, edges sharper than this stay sharp.
    """
    points = np.asarray(rings, dtype=float)
    if points.ndim != 3 or points.shape[2] != 3 or not np.isfinite(points).all():
        raise InputError(Finding(f"rings has shape {points.shape} or NaN", "give finite (m, n, 3)"))
    m, n = points.shape[:2]
    checks.segments("rings", m, 2, 4 * checks.MAX_SEGMENTS)
    checks.segments("points of a ring", n)
    if v is None:
        # The mean over the columns, so that uneven rings stretch the picture least.
        columns = np.linalg.norm(np.diff(points, axis=0), axis=2).mean(axis=1)
        v = np.r_[0.0, np.cumsum(columns)] / max(columns.sum(), 1e-12)
    closed = np.concatenate([points, points[:, :1]], axis=1)  # the seam has two columns
    lengths = np.linalg.norm(np.diff(closed, axis=1), axis=2).sum(axis=0)
    u = np.r_[0.0, np.cumsum(lengths)] / max(lengths.sum(), 1e-12)
    uvs = np.stack(np.broadcast_arrays(u[None, :], np.asarray(v)[:, None]), axis=2)

    i, j = np.meshgrid(np.arange(m - 1), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).reshape(-1)
    b, c, d = a + 1, a + n + 2, a + n + 1
    faces = np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1)
    vertices, faces, texture = closed.reshape(-1, 3), faces.reshape(-1, 3), uvs.reshape(-1, 2)
    if not caps:
        return shade(vertices, faces, texture, crease)
    # Caps keep their own flat normals: they are shaded apart and merged.
    body = shade(vertices, faces, texture, crease)
    return merge([body, _cap(points[0][::-1]), _cap(points[-1])])


def _cap(ring: np.ndarray) -> Mesh:
    """A plane face that fills a ring (n, 3), counter-clockwise seen from where it looks."""
    middle = ring.mean(axis=0)
    normal = np.cross(ring - middle, np.roll(ring, -1, axis=0) - middle).sum(axis=0)
    length = np.linalg.norm(normal)
    if length < 1e-14:
        raise InputError(Finding("a cap has no area", "leave caps out or widen the last ring"))
    normal /= length
    side = np.array([0.0, 1.0, 0.0]) if abs(normal[2]) > 0.5 else np.array([0.0, 0.0, 1.0])
    x_axis = np.cross(side, normal)
    x_axis /= np.linalg.norm(x_axis)
    plane = (ring - middle) @ np.column_stack([x_axis, np.cross(normal, x_axis)])
    faces = triangulate(plane)
    extent = np.maximum(np.ptp(plane, axis=0), 1e-12)
    uvs = (plane - plane.min(axis=0)) / extent
    return Mesh(ring.copy(), faces, np.tile(normal, (len(ring), 1)), uvs)


def _fractions(points: np.ndarray) -> np.ndarray:
    """(m,) way along a polyline to each point, as a fraction of its length."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if steps.sum() == 0.0:
        raise InputError(Finding("profile has no length", key="profile"))
    return np.r_[0.0, np.cumsum(steps)] / steps.sum()


def _minimal_turn_frames(curve: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation-minimizing frames by double reflection (Wang et al., ACM ToG 2008).

    Returns:
        x and y axes (m, 3) of the section at each point, with x cross y along the tangent.
    """
    tangents = np.gradient(curve, axis=0)
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    if (lengths < 1e-12).any():
        raise InputError(Finding("path repeats a point", key="path"))
    tangents /= lengths
    y = up - tangents[0] * (up @ tangents[0])
    if np.linalg.norm(y) < 1e-6:
        raise InputError(Finding("up is parallel to the start of the path", key="up"))
    y_axes = [y / np.linalg.norm(y)]
    for k in range(len(curve) - 1):
        v1 = curve[k + 1] - curve[k]
        y = y_axes[k] - 2.0 / (v1 @ v1) * (v1 @ y_axes[k]) * v1
        t = tangents[k] - 2.0 / (v1 @ v1) * (v1 @ tangents[k]) * v1
        v2 = tangents[k + 1] - t
        square = v2 @ v2
        y = y - (2.0 / square * (v2 @ y) * v2 if square > 1e-24 else 0.0)
        y -= tangents[k + 1] * (y @ tangents[k + 1])
        y_axes.append(y / np.linalg.norm(y))
    return np.cross(y_axes, tangents), np.array(y_axes)
