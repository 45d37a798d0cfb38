"""A sturdy work table; z = 0 of ``base_link`` is its top surface, so that robots stand on it."""

from pathlib import Path

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.furniture import _wood
from prehensile.models.generate.furniture._parts import Block, link
from prehensile.models.generate.sdf_model import Contact, Model, Shape, Visual, sdf_text
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import Material, Part, cylinder, merge, rounded_box, write_gltf

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
    feet = [(*leg.pose[:2], -HEIGHT) for leg in parts[1:]]
    visuals = (Visual("table", Shape("mesh", uri="table.gltf")),)
    comment = "A work table. The origin is the middle of its top surface, z up, x along the length."
    return Model("table", comment, (link("base_link", MASS, parts, LAMINATE, visuals, feet),))


def visual_parts() -> list[Part]:
    """A plate of glued staves on a frame of steel tube with feet."""
    top, *legs = blocks()
    plate = _wood.board(top, 0, 0.006)
    steel = []
    for leg in legs:
        size = leg.shape.size
        tube = rounded_box((size[0], size[1], size[2] - 0.03), 0.006, 2)
        steel.append(tube.transformed(p_AB=(*leg.pose[:2], leg.pose[2] + 0.015)))
    x, y = LENGTH / 2 - INSET - LEG / 2, WIDTH / 2 - INSET - LEG / 2
    for z, height, depth in ((-PLATE - 0.04, 0.08, 0.04), (-HEIGHT + 0.16, 0.05, 0.03)):
        for s in (-1, 1):
            along = rounded_box((2 * x - LEG, depth, height), 0.004, 2)
            steel.append(along.transformed(p_AB=(0, s * y, z)))
            across = rounded_box((depth, 2 * y - LEG, height), 0.004, 2)
            steel.append(across.transformed(p_AB=(s * x, 0, z)))
    foot = cylinder(0.035, 0.03, 24, rounding=0.006)
    feet = merge(foot.transformed(p_AB=(*leg.pose[:2], -HEIGHT + 0.015)) for leg in legs)
    texture = _wood.grain((240, 222, 190), (196, 164, 122), seed=3)
    return [
        Part(plate, _wood.wood("beech", texture)),
        Part(merge(steel), Material("steel", (0.10, 0.115, 0.13, 1.0), roughness=0.5)),
        Part(feet, Material("rubber", (0.02, 0.02, 0.02, 1.0), roughness=0.9)),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "table.gltf", visual_parts())
    write_atomic(folder / "table.sdf", sdf_text(made))
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
