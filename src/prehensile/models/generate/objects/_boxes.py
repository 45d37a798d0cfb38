"""Cardboard boxes and other blocks."""

from collections.abc import Mapping

import numpy as np

from prehensile.models.shapes import Material, Part, rounded_box
from prehensile.models.textures import Panel, atlas

Size = tuple[float, float, float]


def printed_box(
    size: Size,
    faces: Mapping[str, Panel],
    *,
    radius: float = 0.0012,
    roughness: float = 0.55,
    paper: str = "white",
) -> Part:
    """A box of ``size`` m about the origin with panels on its faces; the front looks along +x."""
    texture = atlas(size, faces, paper)
    material = Material("print", (1.0, 1.0, 1.0, 1.0), 0.0, roughness, texture)
    return Part(rounded_box(size, radius, 4), material)


def blank_faces(size: Size, paper: str) -> dict[str, Panel]:
    """A blank panel, in millimetres, for each of the six faces."""
    x, y, z = 1000.0 * np.asarray(size)
    sides = {"+x": (y, z), "-x": (y, z), "+y": (x, z), "-y": (x, z), "+z": (y, x), "-z": (y, x)}
    return {name: Panel(width, height, paper) for name, (width, height) in sides.items()}
