"""An open plastic container for picking; z = 0 of ``base_link`` is its underside."""

from pathlib import Path

from prehensile.models.generate.files import write_description, write_spheres, write_text
from prehensile.models.generate.furniture._parts import Block, link, plain_visuals
from prehensile.models.generate.sdf_model import Contact, Model, sdf_text
from prehensile.models.generate.sphere_cover import cover_model

INNER = (0.56, 0.38)  # m, of the interior along x and y
FLOOR, TOP = 0.01, 0.17  # m, z of the inner floor and of the upper edge of the walls
WALL = 0.03  # m; thick outward, so that nothing is pressed through
MASS = 3.2  # kg

PLASTIC = Contact(mu=0.4, hydroelastic="rigid", relaxation_time=0.02)


def blocks() -> list[Block]:
    """Floor and walls."""
    x, y = INNER[0] / 2, INNER[1] / 2
    X, Y = x + WALL, y + WALL
    return [
        Block("floor", (-X, -Y, 0.0), (X, Y, FLOOR)),
        Block("wall_front", (x, -Y, 0.0), (X, Y, TOP)),
        Block("wall_back", (-X, -Y, 0.0), (-x, Y, TOP)),
        Block("wall_left", (-X, y, 0.0), (X, Y, TOP)),
        Block("wall_right", (-X, -Y, 0.0), (X, -y, TOP)),
    ]


def model() -> Model:
    """The bin."""
    parts = blocks()
    visuals = plain_visuals(parts, (0.36, 0.45, 0.56, 1.0))
    comment = (
        "A container for picking. The origin is the middle of its underside, z up, x along the"
        f" length; interior {INNER[0]:g} x {INNER[1]:g} m from z = {FLOOR:g} to {TOP:g}."
    )
    return Model("bin", comment, (link("base_link", MASS, parts, PLASTIC, visuals),))


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_text(folder / "bin.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made))
    write_description(
        folder,
        title="Picking bin",
        category="furniture",
        description=(
            f"Open container, interior {INNER[0]:g} x {INNER[1]:g} x {TOP - FLOOR:g} m; base_link "
            f"in the middle of the underside, inner floor at z = {FLOOR:g}, upper edge at "
            f"z = {TOP:g}. The walls that touch are {WALL:g} m thick, outward."
        ),
        sources=["Dimensions of our own, near the 600 x 400 mm module of small load carriers"],
    )
