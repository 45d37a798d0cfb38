"""The KUKA LBR iiwa family: kinematics, limits, inertias and collision shapes.

Frames: link i turns about the z axis of its own frame. In the home pose the arm stands straight
up; then z of links 1, 3, 5, 7 points up, z of link 2 and 6 along +y and of link 4 along -y of the
base. All frames of even links lie where the axes of shoulder, elbow and wrist cross.

Every link but the first and the last is a bent tube that ends in a drum: the drum of one link
turns against the drum of the next, side by side, on the axis between them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
from prehensile.models.generate.robots import _iiwa_shape
from prehensile.models.generate.sdf_model import (
    IDENTITY,
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

METAL = Contact(mu=0.4, relaxation_time=0.05)


@dataclass(frozen=True)
class Axis:
    """A joint and the link that it carries.

    Attributes:
        pose: of the link in the frame of the base, all joints at zero.
        direction: of the axis, in the frame of the base, all joints at zero.
        limit: the joint turns between -limit and limit, rad.
        effort: N m.
        velocity: rad/s.
        acceleration: rad/s².
        gear_ratio: turns of the motor for one of the joint.
        rotor_inertia: of the motor, kg m².
        inertial: of the link.
    """

    pose: Pose
    direction: tuple[float, float, float]
    limit: float
    effort: float
    velocity: float
    acceleration: float
    gear_ratio: float
    rotor_inertia: float
    inertial: Inertial


@dataclass(frozen=True)
class Arm:
    """One member of the family.

    Attributes:
        name: of the model.
        title: for people.
        payload: kg.
        reach: from the shoulder to the wrist and flange, m.
        base: mass properties of link 0.
        axes: the seven joints, from the base.
        drum: radius of the drums on joint 2 and on joint 4, m.
        flange: height of the flange's face above the frame of link 7, m.
    """

    name: str
    title: str
    payload: float
    reach: float
    base: Inertial
    axes: tuple[Axis, ...]
    drum: tuple[float, float]
    flange: float


def diagonal(
    mass: float, com: tuple[float, float, float], moments: tuple[float, float, float]
) -> Inertial:
    """Mass properties with principal axes along the link's frame."""
    return Inertial(mass, com, (*moments, 0.0, 0.0, 0.0))


def capsule(name: str, radius: float, start: Sequence[float], end: Sequence[float]) -> Collision:
    """A capsule between two points in the plane x = 0 of a link."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = b - a
    length = float(np.linalg.norm(along))
    roll = float(np.arctan2(-along[1], along[2]))
    pose = (*np.round(0.5 * (a + b), 9), round(roll, 9), 0.0, 0.0)
    return Collision(name, Shape("capsule", (radius, round(length, 9))), pose, METAL)


def collisions(arm: Arm) -> list[tuple[Collision, ...]]:
    """The collision shapes of links 0 to 7."""
    shoulder, elbow = arm.drum
    rise = [arm.axes[i + 1].pose[2] - arm.axes[i].pose[2] for i in range(6)]
    foot = Collision(
        "foot",
        Shape("cylinder", (0.093 if shoulder < 0.08 else 0.11, 0.1575)),
        (0.0, 0.0, 0.07875, 0.0, 0.0, 0.0),
        METAL,
    )
    depth = 0.113 if shoulder < 0.08 else 0.136
    plug = Collision(
        "plug",
        Shape("box", (depth - 0.03, 0.13, 0.13)),
        (-0.5 * (depth + 0.03), 0.0, 0.065, 0.0, 0.0, 0.0),
        METAL,
    )

    # The tubes run on into the links that they turn against, where their round ends are hidden.
    def rising(drum: float, height: float, side: float) -> tuple[Collision, ...]:
        """An odd link: tube up from its own axis, drum on the next axis, off to one side."""
        off = side * (_iiwa_shape.reach(drum, even=False) - drum)
        return (
            capsule("tube", drum, (0.0, 0.0, 0.03), (0.0, off, height - 0.01)),
            capsule("drum", drum - 0.004, (0.0, off, height), (0.0, 0.0, height)),
        )

    def standing(drum: float, tube: float, length: float) -> tuple[Collision, ...]:
        """An even link: drum on its own axis, tube along y up to the next axis."""
        off = _iiwa_shape.reach(drum, even=True) - drum
        return (
            capsule("tube", 0.5 * (drum + tube), (0.0, 0.0, off), (0.0, length - 0.03, 0.0)),
            capsule("drum", drum - 0.004, (0.0, 0.0, off), (0.0, 0.0, 0.0)),
        )

    return [
        (foot, plug),
        rising(shoulder, rise[0], -1.0),
        standing(shoulder, elbow, rise[1]),
        rising(elbow, rise[2], 1.0),
        standing(elbow, elbow, rise[3]),
        (
            capsule("tube", 0.066, (0.0, 0.0, 0.03), (0.0, 0.015, 0.09)),
            Collision(
                "arm", Shape("box", (0.1, 0.03, 0.16)), (0.0, 0.083, 0.185, 0.0, 0.0, 0.0), METAL
            ),
        ),
        (capsule("ball", 0.067, (0.0, -0.018, 0.0), (0.0, 0.012, 0.0)),),
        (
            Collision(
                "flange",
                Shape("cylinder", (0.052, arm.flange)),
                (0.0, 0.0, 0.5 * arm.flange, 0.0, 0.0, 0.0),
                METAL,
            ),
        ),
    ]


def model(arm: Arm) -> Model:
    """The model of an arm."""
    shapes = collisions(arm)
    poses = [IDENTITY, *(axis.pose for axis in arm.axes)]
    inertials = [arm.base, *(axis.inertial for axis in arm.axes)]
    links = tuple(
        Link(
            f"iiwa_link_{i}",
            poses[i],
            inertials[i],
            (Visual("housing", Shape("mesh", uri=f"link_{i}.gltf")),),
            shapes[i],
        )
        for i in range(8)
    )
    joints = tuple(
        Joint(
            f"iiwa_joint_{i + 1}",
            "revolute",
            f"iiwa_link_{i}",
            f"iiwa_link_{i + 1}",
            axis.direction,
            -axis.limit,
            axis.limit,
            axis.effort,
            axis.velocity,
            axis.acceleration,
            gear_ratio=axis.gear_ratio,
            rotor_inertia=axis.rotor_inertia,
            expressed_in="__model__",
        )
        for i, axis in enumerate(arm.axes)
    )
    flange = Frame("flange", "iiwa_link_7", (0.0, 0.0, arm.flange, 0.0, 0.0, 0.0))
    comment = (
        f"{arm.title}. The frame of iiwa_link_0 stands on the floor, z up, x to the front;"
        " the frame flange lies in the face of the flange."
    )
    # Links two apart cannot meet within the limits of the joint between them; the shapes of
    # links 5 and 7, fuller than the links, would.
    apart = tuple((links[i].name, links[i + 2].name) for i in range(6))
    return Model(arm.name, comment, links, joints, (flange,), apart)


def write(arm: Arm, folder: Path) -> None:
    """Writes all files of an arm."""
    made = model(arm)
    heights = [upper.pose[2] - lower.pose[2] for lower, upper in pairwise(arm.axes)]
    for i, parts in enumerate(_iiwa_shape.links(heights, arm.drum, arm.flange)):
        write_gltf(folder / f"link_{i}.gltf", parts)
    write_atomic(folder / f"{arm.name}.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.036))
    write_description(
        folder,
        title=arm.title,
        category="arm",
        description=(
            f"Seven joints iiwa_joint_1..7, links iiwa_link_0..7, {arm.payload:g} kg payload, "
            f"reach {arm.reach:g} m. Frame flange: face of the flange. All joints have actuators "
            "with rotor inertia, so that Drake makes their reflected inertia part of the arm."
        ),
        sources=[
            "KUKA Roboter GmbH, LBR iiwa 7 R800, LBR iiwa 14 R820, Specification",
            "Link frames, masses, inertias and motors: figures of the Drake project's model",
        ],
    )
