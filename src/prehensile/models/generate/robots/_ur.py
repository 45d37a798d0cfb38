"""The e-Series arms of Universal Robots: frames, limits, motors and collision shapes.

Shoulder, elbow and wrist 1 turn about parallel axes; the drums of the links stand side by side on
them. At zero the arm is stretched out level, to the front.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from prehensile.models.generate import solids
from prehensile.models.generate.robots import _ur_shape
from prehensile.models.generate.robots._arm import QUARTER, Arm, Segment, capsule, cylinder, write
from prehensile.models.generate.robots._ur_shape import Build
from prehensile.models.generate.sdf_model import Collision, Frame, Inertial, Shape

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")


@dataclass(frozen=True)
class Size:
    """A size of joint, as the maker builds several arms from.

    Attributes:
        effort: greatest torque, N m.
        rotor_inertia: kg m², with that of the gear's wave generator.
    """

    effort: float
    rotor_inertia: float


# The torques are the maker's. The inertias of rotors are estimates, from catalogues of frameless
# motors and strain wave gears of the joints' diameters; the gear ratio of 101 is known.
SIZE_1, SIZE_2 = Size(28.0, 1.5e-5), Size(54.0, 3.0e-5)
SIZE_3, SIZE_4 = Size(150.0, 1.0e-4), Size(330.0, 2.5e-4)
GEAR_RATIO = 101.0


@dataclass(frozen=True)
class Member:
    """One arm of the series.

    Attributes:
        name: of the model.
        title: for people.
        payload: kg.
        reach: m.
        mass: of the whole arm as the data sheet has it, kg; the base takes what the links leave.
        build: dimensions.
        inertials: of the six moving links.
        sizes: of the six joints.
        speeds: of the six joints, rad/s.
    """

    name: str
    title: str
    payload: float
    reach: float
    mass: float
    build: Build
    inertials: tuple[Inertial, ...]
    sizes: tuple[Size, ...]
    speeds: tuple[float, ...]


def arm(member: Member) -> Arm:
    """The values of one arm."""
    b = member.build
    offsets = (
        # The maker's base frame looks backwards; ours, as the field's, to the front.
        (0.0, 0.0, b.d1, 0.0, 0.0, np.pi),
        (0.0, 0.0, 0.0, QUARTER, 0.0, 0.0),
        (-b.a2, 0.0, 0.0, 0.0, 0.0, 0.0),
        (-b.a3, 0.0, b.d4, 0.0, 0.0, 0.0),
        (0.0, -b.d5, 0.0, QUARTER, 0.0, 0.0),
        (0.0, b.d6, 0.0, -QUARTER, 0.0, 0.0),
    )
    segments = []
    for i, offset in enumerate(offsets):
        # The elbow can turn no farther than half a turn, where the forearm meets the upper arm.
        limit = np.pi if i == 2 else 2.0 * np.pi
        segments.append(
            Segment(
                f"{JOINTS[i]}_joint",
                f"{LINKS[i]}_link",
                offset,
                -limit,
                limit,
                member.sizes[i].effort,
                member.speeds[i],
                member.inertials[i],
                member.sizes[i].rotor_inertia,
                GEAR_RATIO,
            )
        )
    rest = round(member.mass - sum(inertial.mass for inertial in member.inertials), 6)
    foot = Shape("cylinder", (b.foot, b.top))
    return Arm(
        name=member.name,
        title=member.title,
        description=(
            f"Six joints shoulder_pan_joint .. wrist_3_joint, {member.payload:g} kg payload, reach "
            f"{member.reach:g} m. Frame tool0: face of the flange, z out; flange: the same with x "
            "out; base: the frame of the maker's controller. Home: 0, -90, 90, -90, -90, 0 "
            "degrees. All joints have actuators with rotor inertia; the rotor inertias are "
            "estimates."
        ),
        sources=(
            "Universal Robots A/S, e-Series user manual and data sheet",
            "Universal Robots A/S, DH parameters for calculations of kinematics and dynamics",
            "Universal Robots A/S, Max. joint torques",
            "Dimensions of the housings, and inertias of the UR5e: the maker's ROS 2 description",
        ),
        base="base_link",
        base_inertial=solids.body(rest, [(foot, (0.0, 0.0, 0.5 * b.top, 0.0, 0.0, 0.0))]),
        segments=tuple(segments),
        frames=(
            Frame("base", "base_link", (0.0, 0.0, 0.0, 0.0, 0.0, np.pi)),
            Frame("flange", "wrist_3_link", (0.0, 0.0, 0.0, 0.0, -QUARTER, -QUARTER)),
            Frame("tool0", "wrist_3_link"),
        ),
        # The upper arm passes beside the base; spheres about the two would touch.
        apart=(("base_link", "upper_arm_link"),),
    )


def _drum(
    name: str, radius: float, face: tuple[float, float, float], lid: tuple[float, float, float]
) -> Collision:
    """A capsule for a drum between its joint and its lid.

    One end runs on into the next link, which it never meets, by half its radius; the other stands
    out of the lid a little, for the rim of the lid is round as well.
    """
    a, b = np.asarray(face, float), np.asarray(lid, float)
    along = (b - a) / np.linalg.norm(b - a)
    return capsule(name, radius, a + 0.5 * radius * along, b - (radius - 0.006) * along)


def collisions(b: Build) -> list[tuple[Collision, ...]]:
    """The collision shapes of base and links."""
    upper, forearm, end = 0.5 * sum(b.upper_tube), 0.5 * sum(b.forearm_tube), 0.03 - b.a3
    into = 0.5 * b.wrist
    # A ball on the floor that reaches into the shoulder like a drum.
    neck = min(b.shoulder, 2.0 / 3.0 * b.top)
    return [
        (
            cylinder("foot", b.foot - 0.002, (0, 0, 0), (0, 0, 0.05)),
            capsule("neck", neck, (0, 0, neck), (0, 0, max(b.top - 0.5 * neck, neck + 0.002))),
        ),
        (
            _drum("barrel", b.shoulder, (0, 0, b.top - b.d1), (0, 0, b.shoulder_lid)),
            capsule("side", b.shoulder, (0, 0, 0), (0, 0.5 * b.shoulder - b.shoulder_face, 0)),
        ),
        (
            _drum("shoulder", b.shoulder, (0, 0, b.shoulder_face), (0, 0, b.upper_lids[0])),
            capsule("tube", upper, (0, 0, b.upper_axis), (-b.a2, 0, b.upper_axis)),
            _drum("elbow", b.elbow, (-b.a2, 0, b.elbow_face), (-b.a2, 0, b.upper_lids[1])),
        ),
        (
            _drum("elbow", b.elbow, (0, 0, b.elbow_face), (0, 0, b.elbow_lid)),
            capsule("tube", forearm, (0, 0, b.forearm_axis), (end, 0, b.forearm_axis)),
            _drum("wrist", b.wrist, (-b.a3, 0, b.wrist_1_face), (-b.a3, 0, b.forearm_end)),
        ),
        (
            capsule("neck", b.wrist, (0, 0, b.wrist_1_face - b.d4 + into), (0, 0, 0)),
            _drum("barrel", b.wrist, (0, -b.wrist_2_face, 0), (0, b.wrist_lid, 0)),
        ),
        (
            capsule("neck", b.wrist, (0, 0, b.wrist_2_face - b.d5 + into), (0, 0, 0)),
            _drum("barrel", b.wrist, (0, b.wrist_3_face, 0), (0, -b.wrist_lid, 0)),
        ),
        (cylinder("flange", b.flange, (0, 0, b.wrist_3_face - b.d6), (0, 0, 0)),),
    ]


def generate(member: Member, folder: Path) -> None:
    """Writes all files of an arm."""
    b = member.build
    write(arm(member), collisions(b), _ur_shape.links(b), folder)
