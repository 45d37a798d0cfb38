"""Tuna can: flat and blue."""

from pathlib import Path

from prehensile.models.generate.objects._cans import label, tin
from prehensile.models.generate.objects._contact import can_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.shapes import cylinder
from prehensile.models.textures import Panel

RADIUS, HEIGHT = 0.0425, 0.033
NAVY, AQUA, WHITE = "#0b2f6b", "#27b6c9", "#ffffff"


def _fish(panel: Panel, x: float, y: float, length: float) -> None:
    panel.ellipse((x, y), (0.38 * length, 0.17 * length), WHITE)
    panel.polygon(
        [
            (x + 0.3 * length, y),
            (x + 0.52 * length, y - 0.18 * length),
            (x + 0.52 * length, y + 0.18 * length),
        ],
        WHITE,
    )
    panel.ellipse((x - 0.22 * length, y - 0.03 * length), (0.03 * length, 0.03 * length), NAVY)


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    paper = label(RADIUS, HEIGHT - 0.007, NAVY)
    w, h = paper.width, paper.height
    paper.rect((0, 0, w, 0.12 * h), AQUA)
    paper.rect((0, 0.88 * h, w, h), AQUA)
    for k in range(4):
        x = (0.125 + 0.25 * k) * w
        paper.text("TUNA", (x - 13, 0.5 * h), height=11.5, color=WHITE, weight=0.08)
        _fish(paper, x + 20, 0.5 * h, 21.0)
    write_object(
        folder,
        HouseholdObject(
            title="Tuna can",
            description="A flat tin with a navy label and white fish.",
            number="007_tuna_fish_can",
            mass=0.171,
            parts=tin(RADIUS, HEIGHT, paper, rim=0.0035, segments=72),
            body=cylinder(RADIUS, HEIGHT),
            collisions=can_collisions(RADIUS, HEIGHT),
        ),
    )
