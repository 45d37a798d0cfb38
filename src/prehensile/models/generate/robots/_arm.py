"""Arms whose joints follow one another: their values, and the files of their models.

As the vendors' descriptions have it, each joint turns about the z axis of its own frame, and the
frame of a link is that of the joint that carries it. The first link stands on the floor.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.files import write_atomic
from prehensile.models.generate.files import write_description, write_spheres
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
from prehensile.models.generate.sphere_cover import cover_model, transform
from prehensile.models.shapes import Part, write_gltf

METAL = Contact(mu=0.4, relaxation_time=0.05)
QUARTER = 0.5 * np.pi


@dataclass(frozen=True)
class Segment:
    """A joint and the link that it carries.

    Attributes:
        joint: its name.
        link: its name.
        offset: pose of the joint's frame in the frame of the link before.
        lower: least angle, rad.
        upper: greatest angle, rad.
        effort: greatest torque, N m.
        velocity: greatest speed, rad/s.
        inertial: of the link.
        rotor_inertia: of the motor, kg m².
        gear_ratio: turns of the motor for one of the joint.
        acceleration: greatest, rad/s² (None: not published).
        damping: N m s/rad.
    """

    joint: str
    link: str
    offset: Pose
    lower: float
    upper: float
    effort: float
    velocity: float
    inertial: Inertial
    rotor_inertia: float
    gear_ratio: float
    acceleration: float | None = None
    damping: float = 0.0


@dataclass(frozen=True)
class Arm:
    """A robot arm.

    Attributes:
        name: of the model.
        title: for people.
        description: for people, one paragraph.
        sources: where its figures are from.
        base: name of the first link.
        base_inertial: its mass properties.
        segments: joints and links from the base on.
        frames: named frames.
        apart: pairs of links that never meet, though not joined to one another.
    """

    name: str
    title: str
    description: str
    sources: tuple[str, ...]
    base: str
    base_inertial: Inertial
    segments: tuple[Segment, ...]
    frames: tuple[Frame, ...] = ()
    apart: tuple[tuple[str, str], ...] = ()


def capsule(name: str, radius: float, start: ArrayLike, end: ArrayLike) -> Collision:
    """A capsule about the line between two points of a link, m."""
    pose, length = _along(start, end)
    return Collision(name, Shape("capsule", (radius, length)), pose, METAL)


def cylinder(name: str, radius: float, start: ArrayLike, end: ArrayLike) -> Collision:
    """A cylinder about the line between two points of a link, m."""
    pose, length = _along(start, end)
    return Collision(name, Shape("cylinder", (radius, length)), pose, METAL)


def turned(inertial: Inertial, rpy: tuple[float, float, float]) -> Inertial:
    """Mass properties whose inertia is given in axes that are turned against the link's."""
    xx, yy, zz, xy, xz, yz = inertial.inertia
    R = RollPitchYaw(rpy).ToRotationMatrix().matrix()
    inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    rows, columns = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    ixx, iyy, izz, ixy, ixz, iyz = np.round(inertia[rows, columns], 10)
    return Inertial(inertial.mass, inertial.com, (ixx, iyy, izz, ixy, ixz, iyz))


def model(arm: Arm, collisions: Sequence[Sequence[Collision]]) -> Model:
    """The model of an arm, given the collision shapes of each link."""
    names = [arm.base, *(segment.link for segment in arm.segments)]
    inertials = [arm.base_inertial, *(segment.inertial for segment in arm.segments)]
    X_ML = [RigidTransform()]
    for segment in arm.segments:
        X_ML.append(X_ML[-1] @ transform(segment.offset))
    links = tuple(
        Link(
            name,
            _pose(X),
            inertial,
            (Visual("housing", Shape("mesh", uri=f"{name}.gltf")),),
            tuple(shapes),
        )
        for name, X, inertial, shapes in zip(names, X_ML, inertials, collisions, strict=True)
    )
    joints = tuple(
        Joint(
            segment.joint,
            "revolute",
            parent,
            child,
            (0, 0, 1),
            segment.lower,
            segment.upper,
            segment.effort,
            segment.velocity,
            segment.acceleration,
            segment.damping,
            segment.gear_ratio,
            segment.rotor_inertia,
        )
        for segment, (parent, child) in zip(arm.segments, pairwise(names), strict=True)
    )
    comment = f"{arm.title}. The frame of {arm.base} stands on the floor, z up, x to the front."
    return Model(arm.name, comment, links, joints, arm.frames, arm.apart)


def write(
    arm: Arm,
    collisions: Sequence[Sequence[Collision]],
    housings: Sequence[Sequence[Part]],
    folder: Path,
) -> None:
    """Writes all files of an arm.

    Args:
        arm: the arm.
        collisions: shapes that touch, for each link from the base on.
        housings: what is seen of each link.
        folder: to write to.
    """
    made = model(arm, collisions)
    for link, parts in zip(made.links, housings, strict=True):
        write_gltf(folder / f"{link.name}.gltf", parts)
    write_atomic(folder / f"{arm.name}.sdf", sdf_text(made))
    write_spheres(folder, cover_model(made, bulge=0.036))
    write_description(
        folder,
        title=arm.title,
        category="arm",
        description=arm.description,
        sources=arm.sources,
    )


def _pose(X: RigidTransform) -> Pose:
    if X.IsExactlyIdentity():
        return IDENTITY
    angles = RollPitchYaw(RotationMatrix.ProjectToRotationMatrix(X.rotation().matrix())).vector()
    return (*X.translation(), *angles)


def _along(start: ArrayLike, end: ArrayLike) -> tuple[Pose, float]:
    """The pose whose z axis leads from one point to the other from midway, and the distance."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    length = float(np.linalg.norm(b - a))
    x, y, z = (b - a) / length
    roll, pitch = float(np.arctan2(-y, z)), float(np.arcsin(np.clip(x, -1.0, 1.0)))
    # Rx(roll) Ry(pitch) leads z along x, y, z; in fixed axes the order is the other way round.
    turn = RotationMatrix.MakeXRotation(roll) @ RotationMatrix.MakeYRotation(pitch)
    angles = RollPitchYaw(turn).vector()
    return (*np.round(0.5 * (a + b), 9), *np.round(angles, 9)), round(length, 9)
