"""The hand of the Franka Emika Panda, a parallel gripper.

Frame ``panda_hand``: z points from the flange to the finger tips, y is the direction of closing.
Each finger is at 0 when the hand is closed and moves out to 0.04 m, the left one to +y, the right
one to -y. One motor drives both over a belt: the second joint follows the first.
"""

from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.robots._panda_hand_shape import (
    BODY_SIZE,
    BODY_Z,
    FLANGE_RADIUS,
    PAD_LENGTH,
    PAD_WIDTH,
    PAD_Z,
    finger_parts,
    hand_parts,
    pad_volume,
)
from prehensile.models.generate.sdf_model import (
    Collision,
    Contact,
    Frame,
    Inertial,
    Joint,
    Link,
    Model,
    Pose,
    Shape,
    Visual,
    sdf_text,
)
from prehensile.models.generate.sphere_cover import cover_model
from prehensile.models.shapes import write_gltf

FINGER_Z = 0.0584  # m, of the fingers' frames in the hand's
TCP_Z = 0.1034  # m, of the middle between the pads
STROKE = 0.04  # m, of each finger
EFFORT = 70.0  # N, of each finger without a break (140 N for a moment)
VELOCITY = 0.2  # m/s
FINGER_MASS = 0.015  # kg
# Motor, gears and belt as each finger feels them. Nobody publishes it; with this much the hand's
# force accelerates a finger by 7 g, and sampled control holds it still.
DRIVE_MASS = 1.0  # kg

PLASTIC = Contact(mu=0.4, relaxation_time=0.05)
METAL = Contact(mu=0.6, relaxation_time=0.02)
RUBBER = Contact(mu=1.0, hydroelastic="compliant", modulus=3e6, relaxation_time=0.01)


def model(*, boxes_for_pads: bool = False) -> Model:
    """The hand; with boxes for its pads if spheres are to be found for them."""
    block = Shape("box", BODY_SIZE)
    flange = Shape("cylinder", (FLANGE_RADIUS, 0.013))
    hand = Link(
        "panda_hand",
        inertial=Inertial(
            0.73,
            (0.0, 0.0015244, 0.0275912),
            (0.00278560230025, 0.000400033405336, 0.00256378041832, 0.0, 0.0, 0.0),
        ),
        visuals=(Visual("housing", Shape("mesh", uri="hand.gltf")),),
        collisions=(
            Collision("housing", block, (0.0, 0.0, BODY_Z, 0.0, 0.0, 0.0), PLASTIC),
            Collision("flange", flange, (0.0, 0.0, 0.005, 0.0, 0.0, 0.0), METAL),
        ),
    )
    fingers = tuple(_finger(side, boxes_for_pads) for side in (1, -1))
    joints = tuple(
        Joint(
            f"panda_finger_joint{i + 1}",
            "prismatic",
            "panda_hand",
            finger.name,
            (0.0, (1.0, -1.0)[i], 0.0),
            0.0,
            STROKE,
            EFFORT,
            VELOCITY,
            gear_ratio=1.0,
            rotor_inertia=DRIVE_MASS,
            mimic=("panda_finger_joint1", 1.0, 0.0) if i else None,
        )
        for i, finger in enumerate(fingers)
    )
    return Model(
        "panda_hand",
        "Hand of the Franka Emika Panda. In the frame of panda_hand, z points to the finger tips"
        " and y is the direction of closing; panda_hand_tcp lies between the pads.",
        (hand, *fingers),
        joints,
        (Frame("panda_hand_tcp", "panda_hand", (0.0, 0.0, TCP_Z, 0.0, 0.0, 0.0)),),
        (("panda_hand", "panda_leftfinger", "panda_rightfinger"),),
    )


def _finger(side: int, boxes_for_pads: bool) -> Link:
    """The finger on the ``side`` (1 or -1) of y; it has the hand's axes."""
    name = "left" if side > 0 else "right"

    def at(y: float, z: float, roll: float = 0.0) -> Pose:
        return (0.0, side * y, z, side * roll, 0.0, 0.0)

    carriage = (Shape("box", (0.021, 0.015, 0.0205)), at(0.0186, 0.0104))
    stem = (Shape("box", (0.0185, 0.0075, 0.0235)), at(0.0159, 0.02835, np.pi / 6))
    tip = (Shape("box", (0.0175, 0.0102, PAD_LENGTH)), at(0.0091, PAD_Z))
    if boxes_for_pads:
        pad = (Shape("box", (PAD_WIDTH, 0.004, PAD_LENGTH)), at(0.002, PAD_Z))
    else:
        pad = (Shape("mesh", uri=f"{name}_pad.vtk"), at(0.0, 0.0))
    solid = (("carriage", carriage), ("stem", stem), ("tip", tip))
    collisions = [Collision(part, *posed, METAL) for part, posed in solid]
    return Link(
        f"panda_{name}finger",
        (0.0, 0.0, FINGER_Z, 0.0, 0.0, 0.0),
        solids.body(FINGER_MASS, [posed for _, posed in solid]),
        (Visual("finger", Shape("mesh", uri=f"{name}_finger.gltf")),),
        (*collisions, Collision("pad", *pad, RUBBER)),
    )


def generate(folder: Path) -> None:
    """Writes the model."""
    write_gltf(folder / "hand.gltf", hand_parts())
    for name, side in (("left", 1), ("right", -1)):
        write_gltf(folder / f"{name}_finger.gltf", finger_parts(side))
        write_atomic(folder / f"{name}_pad.vtk", pad_volume(side))
    write_atomic(folder / "panda_hand.sdf", sdf_text(model()))
    write_spheres(folder, cover_model(model(boxes_for_pads=True), bulge=0.014))
    write_description(
        folder,
        title="Franka Emika hand",
        category="hand",
        description=(
            "Parallel gripper of the Panda; frame panda_hand has z to the finger tips and y along "
            "the closing direction, panda_hand_tcp lies between the pads. Joints "
            "panda_finger_joint1 and panda_finger_joint2 (0..0.04 m each); the opening is their "
            "sum. The second follows the first (drake:mimic, in discrete plants). On the Panda it "
            "is welded to panda_link8, turned by -45 degrees about z. The pads are compliant "
            "hydroelastic, everything else is rigid."
        ),
        sources=[
            "Franka Emika GmbH, Panda data sheet and hand manual: travel, grasping force, mass",
            "franka_description: frames, joints, limits; mass properties of the hand as in the "
            "Drake project's model; those of the fingers from shape",
            "The inertia of the drive is an estimate",
        ],
    )
