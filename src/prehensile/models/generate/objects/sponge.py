"""Kitchen sponge: yellow foam with a green scouring layer."""

from pathlib import Path

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.textures import speckle

SIZE = (0.072, 0.114, 0.014)
YELLOW, GREEN = (244, 205, 70), (40, 122, 66)


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, "#f4cd46")
    for seed, (name, panel) in enumerate(faces.items()):
        color, contrast = (GREEN, 0.16) if name == "+z" else (YELLOW, 0.10)
        panel.paint(speckle(int(panel.height), int(panel.width), color, contrast, seed))
        if name not in ("+z", "-z"):
            panel.rect((0, 0, panel.width, 4.5), GREEN)
    part = printed_box(SIZE, faces, radius=0.002, roughness=1.0, paper="#f4cd46")
    write_object(
        folder,
        HouseholdObject(
            title="Sponge",
            description="A flat yellow sponge with a green scouring side.",
            number="026_sponge",
            mass=0.0062,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE, mu=0.8),
        ),
    )
