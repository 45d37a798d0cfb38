"""Tins: a printed label between two metal rims."""

import numpy as np

from prehensile.models.shapes import Material, Part, lathe
from prehensile.models.textures import Panel

TIN = Material("tin", (0.82, 0.83, 0.84, 1.0), 0.25, 0.35)


def label(radius: float, height: float, paper: str) -> Panel:
    """A blank label that goes once round; its middle looks along +x."""
    return Panel(2000.0 * np.pi * radius, 1000.0 * height, paper)


def tin(
    radius: float,
    height: float,
    paper: Panel,
    *,
    rim: float = 0.004,
    lid: Material = TIN,
    segments: int = 64,
) -> list[Part]:
    """A can about the origin: label, bottom and lid with beaded rims of ``rim`` m.

    Args:
        radius: outer, at the rims, m.
        height: m.
        paper: the label; it covers the wall between the rims.
        rim: height of a rim, m.
        lid: material of the top.
        segments: faces round the can.
    """
    wall, top = radius - 0.0009, 0.5 * height
    bead = 0.5 * rim
    angle = np.linspace(0.0, np.pi, 7)  # the bead, from its outside over its top to its inside
    arc = np.column_stack(
        [radius - 0.6 * bead + 0.6 * bead * np.cos(angle), top - bead + bead * np.sin(angle)]
    )
    inside = radius - 1.2 * bead
    sunk = top - 0.8 * rim
    upper = np.array(
        [
            [wall, top - rim],
            [radius, top - 0.75 * rim],
            *arc,
            [inside, sunk],
            [0.8 * radius, sunk],
            [0.78 * radius, sunk + 0.0008],
            [0.6 * radius, sunk + 0.0008],
            [0.58 * radius, sunk],
            [0.0, sunk],
        ]
    )
    lower = upper[::-1] * [1.0, -1.0]
    print_material = Material("label", (1.0, 1.0, 1.0, 1.0), 0.0, 0.45, paper.png())
    return [
        Part(lathe([[wall, rim - top], [wall, top - rim]], segments), print_material),
        Part(lathe(lower, segments), TIN),
        Part(lathe(upper, segments), lid),
    ]
