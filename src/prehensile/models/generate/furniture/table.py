"""A sturdy work table; z = 0 of ``base_link`` is its top surface, so that robots stand on it."""

from pathlib import Path

from prehensile.models.generate.files import write_description, write_spheres, write_text
from prehensile.models.generate.furniture._parts import Block, link, plain_visuals
from prehensile.models.generate.sdf_model import Contact, Model, sdf_text
from prehensile.models.generate.sphere_cover import cover_model

LENGTH, WIDTH, HEIGHT = 1.8, 1.6, 0.75  # m, along x, y, z
PLATE = 0.05  # m, thickness of the top
LEG = 0.08  # m, of the square legs
INSET = 0.06  # m, of the legs from the edge of the top
MASS = 95.0  # kg

LAMINATE = Contact(mu=0.5, hydroelastic="rigid", relaxation_time=0.02)


def blocks() -> list[Block]:
    """The top and the four legs."""
    x, y = LENGTH / 2, WIDTH / 2
    parts = [Block("top", (-x, -y, -PLATE), (x, y, 0.0))]
    for sx, sy, name in (
        (1, 1, "front_left"),
        (1, -1, "front_right"),
        (-1, 1, "back_left"),
        (-1, -1, "back_right"),
    ):
        outer, inner = (x - INSET, y - INSET), (x - INSET - LEG, y - INSET - LEG)
        xs, ys = sorted((sx * outer[0], sx * inner[0])), sorted((sy * outer[1], sy * inner[1]))
        parts.append(Block(f"leg_{name}", (xs[0], ys[0], -HEIGHT), (xs[1], ys[1], -PLATE)))
    return parts


def model() -> Model:
    """The table."""
    parts = blocks()
    visuals = plain_visuals(parts[:1], (0.78, 0.74, 0.68, 1.0))
    visuals += plain_visuals(parts[1:], (0.35, 0.37, 0.4, 1.0))
    comment = "A work table. The origin is the middle of its top surface, z up, x along the length."
    return Model("table", comment, (link("base_link", MASS, parts, LAMINATE, visuals),))


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_text(folder / "table.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.035))
    write_description(
        folder,
        title="Work table",
        category="furniture",
        description=(
            f"Top {LENGTH:g} x {WIDTH:g} m at z = 0 of base_link, {HEIGHT:g} m above the floor; "
            "a robot welded to the world's origin stands in its middle."
        ),
        sources=["Dimensions of our own, those of a common heavy work table"],
    )
