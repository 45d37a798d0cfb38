"""How the xArm 7 looks: white drums, each carried by a plate beside the one before."""

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
from prehensile.models.shapes import Material, Mesh, Part, cylinder, lathe, merge
from prehensile.models.shapes.implicit import Field, cone, drum, rounded_block, slab

WHITE = Material("white", (0.84, 0.84, 0.84, 1.0), metallic=0.0, roughness=0.4)
STEEL = Material("steel", (0.55, 0.56, 0.57, 1.0), metallic=0.2, roughness=0.4)

STEP = 0.0088  # m, edge of the triangles
X, Y, Z = np.eye(3)


def _plate(end: tuple[float, float], radius: float, low: float, high: float) -> Field:
    """A plate with round ends from z axis to a point (x, y), between two heights."""
    along = np.array(end)

    def outline(p: np.ndarray) -> np.ndarray:
        q = p[..., :2]
        t = np.clip(q @ along / (along @ along), 0.0, 1.0)
        return np.linalg.norm(q - t[..., None] * along, axis=-1) - radius

    return slab(outline, 2, low, high, 0.008)


def base() -> list[Part]:
    """A column on a round foot, with the plugs behind."""
    r, top = 0.047, 0.155
    body = lathe(
        [
            (0.0, 0.0),
            (0.063, 0.0),
            (0.063, 0.009),
            (0.0615, 0.0105),
            (0.052, 0.0115),
            (r, 0.016),
            (r, top - GAP),
            (0.0, top - GAP),
        ],
        64,
        crease=np.radians(25.0),
    )
    corners = 0.055 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / np.sqrt(2.0)
    screws = [cylinder(0.0045, 0.004, 20).transformed(p_AB=(*p, 0.0125)) for p in corners]
    plugs = [disc(0.009, (-0.03, y, 0.03), (-0.07, y, 0.03), 0.001) for y in (-0.016, 0.016)]
    return [Part(body, WHITE), Part(merge([*screws, *plugs]), DARK), ring(r, top * Z, 2)]


def _shell(body: Field, low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    return shell(body, low, high, STEP)


def link_1() -> list[Part]:
    """A tube, and a drum on y that carries the upper arm on its +y side."""
    low, face, r = -0.112, 0.075, 0.0475
    body = joined(
        drum((0, 0, low - 0.04), (0, 0, -0.03), r, 0.01),
        drum((0, -0.057, 0), (0, face + 0.04, 0), r, 0.016),
        blend=0.02,
        ends=[(low * Z, Z), (face * Y, -Y)],
    )
    mesh = _shell(body, (-r, -0.06, low - 0.04), (r, face + 0.04, r + 0.005))
    mesh = kept(mesh, body, (2, low + GAP, 1.0), (1, face - GAP, -1.0))
    return [Part(mesh, WHITE), ring(r, face * Y, 1)]


def link_2() -> list[Part]:
    """A plate beside the shoulder, and a tube back on its axis."""
    low, end, r = 0.075, -0.192, 0.0475
    body = joined(
        _plate((0.0, -0.09), r, low + GAP, 0.119),
        rounded_block((-0.045, -0.152, -0.034), (0.045, -0.062, 0.117), 0.032),
        drum((0, end - 0.04, 0), (0, -0.08, 0), 0.042, 0.01),
        blend=0.016,
        ends=[(end * Y, Y)],
    )
    mesh = _shell(body, (-r, end - 0.04, -0.045), (r, r, 0.12))
    mesh = kept(mesh, body, (1, end + GAP, 1.0))
    return [Part(mesh, WHITE), ring(0.042, end * Y, 1)]


def link_3() -> list[Part]:
    """A tube, and a drum on y before it that carries the forearm on its -y side."""
    low, face, r = -0.101, -0.067, 0.0425
    body = joined(
        drum((0, 0, low - 0.04), (0, 0, -0.055), 0.042, 0.01),
        cone((0, 0, -0.055), (0.045, 0.005, -0.01), 0.037, 0.037),
        drum((0.0525, face - 0.04, 0), (0.0525, 0.069, 0), r, 0.014),
        blend=0.022,
        ends=[(low * Z, Z), (face * Y, Y)],
    )
    mesh = _shell(body, (-r, face - 0.04, low - 0.04), (0.1, 0.07, 0.045))
    mesh = kept(mesh, body, (2, low + GAP, 1.0), (1, face + GAP, 1.0))
    return [Part(mesh, WHITE), ring(r, 0.0525 * X + face * Y, 1)]


def link_4() -> list[Part]:
    """A plate beside the elbow, and a tube before it."""
    low, end, r, x = 0.067, -0.169, 0.0425, 0.0775
    body = joined(
        _plate((x - 0.003, -0.08), r, low + GAP, 0.107),
        rounded_block((x - 0.041, -0.127, -0.034), (x + 0.041, -0.045, 0.105), 0.03),
        drum((x, end - 0.04, 0), (x, -0.07, 0), 0.042, 0.01),
        blend=0.016,
        ends=[(end * Y, Y)],
    )
    mesh = _shell(body, (-r, end - 0.04, -0.045), (x + 0.045, r, 0.11))
    mesh = kept(mesh, body, (1, end + GAP, 1.0))
    return [Part(mesh, WHITE), ring(0.042, x * X + end * Y, 1)]


def link_5() -> list[Part]:
    """A tube that leans over to a plate beside the wrist."""
    low, face, r = -0.173, 0.005, 0.0375
    body = joined(
        drum((0, 0, low - 0.04), (0, 0, -0.145), 0.042, 0.01),
        cone((0, 0, -0.15), (0, 0.058, -0.09), 0.036, 0.026),
        rounded_block((-r, 0.05, -0.105), (r, 0.086, 0.0), 0.012),
        drum((0, face - 0.03, 0), (0, 0.086, 0), r, 0.012),
        blend=0.02,
        ends=[(low * Z, Z)],
    )
    mesh = _shell(body, (-0.045, -0.045, low - 0.04), (0.045, 0.09, 0.04))
    mesh = without(mesh, body, (0, face + GAP, 0), (0, -0.3, 0), r)
    mesh = kept(mesh, body, (2, low + GAP, 1.0))
    return [Part(mesh, WHITE), ring(r, face * Y, 1)]


def link_6() -> list[Part]:
    """A drum on its own joint, and a tube before it, down to the flange."""
    low, end, r, x = -0.005, 0.069, 0.0375, 0.076
    body = joined(
        drum((0, 0, low - 0.03), (0, 0, 0.058), r, 0.012),
        cone((0.01, 0, 0.025), (x, 0, 0.007), 0.027, 0.03),
        drum((x, -0.035, 0), (x, end + 0.04, 0), r, 0.012),
        blend=0.022,
        ends=[(end * Y, -Y)],
    )
    mesh = _shell(body, (-r, -0.045, low - 0.04), (x + 0.04, end + 0.04, 0.06))
    mesh = without(mesh, body, (0, 0, low + GAP), (0, 0, -0.3), r)
    mesh = kept(mesh, body, (1, end - GAP, -1.0))
    return [Part(mesh, WHITE), ring(r, x * X + end * Y, 1)]


def link_7() -> list[Part]:
    """The flange, with its holes and the plug for the tool."""
    low, r = -0.028 + GAP, 0.037
    body = lathe(
        [
            (r - 0.001, low),
            (r, low + 0.001),
            (r, -0.001),
            (r - 0.001, 0.0),
            (0.0155, 0.0),
            (0.0155, -0.004),
            (0.0, -0.004),
        ],
        64,
        crease=np.radians(25.0),
    )
    angles = np.radians([45.0, 135.0, 225.0, 315.0])
    holes = merge(
        cylinder(0.003, 0.0006, 16).transformed(p_AB=(0.025 * np.cos(a), 0.025 * np.sin(a), 0.0))
        for a in angles
    )
    plug = disc(0.009, (0.0, -r + 0.006, -0.014), (0.0, -0.05, -0.014), 0.001)
    return [Part(body, STEEL), Part(merge([holes, plug]), DARK)]


def links() -> list[list[Part]]:
    """The parts of base and links, each in the frame of its link."""
    return [base(), link_1(), link_2(), link_3(), link_4(), link_5(), link_6(), link_7()]
