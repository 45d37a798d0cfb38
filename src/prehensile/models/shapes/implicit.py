"""Smooth bodies from fields: functions that are negative inside and grow with distance.

A field takes points (..., 3) and gives values (...). Blended unions and cuts of a few simple
fields make the flowing housings of modern arms; `polygonize` turns a field into a mesh, `split`
cuts a mesh along the zero of a second function, for clean edges and for areas of another colour.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from prehensile.errors import Finding, InputError
from prehensile.models.shapes import checks
from prehensile.models.shapes.mesh import Mesh

Field = Callable[[np.ndarray], np.ndarray]

_MAX_CELLS = 4_000_000


def cone(start: ArrayLike, end: ArrayLike, start_radius: float, end_radius: float) -> Field:
    """A capsule whose radius changes evenly from one end to the other."""
    a, b = checks.vector("start", start, 3), checks.vector("end", end, 3)
    along = b - a
    length2 = checks.positive("length", float(along @ along))

    def field(p: np.ndarray) -> np.ndarray:
        t = np.clip((p - a) @ along / length2, 0.0, 1.0)
        away = np.linalg.norm(p - a - t[..., None] * along, axis=-1)
        return away - (start_radius + t * (end_radius - start_radius))

    return field


def drum(start: ArrayLike, end: ArrayLike, radius: float, rounding: float) -> Field:
    """A cylinder between two points, its rims rounded."""
    a, b = checks.vector("start", start, 3), checks.vector("end", end, 3)
    middle, half = 0.5 * (a + b), 0.5 * float(np.linalg.norm(b - a))
    axis = (b - a) / (2.0 * checks.positive("length", half))
    checks.in_range("rounding", rounding, 0.0, min(radius, half))

    def field(p: np.ndarray) -> np.ndarray:
        t = (p - middle) @ axis
        r = np.linalg.norm(p - middle - t[..., None] * axis, axis=-1)
        return _rounded(r - radius, np.abs(t) - half, rounding)

    return field


def slab(outline: Field, axis: int, low: float, high: float, rounding: float) -> Field:
    """What lies in an outline, a field that is constant along an axis, between two planes."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def field(p: np.ndarray) -> np.ndarray:
        return _rounded(outline(p), np.abs(p[..., axis] - middle) - half, rounding)

    return field


def rounded_block(low: ArrayLike, high: ArrayLike, rounding: float) -> Field:
    """A box between two corners, its edges rounded."""
    a, b = checks.vector("low", low, 3), checks.vector("high", high, 3)
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    checks.in_range("rounding", rounding, 0.0, float(half.min()))

    def field(p: np.ndarray) -> np.ndarray:
        q = np.abs(p - middle) - half + rounding
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=-1)
        return outside + np.minimum(q.max(axis=-1), 0.0) - rounding

    return field


def union(*fields: Field, blend: float) -> Field:
    """All of the fields; where two come together a fillet about ``blend`` wide joins them."""

    def field(p: np.ndarray) -> np.ndarray:
        result = fields[0](p)
        for other in fields[1:]:
            result = _smooth_min(result, other(p), blend)
        return result

    return field


def cut(body: Field, tool: Field, *, blend: float) -> Field:
    """The body without the tool; the new edge is rounded about ``blend`` wide."""
    return lambda p: -_smooth_min(-body(p), tool(p), blend)


def polygonize(field: Field, low: ArrayLike, high: ArrayLike, step: float) -> Mesh:
    """The surface where the field is zero, by surface nets drawn onto it.

    One vertex in each cell that the surface crosses (Gibson, "Constrained elastic surface nets",
    1998), moved by Newton's method onto the surface; normals are the field's gradients.

    Args:
        field: negative inside.
        low: (3,) lower corner of the box that is searched, m.
        high: (3,) upper corner; the surface must not leave the box.
        step: edge of a cell, m.

    Returns:
        The mesh, texture coordinates zero.
    """
    a, b = checks.vector("low", low, 3), checks.vector("high", high, 3)
    checks.positive("step", step)
    counts = np.ceil((b - a) / step).astype(int) + 1
    if counts.min() < 2 or counts.prod() > _MAX_CELLS:
        raise InputError(Finding("the grid is empty or too fine", "mend the box or the step"))
    axes = [low_i + step * np.arange(n) for low_i, n in zip(a, counts, strict=True)]
    values = field(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    inside = values < 0.0

    cells = tuple(counts - 1)
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]

    def corner(array: np.ndarray, c: tuple[int, ...]) -> np.ndarray:
        return array[tuple(slice(o, o + n) for o, n in zip(c, cells, strict=True))]

    total, crossings = np.zeros((*cells, 3)), np.zeros(cells)
    for c in corners:
        for axis in range(3):
            if c[axis]:
                continue
            d = tuple(o + (m == axis) for m, o in enumerate(c))
            f, g = corner(values, c), corner(values, d)
            crossed = (f < 0.0) != (g < 0.0)
            at = np.array(c, dtype=float) * np.ones((*cells, 1))
            at[..., axis] += np.where(crossed, f / np.where(crossed, f - g, 1.0), 0.0)
            total += np.where(crossed[..., None], at, 0.0)
            crossings += crossed
    used = crossings > 0
    if not used.any():
        raise InputError("the field has no surface in the box")
    number = np.full(cells, -1)
    number[used] = np.arange(used.sum())
    where = np.argwhere(used) + total[used] / crossings[used][:, None]
    vertices = _onto(field, a + step * where, step)

    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        n = list(counts)
        n[axis] -= 1
        start, stop = [0, 0, 0], list(n)
        start[u] = start[v] = 1
        stop[u], stop[v] = n[u] - 1, n[v] - 1
        first = tuple(slice(s, e) for s, e in zip(start, stop, strict=True))
        second = tuple(
            slice(s + (m == axis), e + (m == axis))
            for m, (s, e) in enumerate(zip(start, stop, strict=True))
        )
        at = np.argwhere(inside[first] != inside[second]) + start
        leaving = inside[tuple(at.T)]  # the edge leads out of the body
        around = []
        for du, dv in ((1, 1), (0, 1), (0, 0), (1, 0)):
            cell = at.copy()
            cell[:, u] -= du
            cell[:, v] -= dv
            around.append(number[tuple(cell.T)])
        quads = np.column_stack(around)
        quads[~leaving] = quads[~leaving][:, ::-1]
        # The shorter diagonal, for rounder triangles.
        p = vertices[quads]
        short = np.linalg.norm(p[:, 0] - p[:, 2], axis=1) <= np.linalg.norm(
            p[:, 1] - p[:, 3], axis=1
        )
        quads = np.where(short[:, None], quads, np.roll(quads, -1, axis=1))
        faces += [quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]
    return Mesh(vertices, np.concatenate(faces), _normals(field, vertices), _no_uvs(vertices))


def split(mesh: Mesh, side: Field, field: Field) -> tuple[Mesh | None, Mesh | None]:
    """Cuts a mesh along the curve where a function is zero.

    Args:
        mesh: from `polygonize` of ``field``.
        side: the function.
        field: whose surface the mesh is; new vertices are drawn onto it.

    Returns:
        The parts where ``side`` is negative and where it is not; None for an empty part.
    """
    value = side(mesh.vertices)
    value = np.where(value == 0.0, 1e-12, value)
    negative = value < 0.0
    pattern = negative[mesh.faces]
    lone_sign = pattern.sum(axis=1) == 1
    mixed = (pattern.sum(axis=1) % 3) > 0
    faces = mesh.faces[mixed]
    lone = np.argmax(pattern[mixed] == lone_sign[mixed, None], axis=1)
    faces = np.take_along_axis(faces, (lone[:, None] + np.arange(3)) % 3, axis=1)

    edges = np.concatenate([faces[:, [0, 1]], faces[:, [0, 2]]])
    unique, index = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    i, j = unique.T
    t = value[i] / (value[i] - value[j])
    added = mesh.vertices[i] + t[:, None] * (mesh.vertices[j] - mesh.vertices[i])
    reach = float(np.linalg.norm(mesh.vertices[j] - mesh.vertices[i], axis=1).max(initial=1e-3))
    for _ in range(4):
        added = _onto(field, _onto(side, added, reach, 1), reach, 1)

    vertices = np.concatenate([mesh.vertices, added])
    normals = np.concatenate([mesh.normals, _normals(field, added)])
    first, second = len(mesh.vertices) + index.reshape(2, -1)
    tip = np.column_stack([faces[:, 0], first, second])
    rest = np.concatenate(
        [
            np.column_stack([first, faces[:, 1], faces[:, 2]]),
            np.column_stack([first, faces[:, 2], second]),
        ]
    )
    tip_negative = lone_sign[mixed]
    rest_negative = np.tile(~tip_negative, 2)
    whole, whole_negative = mesh.faces[~mixed], pattern[~mixed].all(axis=1)

    def part(want: bool) -> Mesh | None:
        chosen = np.concatenate(
            [whole[whole_negative == want], tip[tip_negative == want], rest[rest_negative == want]]
        )
        if not len(chosen):
            return None
        used, faces = np.unique(chosen, return_inverse=True)
        return Mesh(vertices[used], faces.reshape(-1, 3), normals[used], _no_uvs(used))

    return part(True), part(False)


def _rounded(u: np.ndarray, v: np.ndarray, rounding: float) -> np.ndarray:
    """The intersection of two half-planes of distances u and v, its corner rounded."""
    u, v = u + rounding, v + rounding
    outside = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
    return outside + np.minimum(np.maximum(u, v), 0.0) - rounding


def _smooth_min(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Minimum with a parabola where the two differ by less than ``blend``."""
    if blend <= 0.0:
        return np.minimum(a, b)
    overlap = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.minimum(a, b) - 0.25 * blend * overlap**2


def _gradient(field: Field, points: np.ndarray, h: float = 1e-5) -> np.ndarray:
    steps = h * np.eye(3)
    ahead = field(points[:, None, :] + steps)
    behind = field(points[:, None, :] - steps)
    return (ahead - behind) / (2.0 * h)


def _onto(field: Field, points: np.ndarray, reach: float, rounds: int = 6) -> np.ndarray:
    """Points moved onto the zero of a field, no step longer than ``reach``."""
    for _ in range(rounds):
        gradient = _gradient(field, points)
        square = np.maximum((gradient**2).sum(axis=1), 1e-6)
        move = -(field(points) / square)[:, None] * gradient
        length = np.linalg.norm(move, axis=1, keepdims=True)
        points = points + move * np.minimum(1.0, 0.7 * reach / np.maximum(length, 1e-12))
    return points


def _normals(field: Field, points: np.ndarray) -> np.ndarray:
    gradient = _gradient(field, points)
    return gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12)


def _no_uvs(points: np.ndarray) -> np.ndarray:
    return np.zeros((len(points), 2))
