"""Puzzle cube: three by three by three, scrambled."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object

SIZE = (0.057, 0.057, 0.057)
BLACK = "#141414"
STICKERS = ("#e8e8e8", "#f5d312", "#1b9e3d", "#1549b8", "#d0211c", "#f57d16")


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, BLACK)
    colors = np.random.default_rng(4).permutation(np.repeat(np.arange(6), 9)).reshape(6, 3, 3)
    for panel, stickers in zip(faces.values(), colors, strict=True):
        for i in range(3):
            for j in range(3):
                x, y = 1.5 + 18.2 * j, 1.5 + 18.2 * i
                box = (x + 0.9, y + 0.9, x + 16.7, y + 16.7)
                panel.rect(box, STICKERS[stickers[i, j]], radius=2.0)
    part = printed_box(SIZE, faces, radius=0.003, roughness=0.35, paper=BLACK)
    write_object(
        folder,
        HouseholdObject(
            title="Puzzle cube",
            description="A scrambled cube puzzle with nine stickers on each face.",
            number="077_rubiks_cube",
            mass=0.094,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE),
        ),
    )
