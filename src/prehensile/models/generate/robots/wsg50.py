"""Schunk WSG 50, a parallel gripper, with finger tips of rubber.

Frame ``body``: y points from the palm to the finger tips, x is the direction of closing. Both
fingers are at 0 when the gripper is closed; the left one moves to negative, the right one to
positive positions, so that the opening is right minus left, up to 0.11 m. The pads meet in the
plane x = 0 when closed: the opening is the distance between them.
"""

from pathlib import Path

from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres, write_text
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
    Mesh,
    Part,
    cylinder,
    extrude,
    lathe,
    merge,
    rounded_box,
    write_gltf,
)

BODY_SIZE = (0.146, 0.0725, 0.05)
BODY_Y = -0.049133  # m, of the body in the frame of the model, as in the field's model
FINGER_X, FINGER_Y = 0.0115, 0.028  # m, of the fingers in the frame of the model
TURN = 3.141592  # rad, of the left finger about y; the field's figure, to its last digit
STROKE = 0.055  # m, of each finger
EFFORT = 80.0  # N, of each finger

PAD_LENGTH, PAD_WIDTH = 0.032, 0.022  # m, along y and z
PAD_DEPTH = 0.0075  # m, along x; its face is in the plane where the two fingers meet
FINGER_TIP = 0.041  # m, y of the end of the finger in its frame

ANTHRACITE = Material("anthracite", (0.075, 0.08, 0.088, 1.0), roughness=0.5)
ALUMINIUM = Material("aluminium", (0.62, 0.63, 0.65, 1.0), roughness=0.45)
STEEL_BRIGHT = Material("steel", (0.42, 0.43, 0.45, 1.0), roughness=0.35)
BLACK = Material("black", (0.02, 0.02, 0.022, 1.0), roughness=0.8)
GREEN = Material("lamp", (0.1, 0.8, 0.2, 1.0), roughness=0.4)

HOUSING = Contact(mu=0.4, relaxation_time=0.05)
RUBBER = Contact(mu=1.0, hydroelastic="compliant", modulus=2e6, relaxation_time=0.02)
STEEL = Contact(mu=0.6, relaxation_time=0.02)


def at(x: float, y: float, z: float = 0.0) -> Pose:
    """A pose without rotation."""
    return (round(x, 9), round(y, 9), round(z, 9), 0.0, 0.0, 0.0)


PAD = (
    Shape("box", (PAD_DEPTH, PAD_LENGTH, PAD_WIDTH)),
    at(-FINGER_X + PAD_DEPTH / 2, FINGER_TIP - PAD_LENGTH / 2),
)
STEM = (Shape("box", (0.011, 0.082, 0.02)), at(0.0015, 0.0))
FOOT = (Shape("box", (0.02, 0.03, 0.026)), at(0.004, -0.026))


def model() -> Model:
    """The gripper."""
    block = Shape("box", BODY_SIZE)
    body = Link(
        "body",
        at(0.0, BODY_Y),
        solids.body(0.988882, [(block, at(0.0, 0.0))]),
        (Visual("housing", Shape("mesh", uri="body.gltf")),),
        (Collision("housing", block, contact=HOUSING),),
    )
    inertial = solids.body(0.05, [STEM, FOOT])
    parts = (("stem", STEM, STEEL), ("foot", FOOT, STEEL), ("pad", PAD, RUBBER))
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


def body_parts() -> list[Part]:
    """The housing, the guides of the fingers in its front, and the flange behind."""
    x, y, z = BODY_SIZE
    core = rounded_box((x, y - 0.012, z), 0.005).transformed(p_AB=(0, -0.006, 0))
    front = rounded_box((x - 0.004, 0.013, z - 0.004), 0.002).transformed(
        p_AB=(0, y / 2 - 0.0065, 0)
    )
    slot = rounded_box((x - 0.012, 0.002, 0.030), 0.0008).transformed(p_AB=(0, y / 2 - 0.0009, 0))
    rails = merge(
        rounded_box((x - 0.014, 0.003, 0.004), 0.001).transformed(p_AB=(0, y / 2 - 0.0012, side))
        for side in (-0.0095, 0.0095)
    )
    to_y = ((1, 0, 0), (0, 0, 1), (0, -1, 0))  # turns z to y
    # From the face of the arm's flange to the housing: 90 mm less the flange's 45 mm.
    neck = lathe([(0.0, -0.045), (0.036, -0.045), (0.0375, -0.0435), (0.0375, -0.0395),
                  (0.031, -0.0385), (0.031, -0.030), (0.0, -0.030)], 56)  # fmt: skip
    neck = neck.transformed(to_y)
    plug = cylinder(0.007, 0.014, 24, rounding=0.001).transformed(
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)), (x / 2 + 0.004, -0.018, 0.0)
    )
    label = rounded_box((0.05, 0.014, 0.0006), 0.0002, 2)
    labels = merge(label.transformed(p_AB=(-0.032, -0.012, side * z / 2)) for side in (-1, 1))
    lamp = cylinder(0.0022, 0.0012, 16).transformed(p_AB=(0.058, -0.018, z / 2))
    return [
        Part(core, ANTHRACITE),
        Part(merge([front, neck]), ALUMINIUM),
        Part(merge([slot, plug]), BLACK),
        Part(rails, STEEL_BRIGHT),
        Part(labels, ALUMINIUM),
        Part(lamp, GREEN),
    ]


def finger_parts() -> list[Part]:
    """A finger: the jaw on its guide, the stem, and the ribbed pad of rubber."""
    inner, tip = -0.004, FINGER_TIP
    outline = [(-0.006, -0.041), (0.014, -0.041), (0.014, -0.0135), (0.0135, -0.0115),
               (0.0085, 0.001), (0.0075, 0.004), (0.0066, tip - 0.006), (0.0056, tip - 0.0025),
               (0.0035, tip - 0.0005), (0.0015, tip), (inner, tip), (inner, -0.008),
               (-0.0045, -0.0105), (-0.006, -0.012)]  # fmt: skip
    stem = extrude(outline, 0.019, bevel=0.0012).transformed(p_AB=(0, 0, -0.0095))
    jaw = rounded_box((0.021, 0.029, 0.026), 0.002).transformed(p_AB=(0.004, -0.0262, 0))
    back = rounded_box((0.005, PAD_LENGTH, PAD_WIDTH), 0.0015).transformed(
        p_AB=(inner - 0.0025, tip - PAD_LENGTH / 2, 0)
    )
    count, face = 8, -FINGER_X
    pitch = PAD_LENGTH / count
    rib = rounded_box((0.004, 0.72 * pitch, PAD_WIDTH), 0.0007)
    ribs: list[Mesh] = [
        rib.transformed(p_AB=(face + 0.002, tip - (i + 0.5) * pitch, 0)) for i in range(count)
    ]
    screw = cylinder(0.0028, 0.001, 20).transformed(((0, 0, 1), (0, 1, 0), (-1, 0, 0)))
    screws = merge(screw.transformed(p_AB=(0.0145, y, 0)) for y in (-0.034, -0.0195))
    return [
        Part(jaw, ALUMINIUM),
        Part(stem, STEEL_BRIGHT),
        Part(merge([back, *ribs]), BLACK),
        Part(screws, ANTHRACITE),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    made = model()
    write_gltf(folder / "body.gltf", body_parts())
    write_gltf(folder / "finger.gltf", finger_parts())
    write_text(folder / "wsg50.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.016))
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
