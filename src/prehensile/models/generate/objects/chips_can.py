"""Chips can: a tall purple tube with a plastic lid."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._cans import label, tin
from prehensile.models.generate.objects._contact import can_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.shapes import Material, cylinder

RADIUS, HEIGHT = 0.0375, 0.250
PURPLE, YELLOW, CHIP, EDGE = "#5b2a91", "#ffd84a", "#f3c35a", "#c98a26"


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    paper = label(RADIUS, HEIGHT - 0.012, PURPLE)
    w, h = paper.width, paper.height
    paper.rect((0, 0, w, 0.04 * h), YELLOW)
    paper.rect((0, 0.96 * h, w, h), YELLOW)
    bend = np.linspace(-1.0, 1.0, 30)
    for x in (0.5 * w, 0.0, w):
        paper.text("CHIPS", (x, 0.27 * h), height=30, max_width=0.37 * w, color=YELLOW, weight=0.09)
        for k in range(4):
            y = 0.52 * h + 20.0 * k
            upper = np.column_stack([x + 30 * bend, y - 9 * (1 - bend**2) - 5 * bend])
            lower = np.column_stack([x + 30 * bend, y + 9 * (1 - bend**2) - 5 * bend])
            outline = np.concatenate([upper, lower[::-1]])
            paper.polygon(outline, EDGE)
            paper.polygon((outline - [x, y]) * 0.88 + [x, y], CHIP)
    paper.barcode((0.25 * w - 15, 0.72 * h, 0.25 * w + 15, 0.86 * h), seed=6)
    paper.facts((0.75 * w - 16, 0.62 * h, 0.75 * w + 16, 0.90 * h))
    lid = Material("plastic lid", (0.85, 0.68, 0.05, 1.0), 0.0, 0.4)
    write_object(
        folder,
        HouseholdObject(
            title="Chips can",
            description="A tall purple tube with yellow letters and a plastic lid.",
            number="001_chips_can",
            mass=0.205,
            parts=tin(RADIUS, HEIGHT, paper, rim=0.006, lid=lid),
            body=cylinder(RADIUS, HEIGHT),
            collisions=can_collisions(RADIUS, HEIGHT),
        ),
    )
