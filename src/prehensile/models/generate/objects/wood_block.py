"""Wood block: a beam of planed pine."""

from pathlib import Path

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.textures import grain

SIZE = (0.085, 0.085, 0.200)
LIGHT, DARK = (226, 184, 128), (164, 108, 58)


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, "#dcb078")
    for seed, name in enumerate(("+x", "+y", "-x", "-y")):
        faces[name].paint(grain(300, 130, LIGHT, DARK, 7.0, seed))
    for name in ("+z", "-z"):
        end = faces[name]
        end.rect((0, 0, end.width, end.height), "#c8945a")
        for k in range(12, 0, -1):
            radius = 7.5 * k
            end.ellipse((20, 96), (radius + 1.6, radius + 1.6), "#9a6434")
            end.ellipse((20, 96), (radius, radius), "#d9ac72" if k % 2 else "#d2a268")
    part = printed_box(SIZE, faces, radius=0.003, roughness=0.8, paper="#dcb078")
    write_object(
        folder,
        HouseholdObject(
            title="Wood block",
            description="A beam of pine with visible grain and year rings at its ends.",
            number="036_wood_block",
            mass=0.729,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE),
        ),
    )
