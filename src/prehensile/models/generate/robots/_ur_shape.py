"""How the e-Series arms look: drums side by side, straight tubes between them, blue lids."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from prehensile.models.generate.robots._housing import (
    DARK,
    GAP,
    Plane,
    disc,
    divided,
    joined,
    kept,
    ring,
    shell,
)
from prehensile.models.shapes import Material, Part, cylinder, lathe, merge
from prehensile.models.shapes.implicit import Field, drum

LIGHT = Material("light grey", (0.70, 0.71, 0.72, 1.0), metallic=0.0, roughness=0.4)
GREY = Material("joint grey", (0.30, 0.31, 0.32, 1.0), metallic=0.0, roughness=0.5)
BLUE = Material("blue", (0.22, 0.47, 0.66, 1.0), metallic=0.0, roughness=0.4)

STEP = 0.0085  # m, edge of the triangles
AXES = np.eye(3)
_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) / np.sqrt(2.0)


@dataclass(frozen=True)
class Build:
    """Dimensions in metres. Those along an axis are z of the link, where not said otherwise.

    Attributes:
        d1, a2, a3, d4, d5, d6: kinematic distances (a2 and a3 without their sign).
        foot: radius of the base where it stands.
        top: height of the base.
        shoulder: radius of the shoulder's drums.
        shoulder_lid: the lid on top of the shoulder, above its frame.
        shoulder_face: from the first axis to where the upper arm turns against the shoulder.
        upper_lids: the lids of the upper arm, at the shoulder and at the elbow.
        upper_axis: the middle of the upper arm's tube.
        upper_tube: radius of the tube at the shoulder and at the elbow.
        elbow: radius of the elbow's drums.
        elbow_face: where the forearm turns against the upper arm.
        elbow_lid: the lid of the forearm.
        forearm_axis: the middle of the forearm's tube.
        forearm_tube: radius of the tube at the elbow and at the wrist.
        forearm_end: the closed end of the drum that carries the wrist.
        wrist: radius of the wrist's drums.
        wrist_1_face: where wrist 1 turns against the forearm.
        wrist_2_face: from the axis of wrist 1 to where wrist 2 turns against it.
        wrist_3_face: from the axis of wrist 2 to where the flange turns against it.
        wrist_lid: from the axes of wrist 1 and 2 to their lids.
        flange: radius of wrist 3.
    """

    d1: float
    a2: float
    a3: float
    d4: float
    d5: float
    d6: float
    foot: float
    top: float
    shoulder: float
    shoulder_lid: float
    shoulder_face: float
    upper_lids: tuple[float, float]
    upper_axis: float
    upper_tube: tuple[float, float]
    elbow: float
    elbow_face: float
    elbow_lid: float
    forearm_axis: float
    forearm_tube: tuple[float, float]
    forearm_end: float
    wrist: float
    wrist_1_face: float
    wrist_2_face: float
    wrist_3_face: float
    wrist_lid: float
    flange: float


def base(b: Build) -> list[Part]:
    """The foot, its screws, and the plug of the cable behind it."""
    neck = b.shoulder
    profile = [
        (0.0, 0.0),
        (b.foot, 0.0),
        (b.foot, 0.022),
        (b.foot - 0.003, 0.025),
        (neck + 0.003, b.top - 0.02),
        (neck, b.top - 0.012),
        (neck, b.top - GAP),
        (0.0, b.top - GAP),
    ]
    body = lathe(profile, 64, crease=np.radians(25.0))
    spots = [
        0.9 * b.foot * np.array([np.cos(a), np.sin(a)]) for a in np.radians([45, 135, 225, 315])
    ]
    screws = merge(cylinder(0.006, 0.016, 20).transformed(p_AB=(*p, 0.022)) for p in spots)
    plug = disc(0.011, (-b.foot + 0.02, 0.0, 0.042), (-b.foot - 0.012, 0.0, 0.042), 0.002)
    return [Part(body, GREY), Part(merge([screws, plug]), DARK), ring(neck, (0, 0, b.top), 2)]


def _joined(
    drums: Sequence[Field],
    blend: float,
    reach: float,
    planes: Sequence[Plane],
    lid: Plane,
) -> list[Part]:
    """Drums that flow into one another, cut off at the joints, and a blue lid on one end."""
    ends = [(place * AXES[axis], sign * AXES[axis]) for axis, place, sign in planes]
    body = joined(*drums, blend=blend, ends=ends)
    mesh = kept(shell(body, (-reach,) * 3, (reach,) * 3, STEP), body, *planes)
    housing, cover = divided(mesh, body, lid)
    return [Part(housing, GREY), Part(cover, BLUE)]


def shoulder(b: Build) -> list[Part]:
    """A drum that stands on the base, and one that carries the upper arm."""
    low, face, r = b.top - b.d1, -b.shoulder_face, b.shoulder
    drums = (
        drum((0, 0, low - 0.05), (0, 0, b.shoulder_lid), r, 0.022),
        drum((0, face - 0.05, 0), (0, 0.02, 0), r, 0.015),
    )
    planes = ((2, low + GAP, 1.0), (1, face + GAP, 1.0))
    lid = (2, b.shoulder_lid - 0.019, -1.0)
    parts = _joined(drums, 0.025, b.shoulder_face + 0.06, planes, lid)
    return [*parts, ring(r, (0, face, 0), 1)]


def _tube(radii: tuple[float, float], length: float, z: float) -> Part:
    """A straight tube towards -x that narrows a little, open at the ends, inside the drums."""
    tube = lathe([(radii[0], 0.0), (radii[1], length)], 64)
    R = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])  # z to -x
    return Part(tube.transformed(R, (0.0, 0.0, z)), LIGHT)


def _end(
    r: float, x: float, face: float, lid: float, tube: tuple[float, float, float]
) -> list[Part]:
    """A drum at an end of a tube: its face on a joint, the other end a lid, a socket for the tube.

    Args:
        r: radius, m.
        x: of the drum's axis.
        face: z of the joint.
        lid: z of the lid.
        tube: its z, its radius, and x where the socket ends.
    """
    sign = 1.0 if lid > face else -1.0
    z, radius, to = tube
    barrel = drum((x, 0, face - 0.05 * sign), (x, 0, lid), r, 0.018)
    socket = drum((x, 0, z), (to, 0, z), radius, 0.002)
    end = ((x, 0, face), (0, 0, sign))
    body = joined(barrel, socket, blend=0.03, ends=[end])
    low = (min(x, to) - r, -r - 0.01, min(face - 0.05, lid))
    high = (max(x, to) + r, r + 0.01, max(face + 0.05, lid))
    mesh = kept(shell(body, low, high, STEP), body, (2, face + GAP * sign, sign))
    housing, cover = divided(mesh, body, (2, lid - 0.016 * sign, -sign))
    return [Part(housing, GREY), Part(cover, BLUE)]


def upper_arm(b: Build) -> list[Part]:
    """Drums at shoulder and elbow, a tube between them."""
    z, (start, end) = b.upper_axis, b.upper_tube
    near = (z, start + 0.0015, -b.shoulder - 0.025)
    far = (z, end + 0.0015, -b.a2 + b.elbow + 0.025)
    return [
        *_end(b.shoulder, 0.0, b.shoulder_face, b.upper_lids[0], near),
        _tube(b.upper_tube, b.a2, z),
        *_end(b.elbow, -b.a2, b.elbow_face, b.upper_lids[1], far),
        ring(b.elbow, (-b.a2, 0, b.elbow_face), 2),
    ]


def forearm(b: Build) -> list[Part]:
    """A drum at the elbow, a tube, and the end of the tube that carries the wrist."""
    z, (start, end) = b.forearm_axis, b.forearm_tube
    near = (z, start + 0.0015, -b.elbow - 0.03)
    far = (z, end + 0.0015, -b.a3 + b.wrist + 0.025)
    elbow = _end(b.elbow, 0.0, b.elbow_face, b.elbow_lid, near)
    wrist = _end(b.wrist, -b.a3, b.wrist_1_face, b.forearm_end, far)
    return [
        *elbow,
        _tube(b.forearm_tube, b.a3, z),
        *(Part(part.mesh, GREY) for part in wrist),
        ring(b.wrist, (-b.a3, 0, b.wrist_1_face), 2),
    ]


def wrist(b: Build, low: float, face: float) -> list[Part]:
    """Wrist 1 or 2: a neck up from its own joint, a drum on the next with a lid behind.

    Args:
        b: dimensions.
        low: z of its own joint's face.
        face: y of the next joint's face.
    """
    sign, r = np.sign(face), b.wrist
    back = -sign * b.wrist_lid
    drums = (
        drum((0, 0, low - 0.05), (0, 0, 0.01), r, 0.01),
        drum((0, face + 0.05 * sign, 0), (0, back, 0), r, 0.014),
    )
    planes = ((2, low + GAP, 1.0), (1, face - GAP * sign, -sign))
    parts = _joined(drums, 0.02, 0.13, planes, (1, back + 0.013 * sign, sign))
    return [*parts, ring(r, (0, face, 0), 1)]


def wrist_3(b: Build) -> list[Part]:
    """The flange, with its holes and the plug for the tool."""
    low, r = b.wrist_3_face - b.d6 + GAP, b.flange
    body = lathe(
        [
            (r - 0.001, low),
            (r, low + 0.001),
            (r, -0.0075),
            (r - 0.003, -0.0065),
            (r - 0.003, -0.001),
            (r - 0.004, 0.0),
            (0.0158, 0.0),
            (0.0158, -0.005),
            (0.0, -0.005),
        ],
        64,
        crease=np.radians(25.0),
    )
    spots = 0.025 * _CORNERS
    holes = merge(cylinder(0.003, 0.0006, 16).transformed(p_AB=(*p, 0.0)) for p in spots)
    plug = disc(0.006, (0.0, -r + 0.006, 0.5 * low), (0.0, -r - 0.007, 0.5 * low), 0.001)
    return [Part(body, LIGHT), Part(merge([holes, plug]), DARK)]


def links(b: Build) -> list[list[Part]]:
    """The parts of base and links, each in the frame of its link."""
    return [
        base(b),
        shoulder(b),
        upper_arm(b),
        forearm(b),
        wrist(b, b.wrist_1_face - b.d4, -b.wrist_2_face),
        wrist(b, b.wrist_2_face - b.d5, b.wrist_3_face),
        wrist_3(b),
    ]
