"""Foam brick: 5 x 7.5 x 5 cm of red foam, 28 g."""

from pathlib import Path

from prehensile.models.generate.objects._boxes import blank_faces, printed_box
from prehensile.models.generate.objects._contact import box_collisions
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.textures import speckle

SIZE = (0.050, 0.075, 0.050)
RED = (196, 66, 44)


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    faces = blank_faces(SIZE, "#c4422c")
    for seed, panel in enumerate(faces.values()):
        panel.paint(speckle(int(panel.height), int(panel.width), RED, 0.12, seed))
    # Three holes, as a mason's brick has, printed only: the collision shape is a plain box.
    for name in ("+z", "-z"):
        for k in range(3):
            center = (faces[name].width * (1 + 2 * k) / 6.0, faces[name].height / 2.0)
            faces[name].ellipse(center, (7.0, 7.0), "#7c2415")
            faces[name].ellipse((center[0] + 0.8, center[1] + 0.8), (6.0, 6.0), "#571208")
    part = printed_box(SIZE, faces, radius=0.003, roughness=0.95, paper="#c4422c")
    write_object(
        folder,
        HouseholdObject(
            title="Foam brick",
            description="A red brick of foam, 5 x 7.5 x 5 cm.",
            number="061_foam_brick",
            mass=0.028,
            parts=[part],
            body=part.mesh,
            collisions=box_collisions(SIZE, mu=0.8),
        ),
    )
