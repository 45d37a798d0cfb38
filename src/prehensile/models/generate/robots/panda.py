"""Franka Emika Panda."""

from pathlib import Path

from prehensile.models.generate.robots import _panda_shape
from prehensile.models.generate.robots._arm import (
    METAL,
    QUARTER,
    Arm,
    Segment,
    capsule,
    cylinder,
    write,
)
from prehensile.models.generate.sdf_model import Collision, Frame, Inertial, Shape

# Frame of each joint in that of the one before: x, y, z, and the turn about x in quarters.
OFFSETS = (
    (0.0, 0.0, 0.333, 0),
    (0.0, 0.0, 0.0, -1),
    (0.0, -0.316, 0.0, 1),
    (0.0825, 0.0, 0.0, 1),
    (-0.0825, 0.384, 0.0, -1),
    (0.0, 0.0, 0.0, 1),
    (0.088, 0.0, 0.0, 1),
)
LIMITS = (  # rad
    (-2.8973, 2.8973),
    (-1.7628, 1.7628),
    (-2.8973, 2.8973),
    (-3.0718, -0.0698),
    (-2.8973, 2.8973),
    (-0.0175, 3.7525),
    (-2.8973, 2.8973),
)
EFFORTS = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)
SPEEDS = (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61)
ACCELERATIONS = (15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0)
# The maker tells the reflected inertias of the arm's successor; the gear ratio is 100.
ROTORS = tuple(1e-4 * j for j in (0.605721456,) * 2 + (0.462474144,) * 2 + (0.205544064,) * 3)

# The gravity torques of these agree with those of Gaz et al. to 0.8 N m (root mean square over
# the workspace, joint 2), and their masses sum up to the weight of the data sheet, which those
# of the maker's own description and of Gaz et al. do not.
BASE = Inertial(
    2.92,
    (-0.025566, -2.88e-05, 0.057332),
    (
        0.00782229414331,
        0.0109027971813,
        0.0102355503949,
        -1.56191622996e-05,
        -0.00126005738123,
        1.08233858202e-05,
    ),
)
INERTIALS = (
    Inertial(
        2.74,
        (0.0, -0.0324958, -0.0675818),
        (0.0180416958283, 0.0159136071891, 0.00620690827127, 0.0, 0.0, 0.0046758424612),
    ),
    Inertial(
        2.74,
        (0.0, -0.06861, 0.0322285),
        (0.0182856182281, 0.00621358421175, 0.0161514346309, 0.0, 0.0, -0.00472844221905),
    ),
    Inertial(
        2.38,
        (0.0469893, 0.0316374, -0.031704),
        (
            0.00771376630908,
            0.00989108008727,
            0.00811723558464,
            -0.00248490625138,
            -0.00332147581033,
            -0.00217796151484,
        ),
    ),
    Inertial(
        2.38,
        (-0.0360446, 0.0336853, 0.031882),
        (
            0.00799663881132,
            0.00825390705278,
            0.0102515004345,
            0.00347095570217,
            -0.00241222942995,
            0.00235774044121,
        ),
    ),
    Inertial(
        2.74,
        (0.0, 0.0610427, -0.104176),
        (
            0.030371374513,
            0.0288752887402,
            0.00444134056164,
            6.50283587108e-07,
            -1.05129179916e-05,
            -0.00775653445787,
        ),
    ),
    Inertial(
        1.55,
        (0.0510509, 0.009108, 0.0106343),
        (
            0.00303336450376,
            0.00404479911567,
            0.00558234286039,
            -0.000437276865508,
            0.000629257294877,
            0.000130472021025,
        ),
    ),
    Inertial(
        0.54,
        (0.0109695, 0.0107965, 0.0650411),
        (
            0.000888868887021,
            0.000888001373233,
            0.0007176834609,
            -0.00012239074652,
            3.98699829666e-05,
            -9.33825115206e-05,
        ),
    ),
)

PANDA = Arm(
    name="panda",
    title="Franka Emika Panda",
    description=(
        "Seven joints panda_joint1..7, links panda_link0..7, 3 kg payload, reach 0.855 m. Frame "
        "panda_link8: face of the flange, z out. Home: 0, -45, 0, -135, 0, 90, 45 degrees; zero "
        "lies outside the limits. All joints have actuators with rotor inertia, which the maker "
        "tells of the arm's successor."
    ),
    sources=(
        "Franka Emika GmbH, Panda data sheet; Franka Control Interface, robot limits",
        "Masses, inertias and motors: figures of the Drake project's model",
        "C. Gaz, M. Cognetti, A. Oliva, P. Robuffo Giordano, A. De Luca, Dynamic identification "
        "of the Franka Emika Panda robot, IEEE Robotics and Automation Letters 4(4), 2019",
    ),
    base="panda_link0",
    base_inertial=BASE,
    segments=tuple(
        Segment(
            f"panda_joint{i + 1}",
            f"panda_link{i + 1}",
            (x, y, z, turns * QUARTER, 0.0, 0.0),
            *LIMITS[i],
            EFFORTS[i],
            SPEEDS[i],
            INERTIALS[i],
            ROTORS[i],
            100.0,
            ACCELERATIONS[i],
        )
        for i, (x, y, z, turns) in enumerate(OFFSETS)
    ),
    frames=(Frame("panda_link8", "panda_link7", (0.0, 0.0, 0.107, 0.0, 0.0, 0.0)),),
)


def collisions() -> list[tuple[Collision, ...]]:
    """The collision shapes of the links."""
    r = 0.055
    foot = Shape("box", (0.16, 0.17, 0.085))
    return [
        (
            Collision("foot", foot, (-0.06, 0.0, 0.0425, 0.0, 0.0, 0.0), METAL),
            cylinder("neck", r, (0, 0, 0), (0, 0, 0.14)),
        ),
        (
            cylinder("tube", r, (0, 0, -0.193), (0, 0, -0.08)),
            cylinder("drum", r, (0, -0.129, 0), (0, 0, 0)),
            capsule("bend", r, (0, 0, -0.09), (0, -0.06, 0)),
        ),
        (
            cylinder("drum", r, (0, 0, 0), (0, 0, 0.129)),
            cylinder("tube", r, (0, -0.08, 0), (0, -0.194, 0)),
            capsule("bend", r, (0, 0, 0.06), (0, -0.09, 0)),
        ),
        (
            cylinder("tube", r, (0, 0, -0.121), (0, 0, -0.06)),
            cylinder("drum", r, (0.0825, 0, 0), (0.0825, 0.111, 0)),
            capsule("bend", 0.05, (0, 0, -0.066), (0.0825, 0.055, 0)),
        ),
        (
            cylinder("drum", r, (0, 0, 0), (0, 0, 0.111)),
            cylinder("tube", r, (-0.0825, 0.06, 0), (-0.0825, 0.124, 0)),
            capsule("bend", 0.05, (0, 0, 0.055), (-0.0825, 0.066, 0)),
        ),
        (
            cylinder("tube", r, (0, 0, -0.259), (0, 0, -0.19)),
            capsule("bend", 0.045, (0, 0, -0.2), (0, 0.078, -0.14)),
            capsule("forearm", 0.034, (0, 0.082, -0.15), (0, 0.086, -0.03)),
            cylinder("drum", 0.05, (0, 0.016, 0), (0, 0.13, 0)),
        ),
        (
            cylinder("drum", 0.048, (0, 0, -0.014), (0, 0, 0.056)),
            capsule("bend", 0.042, (0, 0, 0.012), (0.088, 0.01, 0)),
            cylinder("barrel", 0.045, (0.088, -0.051, 0), (0.088, 0.082, 0)),
        ),
        (
            cylinder("flange", 0.044, (0, 0, 0.052), (0, 0, 0.107)),
            capsule("knob", 0.015, (0.03, 0.03, 0.083), (0.06, 0.06, 0.083)),
        ),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    write(PANDA, collisions(), _panda_shape.links(), folder)
