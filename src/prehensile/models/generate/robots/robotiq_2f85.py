"""Robotiq 2F-85, an adaptive gripper: its fingers are linkages with fewer motors than freedoms.

Each finger is a loop of five hinges A to E (see `_robotiq_2f85_shape`): base, outer knuckle, outer
finger, inner finger and inner knuckle. The tree is cut at E, where a pin closes it. The motor
turns the outer knuckles; a spring holds each outer finger against a stop on its knuckle. While it
lies there, A, C, E, D is a parallelogram and the pads stay parallel. When the inner knuckle is held
up by an object, or the pad is pushed below the point where the lines B C and D E cross, the outer
finger leaves its stop and the tip bends round the object.

Frame ``robotiq_base_link``: at the face of the coupling, z to the finger tips, x along the
closing direction. Every joint is at 0 when the gripper is open; positive motion of ``finger_joint``
closes.
"""

from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.robots import _robotiq_2f85_shape as shape
from prehensile.models.generate.robots._robotiq_2f85_shape import (
    BASE_RADIUS,
    FINGER,
    INNER,
    INSIDE,
    KNUCKLE,
    OUTSIDE,
    PAD_DEPTH,
    PAD_LENGTH,
    PAD_WIDTH,
    PAD_X,
    PAD_Z,
    A,
    B,
    C,
    D,
    E,
)
from prehensile.models.generate.sdf_model import (
    Collision,
    Contact,
    Frame,
    Inertial,
    Joint,
    Link,
    Model,
    Pin,
    Pose,
    Shape,
    Visual,
    sdf_text,
)
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import Part, write_gltf

CRANK = float(np.linalg.norm(C - A))  # m
OPEN = float(np.arctan2(*(C - A)[::-1]))  # rad, of A C against x, gripper open
CLOSED = float(np.arccos((-PAD_X - A[0]) / CRANK)) - OPEN  # rad, position where the pads meet
GRIP_FORCE = 235.0  # N
SPEED = 0.15  # m/s, of the opening
# What the published force and speed of the two fingers ask of the joint, the pads moving by at
# most the length of the crank for each radian.
EFFORT = round(2.0 * GRIP_FORCE * CRANK, 2)  # N m
VELOCITY = round(SPEED / (2.0 * CRANK), 3)  # rad/s
# Motor and spindle as the joint feels them, friction of the hinges, and the spring at the stop are
# estimates: the spring holds a pinch of 60 N parallel that is 2 mm below the crossing of B C and
# D E, and it holds the finger on its stop at twice the published speed.
DRIVE_INERTIA = 0.05  # kg m²
DRIVE_DAMPING = 2.0  # N m s/rad
HINGE_DAMPING = 0.02  # N m s/rad; with much less, links this light make contact soft in SAP
SPRING = (0.1, 1.5)  # N m/rad, rad

HOUSING = Contact(mu=0.4, relaxation_time=0.05)
METAL = Contact(mu=0.5, relaxation_time=0.02)
RUBBER = Contact(mu=1.0, hydroelastic="compliant", modulus=3e6, relaxation_time=0.005)


def _mirrored(inertial: Inertial, side: int) -> Inertial:
    """Mass properties of the link on the ``side`` of x, given those of the one at +x."""
    x, y, z = inertial.com
    ixx, iyy, izz, ixy, ixz, iyz = inertial.inertia
    return Inertial(inertial.mass, (side * x, y, z), (ixx, iyy, izz, ixy, side * ixz, iyz))


def _bar(name: str, start: np.ndarray, end: np.ndarray, radius: float, half: float, side: int):
    """A box along a bar of the linkage, in a frame at the bar's start."""
    x, z = end - start
    length = float(np.hypot(x, z)) + radius
    pose: Pose = (side * x / 2, 0.0, z / 2, 0.0, float(-np.arctan2(z, side * x)), 0.0)
    return Collision(name, Shape("box", (length, 2 * half, 2 * radius)), pose, METAL)


def _links(side: int, boxes_for_pads: bool) -> list[Link]:
    """The four links of the finger on the ``side`` (1 or -1) of x."""
    name = "left" if side > 0 else "right"
    if boxes_for_pads:
        size = Shape("box", (PAD_DEPTH, PAD_WIDTH, PAD_LENGTH))
        pad = Collision("pad", size, (side * (PAD_X + PAD_DEPTH / 2), 0, PAD_Z, 0, 0, 0), RUBBER)
    else:
        pad = Collision("pad", Shape("mesh", uri=f"{name}_pad.vtk"), contact=RUBBER)
    block = Shape("box", (0.0095, 2 * OUTSIDE - 0.002, PAD_LENGTH))
    cheek = Shape("box", (0.028, 2 * OUTSIDE, 0.015))
    tip = (
        Collision("block", block, (side * -0.0182, 0.0, PAD_Z, 0.0, 0.0, 0.0), METAL),
        Collision("cheek", cheek, (side * -0.0085, 0.0, 0.0035, 0.0, 0.0, 0.0), METAL),
        pad,
    )
    # Name, place of the frame, mass, centre of mass, moments (ixx iyy izz ixz), shapes.
    table = (
        ("outer_knuckle", A, 0.01384773208, (0.01213197, 0.0, -0.00058647),
         (3.5232e-7, 2.31944e-6, 2.23136e-6, 1.1744e-7),
         (_bar("bar", A, B, KNUCKLE, OUTSIDE, side),)),
        ("outer_finger", B, 0.04260376752, (0.00346899, 0.0, 0.01867121),
         (1.385792e-5, 1.183208e-5, 5.19672e-6, -2.17264e-6),
         (_bar("bar", B, C, FINGER, INSIDE, side),)),
        ("inner_finger", C, 0.04268588744, (-0.01456706, 0.0, 0.01649701),
         (1.048152e-5, 1.197888e-5, 4.22784e-6, 3.5232e-6), tip),
        ("inner_knuckle", D, 0.02969376448, (0.01897699, 0.0, 0.02247101),
         (9.57136e-6, 8.69056e-6, 8.19144e-6, -3.93424e-6),
         (_bar("bar", D, E, INNER, INSIDE, side),)),
    )  # fmt: skip
    links = []
    for link, (x, z), mass, com, (ixx, iyy, izz, ixz), collisions in table:
        inertial = Inertial(mass, com, (ixx, iyy, izz, 0.0, ixz, 0.0))
        links.append(
            Link(
                f"{name}_{link}",
                (side * x, 0.0, z, 0.0, 0.0, 0.0),
                _mirrored(inertial, side),
                (Visual("link", Shape("mesh", uri=f"{name}_{link}.gltf")),),
                collisions,
            )
        )
    return links


def _joints(side: int) -> list[Joint]:
    """The four hinges of a finger; positive positions turn it inwards."""
    name = "left" if side > 0 else "right"
    inwards = (0.0, float(-side), 0.0)
    return [
        Joint(
            "finger_joint" if side > 0 else "right_outer_knuckle_joint",
            "revolute",
            "robotiq_base_link",
            f"{name}_outer_knuckle",
            inwards,
            0.0,
            CLOSED,
            effort=EFFORT if side > 0 else 0.0,
            velocity=VELOCITY,
            damping=DRIVE_DAMPING if side > 0 else HINGE_DAMPING,
            gear_ratio=1.0 if side > 0 else None,
            rotor_inertia=DRIVE_INERTIA if side > 0 else None,
            mimic=None if side > 0 else ("finger_joint", 1.0, 0.0),
        ),
        Joint(
            f"{name}_outer_finger_joint",
            "revolute",
            f"{name}_outer_knuckle",
            f"{name}_outer_finger",
            inwards,
            -0.9,
            0.0,
            damping=HINGE_DAMPING,
            spring=SPRING,
        ),
        Joint(
            f"{name}_inner_finger_joint",
            "revolute",
            f"{name}_outer_finger",
            f"{name}_inner_finger",
            inwards,
            -0.9,
            0.9,
            damping=HINGE_DAMPING,
        ),
        Joint(
            f"{name}_inner_knuckle_joint",
            "revolute",
            "robotiq_base_link",
            f"{name}_inner_knuckle",
            inwards,
            -0.1,
            0.9,
            damping=HINGE_DAMPING,
        ),
    ]


def model(*, boxes_for_pads: bool = False) -> Model:
    """The gripper; with boxes for its pads if spheres are to be found for them."""
    cup = Shape("cylinder", (BASE_RADIUS, 0.044))
    neck = Shape("box", (0.076, 2 * INSIDE, 0.026))
    base = Link(
        "robotiq_base_link",
        inertial=Inertial(
            0.66320197,
            (0.0, 0.0, 0.03232288),
            (5.1617816e-4, 5.8802208e-4, 3.9462776e-4, 0.0, 0.0, 0.0),
        ),
        visuals=(Visual("housing", Shape("mesh", uri="base.gltf")),),
        collisions=(
            Collision("housing", cup, (0.0, 0.0, 0.022, 0.0, 0.0, 0.0), HOUSING),
            Collision("neck", neck, (0.0, 0.0, 0.055, 0.0, 0.0, 0.0), HOUSING),
        ),
    )
    links = [base, *_links(1, boxes_for_pads), *_links(-1, boxes_for_pads)]
    names = [link.name for link in links]
    pins, frames = [], []
    for name, side in (("left", 1), ("right", -1)):
        ends = [(side * x, 0.0, z) for x, z in np.round([E - C, E - D], 12)]
        pins.append(Pin(f"{name}_inner_finger", ends[0], f"{name}_inner_knuckle", ends[1]))
        middle = (side * PAD_X, 0.0, PAD_Z, 0.0, 0.0, 0.0)
        frames.append(Frame(f"{name}_pad", f"{name}_inner_finger", middle))
    pinch = A[1] + CRANK * np.sin(OPEN + CLOSED) + PAD_Z
    frames.append(Frame("grasp_frame", "robotiq_base_link", (0.0, 0.0, pinch, 0.0, 0.0, 0.0)))
    return Model(
        "robotiq_2f85",
        "Robotiq 2F-85. In the frame of robotiq_base_link, z points to the finger tips and x is"
        " the direction of closing; grasp_frame lies where the middles of the pads meet.",
        tuple(links),
        (*_joints(1), *_joints(-1)),
        tuple(frames),
        # The tips touch one another, everything else moves past its neighbours.
        tuple(tuple(n for n in names if n != f"{s}_inner_finger") for s in ("left", "right")),
        tuple(pins),
    )


def generate(folder: Path) -> None:
    """Writes the model."""
    write_gltf(folder / "base.gltf", shape.base_parts())
    made = {
        "outer_knuckle": shape.outer_knuckle_parts(),
        "outer_finger": shape.outer_finger_parts(),
        "inner_finger": shape.inner_finger_parts(),
        "inner_knuckle": shape.inner_knuckle_parts(),
    }
    for name, side in (("left", 1), ("right", -1)):
        for link, parts in made.items():
            if side < 0:
                parts = [Part(part.mesh.mirrored(0), part.material) for part in parts]
            write_gltf(folder / f"{name}_{link}.gltf", parts)
        write_atomic(folder / f"{name}_pad.vtk", shape.pad_volume(side))
    write_atomic(folder / "robotiq_2f85.sdf", sdf_text(model()))
    write_spheres(folder, cover_model(model(boxes_for_pads=True), bulge=0.014))
    write_description(
        folder,
        title="Robotiq 2F-85",
        category="hand",
        description=(
            "Adaptive gripper of two linkages; frame robotiq_base_link has z to the finger tips "
            "and x along the closing direction. One actuator, finger_joint (0 open, "
            f"{CLOSED:.4f} rad closed); the opening of parallel pads is "
            f"2 ({A[0] + PAD_X:.5f} + {CRANK:.5f} cos({OPEN:.5f} + finger_joint)) m, 0.085 m at "
            "most. Loops closed by ball constraints and the fingers coupled by drake:mimic: "
            "simulate with a SAP solver. The outer finger joints have a spring and a stop, so "
            "that the tips bend round what touches the inner knuckles. The pads are compliant "
            "hydroelastic, everything else is rigid."
        ),
        sources=[
            "Robotiq, 2F-85 and 2F-140 instruction manual: stroke, force, speed, length",
            "robotiq_description: hinges and mass properties; MuJoCo Menagerie: size of the pads",
            "Inertia of the drive, friction and spring are estimates",
        ],
    )
