"""Potted meat can: a rounded rectangular tin, blue with a pink roll of ham."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._cans import TIN
from prehensile.models.generate.objects._contact import INSET, balls, hull, octagon
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.generate.sdf_model import Collision
from prehensile.models.shapes import Material, Part, loft, offset, rounded_rectangle
from prehensile.models.textures import Panel

SIZE = (0.0575, 0.1015, 0.0835)
CORNER, RIM = 0.022, 0.004
BLUE, YELLOW, PINK, WHITE = "#1565c0", "#ffd400", "#f48fa0", "#ffffff"


def _outline() -> np.ndarray:
    """The outer edge of the rims, beginning amid the back so that the label's seam is there."""
    outline = rounded_rectangle(SIZE[0], SIZE[1], CORNER, 8)
    back = np.argmin(outline[:, 0] + 1e-3 * outline[:, 1])
    ring = np.roll(outline, -back, axis=0)
    middle = np.array([[-0.5 * SIZE[0], 0.0]])
    rest = ring if ring[0, 1] < 0.0 else np.roll(ring, -1, axis=0)
    return np.concatenate([middle, rest])


def _parts(paper: Panel) -> list[Part]:
    outer, top = _outline(), 0.5 * SIZE[2]
    wall = offset(outer, -0.0009)
    levels = [
        (wall, top - RIM),
        (outer, top - 0.75 * RIM),
        (outer, top - 0.1 * RIM),
        (offset(outer, -0.0006), top),
        (offset(outer, -0.0012), top),
        (offset(outer, -0.0020), top - 0.2 * RIM),
        (offset(outer, -0.0024), top - 0.8 * RIM),
        (offset(outer, -0.0100), top - 0.8 * RIM),
        (offset(outer, -0.0106), top - 0.5 * RIM),
    ]
    upper = loft([o for o, _ in levels], [z for _, z in levels], caps=False)
    lid = loft([levels[-1][0], levels[-1][0]], [levels[-1][1] - 1e-4, levels[-1][1]])
    metal = [upper, lid, *(m.mirrored(2) for m in (upper, lid))]
    label = loft([wall, wall], [RIM - top, top - RIM], caps=False)
    print_material = Material("label", (1.0, 1.0, 1.0, 1.0), 0.0, 0.4, paper.png())
    return [Part(label, print_material), *(Part(m, TIN) for m in metal)]


def _collisions() -> list[Collision]:
    a, b, c = 0.5 * np.asarray(SIZE)
    flat_a, flat_b = a - 0.4 * CORNER, b - 0.4 * CORNER
    gap = 2.0 * INSET
    return [
        hull("hull_broad", "box", [2 * a - gap, 2 * flat_b - gap, 2 * c - gap]),
        hull("hull_narrow", "box", [2 * flat_a - gap, 2 * b - gap, 2 * c - gap]),
        *balls(octagon(a, b, flat_a, flat_b, -c)),
        *balls(octagon(a, b, flat_a, flat_b, c), start=8),
    ]


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    outline = _outline()
    around = float(np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1).sum())
    paper = Panel(1000.0 * around, 1000.0 * (SIZE[2] - 2.0 * RIM), BLUE)
    w, h = paper.width, paper.height
    paper.rect((0, 0, w, 0.07 * h), YELLOW)
    paper.rect((0, 0.93 * h, w, h), YELLOW)
    for x in (0.5 * w, 0.0, w):
        paper.text("HAM", (x, 0.29 * h), height=21, color=YELLOW, weight=0.1)
        paper.rect((x - 30, 0.52 * h, x + 30, 0.85 * h), "#c2556a", radius=8)
        paper.rect((x - 28.5, 0.54 * h, x + 24, 0.83 * h), PINK, radius=7)
        paper.ellipse((x + 22, 0.685 * h), (7.5, 0.165 * h), "#fbd3d9")
        paper.ellipse((x + 22, 0.685 * h), (6.0, 0.135 * h), PINK)
    for x in (0.25 * w, 0.75 * w):
        paper.text("POTTED", (x, 0.2 * h), height=8.5, color=WHITE, max_width=32)
        paper.text("MEAT", (x, 0.36 * h), height=8.5, color=WHITE, max_width=30)
    paper.barcode((0.25 * w - 12, 0.52 * h, 0.25 * w + 12, 0.85 * h), seed=9)
    paper.facts((0.75 * w - 12, 0.48 * h, 0.75 * w + 12, 0.88 * h), "MEAT")
    body = loft([outline, outline], [-0.5 * SIZE[2], 0.5 * SIZE[2]])
    write_object(
        folder,
        HouseholdObject(
            title="Potted meat can",
            description="A blue tin with rounded corners, yellow letters and a pink ham.",
            number="010_potted_meat_can",
            mass=0.370,
            parts=_parts(paper),
            body=body,
            collisions=_collisions(),
            scanned=True,
        ),
    )
