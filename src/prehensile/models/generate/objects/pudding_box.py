"""Pudding box: a small brown carton."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object

SIZE = (0.035, 0.110, 0.089)
BROWN, CREAM, DARK, GOLD = "#5a2f16", "#f7e3bd", "#36190a", "#e0a030"


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, BROWN)
    turn = np.linspace(0.0, 6.0 * np.pi, 200)
    for name in ("+x", "-x"):
        front = faces[name]
        w, h = front.width, front.height
        front.rect((0, 0.07 * h, w, 0.42 * h), CREAM)
        front.text("PUDDING", (w / 2, 0.245 * h), height=18, max_width=0.88 * w, color=BROWN)
        front.ellipse((w / 2, 0.74 * h), (36, 19), GOLD)
        front.ellipse((w / 2, 0.74 * h), (33, 16.5), DARK)
        swirl = np.column_stack(
            [w / 2 + 1.6 * turn * np.cos(turn), 0.74 * h + 0.75 * turn * np.sin(turn)]
        )
        front.line(swirl, CREAM, 2.0)
    for name in ("+y", "-y"):
        side = faces[name]
        side.rect((0, 0.07 * side.height, side.width, 0.42 * side.height), CREAM)
    faces["+y"].barcode((4, 46, faces["+y"].width - 4, 78), seed=8)
    faces["-y"].facts((4, 42, faces["-y"].width - 4, 84), "FACTS")
    for name in ("+z", "-z"):
        lid = faces[name]
        lid.text("PUDDING", (lid.width / 2, lid.height / 2), height=15, color=CREAM, max_width=92)
    part = printed_box(SIZE, faces, paper=BROWN)
    write_object(
        folder,
        HouseholdObject(
            title="Pudding box",
            description="A brown carton with a cream band and a swirl.",
            number="008_pudding_box",
            mass=0.187,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE),
        ),
    )
