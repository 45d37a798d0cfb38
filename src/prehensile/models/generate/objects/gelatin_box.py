"""Gelatin box: a small flat carton in pink and green."""

from pathlib import Path

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object

SIZE = (0.0295, 0.089, 0.073)
PINK, WHITE, GREEN, DEEP = "#e83e8c", "#ffffff", "#3fae49", "#b0175f"


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, PINK)
    for name in ("+x", "-x"):
        front = faces[name]
        w, h = front.width, front.height
        front.polygon([(0, 0.66 * h), (w, 0.46 * h), (w, h), (0, h)], WHITE)
        front.polygon([(0, 0.66 * h), (w, 0.46 * h), (w, 0.52 * h), (0, 0.72 * h)], GREEN)
        front.text("GELATIN", (w / 2, 0.24 * h), height=15, max_width=0.88 * w, color=WHITE)
        # A wobbling moulded jelly.
        x, y = 0.63 * w, 0.90 * h
        front.polygon([(x - 21, y), (x + 21, y), (x + 13, y - 19), (x - 13, y - 19)], DEEP)
        for k in range(5):
            front.ellipse((x + (k - 2) * 6.0, y - 18.5), (3.6, 4.0), PINK)
            front.line([(x + (k - 2) * 8.4, y), (x + (k - 2) * 5.6, y - 17)], PINK, 1.6)
        front.text("3 MIN", (0.2 * w, 0.87 * h), height=6.5, color=GREEN)
    for name in ("+y", "-y"):
        faces[name].rect((0, 0.66 * 73, 30, 0.72 * 73), GREEN)
        faces[name].rect((0, 0.72 * 73, 30, 73), WHITE)
        faces[name].text("GELATIN", (14.7, 25), height=8, color=WHITE, angle=90, max_width=42)
    faces["+z"].barcode((52, 5, 83, 24), seed=11)
    faces["+z"].text("GELATIN", (28, 14.7), height=9, color=WHITE, max_width=44)
    part = printed_box(SIZE, faces, paper=PINK)
    write_object(
        folder,
        HouseholdObject(
            title="Gelatin box",
            description="A small pink carton with a green stripe.",
            number="009_gelatin_box",
            mass=0.097,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE),
            scanned=True,
        ),
    )
