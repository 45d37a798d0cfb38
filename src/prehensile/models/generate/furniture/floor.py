"""The floor of a room; z = 0 of ``base_link`` is its surface. What falls off a table ends there."""

from pathlib import Path

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.furniture._parts import Block, link
from prehensile.models.generate.sdf_model import Contact, Model, Shape, Visual, sdf_text
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import Material, Part, rounded_box, write_gltf

SIDE = 4.0  # m
THICKNESS = 0.5  # m, of what touches: nothing is pressed through
SLAB = 0.02  # m, of what is seen
MASS = 1000.0  # kg; it is meant to be welded to the world

CONCRETE = Contact(mu=0.6, hydroelastic="rigid", relaxation_time=0.02)


def model() -> Model:
    """The floor."""
    half = SIDE / 2
    parts = [Block("slab", (-half, -half, -THICKNESS), (half, half, 0.0))]
    visuals = (Visual("floor", Shape("mesh", uri="floor.gltf")),)
    comment = "A floor. The origin is the middle of its surface, z up."
    return Model("floor", comment, (link("base_link", MASS, parts, CONCRETE, visuals),))


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    slab = rounded_box((SIDE, SIDE, SLAB), 0.004, 2).transformed(p_AB=(0.0, 0.0, -SLAB / 2))
    concrete = Material("concrete", (0.50, 0.51, 0.53, 1.0), roughness=0.9)
    write_gltf(folder / "floor.gltf", [Part(slab, concrete)])
    write_atomic(folder / "floor.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.2))
    write_description(
        folder,
        title="Floor",
        category="furniture",
        description=(
            f"Square of {SIDE:g} m, its surface at z = 0 of base_link; weld it to the world 0.75 m "
            "below the top of the table."
        ),
        sources=["Dimensions of our own"],
    )
