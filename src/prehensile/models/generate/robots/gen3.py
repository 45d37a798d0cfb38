"""Kinova Gen3 with seven joints and a camera on its wrist."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.robots import _gen3_shape
from prehensile.models.generate.robots._arm import (
    METAL,
    Arm,
    Segment,
    capsule,
    cylinder,
    write,
)
from prehensile.models.generate.sdf_model import Collision, Frame, Inertial, Shape

# The maker's description has right angles of four decimals.
QUARTER, HALF = 1.5708, 3.1416
LINKS = (
    "shoulder_link",
    "half_arm_1_link",
    "half_arm_2_link",
    "forearm_link",
    "spherical_wrist_1_link",
    "spherical_wrist_2_link",
    "bracelet_link",
)
OFFSETS = (  # x, y, z, and the turn about x
    (0.0, 0.0, 0.15643, HALF),
    (0.0, 0.005375, -0.12838, QUARTER),
    (0.0, -0.21038, -0.006375, -QUARTER),
    (0.0, 0.006375, -0.21038, QUARTER),
    (0.0, -0.20843, -0.006375, -QUARTER),
    (0.0, 0.00017505, -0.10593, QUARTER),
    (0.0, -0.10593, -0.00017505, -QUARTER),
)
# Joints 1, 3, 5 and 7 turn without end. Two turns to and fro, as the maker has it for arms with
# cables outside, keep them finite.
LIMITS = (2.0 * np.pi, 2.24, 2.0 * np.pi, 2.57, 2.0 * np.pi, 2.09, 2.0 * np.pi)


def _inertial(
    mass: float,
    com: tuple[float, float, float],
    xx: float,
    xy: float,
    xz: float,
    yy: float,
    yz: float,
    zz: float,
) -> Inertial:
    """Mass properties in the order of URDF."""
    return Inertial(mass, com, (xx, yy, zz, xy, xz, yz))


BASE = _inertial(
    1.697, (-0.000648, -0.000166, 0.084487), 0.004622, 9e-6, 6e-5, 0.004495, 9e-6, 0.002079
)
INERTIALS = (
    _inertial(
        1.3773, (-2.3e-5, -0.010364, -0.07336), 0.00457, 1e-6, 2e-6, 0.004831, 0.000448, 0.001409
    ),
    _inertial(
        1.1636, (-4.4e-5, -0.09958, -0.013278), 0.011088, 5e-6, 0.0, 0.001072, -0.000691, 0.011255
    ),
    _inertial(
        1.1636, (-4.4e-5, -0.006641, -0.117892), 0.010932, 0.0, -7e-6, 0.011127, 0.000606, 0.001043
    ),
    _inertial(
        0.9302, (-1.8e-5, -0.075478, -0.015006), 0.008147, -1e-6, 0.0, 0.000631, -0.0005, 0.008316
    ),
    _inertial(
        0.6781, (1e-6, -0.009432, -0.063883), 0.001596, 0.0, 0.0, 0.001607, 0.000256, 0.000399
    ),
    _inertial(
        0.6781, (1e-6, -0.045483, -0.00965), 0.001641, 0.0, 0.0, 0.00041, -0.000278, 0.001641
    ),
    _inertial(
        0.5, (0.000281, 0.011402, -0.029798), 0.000587, 3e-6, 3e-6, 0.000369, -0.000118, 0.000609
    ),
)


def _segments() -> tuple[Segment, ...]:
    segments = []
    for i, (x, y, z, turn) in enumerate(OFFSETS):
        # Four large and three small actuators. Ratio and inertia of their motors are not
        # published; these are what strain wave gears and motors of their diameters have.
        large = i < 4
        segments.append(
            Segment(
                f"joint_{i + 1}",
                LINKS[i],
                (x, y, z, turn, 0.0, 0.0),
                -LIMITS[i],
                LIMITS[i],
                39.0 if large else 9.0,
                1.3963 if large else 1.2218,
                INERTIALS[i],
                3.0e-5 if large else 1.0e-5,
                100.0,
                5.2 if large else 10.0,
            )
        )
    return tuple(segments)


GEN3 = Arm(
    name="gen3",
    title="Kinova Gen3, seven joints, with camera",
    description=(
        "Seven joints joint_1..7, links base_link .. bracelet_link, 4 kg payload, reach 0.902 m. "
        "Frame end_effector_link: face of the interface, z out; camera_link: the camera of the "
        "wrist, z out. Joints 1, 3, 5, 7 turn without end on the robot; here two turns either "
        "way. Home: 0, 15, 180, -130, 0, 55, 90 degrees. All joints have actuators with rotor "
        "inertia, which is an estimate."
    ),
    sources=(
        "Kinova inc., Gen3 Ultra lightweight robot, User Guide",
        "Frames, masses, inertias and limits: the maker's ROS 2 description",
    ),
    base="base_link",
    base_inertial=BASE,
    segments=_segments(),
    frames=(
        Frame("end_effector_link", "bracelet_link", (0.0, 0.0, -0.061525, np.pi, 0.0, 0.0)),
        # In the maker's words 56.39 mm aside of the end effector's frame, 3.05 mm behind it.
        Frame("camera_link", "bracelet_link", (0.0, -0.05639, -0.058475, np.pi, 0.0, np.pi)),
    ),
)


def collisions() -> list[tuple[Collision, ...]]:
    """The collision shapes of the links."""
    large, small = 0.0455, 0.0345
    eye = Shape("box", (0.09, 0.04, 0.021))

    def rising(r: float, height: float, back: float, face: float) -> tuple[Collision, ...]:
        """A tube up from its own joint, a drum on the next."""
        return (
            cylinder("tube", r, (0, 0, 0), (0, 0, 0.05 - height)),
            cylinder("drum", r, (0, -back, -height), (0, face, -height)),
        )

    def standing(r: float, back: float, length: float, tube: float) -> tuple[Collision, ...]:
        """A drum on its own joint, a tube off to the side, up to the next."""
        z = -0.5 * back
        return (
            cylinder("drum", r, (0, 0, -back), (0, 0, 0)),
            capsule("waist", 0.9 * tube, (0, 0, z), (0, 0.05 - length, -0.006)),
            cylinder("tube", tube, (0, 0.05 - length, -0.006), (0, -length, -0.006)),
        )

    return [
        (cylinder("foot", large, (0, 0, 0), (0, 0, 0.15643)),),
        rising(large, 0.12838, 0.049, 0.005375),
        standing(large, 0.055, 0.21038, large),
        rising(large, 0.21038, 0.049, 0.006375),
        standing(large, 0.056, 0.20843, small),
        rising(small, 0.10593, 0.053, 0.0),
        standing(small, 0.053, 0.10593, small),
        (
            cylinder("interface", 0.037, (0, 0, -0.0615), (0, 0, 0)),
            Collision("camera", eye, (0.0, -0.055, -0.0525, 0.0, 0.0, 0.0), METAL),
        ),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    write(GEN3, collisions(), _gen3_shape.links(), folder)
