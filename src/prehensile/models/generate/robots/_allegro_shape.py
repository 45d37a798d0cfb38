"""How the Allegro hand looks: a palm, and fingers of boxy links that end in round rubber tips.

Frames of the links: z along the finger, y along the axis that it bends about, x to where it bends.
The near end of a link is a fork about the joint; its far end is a tongue that the next one grips.
"""

import numpy as np

from prehensile.models.shapes import (
    Material,
    Mesh,
    Part,
    capsule,
    cylinder,
    extrude,
    merge,
    rounded_box,
)

WIDTH, DEPTH = 0.0275, 0.0196  # m, of a finger along y and x
TIP_RADIUS = 0.012  # m
PALM_SIZE = (0.0408, 0.113, 0.095)  # m
PALM_X = -0.0093  # m, of the palm's middle
MOUNT_SIZE = (0.0358, 0.034, 0.0455)  # m, of the thumb's first link
MOUNT_AT = (-0.0179, 0.009, 0.0145)  # m, of its middle

DARK = Material("dark", (0.06, 0.062, 0.068, 1.0), roughness=0.5)
BLACK = Material("black", (0.02, 0.02, 0.022, 1.0), roughness=0.7)
METAL = Material("metal", (0.55, 0.56, 0.58, 1.0), roughness=0.4)
WHITE = Material("white", (0.8, 0.8, 0.79, 1.0), roughness=0.5)
RUBBER = Material("rubber", (0.62, 0.62, 0.6, 1.0), roughness=0.9)

_FORK, _TONGUE = 0.0088, 0.0075  # m, radii about the axis of the joint
_R_XZ = ((1, 0, 0), (0, 0, -1), (0, 1, 0))  # turns the plane x, y to x, z
_R_ZX = ((0, 0, 1), (0, 1, 0), (-1, 0, 0))  # turns z to x


def _plate(outline: list[tuple[float, float]], width: float, bevel: float) -> Mesh:
    """An outline in the plane x, z with a width along y."""
    return extrude(outline, width, bevel=bevel).transformed(_R_XZ, (0, width / 2, 0))


def _arc(z: float, radius: float, start: float, end: float) -> list[tuple[float, float]]:
    angle = np.radians(np.linspace(start, end, 13))
    return [(radius * np.cos(a), z + radius * np.sin(a)) for a in angle]


def _tongue(length: float) -> Mesh:
    root = length - 0.0155
    outline = [(-_TONGUE, root), (_TONGUE, root), *_arc(length, _TONGUE, 0.0, 180.0)]
    return _plate(outline, 0.0205, 0.0008)


def _axle() -> Mesh:
    return cylinder(0.0042, WIDTH + 0.0003, 24, rounding=0.0006).transformed(_R_XZ)


def _fork(top: float) -> Mesh:
    half = DEPTH / 2
    outline = [*_arc(0.0, _FORK, 180.0, 360.0), (half, 0.0075), (half, top), (-half, top)]
    return _plate([*outline, (-half, 0.0075)], WIDTH - 0.0005, 0.0011)


def knuckle(length: float) -> list[Part]:
    """The first link of a finger, which turns about z; its end carries the bending joint."""
    block = rounded_box((DEPTH, WIDTH, 0.0078), 0.0012).transformed(p_AB=(0, 0, 0.0041))
    return [Part(block, METAL), Part(_tongue(length), BLACK)]


def phalanx(length: float) -> list[Part]:
    """A link between two bending joints."""
    motor = cylinder(0.0062, 0.4 * length, 32, rounding=0.001)
    return [
        Part(_fork(length - 0.0098), DARK),
        Part(_tongue(length), BLACK),
        Part(merge([_axle(), motor.transformed(p_AB=(0.0048, 0, 0.46 * length))]), METAL),
    ]


def fingertip(tip: float) -> list[Part]:
    """The last link; ``tip`` is the height of the middle of its round end."""
    top = tip - 0.011
    rubber = capsule(TIP_RADIUS, 0.011, 40).transformed(p_AB=(0, 0, tip - 0.0055))
    return [Part(_fork(top), DARK), Part(rubber, RUBBER), Part(_axle(), METAL)]


def thumb_mount() -> list[Part]:
    """The first link of the right hand's thumb, which turns about x and carries the next on z."""
    x, y, z = MOUNT_AT
    block = rounded_box(np.array(MOUNT_SIZE) - 0.0006, 0.003).transformed(p_AB=(x, y, z))
    axle = cylinder(0.0079, 0.0415, 32, rounding=0.001).transformed(_R_ZX, (-0.0165, 0, 0))
    seat = cylinder(0.0088, 0.003, 32).transformed(p_AB=(-0.027, 0.005, 0.0383))
    return [Part(block, DARK), Part(merge([axle, seat]), METAL)]


def palm(bases: list[tuple[np.ndarray, np.ndarray]]) -> list[Part]:
    """The palm; ``bases`` are rotation matrices and places of the three fingers on its rim."""
    depth, width, height = PALM_SIZE
    back, front = PALM_X - depth / 2, PALM_X + depth / 2
    seam = 0.0  # m, x where the white cover of the inner side begins

    def slab(low: float, high: float, y: float, z: tuple[float, float], rounding: float) -> Mesh:
        size = (high - low, y, z[1] - z[0])
        return rounded_box(size, rounding).transformed(p_AB=((low + high) / 2, 0, sum(z) / 2))

    frame = slab(back, seam + 0.002, width, (0.0, height), 0.004)
    cover = slab(seam, front, width - 0.004, (0.003, height - 0.003), 0.0035)
    ribs = merge(
        slab(back - 0.0004, back + 0.004, 0.07, (z, z + 0.003), 0.0005)
        for z in np.arange(0.02, 0.05, 0.007)
    )
    grip = slab(front - 0.003, front + 0.0004, 0.06, (0.02, 0.075), 0.0015)
    sockets = merge(
        cylinder(0.0094, 0.012, 32, rounding=0.0008).transformed(R, p - 0.0063 * R[:, 2])
        for R, p in bases
    )
    return [
        Part(merge([frame]), DARK),
        Part(cover, WHITE),
        Part(merge([ribs, grip]), BLACK),
        Part(sockets, METAL),
    ]
