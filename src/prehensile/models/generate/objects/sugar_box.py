"""Sugar box: a narrow yellow carton."""

from pathlib import Path

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object

SIZE = (0.045, 0.0925, 0.176)
YELLOW, BLUE, WHITE = "#f6c512", "#17418f", "#ffffff"


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, YELLOW)
    for name in ("+x", "-x"):
        front = faces[name]
        w, h = front.width, front.height
        front.rect((0, 0.0, w, 0.1 * h), WHITE)
        front.ellipse((w / 2, 0.33 * h), (0.43 * w, 0.17 * h), WHITE)
        front.ellipse((w / 2, 0.33 * h), (0.40 * w, 0.155 * h), BLUE)
        front.text("SUGAR", (w / 2, 0.33 * h), height=20, max_width=0.68 * w, color=WHITE)
        # A heap of cubes.
        for row in range(4):
            for k in range(4 - row):
                x, y = w / 2 + (k - 0.5 * (3 - row)) * 17.0, 0.86 * h - 14.5 * row
                front.rect((x - 7.5, y - 6.5, x + 7.5, y + 6.5), "#c9971a", radius=1.5)
                front.rect((x - 8.0, y - 7.0, x + 6.5, y + 5.5), WHITE, radius=1.5)
        front.rect((0, 0.94 * h, w, h), BLUE)
    for name in ("+y", "-y"):
        side = faces[name]
        w, h = side.width, side.height
        side.rect((0, 0.0, w, 0.1 * h), WHITE)
        side.rect((0, 0.94 * h, w, h), BLUE)
        side.text("SUGAR", (w / 2, 0.36 * h), height=20, color=BLUE, angle=90)
    faces["+y"].barcode((7, 112, faces["+y"].width - 7, 150), seed=5)
    faces["-y"].facts((6, 100, faces["-y"].width - 6, 156), "ENERGY")
    faces["+z"].rect((0, 0, faces["+z"].width, faces["+z"].height), WHITE)
    faces["+z"].text(
        "SUGAR", (faces["+z"].width / 2, faces["+z"].height / 2), height=18, color=BLUE
    )
    part = printed_box(SIZE, faces, paper=YELLOW)
    write_object(
        folder,
        HouseholdObject(
            title="Sugar box",
            description="A yellow carton with a blue oval and white sugar cubes.",
            number="004_sugar_box",
            mass=0.514,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE),
            scanned=True,
        ),
    )
