"""An open plastic container for picking; z = 0 of ``base_link`` is its underside."""

from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.furniture._parts import Block, link
from prehensile.models.generate.sdf_model import Contact, Model, Shape, Visual, sdf_text
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import (
    Material,
    Part,
    extrude,
    merge,
    rounded_box,
    rounded_rectangle,
    skin,
    write_gltf,
)

INNER = (0.56, 0.38)  # m, of the interior along x and y
# m, z of the inner floor and of the upper edge of the walls. The floor is thick: what falls at
# 2.5 m/s goes 12 mm deep in a step of 5 ms, and is pushed out on the nearer side.
FLOOR, TOP = 0.03, 0.19
WALL = 0.03  # m; thick outward, so that nothing is pressed through
MASS = 3.2  # kg

PLASTIC_BLUE = Material("plastic", (0.13, 0.22, 0.36, 1.0), roughness=0.55)
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
    x, y = INNER[0] / 2 + WALL / 2, INNER[1] / 2 + WALL / 2  # under the walls
    feet = [(x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0)]
    visuals = (Visual("bin", Shape("mesh", uri="bin.gltf")),)
    comment = (
        "A container for picking. The origin is the middle of its underside, z up, x along the"
        f" length; interior {INNER[0]:g} x {INNER[1]:g} m from z = {FLOOR:g} to {TOP:g}."
    )
    return Model("bin", comment, (link("base_link", MASS, parts, PLASTIC, visuals, feet),))


def visual_parts() -> list[Part]:
    """A container of plastic: a thin wall between a broad rim and a foot, joined by ribs."""
    # The wall in section: distance outward from the interior's side, and height.
    section = [
        (0.017, 0.0), (0.0195, 0.0025), (0.0195, 0.016), (0.018, 0.018), (0.007, 0.020),
        (0.006, 0.022), (0.006, TOP - 0.036), (0.007, TOP - 0.034), (0.027, TOP - 0.033),
        (WALL, TOP - 0.030), (WALL, TOP - 0.003), (WALL - 0.003, TOP), (0.003, TOP),
        (0.0009, TOP - 0.0009), (0.0, TOP - 0.003), (0.0, FLOOR + 0.004),
        (-0.0012, FLOOR + 0.0012), (-0.004, FLOOR),
    ]  # fmt: skip
    rings = []
    for out, z in section:
        ring = rounded_rectangle(INNER[0] + 2 * out, INNER[1] + 2 * out, 0.014 + out, 6)
        rings.append(np.column_stack([ring, np.full(len(ring), z)]))
    shell = skin(np.array(rings), caps=True)
    low, high = 0.018, TOP - 0.033
    ribs = []
    for axis in (0, 1):
        half, reach = INNER[axis] / 2 - 0.03, INNER[1 - axis] / 2
        size = [0.004, 0.016, high - low]
        for along in np.linspace(-half, half, 9 if axis == 0 else 7):
            if axis == 1 and abs(along) < 0.06:
                continue  # the handles
            for side in (-1.0, 1.0):
                p = (along, side * (reach + 0.010), 0.5 * (low + high))
                turned = size if axis == 0 else [size[1], size[0], size[2]]
                place = p if axis == 0 else (p[1], p[0], p[2])
                ribs.append(rounded_box(turned, 0.001, 2).transformed(p_AB=place))
    to_x = ((0, 0, 1), (1, 0, 0), (0, 1, 0))  # turns an outline's x, y to y, z
    grip = extrude(rounded_rectangle(0.13, 0.046, 0.012, 5), 0.0185, bevel=0.001)
    hole = extrude(rounded_rectangle(0.104, 0.022, 0.0105, 6), 0.0010)
    grips, holes = [], []
    for s in (-1.0, 1.0):
        turn = np.array(to_x) if s > 0 else np.array(((0, 0, -1), (-1, 0, 0), (0, 1, 0)))
        grips.append(grip.transformed(turn, (s * (INNER[0] / 2 + 0.005), 0, 0.105)))
        holes.append(hole.transformed(turn, (s * (INNER[0] / 2 + 0.0230), 0, 0.105)))
    card = rounded_box((0.11, 0.0012, 0.055), 0.0005, 2)
    cards = merge(card.transformed(p_AB=(0, s * (INNER[1] / 2 + 0.0188), 0.08)) for s in (-1, 1))
    return [
        Part(merge([shell, *ribs, *grips]), PLASTIC_BLUE),
        Part(merge(holes), Material("shadow", (0.02, 0.03, 0.045, 1.0), roughness=0.9)),
        Part(cards, Material("card", (0.85, 0.85, 0.82, 1.0), roughness=0.8)),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "bin.gltf", visual_parts())
    write_atomic(folder / "bin.sdf", sdf_text(made))
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
