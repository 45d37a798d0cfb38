"""How the Panda looks: white tubes that bend into drums, grey rings where they turn."""

import numpy as np

from prehensile.models.generate.robots._housing import (
    DARK,
    GAP,
    disc,
    joined,
    kept,
    ring,
    shell,
    without,
)
from prehensile.models.shapes import Material, Part, cylinder, lathe, merge
from prehensile.models.shapes.implicit import cone, drum, rounded_block, union

WHITE = Material("white", (0.84, 0.84, 0.84, 1.0), metallic=0.0, roughness=0.4)
GREY = Material("grey", (0.26, 0.27, 0.28, 1.0), metallic=0.0, roughness=0.5)
STEEL = Material("steel", (0.62, 0.63, 0.64, 1.0), metallic=0.2, roughness=0.4)

STEP = 0.0104  # m, edge of the triangles
R = 0.055  # m, radius of tubes and drums
X, Y, Z = np.eye(3)


def _band(radius: float, at: np.ndarray, along: np.ndarray, width: float = 0.009) -> list[Part]:
    """A grey band at a joint, on the side of this link, and what fills the gap beside it."""
    band = disc(radius + 0.0007, at + GAP * along, at + width * along)
    return [Part(band, GREY), ring(radius, at, int(np.argmax(np.abs(along))))]


def base() -> list[Part]:
    """Link 0: a foot on two broad toes, with the plugs behind, and the neck."""
    body = joined(
        rounded_block((-0.132, -0.07, -0.06), (0.0, 0.07, 0.088), 0.03),
        rounded_block((-0.12, -0.095, -0.06), (-0.04, 0.095, 0.028), 0.014),
        drum((0, 0, -0.06), (0, 0, 0.026), 0.072, 0.012),
        drum((0, 0, -0.06), (0, 0, 0.2), R, 0.01),
        blend=0.045,
        ends=[(0.14 * Z, -Z)],
    )
    mesh = shell(body, (-0.16, -0.12, -0.07), (0.1, 0.12, 0.2), STEP)
    mesh = kept(mesh, body, (2, 0.0, 1.0), (2, 0.14 - GAP, -1.0))
    spots = (-0.035, 0.0, 0.035)
    plugs = [disc(0.012, (-0.12, y, 0.045), (-0.136, y, 0.045), 0.002) for y in spots]
    return [
        Part(mesh, WHITE),
        Part(merge(plugs), DARK),
        *_band(R, 0.14 * Z, -Z),
    ]


def _shoulder(low: float) -> list[Part]:
    """Link 1: a tube that stands on z at ``low``, and a drum on y whose face is at y = 0."""
    body = joined(
        drum((0, 0, low - 0.05), (0, 0, -0.105), R, 0.02),
        cone((0, 0, -0.105), (0, -0.055, -0.015), R - 0.002, R - 0.002),
        drum((0, -0.129, 0), (0, 0.05, 0), R, 0.034),
        blend=0.03,
        ends=[(low * Z, Z)],
    )
    mesh = shell(body, (-0.07, -0.14, low - 0.06), (0.07, 0.08, 0.07), STEP)
    mesh = kept(mesh, body, (2, low + GAP, 1.0))
    mesh = without(mesh, body, (0, -GAP, 0), (0, 0.3, 0), R)
    return [Part(mesh, WHITE), *_band(R, low * Z, Z), *_band(R, 0.0 * Y, -Y)]


def _elbow(low: float) -> list[Part]:
    """Link 3: a tube that stands on z at ``low``, and a drum before it, its face at y = 0."""
    body = joined(
        drum((0, 0, low - 0.05), (0, 0, -0.06), R, 0.02),
        cone((0, 0, -0.07), (0.07, 0.055, -0.01), R - 0.004, R - 0.006),
        drum((0.0825, -0.05, 0), (0.0825, 0.111, 0), R, 0.034),
        blend=0.03,
        ends=[(low * Z, Z)],
    )
    mesh = shell(body, (-0.07, -0.08, low - 0.06), (0.15, 0.12, 0.07), STEP)
    mesh = kept(mesh, body, (2, low + GAP, 1.0))
    mesh = without(mesh, body, (0.0825, GAP, 0), (0.0825, -0.3, 0), R)
    return [Part(mesh, WHITE), *_band(R, low * Z, Z), *_band(R, 0.0825 * X, Y)]


def _turned(parts: list[Part], columns: tuple[np.ndarray, ...], x: float) -> list[Part]:
    """Parts in a frame A as seen in a frame B: the axes of A in B, and its origin on x."""
    R_BA = np.column_stack(columns)
    return [Part(part.mesh.transformed(R_BA, (x, 0.0, 0.0)), part.material) for part in parts]


def forearm() -> list[Part]:
    """Link 5: a tube that narrows to a flat arm beside the wrist, with a drum on its axis."""
    low, r = -0.259, 0.05
    body = joined(
        drum((0, 0, low - 0.05), (0, 0, -0.215), R, 0.02),
        cone((0, 0, -0.2), (0, 0.078, -0.135), R - 0.008, 0.03),
        cone((0, 0.08, -0.15), (0, 0.086, -0.02), 0.031, 0.034),
        drum((0, -0.04, 0), (0, 0.13, 0), r, 0.03),
        blend=0.035,
        ends=[(low * Z, Z)],
    )
    mesh = shell(body, (-0.07, -0.08, low - 0.06), (0.07, 0.14, 0.06), STEP)
    mesh = kept(mesh, body, (2, low + GAP, 1.0))
    mesh = without(mesh, body, (0, 0.015 - GAP, 0), (0, -0.3, 0), r)
    return [Part(mesh, WHITE), *_band(R, low * Z, Z), *_band(r, 0.015 * Y, Y, 0.007)]


def wrist() -> list[Part]:
    """Link 6: a drum on its own joint, a barrel about the next, off to the front."""
    r, face = 0.048, -0.0515
    body = joined(
        drum((0, 0, -0.07), (0, 0, 0.055), r, 0.02),
        cone((0, 0, 0.015), (0.07, 0.012, 0), 0.036, 0.038),
        drum((0.088, face - 0.04, 0), (0.088, 0.082, 0), 0.0445, 0.018),
        blend=0.03,
        ends=[(face * Y, Y)],
    )
    mesh = shell(body, (-0.06, -0.1, -0.08), (0.14, 0.09, 0.07), STEP)
    mesh = without(mesh, body, (0, 0, -0.015 + GAP), (0, 0, -0.3), r)
    mesh = kept(mesh, body, (1, face + GAP, 1.0))
    return [Part(mesh, WHITE), *_band(0.0445, 0.088 * X + face * Y, Y, 0.007)]


def flange() -> list[Part]:
    """Link 7: the disc that tools are screwed to, and the knob with the buttons."""
    low, high = 0.0515 + GAP, 0.107
    body = union(
        drum((0, 0, low - 0.03), (0, 0, 0.098), 0.0435, 0.008),
        drum((0.048, 0.048, 0.071), (0.048, 0.048, 0.097), 0.025, 0.008),
        cone((0.02, 0.02, 0.08), (0.045, 0.045, 0.084), 0.014, 0.012),
        blend=0.02,
    )
    mesh = shell(body, (-0.05, -0.05, low - 0.04), (0.09, 0.09, 0.11), 0.0072)
    mesh = kept(mesh, body, (2, low, 1.0))
    face = lathe(
        [(0.0315, 0.09), (0.0315, high - 0.001), (0.0305, high), (0.021, high), (0.021, 0.1)],
        64,
        crease=np.radians(25.0),
    )
    floor = disc(0.021, (0, 0, 0.099), (0, 0, 0.1005))
    angles = np.radians([45.0, 135.0, 225.0, 315.0])
    holes = merge(
        cylinder(0.003, 0.0006, 16).transformed(p_AB=(0.025 * np.cos(a), 0.025 * np.sin(a), high))
        for a in angles
    )
    button = disc(0.011, (0.048, 0.048, 0.09), (0.048, 0.048, 0.0985), 0.001)
    return [
        Part(mesh, WHITE),
        Part(merge([face, floor]), STEEL),
        Part(merge([holes, button]), DARK),
    ]


def links() -> list[list[Part]]:
    """The parts of links 0 to 7, each in the frame of its link."""
    return [
        base(),
        _shoulder(-0.193),
        _turned(_shoulder(-0.194), (X, -Z, Y), 0.0),
        _elbow(-0.122),
        _turned(_elbow(-0.124), (X, Z, -Y), -0.0825),
        forearm(),
        wrist(),
        flange(),
    ]
