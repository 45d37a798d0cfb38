"""Mass properties of bodies put together from homogeneous boxes, cylinders and the like."""

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RotationalInertia, SpatialInertia

from prehensile.models.generate.sdf_model import Inertial, Pose, Shape
from prehensile.models.generate.sphere_cover import transform


def volume(shape: Shape) -> float:
    """Volume of a primitive in m³."""
    if shape.kind == "box":
        return float(np.prod(shape.size))
    radius = shape.size[0]
    length = shape.size[1] if len(shape.size) > 1 else 0.0
    ball = 4.0 / 3.0 * np.pi * radius**3 if shape.kind in ("sphere", "capsule") else 0.0
    return float(ball + np.pi * radius**2 * length)


def solid(shape: Shape, mass: float, X_LS: RigidTransform) -> SpatialInertia:
    """Spatial inertia about the origin of the link L, in L, of a homogeneous primitive."""
    if shape.kind == "box":
        M = SpatialInertia.SolidBoxWithMass(mass, *shape.size)
    elif shape.kind == "sphere":
        M = SpatialInertia.SolidSphereWithMass(mass, *shape.size)
    elif shape.kind == "cylinder":
        M = SpatialInertia.SolidCylinderWithMass(mass, *shape.size, [0.0, 0.0, 1.0])
    else:
        M = SpatialInertia.SolidCapsuleWithMass(mass, *shape.size, [0.0, 0.0, 1.0])
    return M.ReExpress(X_LS.rotation()).Shift(-X_LS.translation())


def body(mass: float, parts: Sequence[tuple[Shape, Pose]]) -> Inertial:
    """Mass properties of a body of one material.

    Args:
        mass: of the whole, kg.
        parts: primitives with their poses in the link; overlaps count twice.

    Returns:
        Mass, centre of mass in the link's frame, inertia about it.
    """
    total = sum(volume(shape) for shape, _ in parts)
    M = SpatialInertia.Zero()
    for shape, pose in parts:
        M += solid(shape, mass * volume(shape) / total, transform(pose))
    return _inertial(M)


def assembly(bodies: Sequence[Inertial]) -> Inertial:
    """Mass properties of bodies that are fixed to one another, all given in one frame."""
    M = SpatialInertia.Zero()
    for part in bodies:
        ixx, iyy, izz, ixy, ixz, iyz = part.inertia
        about_com = RotationalInertia(ixx, iyy, izz, ixy, ixz, iyz)
        M += SpatialInertia.MakeFromCentralInertia(part.mass, part.com, about_com)
    return _inertial(M)


def _inertial(M: SpatialInertia) -> Inertial:
    """The same mass properties with the inertia about the centre of mass, rounded."""
    com = M.get_com()
    inertia = M.Shift(com).CalcRotationalInertia().CopyToFullMatrix3()
    ixx, iyy, izz = np.round(np.diag(inertia), 10)
    ixy, ixz, iyz = np.round([inertia[0, 1], inertia[0, 2], inertia[1, 2]], 10)
    mass = round(M.get_mass(), 9)
    return Inertial(mass, tuple(np.round(com, 8)), (ixx, iyy, izz, ixy, ixz, iyz))
