"""How the Gen3 looks: slender light tubes with waists, dark rings where they turn."""

import numpy as np

from prehensile.models.generate.robots._housing import (
    DARK,
    GAP,
    disc,
    kept,
    parted,
    ring,
    shell,
    without,
)
from prehensile.models.shapes import Material, Part, cylinder, lathe, merge, rounded_box
from prehensile.models.shapes.implicit import cone, drum, union

SILVER = Material("silver", (0.78, 0.79, 0.80, 1.0), metallic=0.0, roughness=0.4)
BLACK = Material("black", (0.06, 0.062, 0.066, 1.0), metallic=0.0, roughness=0.5)
STEEL = Material("steel", (0.55, 0.56, 0.57, 1.0), metallic=0.2, roughness=0.4)

LARGE, SMALL = 0.0455, 0.035  # m, radius of the two sizes of actuator
X, Y, Z = np.eye(3)


def base() -> list[Part]:
    """The foot with its plugs behind."""
    top = 0.15643
    r = LARGE
    body = lathe(
        [(0, 0), (r, 0), (r, 0.03), (r - 0.0012, 0.031), (r - 0.0012, 0.034), (r, 0.035)]
        + [(r, top - 0.016)],
        64,
        crease=np.radians(25.0),
    )
    collar = lathe([(r, top - 0.016), (r, top - GAP), (0, top - GAP)], 64)
    plugs = [
        rounded_box((0.012, 0.03, 0.016), 0.003).transformed(p_AB=(-r + 0.002, 0.0, z))
        for z in (0.06, 0.09)
    ]
    return [
        Part(body, SILVER),
        Part(collar, BLACK),
        Part(merge(plugs), DARK),
        ring(r, top * Z, 2),
    ]


def _rising(r: float, height: float, back: float, face: float, waist: float) -> list[Part]:
    """A tube up -z from its own joint, and a drum on y for the next, its end a black lid.

    Args:
        r: radius of tube and drum, m.
        height: of the next axis, m.
        back: how far the drum reaches along -y, m.
        face: y of the next joint, m.
        waist: radius of the tube half way, m.
    """
    middle = 0.5 * (face - back)
    body = union(
        drum((0, 0, 0.05), (0, 0, -0.03), r, 0.01),
        cone((0, 0, -0.03), (0, middle, 0.04 - height), waist, waist),
        drum((0, -back, -height), (0, face + 0.04, -height), r, 0.014),
        blend=0.024,
    )
    low, high = (-r, -back - 0.01, -height - r), (r, max(r, face + 0.04), 0.05)
    mesh = shell(body, np.subtract(low, 0.015), np.add(high, 0.015), 0.19 * r)
    mesh = kept(mesh, body, (2, -GAP, -1.0))
    mesh = without(mesh, body, (0, face - GAP, -height), (0, face + 0.3, -height), r)
    away = (0, -back - 0.1, -height)
    lid, housing = parted(mesh, body, (0, -back + 0.012, -height), away, 0.78 * r)
    return [Part(housing, SILVER), Part(lid, BLACK), ring(r, face * Y - height * Z, 1)]


def _standing(r: float, back: float, length: float, tube: float, z: float) -> list[Part]:
    """A drum on its own joint, its end a black lid, and a tube along -y up to the next.

    Args:
        r: radius of the drum, m.
        back: how far it reaches along -z, m.
        length: up to the next joint, m.
        tube: radius of the tube there, m.
        z: of its middle, m.
    """
    waist = 0.84 * min(r, tube)
    body = union(
        drum((0, 0, -back), (0, 0, 0.04), r, 0.014),
        cone((0, -0.02, -0.5 * back), (0, 0.04 - length, z), waist, waist),
        drum((0, -length - 0.05, z), (0, 0.035 - length, z), tube, 0.01),
        blend=0.024,
    )
    low, high = (-r, -length - 0.05, -back - 0.01), (r, r, max(0.04, z + tube))
    mesh = shell(body, np.subtract(low, 0.015), np.add(high, 0.015), 0.19 * r)
    mesh = without(mesh, body, (0, 0, -GAP), (0, 0, 0.3), r)
    mesh = kept(mesh, body, (1, GAP - length, 1.0))
    lid, housing = parted(mesh, body, (0, 0, -back + 0.012), (0, 0, -back - 0.1), 0.78 * r)
    return [Part(housing, SILVER), Part(lid, BLACK), ring(tube, -length * Y + z * Z, 1)]


def bracelet() -> list[Part]:
    """The last link: the interface for hands, with its buttons and the camera above it."""
    face = -0.061525
    body = lathe(
        [
            (0.0, face + 0.003),
            (0.022, face + 0.003),
            (0.022, face),
            (0.0355, face),
            (0.0368, face + 0.0013),
            (0.0368, -0.03),
            (SMALL, -0.012),
            (SMALL, -GAP),
            (0.0, -GAP),
        ],
        64,
        crease=np.radians(25.0),
    )
    eye = rounded_box((0.088, 0.036, 0.018), 0.007).transformed(p_AB=(0, -0.056, -0.0525))
    neck = rounded_box((0.05, 0.03, 0.016), 0.005).transformed(p_AB=(0, -0.035, -0.0515))
    lenses = merge(
        disc(r, (x, -0.057, -0.06), (x, -0.057, -0.0622))
        for x, r in ((0.0, 0.009), (0.0275, 0.006))
    )
    angles = np.radians(np.arange(4) * 90.0 + 45.0)
    holes = merge(
        cylinder(0.0025, 0.0006, 16).transformed(p_AB=(0.029 * np.cos(a), 0.029 * np.sin(a), face))
        for a in angles
    )
    return [
        Part(body, SILVER),
        Part(merge([eye, neck]), BLACK),
        Part(lenses, STEEL),
        Part(holes, DARK),
    ]


def links() -> list[list[Part]]:
    """The parts of base and links, each in the frame of its link."""
    return [
        base(),
        _rising(LARGE, 0.12838, 0.049, 0.005375, 0.039),
        _standing(LARGE, 0.055, 0.21038, LARGE, -0.006375),
        _rising(LARGE, 0.21038, 0.049, 0.006375, 0.0375),
        _standing(LARGE, 0.056, 0.20843, SMALL, -0.006375),
        _rising(SMALL, 0.10593, 0.053, 0.00017505, 0.03),
        _standing(SMALL, 0.053, 0.10593, SMALL, -0.00017505),
        bracelet(),
    ]
