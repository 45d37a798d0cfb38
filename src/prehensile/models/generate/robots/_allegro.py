"""The Wonik Allegro hand, right and left: kinematics, limits, masses and collision shapes.

Frame ``hand_root``: at the wrist, z to the fingers, x out of the palm's inner side. Links 0 to 3
are the index finger, 4 to 7 the middle, 8 to 11 the ring finger, 12 to 15 the thumb. The first
joint of a finger spreads it, the other three bend it; the thumb's first joint sets it against the
fingers, its second turns it. The left hand is the right one seen in a mirror, and joint positions
mean the same on both.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.files import write_atomic
from prehensile.models.generate import solids
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.robots import _allegro_shape
from prehensile.models.generate.robots._allegro_shape import (
    DEPTH,
    MOUNT_AT,
    MOUNT_SIZE,
    PALM_SIZE,
    PALM_X,
    TIP_RADIUS,
    WIDTH,
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
from prehensile.models.shapes import Part, write_gltf

PALM_MASS = 0.4154  # kg
TIP_MASS = 0.0168  # kg, of the rubber tip
EFFORT = 0.7  # N m
VELOCITY = float(np.radians(60.0)) / 0.11  # rad/s
DAMPING = 0.015  # N m s/rad
GEAR_RATIO = 369.0
# Of the motor, which is 1 cm wide. Nobody publishes it; with this much 0.7 N m bring a joint to
# its full speed in a fiftieth of a second, as the hand does.
ROTOR_INERTIA = 1e-8  # kg m²

HOUSING = Contact(mu=0.5, relaxation_time=0.05)
RUBBER = Contact(
    mu=1.0, hydroelastic="compliant", modulus=1e6, resolution=0.006, relaxation_time=0.02
)

_MIRROR = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Segment:
    """A joint and the link that it carries.

    Attributes:
        X_PL: pose of the link in the one before it, the joint at zero.
        axis: of the joint, in the frame of the link.
        limits: of the joint, rad.
        mass: of the link without its rubber tip, kg.
        length: to the next joint, or to the middle of the round tip, m.
        visual: name of the mesh.
        tip: whether the link ends in a tip.
    """

    X_PL: RigidTransform
    axis: tuple[int, int, int]
    limits: tuple[float, float]
    mass: float
    length: float
    visual: str
    tip: bool = False


def _along_z(length: float) -> RigidTransform:
    return RigidTransform([0.0, 0.0, length])


def _finger(y: float, z: float, roll: float) -> list[Segment]:
    """A finger whose root lies at y, z of the palm and leans by ``roll``."""
    X_RL = RigidTransform(RollPitchYaw(roll, 0.0, 0.0), [0.0, y, z])
    bend = (0, 1, 0)
    return [
        Segment(X_RL, (0, 0, 1), (-0.47, 0.47), 0.0119, 0.0164, "knuckle"),
        Segment(_along_z(0.0164), bend, (-0.196, 1.61), 0.065, 0.054, "proximal"),
        Segment(_along_z(0.054), bend, (-0.174, 1.709), 0.0355, 0.0384, "medial"),
        Segment(_along_z(0.0384), bend, (-0.227, 1.618), 0.0096, 0.0267, "distal", tip=True),
    ]


def _thumb() -> list[Segment]:
    R_RL = RollPitchYaw(np.pi, np.radians(-85.0), np.pi / 2)
    X_RL = RigidTransform(R_RL, [-0.0182, 0.019333, 0.049013])
    return [
        Segment(X_RL, (-1, 0, 0), (0.263, 1.396), 0.0176, 0.0, "thumb_mount"),
        Segment(
            RigidTransform([-0.027, 0.005, 0.0399]),
            (0, 0, 1),
            (-0.105, 1.163),
            0.0119,
            0.0177,
            "thumb_knuckle",
        ),
        Segment(_along_z(0.0177), (0, 1, 0), (-0.189, 1.644), 0.038, 0.0514, "thumb_proximal"),
        Segment(
            _along_z(0.0514), (0, 1, 0), (-0.162, 1.719), 0.0388, 0.0423, "thumb_distal", tip=True
        ),
    ]


LEAN = float(np.radians(5.0))  # rad, of the outer fingers
SEGMENTS: tuple[Segment, ...] = (
    *_finger(0.0435, 0.093458, -LEAN),
    *_finger(0.0, 0.0957, 0.0),
    *_finger(-0.0435, 0.093458, LEAN),
    *_thumb(),
)
"""The right hand's sixteen, in the order of their numbers."""


def mirrored(X: RigidTransform) -> RigidTransform:
    """The pose as seen in a mirror in the plane y = 0, mirrored frames being right-handed."""
    R = RotationMatrix(_MIRROR @ X.rotation().matrix() @ _MIRROR)
    return RigidTransform(R, _MIRROR @ X.translation())


def _pose(X: RigidTransform) -> Pose:
    rpy = RollPitchYaw(X.rotation()).vector()
    x, y, z, roll, pitch, yaw = (round(float(v), 12) for v in (*X.translation(), *rpy))
    return (x, y, z, roll, pitch, yaw)


def _shapes(segment: Segment, side: int) -> list[tuple[str, Shape, Pose, Contact]]:
    """Name, shape, pose and surface of what touches."""
    if segment.visual == "thumb_mount":
        x, y, z = MOUNT_AT
        return [("mount", Shape("box", MOUNT_SIZE), (x, side * y, z, 0.0, 0.0, 0.0), HOUSING)]
    tube = 0.011 if segment.tip else 0.0  # m, of the tip, below its round end
    height = round(segment.length - tube, 9)
    box = Shape("box", (DEPTH, WIDTH, height))
    found = [("box", box, (0.0, 0.0, height / 2, 0.0, 0.0, 0.0), HOUSING)]
    if segment.tip:
        tip = Shape("capsule", (TIP_RADIUS, tube))
        found.append(("tip", tip, (0.0, 0.0, segment.length - tube / 2, 0.0, 0.0, 0.0), RUBBER))
    return found


def _inertial(segment: Segment, side: int) -> Inertial:
    box, *tip = _shapes(segment, side)
    parts = [solids.body(segment.mass, [box[1:3]])]
    return solids.assembly([*parts, *(solids.body(TIP_MASS, [t[1:3]]) for t in tip)])


def model(name: str, side: int) -> Model:
    """The hand; ``side`` is 1 for the right and -1 for the left one."""
    box = Shape("box", PALM_SIZE)
    at = (PALM_X, 0.0, PALM_SIZE[2] / 2, 0.0, 0.0, 0.0)
    links = [
        Link(
            "hand_root",
            inertial=solids.body(PALM_MASS, [(box, at)]),
            visuals=(Visual("palm", Shape("mesh", uri="palm.gltf")),),
            collisions=(Collision("palm", box, at, HOUSING),),
        )
    ]
    joints, frames, apart = [], [], []
    X_RL = RigidTransform()
    for i, segment in enumerate(SEGMENTS):
        first = i % 4 == 0
        X_RL = segment.X_PL if first else X_RL @ segment.X_PL
        shapes = _shapes(segment, side)
        links.append(
            Link(
                f"link_{i}",
                _pose(X_RL if side > 0 else mirrored(X_RL)),
                _inertial(segment, side),
                (Visual("link", Shape("mesh", uri=f"{segment.visual}.gltf")),),
                tuple(Collision(*shape) for shape in shapes),
            )
        )
        ax, ay, az = segment.axis
        joints.append(
            Joint(
                f"joint_{i}",
                "revolute",
                "hand_root" if first else f"link_{i - 1}",
                f"link_{i}",
                # The axis of a turn is mirrored the other way round.
                (float(side * ax), float(ay), float(side * az)),
                *segment.limits,
                EFFORT,
                VELOCITY,
                damping=DAMPING,
                gear_ratio=GEAR_RATIO,
                rotor_inertia=ROTOR_INERTIA,
            )
        )
        if first:
            apart.append(("hand_root", f"link_{i}", f"link_{i + 1}"))
            apart.append((f"link_{i}", f"link_{i + 1}", f"link_{i + 2}"))
        if segment.tip:
            end = (0.0, 0.0, segment.length, 0.0, 0.0, 0.0)
            frames.append(Frame(f"link_{i}_tip", f"link_{i}", end))
    hand = "Right" if side > 0 else "Left"
    return Model(
        name,
        f"{hand} Allegro hand. In the frame of hand_root, z points to the fingers and x out of the"
        " palm; link_3_tip, link_7_tip, link_11_tip and link_15_tip lie in the round finger tips.",
        tuple(links),
        tuple(joints),
        tuple(frames),
        tuple(apart),
    )


def _meshes(side: int) -> dict[str, list[Part]]:
    roots = [SEGMENTS[i].X_PL for i in (0, 4, 8)]
    meshes = {
        "palm": _allegro_shape.palm([(X.rotation().matrix(), X.translation()) for X in roots])
    }
    for segment in SEGMENTS:
        if segment.visual == "thumb_mount":
            parts = _allegro_shape.thumb_mount()
            if side < 0:
                parts = [Part(part.mesh.mirrored(1), part.material) for part in parts]
        elif segment.tip:
            parts = _allegro_shape.fingertip(segment.length)
        elif segment.axis[2]:
            parts = _allegro_shape.knuckle(segment.length)
        else:
            parts = _allegro_shape.phalanx(segment.length)
        meshes[segment.visual] = parts
    return meshes


def generate(folder: Path, side: int) -> None:
    """Writes the hand of a side (1 right, -1 left) into a folder of the model's name."""
    name, hand = folder.name, "right" if side > 0 else "left"
    made = model(name, side)
    for mesh, parts in _meshes(side).items():
        write_gltf(folder / f"{mesh}.gltf", parts)
    write_atomic(folder / f"{name}.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.013))
    write_description(
        folder,
        title=f"Wonik Allegro hand, {hand}",
        category="hand",
        description=(
            "Sixteen joints joint_0..15: index finger 0..3, middle 4..7, ring 8..11, thumb "
            "12..15; links link_0..15 on hand_root, whose z points to the fingers and x out of "
            "the palm. Frames link_3_tip, link_7_tip, link_11_tip, link_15_tip. The rubber tips "
            "are compliant hydroelastic. Zero lies outside the limits of joint_12 (0.263..1.396)."
        ),
        sources=[
            "Wonik Robotics, Allegro Hand user's manual: torque, speed, gear ratio",
            "Frames, limits, masses and damping: figures of the Drake project's model and of "
            "allegro_hand_ros; centres of mass and inertias from shape",
            "The inertia of the rotors is an estimate",
        ],
    )
