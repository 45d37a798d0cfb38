"""How the links of the iiwa look: tubes and drums that flow into one another.

Even links carry orange covers on the outer side of their drums. Where two drums meet, and at the
ends of the tubes, the housings stop a little short of one another; a dark ring fills the gap.
"""

from collections.abc import Sequence

import numpy as np

from prehensile.models.shapes import Material, Mesh, Part, cylinder, lathe, merge
from prehensile.models.shapes.implicit import (
    Field,
    cone,
    cut,
    drum,
    polygonize,
    rounded_block,
    slab,
    split,
    union,
)

SILVER = Material("silver", (0.80, 0.81, 0.83, 1.0), metallic=0.0, roughness=0.42)
ORANGE = Material("orange", (1.0, 0.21, 0.012, 1.0), metallic=0.0, roughness=0.42)
DARK = Material("dark", (0.045, 0.047, 0.05, 1.0), metallic=0.0, roughness=0.6)

STEP = 0.0088  # m, edge of the triangles
GAP = 0.0018  # m, half of what is between two links
FLOW = 0.048  # m, width of the fillets between tube and drum

R_YZ = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # turns z to y


def base(radius: float, foot: float, back: float) -> list[Part]:
    """Link 0: a foot that narrows to the first joint, and a box for the plugs behind it."""
    top = 0.1575

    def flare(p: np.ndarray) -> np.ndarray:
        height = np.clip(p[..., 2] / top, 0.0, 1.0)
        edge = radius + (foot - radius) * (1.0 - height) ** 2 * (1.0 + 1.2 * height)
        return 0.9 * (np.hypot(p[..., 0], p[..., 1]) - edge)

    plug = rounded_block((-back, -0.052, -0.05), (0.0, 0.052, 0.132), 0.008)
    body = union(flare, plug, blend=0.02)
    for angle in np.radians([45.0, 135.0, 225.0, 315.0]):  # recesses for the screws
        x, y = 0.99 * foot * np.cos(angle), 0.99 * foot * np.sin(angle)
        body = cut(body, cone((x, y, 0.016), (x, y, 0.2), 0.013, 0.013), blend=0.005)
    capped = cut(body, lambda p: 0.3 - np.abs(p[..., 2]), blend=0.0)
    shell = polygonize(capped, (-0.16, -0.16, -0.32), (0.16, 0.16, 0.32), 0.0078)
    shell = _between(shell, body, 2, 0.0, top - GAP)
    return [
        Part(shell, SILVER),
        _ring((0, 0, top), 2, radius),
        Part(_plugs().transformed(p_AB=(-back - 0.0005, 0, 0)), DARK),
    ]


def rising(radius: float, height: float, side: float) -> list[Part]:
    """Links 1 and 3: up along z from their own joint, drum on the next, on the ``side`` of y."""
    outer = side * reach(radius, False)
    off = outer - side * radius
    tube = _swaying(2, 1, (0.02, height - 0.035), (0.0, off), (radius, radius), height)
    head = drum((0, outer, height), (0, -side * 0.08, height), radius, 0.82 * radius)
    body = union(tube, head, blend=FLOW)
    other = drum((0, -side * 0.3, height), (0, side * GAP, height), radius + 0.0005, 0.0)
    shell = _housing(body, height + radius)
    shell = _kept(split(shell, other, body)[1])
    shell = _kept(split(shell, lambda p: GAP - p[..., 2], body)[0])
    return [Part(shell, SILVER), _ring((0, 0, height), 1, radius)]


def standing(radius: float, tube: float, length: float) -> list[Part]:
    """Links 2 and 4: drum on their own joint, tube along y; an orange cover on the drum."""
    outer = reach(radius, True)
    off = outer - radius
    neck = _swaying(1, 2, (0.035, length - 0.02), (off, 0.0), (radius, tube), 0.0)
    head = drum((0, 0, outer), (0, 0, -0.08), radius, 0.82 * radius)
    body = union(neck, head, blend=FLOW)
    other = drum((0, 0, -0.3), (0, 0, GAP), radius + 0.0005, 0.0)
    shell = _housing(body, length + radius)
    shell = _kept(split(shell, other, body)[1])
    shell = _kept(split(shell, lambda p: p[..., 1] - (length - GAP), body)[0])
    edge = 0.46 * outer
    rest, cover = split(shell, lambda p: p[..., 2] - edge - 0.36 * p[..., 1], body)
    return [
        Part(_kept(rest), SILVER),
        Part(_kept(cover), ORANGE),
        _ring((0, length, 0), 1, tube),
    ]


def forearm(height: float) -> list[Part]:
    """Link 5: a short tube, and a flat arm beside the wrist."""
    radius = 0.068
    outline = _stadium((0.0, 0.05), (0.0, height), 0.062, 0.051)
    straight = slab(outline, 1, 0.072, 0.0985, 0.011)

    def plate(p: np.ndarray) -> np.ndarray:
        # Below the arm bends inwards, to merge with the tube.
        bent = p.copy()
        bent[..., 1] += 0.05 * (1.0 - _smooth_step((p[..., 2] - 0.02) / 0.115))
        return straight(bent)

    tube = _swaying(2, 1, (0.03, 0.165), (0.0, 0.06), (radius, 0.03), 0.15)
    body = union(tube, plate, blend=0.025)
    sweep = drum((0, -0.3, height), (0, 0.0715, height), 0.088, 0.012)
    body = cut(body, sweep, blend=0.012)
    shell = _housing(body, height + 0.06)
    shell = _kept(split(shell, lambda p: GAP - p[..., 2], body)[0])
    pivot = cylinder(0.036, 0.003, rounding=0.001).transformed(R_YZ.T, (0, 0.0992, height))
    return [Part(shell, SILVER), Part(pivot, DARK)]


def wrist(length: float) -> list[Part]:
    """Link 6: a ball that reaches from the forearm to the flange; its belly is orange."""
    body = union(
        cone((0, -0.021, 0.002), (0, 0.010, 0), 0.0635, 0.0655),
        drum((0, -0.02, 0), (0, length + 0.1, 0), 0.0525, 0.01),
        blend=0.05,
    )
    body = union(body, drum((0, 0, -0.0705), (0, 0, 0), 0.048, 0.004), blend=0.03)
    shell = _housing(body, length + 0.12)
    shell = _kept(split(shell, lambda p: p[..., 1] - (length - GAP), body)[0])
    rest, cover = split(shell, lambda p: 0.014 + p[..., 1] * 0.55 - p[..., 2], body)
    return [
        Part(_kept(cover), SILVER),
        Part(_kept(rest), ORANGE),
        _ring((0, length, 0), 1, 0.0525),
    ]


def flange(height: float) -> list[Part]:
    """Link 7: the disc that tools are screwed to."""
    radius = 0.0525
    body = lathe(
        [
            (radius - 0.002, GAP),
            (radius, GAP + 0.002),
            (radius, 0.026),
            (0.0495, 0.030),
            (0.0495, height - 0.0015),
            (0.048, height),
            (0.0225, height),
            (0.0225, height - 0.005),
            (0, height - 0.005),
        ],
        64,
        crease=np.radians(25.0),
    )
    angle = np.arange(7) * np.pi / 4.0 + np.pi / 4.0
    holes = merge(
        cylinder(0.0032, 0.0006, 16).transformed(
            p_AB=(0.0315 * np.cos(a), 0.0315 * np.sin(a), height)
        )
        for a in angle
    )
    mark = cylinder(0.0495 + 0.0004, 0.0015).transformed(p_AB=(0, 0, 0.0345))
    return [Part(body, SILVER), Part(holes, DARK), Part(mark, DARK)]


def links(heights: Sequence[float], drums: tuple[float, float], face: float) -> list[list[Part]]:
    """The parts of links 0 to 7.

    Args:
        heights: (6,) distance from the frame of link i + 1 to that of link i + 2, m.
        drums: radius of the drums on joints 2 and 4, m.
        face: of the flange above the frame of link 7, m.
    """
    shoulder, elbow = drums
    large = shoulder > 0.08
    return [
        base(shoulder, 0.118 if large else 0.102, 0.136 if large else 0.113),
        rising(shoulder, heights[0], -1.0),
        standing(shoulder, elbow, heights[1]),
        rising(elbow, heights[2], 1.0),
        standing(elbow, elbow, heights[3]),
        forearm(heights[4]),
        wrist(heights[5]),
        flange(face),
    ]


def reach(radius: float, even: bool) -> float:
    """How far the drum of a link reaches to the side of the tube's joint, m.

    Args:
        radius: of the drum.
        even: whether the link's number is.
    """
    if radius < 0.08:
        return 0.109
    return 0.124 if even else 0.116


def _housing(body: Field, reach: float) -> Mesh:
    low = np.array([-0.11, -0.21, -0.21])
    return polygonize(body, low, (0.11, reach + 0.21, reach + 0.21), STEP)


def _between(mesh: Mesh, body: Field, axis: int, low: float, high: float) -> Mesh:
    upper = _kept(split(mesh, lambda p: low - p[..., axis], body)[0])
    return _kept(split(upper, lambda p: p[..., axis] - high, body)[0])


def _kept(mesh: Mesh | None) -> Mesh:
    """A part of a split that must be there."""
    if mesh is None:
        raise ValueError("a cut left nothing of a housing")
    return mesh


def _ring(at: Sequence[float], axis: int, radius: float) -> Part:
    """The dark ring in the gap at a joint, about axis 1 (y) or 2 (z)."""
    ring = cylinder(radius - 0.0015, 0.012)
    return Part(ring.transformed(R_YZ if axis == 1 else np.eye(3), at), DARK)


def _smooth_step(t: np.ndarray) -> np.ndarray:
    """From 0 to 1, level at both ends."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _swaying(
    along: int,
    across: int,
    span: Sequence[float],
    shift: Sequence[float],
    radii: Sequence[float],
    end: float,
) -> Field:
    """A tube along one axis that sways to the side along another.

    Args:
        along: axis of the tube, 1 or 2; it comes from far away, from the side of the joint.
        across: axis of the sway.
        span: where along the tube the sway begins and ends, m.
        shift: to the side, before and after, m.
        radii: before and after, m.
        end: where the tube stops, m.
    """
    from_below = end > span[0]

    def side(p: np.ndarray) -> np.ndarray:
        t = (p[..., along] - span[0]) / (span[1] - span[0])
        step = _smooth_step(t)
        slope = 6.0 * np.clip(t, 0.0, 1.0) * (1.0 - np.clip(t, 0.0, 1.0))
        slope = slope * (shift[1] - shift[0]) / (span[1] - span[0])
        aside = p[..., across] - shift[0] - step * (shift[1] - shift[0])
        aside = aside / np.sqrt(1.0 + 0.7 * slope**2)  # keeps the tube as thick where it leans
        radius = radii[0] + step * (radii[1] - radii[0])
        return 0.8 * (np.hypot(p[..., 0], aside) - radius)

    sign = 1.0 if from_below else -1.0
    return cut(side, lambda p: sign * (end - p[..., along]), blend=0.07)


def _stadium(a: Sequence[float], b: Sequence[float], ra: float, rb: float) -> Field:
    """Round outline in x and z about two points, its radius changing evenly."""
    start, end = np.asarray(a, float), np.asarray(b, float)
    along = end - start

    def field(p: np.ndarray) -> np.ndarray:
        q = p[..., [0, 2]]
        t = np.clip((q - start) @ along / (along @ along), 0.0, 1.0)
        return np.linalg.norm(q - start - t[..., None] * along, axis=-1) - (ra + t * (rb - ra))

    return field


def _plugs() -> Mesh:
    """The sockets on the back of the foot, in the plane x = 0."""
    spots = [
        (-0.027, 0.085, 0.013),
        (0.025, 0.085, 0.011),
        (-0.027, 0.042, 0.011),
        (0.025, 0.042, 0.013),
    ]
    turn = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])  # z to -x
    return merge(
        cylinder(r, 0.008, 24, rounding=0.001).transformed(turn, (0, y, z)) for y, z, r in spots
    )
