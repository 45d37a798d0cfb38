"""The linkage of the Robotiq 2F-85 in its plane, how the gripper looks, and its pads.

Points are those of the finger at +x, in the plane x, z of the base's frame, gripper open; the
hinges turn about y. The other finger is the mirror image.
"""

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.models.generate.robots._pad import pad_mesh
from prehensile.models.shapes import (
    Material,
    Mesh,
    Part,
    cylinder,
    extrude,
    lathe,
    loft,
    merge,
    rounded_box,
    rounded_rectangle,
)

# Hinges: A outer knuckle on base, B outer finger on outer knuckle, C inner finger on outer finger,
# D inner knuckle on base, E inner finger on inner knuckle. A, C, E, D make a parallelogram.
A = np.array([0.03060114, 0.05490452])
B = A + [0.03152616, -0.00376347]
C = B + [0.00563134, 0.04718515]
D = np.array([0.0127, 0.06142])
E = D + C - A

STROKE = 0.085  # m, opening of the gripper
PAD_X = 0.5 * STROKE - C[0]  # m, of the pad's face in the frame of the inner finger, at C
PAD_Z = 0.03225  # m, of its middle above C
PAD_LENGTH, PAD_WIDTH = 0.0375, 0.022  # m, along z and y
PAD_DEPTH = 0.002  # m, of the rubber

BASE_RADIUS = 0.0375  # m
KNUCKLE, FINGER, INNER = 0.0085, 0.0075, 0.0065  # m, half widths of the bars in the plane
OUTSIDE, INSIDE = 0.0145, 0.0095  # m, half thicknesses of forks and of what they hold

BLACK = Material("black", (0.03, 0.03, 0.033, 1.0), roughness=0.5)
RUBBER = Material("rubber", (0.05, 0.05, 0.052, 1.0), roughness=0.9)
METAL = Material("metal", (0.5, 0.51, 0.53, 1.0), roughness=0.4)
GREY = Material("grey", (0.2, 0.2, 0.21, 1.0), roughness=0.5)

_R_XZ = ((1, 0, 0), (0, 0, -1), (0, 1, 0))  # turns the plane x, y to x, z


def pad_volume(side: int) -> str:
    """The pad of the finger on the ``side`` (1 or -1) of x as a volume mesh, in its frame."""
    R_LP = RotationMatrix(np.column_stack([(side, 0, 0), (0, 0, 1), (0, -side, 0)]))
    X_LP = RigidTransform(R_LP, [side * PAD_X, 0.0, PAD_Z])
    return pad_mesh(X_LP, PAD_LENGTH, PAD_WIDTH, depth=0.0105, core=0.007, count=4)


def _plate(outline: np.ndarray, low: float, high: float, bevel: float = 0.0008) -> Mesh:
    """An outline in the plane x, z between two planes of constant y."""
    return extrude(outline, high - low, bevel=bevel).transformed(_R_XZ, (0, high, 0))


def _fork(outline: np.ndarray) -> Mesh:
    inner = INSIDE + 0.0006
    return merge([_plate(outline, inner, OUTSIDE), _plate(outline, -OUTSIDE, -inner)])


def _bar(start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Outline of a bar with round ends about two points."""
    along = np.arctan2(*(end - start)[::-1])
    angle = np.linspace(-np.pi / 2, np.pi / 2, 13)
    arc = np.column_stack([np.cos(along + angle), np.sin(along + angle)])
    return np.concatenate([end + radius * arc, start - radius * arc])


def _axle(at: np.ndarray, radius: float = 0.0032) -> Mesh:
    pin = cylinder(radius, 2 * OUTSIDE + 0.0012, 24, rounding=0.0005)
    return pin.transformed(_R_XZ, (at[0], 0, at[1]))


def base_parts() -> list[Part]:
    """The coupling, the housing that narrows to the hinges, and their axles."""
    coupling = lathe([(0.0, 0.0), (0.0365, 0.0), (BASE_RADIUS, 0.001), (BASE_RADIUS, 0.0115),
                      (0.0362, 0.0125), (0.0, 0.0125)], 56)  # fmt: skip
    groove = lathe([(0.0, 0.0125), (0.0358, 0.0125), (0.0358, 0.0145), (0.0, 0.0145)], 56)
    sections = [(0.0145, 0.0372, 0.0372, 0.0368), (0.022, 0.0375, 0.0370, 0.0350),
                (0.032, 0.0385, 0.0335, 0.0260), (0.0405, 0.0395, 0.0290, 0.0200),
                (0.0438, 0.0393, 0.0268, 0.0180), (0.0450, 0.0390, 0.0240, 0.0160),
                (0.0455, 0.0386, 0.0098, 0.0090), (0.0590, 0.0380, 0.0096, 0.0085),
                (0.0655, 0.0330, 0.0094, 0.0080), (0.0690, 0.0250, 0.0088, 0.0075)]  # fmt: skip
    outlines = [rounded_rectangle(2 * x, 2 * y, r, 7) for _, x, y, r in sections]
    housing = loft(outlines, [section[0] for section in sections])
    plug = rounded_box((0.016, 0.008, 0.012), 0.0015).transformed(p_AB=(0, -0.0385, 0.024))
    axles = merge(_axle(np.array([s * p[0], p[1]]), 0.0036) for s in (-1, 1) for p in (A, D))
    return [
        Part(housing, BLACK),
        Part(coupling, GREY),
        Part(merge([groove, plug]), RUBBER),
        Part(axles, METAL),
    ]


def outer_knuckle_parts() -> list[Part]:
    """The driven link from A to B, in a frame at A."""
    return [Part(_fork(_bar(np.zeros(2), B - A, KNUCKLE)), METAL), Part(_axle(B - A), GREY)]


def outer_finger_parts() -> list[Part]:
    """The link from B to C, in a frame at B."""
    bar = _plate(_bar(np.zeros(2), C - B, FINGER), -INSIDE, INSIDE)
    return [Part(bar, BLACK)]


def inner_knuckle_parts() -> list[Part]:
    """The link from D to E, in a frame at D."""
    bar = _plate(_bar(np.zeros(2), E - D, INNER), -INSIDE + 0.0004, INSIDE - 0.0004)
    return [Part(bar, GREY)]


def inner_finger_parts() -> list[Part]:
    """The tip on C and E, in a frame at C, with its ribbed pad."""
    back = PAD_X + PAD_DEPTH
    top = PAD_Z + PAD_LENGTH / 2 + 0.0012
    block = [(back, 0.0125), (-0.0102, 0.0125), (-0.0108, 0.018), (-0.0142, 0.034),
             (-0.0162, top - 0.004), (-0.0182, top), (back + 0.0006, top),
             (back, top - 0.0006)]  # fmt: skip
    arc_C = [(0.0072 * np.cos(a), 0.0072 * np.sin(a)) for a in np.radians(np.linspace(-95, 70, 12))]
    e_x, e_z = E - C
    arc_E = [
        (e_x + 0.0068 * np.cos(a), e_z + 0.0068 * np.sin(a))
        for a in np.radians(np.linspace(-190, -112, 8))
    ]
    cheek = [*arc_E, *arc_C, (-0.0112, 0.019), (back, 0.019)]
    ribs, count = [], 10
    pitch = PAD_LENGTH / count
    for i in range(count):
        rib = rounded_box((PAD_DEPTH + 0.0006, PAD_WIDTH, 0.8 * pitch), 0.0006, 2)
        z = PAD_Z - PAD_LENGTH / 2 + (i + 0.5) * pitch
        ribs.append(rib.transformed(p_AB=(PAD_X + (PAD_DEPTH + 0.0006) / 2, 0, z)))
    return [
        Part(_plate(np.array(block), -OUTSIDE + 0.001, OUTSIDE - 0.001), METAL),
        Part(_fork(np.array(cheek)), METAL),
        Part(merge([_axle(np.zeros(2)), _axle(E - C)]), GREY),
        Part(merge(ribs), RUBBER),
    ]
