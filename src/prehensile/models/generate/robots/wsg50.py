"""Schunk WSG 50, a parallel gripper, with finger tips of rubber.

Frame ``body``: y points from the palm to the finger tips, x is the direction of closing. Both
fingers are at 0 when the gripper is closed; the left one moves to negative, the right one to
positive positions, so that the opening is right minus left, up to 0.11 m. The pads meet in the
plane x = 0 when closed: the opening is the distance between them.
"""

from pathlib import Path

from prehensile.files import write_atomic
from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.robots._wsg50_shape import (
    BODY_SIZE,
    FINGER_TIP,
    FINGER_X,
    PAD_DEPTH,
    PAD_LENGTH,
    PAD_WIDTH,
    body_parts,
    finger_parts,
    pad_volume,
)
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
from prehensile.models.shapes import write_gltf

BODY_Y = -0.049133  # m, of the body in the frame of the model, as in the field's model
FINGER_Y = 0.028  # m, of the fingers in the frame of the model
TURN = 3.141592  # rad, of the left finger about y; the field's figure, to its last digit
STROKE = 0.055  # m, of each finger
EFFORT = 80.0  # N, of each finger


HOUSING = Contact(mu=0.4, relaxation_time=0.05)
RUBBER = Contact(mu=1.0, hydroelastic="compliant", modulus=2e6, relaxation_time=0.02)
STEEL = Contact(mu=0.6, relaxation_time=0.02)


def at(x: float, y: float, z: float = 0.0) -> Pose:
    """A pose without rotation."""
    return (round(x, 9), round(y, 9), round(z, 9), 0.0, 0.0, 0.0)


PAD = (Shape("mesh", uri="pad.vtk"), at(0.0, 0.0))
PAD_BOX = (
    Shape("box", (PAD_DEPTH, PAD_LENGTH, PAD_WIDTH)),
    at(-FINGER_X + PAD_DEPTH / 2, FINGER_TIP - PAD_LENGTH / 2),
)
STEM = (Shape("box", (0.011, 0.082, 0.02)), at(0.0015, 0.0))
FOOT = (Shape("box", (0.02, 0.03, 0.026)), at(0.004, -0.026))


def model(pad: tuple[Shape, Pose] = PAD) -> Model:
    """The gripper; ``pad`` is the shape of the pads that touches."""
    block = Shape("box", BODY_SIZE)
    body = Link(
        "body",
        at(0.0, BODY_Y),
        solids.body(0.988882, [(block, at(0.0, 0.0))]),
        (Visual("housing", Shape("mesh", uri="body.gltf")),),
        (Collision("housing", block, contact=HOUSING),),
    )
    inertial = solids.body(0.05, [STEM, FOOT])
    parts = (("stem", STEM, STEEL), ("foot", FOOT, STEEL), ("pad", pad, RUBBER))
    visuals = (Visual("finger", Shape("mesh", uri="finger.gltf")),)
    collisions = tuple(Collision(name, *part, contact) for name, part, contact in parts)
    left_pose = (-FINGER_X, FINGER_Y, 0.0, 0.0, TURN, 0.0)
    left = Link("left_finger", left_pose, inertial, visuals, collisions)
    right = Link("right_finger", at(FINGER_X, FINGER_Y), inertial, visuals, collisions)
    joints = (
        Joint(
            "left_finger_sliding_joint",
            "prismatic",
            "body",
            "left_finger",
            (-1, 0, 0),
            -STROKE,
            0.0,
            EFFORT,
        ),
        Joint(
            "right_finger_sliding_joint",
            "prismatic",
            "body",
            "right_finger",
            (1, 0, 0),
            0.0,
            STROKE,
            EFFORT,
        ),
    )
    middle_of_pads = FINGER_Y - BODY_Y + FINGER_TIP - PAD_LENGTH / 2
    return Model(
        "wsg50",
        "Schunk WSG 50. In the frame of body, y points to the finger tips and x is the direction"
        " of closing; grasp_frame lies between the pads.",
        (body, left, right),
        joints,
        (Frame("body_frame", "body"), Frame("grasp_frame", "body", at(0.0, middle_of_pads))),
        (("body", "left_finger", "right_finger"),),
    )


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "body.gltf", body_parts())
    write_gltf(folder / "finger.gltf", finger_parts())
    write_atomic(folder / "pad.vtk", pad_volume())
    write_atomic(folder / "wsg50.sdf", sdf_text(made))
    write_spheres(folder, cover_model(model(PAD_BOX), bulge=0.016))
    write_description(
        folder,
        title="Schunk WSG 50 with rubber finger tips",
        category="hand",
        description=(
            "Parallel gripper; frame body has y to the finger tips and x along the closing "
            "direction. Joints left_finger_sliding_joint (-0.055..0) and "
            "right_finger_sliding_joint (0..0.055 m); their difference is the distance between "
            "the pads. The pads are compliant hydroelastic, everything else is rigid."
        ),
        sources=[
            "Schunk, WSG 50 servo-electric 2-finger parallel gripper, operating manual",
            "Frames, joints and masses: figures of the Drake project's model; inertias from shape",
        ],
    )
