"""Tomato soup can: red above, white below."""

from pathlib import Path

from prehensile.models.generate.objects._cans import label, tin
from prehensile.models.generate.objects._contact import can_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.shapes import cylinder
from prehensile.models.textures import Panel

RADIUS, HEIGHT = 0.0335, 0.1015
RED, WHITE, GREEN, GOLD = "#d3231c", "#fdfaf2", "#2f8f3a", "#d9a520"


def _tomato(panel: Panel, x: float, y: float, radius: float) -> None:
    panel.ellipse((x, y), (1.08 * radius, radius), "#a8140e")
    panel.ellipse((x - 0.05 * radius, y - 0.05 * radius), (1.0 * radius, 0.92 * radius), "#e63a25")
    panel.ellipse((x - 0.4 * radius, y - 0.4 * radius), (0.2 * radius, 0.14 * radius), "#ff9a80")
    for dx in (-0.5, 0.0, 0.5):
        panel.polygon(
            [
                (x, y - 0.75 * radius),
                (x + dx * radius - 0.12 * radius, y - 1.0 * radius),
                (x + dx * radius + 0.12 * radius, y - 1.05 * radius),
            ],
            GREEN,
        )
        panel.line([(x, y - 0.8 * radius), (x + dx * radius, y - 0.98 * radius)], GREEN, 2.2)


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    paper = label(RADIUS, HEIGHT - 0.008, WHITE)
    w, h = paper.width, paper.height
    paper.rect((0, 0, w, 0.48 * h), RED)
    paper.rect((0, 0.48 * h, w, 0.51 * h), GOLD)
    paper.rect((0, 0.93 * h, w, h), RED)
    for x in (0.25 * w, 0.75 * w):  # at the sides of the front
        paper.text("SOUP", (x, 0.25 * h), height=9, color=GOLD)
    for x in (0.5 * w, 0.0, w):  # front, and the back in two halves
        paper.text("TOMATO", (x, 0.25 * h), height=19, max_width=0.31 * w, color=WHITE, weight=0.08)
        _tomato(paper, x, 0.72 * h, 15.0)
    paper.barcode((0.25 * w - 12, 0.58 * h, 0.25 * w + 12, 0.86 * h), seed=2)
    paper.facts((0.75 * w - 13, 0.55 * h, 0.75 * w + 13, 0.90 * h), "SOUP")
    write_object(
        folder,
        HouseholdObject(
            title="Tomato soup can",
            description="A tin, red above and white below, with a tomato on it.",
            number="005_tomato_soup_can",
            mass=0.349,
            parts=tin(RADIUS, HEIGHT, paper),
            body=cylinder(RADIUS, HEIGHT),
            collisions=can_collisions(RADIUS, HEIGHT),
            scanned=True,
        ),
    )
