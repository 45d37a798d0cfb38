"""A cupboard with two hinged doors; z = 0 of ``base_link`` is its underside, the front is +x.

The frames of the doors lie on their hinges, z up, the door itself along y. Positive angles open
both doors.
"""

from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.furniture import _carcass
from prehensile.models.generate.furniture._parts import Block, link
from prehensile.models.generate.sdf_model import (
    Collision,
    Contact,
    Frame,
    Joint,
    Link,
    Model,
    Pose,
    Shape,
    Visual,
    sdf_text,
)
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import (
    Material,
    Part,
    circle,
    cylinder,
    merge,
    rounded_box,
    sweep,
    write_gltf,
)

GAP = 0.003  # m, between the doors, and between them and the carcass
DOOR = 0.018  # m, thickness of the doors
HINGE_X = _carcass.DEPTH / 2 + GAP + DOOR / 2  # m, the axes lie in the middle of the doors
HINGE_Y = _carcass.WIDTH / 2 - DOOR / 2  # m
DOOR_WIDTH = HINGE_Y - GAP / 2  # m, from the hinge to the free edge
DOOR_MASS = 1.6  # kg
OPEN = 2.0  # rad
DAMPING = 0.3  # N m s/rad: a push of 3 N at the handle keeps the door going at about 2.4 rad/s

BAR, BAR_LENGTH = 0.006, 0.16  # m, radius and straight length of the handle
STAND_OFF = 0.045  # m, from the front of the door to the middle of the bar
HANDLE_Y = DOOR_WIDTH - 0.045  # m, from the hinge
HANDLE_Z = _carcass.HEIGHT / 2  # m

PAINT = Material("paint", (0.60, 0.66, 0.65, 1.0), roughness=0.55)
STEEL_GREY = Material("steel", (0.30, 0.31, 0.33, 1.0), roughness=0.4)
STEEL = Contact(mu=0.7, hydroelastic="rigid", resolution=0.004, relaxation_time=0.02)


def door(name: str, side: int) -> Link:
    """A door; ``side`` is 1 where the hinge is on the left of the carcass (+y), else -1."""
    ys = sorted((side * DOOR / 2, -side * DOOR_WIDTH))
    slab = Block("slab", (-DOOR / 2, ys[0], GAP), (DOOR / 2, ys[1], _carcass.HEIGHT - GAP))
    x, y = DOOR / 2 + STAND_OFF, -side * HANDLE_Y
    bar = (Shape("capsule", (BAR, BAR_LENGTH)), (x, y, HANDLE_Z, 0.0, 0.0, 0.0))
    posts = [
        (
            Shape("box", (STAND_OFF, 1.6 * BAR, 1.6 * BAR)),
            (DOOR / 2 + STAND_OFF / 2, y, HANDLE_Z + s * 0.42 * BAR_LENGTH, 0.0, 0.0, 0.0),
        )
        for s in (-1, 1)
    ]
    handle = [("handle", bar), ("post_low", posts[0]), ("post_high", posts[1])]
    pose: Pose = (HINGE_X, side * HINGE_Y, 0.0, 0.0, 0.0, 0.0)
    return Link(
        name,
        pose,
        solids.body(DOOR_MASS, [(slab.shape, slab.pose)]),
        (Visual("door", Shape("mesh", uri=f"{name}.gltf")),),
        (
            Collision("slab", slab.shape, slab.pose, _carcass.WOOD),
            *(Collision(n, *part, STEEL) for n, part in handle),
        ),
    )


def model() -> Model:
    """The cupboard."""
    parts = _carcass.blocks()
    visuals = (Visual("carcass", Shape("mesh", uri="carcass.gltf")),)
    body = link("base_link", _carcass.MASS, parts, _carcass.WOOD, visuals, _carcass.feet())
    # Left and right as seen by one who stands before the cupboard and looks at it.
    left, right = door("left_door", -1), door("right_door", 1)
    joints = tuple(
        Joint(
            f"{d.name}_hinge",
            "revolute",
            "base_link",
            d.name,
            (0, 0, z),
            0.0,
            OPEN,
            damping=DAMPING,
        )
        for d, z in ((left, -1), (right, 1))
    )
    frames = tuple(
        Frame(f"{d.name}_handle", d.name, (DOOR / 2 + STAND_OFF, y, HANDLE_Z, 0.0, 0.0, 0.0))
        for d, y in ((left, HANDLE_Y), (right, -HANDLE_Y))
    )
    comment = (
        "A cupboard with two doors. The origin is the middle of the underside, z up, doors to the"
        " front, +x; positive angles open the doors."
    )
    return Model("cupboard", comment, (body, left, right), joints, frames)


def door_parts(side: int) -> list[Part]:
    """A painted door with a bow handle and two hinges; ``side`` as in ``door``."""
    height = _carcass.HEIGHT - 2 * GAP
    width = DOOR_WIDTH + DOOR / 2
    middle = -side * (width / 2 - DOOR / 2)
    slab = rounded_box((DOOR, width, height), 0.003).transformed(p_AB=(0, middle, HANDLE_Z))
    field = rounded_box((0.004, width - 0.1, height - 0.1), 0.0018, 2)
    field = field.transformed(p_AB=(DOOR / 2 - 0.0005, middle, HANDLE_Z))
    # The bow: out, up and back, with rounded corners.
    reach, half, bend = STAND_OFF, BAR_LENGTH / 2, 0.016
    turn = np.linspace(0.0, np.pi / 2, 6)
    corner = np.column_stack([reach - bend * (1 - np.sin(turn)), -half + bend * (1 - np.cos(turn))])
    path = np.concatenate([[[-0.002, -half]], corner, (corner * [1, -1])[::-1], [[-0.002, half]]])
    y = -side * HANDLE_Y
    points = np.column_stack([DOOR / 2 + path[:, 0], np.full(len(path), y), HANDLE_Z + path[:, 1]])
    bow = sweep(points, circle(BAR, 16), up=(0.0, 1.0, 0.0), crease=np.pi)
    roses = [
        cylinder(0.011, 0.003, 24).transformed(
            ((0, 0, 1), (1, 0, 0), (0, 1, 0)), (DOOR / 2 + 0.0015, y, HANDLE_Z + s * half)
        )
        for s in (-1, 1)
    ]
    hinges = [
        cylinder(DOOR / 2 + 0.0008, 0.05, 20).transformed(p_AB=(0, 0, z))
        for z in (0.12, _carcass.HEIGHT - 0.12)
    ]
    return [
        Part(merge([slab, field]), PAINT),
        Part(merge([bow, *roses, *hinges]), STEEL_GREY),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "carcass.gltf", _carcass.visual_parts())
    write_gltf(folder / "left_door.gltf", door_parts(-1))
    write_gltf(folder / "right_door.gltf", door_parts(1))
    write_atomic(folder / "cupboard.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.035))
    heights = ", ".join(f"{z:g}" for z in _carcass.floors())
    write_description(
        folder,
        title="Cupboard with two hinged doors",
        category="furniture",
        description=(
            f"{_carcass.WIDTH:g} x {_carcass.DEPTH:g} x {_carcass.HEIGHT:g} m; base_link in the "
            f"middle of the underside, things stand at z = {heights} m. Joints left_door_hinge and "
            f"right_door_hinge (0 closed to {OPEN:g} rad), frames left_door_handle and "
            "right_door_handle in the middle of the bars."
        ),
        sources=["Dimensions of our own, those of a common wall cupboard"],
    )
