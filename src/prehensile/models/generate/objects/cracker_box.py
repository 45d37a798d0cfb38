"""Cracker box: a tall red carton."""

import math
from pathlib import Path

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.textures import Panel

SIZE = (0.0715, 0.164, 0.213)
RED, YELLOW, CREAM, BROWN = "#c8201e", "#ffd23c", "#fff3d6", "#8a4b14"


def _cracker(panel: Panel, x: float, y: float, radius: float) -> None:
    panel.ellipse((x + 1.5, y + 2.0), (radius, radius), "#7a120f")
    panel.ellipse((x, y), (radius, radius), "#b9751f")
    panel.ellipse((x, y), (0.93 * radius, 0.93 * radius), "#eeb85c")
    for ring, count in ((0.0, 1), (0.42, 6), (0.74, 12)):
        for k in range(count):
            turn = 2.0 * math.pi * k / count
            place = (x + ring * radius * math.cos(turn), y + ring * radius * math.sin(turn))
            panel.ellipse(place, (0.055 * radius, 0.055 * radius), BROWN)


def _front(panel: Panel) -> None:
    w, h = panel.width, panel.height
    panel.polygon([(0, 0.10 * h), (w, 0.02 * h), (w, 0.36 * h), (0, 0.44 * h)], YELLOW)
    panel.text(
        "CRACKERS",
        (w / 2, 0.235 * h),
        height=27,
        max_width=0.9 * w,
        color=RED,
        angle=6.0,
        weight=0.09,
    )
    for x, y, r in ((0.27, 0.64, 27), (0.72, 0.60, 29), (0.50, 0.80, 31)):
        _cracker(panel, x * w, y * h, r)
    panel.rect((0, 0.94 * h, w, h), CREAM)
    panel.text("CRISP + ROUND", (w / 2, 0.97 * h), height=6.5, color=RED)


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, RED)
    for name in ("+x", "-x"):
        _front(faces[name])
    for name in ("+y", "-y"):
        side = faces[name]
        w, h = side.width, side.height
        side.polygon([(0, 0.02 * h), (w, 0.10 * h), (w, 0.24 * h), (0, 0.16 * h)], YELLOW)
        side.text("CRACKERS", (w / 2, 0.13 * h), height=9, max_width=0.85 * w, color=RED, angle=-17)
        side.rect((0, 0.94 * h, w, h), CREAM)
    faces["+y"].facts((12, 62, faces["+y"].width - 12, 150))
    faces["-y"].barcode((14, 130, faces["-y"].width - 14, 172), seed=3)
    faces["-y"].text("400 g", (faces["-y"].width / 2, 95), height=12, color=CREAM)
    top = faces["+z"]
    top.rect((0, 0.3 * top.height, top.width, 0.7 * top.height), YELLOW)
    top.text("CRACKERS", (top.width / 2, top.height / 2), height=17, color=RED, max_width=130)
    part = printed_box(SIZE, faces, paper=RED)
    write_object(
        folder,
        HouseholdObject(
            title="Cracker box",
            description="A tall red carton with a yellow band and three crackers on it.",
            number="003_cracker_box",
            mass=0.411,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE),
            scanned=True,
        ),
    )
