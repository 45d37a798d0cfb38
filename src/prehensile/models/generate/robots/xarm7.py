"""UFACTORY xArm 7."""

from pathlib import Path

import numpy as np

from prehensile.models.generate import solids
from prehensile.models.generate.robots import _xarm7_shape
from prehensile.models.generate.robots._arm import METAL, Arm, Segment, capsule, cylinder, write
from prehensile.models.generate.sdf_model import Collision, Frame, Inertial, Shape

QUARTER = 1.5708  # the maker's description has right angles of four decimals
OFFSETS = (  # x, y, z, and the turn about x in quarters
    (0.0, 0.0, 0.267, 0),
    (0.0, 0.0, 0.0, -1),
    (0.0, -0.293, 0.0, 1),
    (0.0525, 0.0, 0.0, 1),
    (0.0775, -0.3425, 0.0, 1),
    (0.0, 0.0, 0.0, 1),
    (0.076, 0.097, 0.0, -1),
)
LIMITS = (  # rad
    (-2.0 * np.pi, 2.0 * np.pi),
    (-2.059, 2.0944),
    (-2.0 * np.pi, 2.0 * np.pi),
    (-0.19198, 3.927),
    (-2.0 * np.pi, 2.0 * np.pi),
    (-1.69297, np.pi),
    (-2.0 * np.pi, 2.0 * np.pi),
)
EFFORTS = (50.0, 50.0, 30.0, 30.0, 30.0, 20.0, 20.0)
DAMPING = (10.0, 10.0, 5.0, 5.0, 5.0, 2.0, 2.0)
# Motors and gears are not published; these are what strain wave gears of ratio 100 and motors of
# the joints' three diameters have.
ROTORS = (5.0e-5, 5.0e-5, 3.0e-5, 3.0e-5, 3.0e-5, 1.0e-5, 1.0e-5)

WEIGHT = 13.7  # kg, of the data sheet; the base takes what the links leave
INERTIALS = (
    Inertial(
        2.382,
        (-0.0002, 0.02905, -0.01233),
        (0.0056905, 0.0049566, 0.003316654, -1.579e-05, 5.125e-06, -0.000873378),
    ),
    Inertial(
        1.869,
        (0.00022, -0.12856, 0.01735),
        (0.0095989, 0.00382472, 0.007565669, 1.541e-06, 5.56e-06, -0.00317156),
    ),
    Inertial(
        1.6383,
        (0.0466, -0.02463, -0.00768),
        (0.00310955, 0.00264483, 0.0026624, 0.00030837, -0.00058453, 0.000338893),
    ),
    Inertial(
        1.7269,
        (0.07047, -0.11575, 0.012),
        (0.005889, 0.00359703, 0.00543244, 0.00137112, 0.00088143, -0.001762155),
    ),
    Inertial(
        1.3203,
        (-0.00032, 0.01604, -0.026),
        (0.00534665, 0.0049779, 0.0013624, 1.5117e-05, -3.69e-07, -0.00022132),
    ),
    Inertial(
        1.325,
        (0.06469, 0.03278, 0.02141),
        (0.0014745, 0.0019037, 0.0023652, -0.000488, 0.0002953, 0.00014749),
    ),
    Inertial(0.17, (0.0, -0.00677, -0.01098), (9.3e-05, 5.87e-05, 0.000132, 0.0, 0.0, -3.6e-06)),
)


def _base() -> Inertial:
    column = Shape("cylinder", (0.047, 0.155))
    rest = round(WEIGHT - sum(inertial.mass for inertial in INERTIALS), 6)
    return solids.body(rest, [(column, (0.0, 0.0, 0.0775, 0.0, 0.0, 0.0))])


XARM7 = Arm(
    name="xarm7",
    title="UFACTORY xArm 7",
    description=(
        "Seven joints joint1..7, links link_base, link1..7, 3.5 kg payload, reach 0.7 m. Frame "
        "link_eef: face of the flange, z out. At zero the forearm hangs down before the upper "
        "arm. Home: 0, -14, 0, 52, 0, 66, 0 degrees. All joints have actuators with rotor "
        "inertia, which is an estimate."
    ),
    sources=(
        "UFACTORY, xArm user manual and data sheet",
        "Frames, masses, inertias, limits and damping: the maker's ROS description",
    ),
    base="link_base",
    base_inertial=_base(),
    segments=tuple(
        Segment(
            f"joint{i + 1}",
            f"link{i + 1}",
            (x, y, z, turns * QUARTER, 0.0, 0.0),
            *LIMITS[i],
            EFFORTS[i],
            np.pi,
            INERTIALS[i],
            ROTORS[i],
            100.0,
            20.0,
            DAMPING[i],
        )
        for i, (x, y, z, turns) in enumerate(OFFSETS)
    ),
    frames=(Frame("link_eef", "link7"),),
)


def collisions() -> list[tuple[Collision, ...]]:
    """The collision shapes of the links."""
    upper = Shape("box", (0.086, 0.09, 0.15))
    fore = Shape("box", (0.078, 0.08, 0.14))
    return [
        (
            cylinder("foot", 0.062, (0, 0, 0), (0, 0, 0.022)),
            cylinder("column", 0.047, (0, 0, 0), (0, 0, 0.155)),
        ),
        (
            cylinder("tube", 0.047, (0, 0, -0.112), (0, 0, 0)),
            cylinder("drum", 0.047, (0, -0.057, 0), (0, 0.075, 0)),
        ),
        (
            cylinder("drum", 0.047, (0, 0, 0.075), (0, 0, 0.119)),
            capsule("plate", 0.023, (0, 0, 0.096), (0, -0.08, 0.09)),
            Collision("bend", upper, (0.0, -0.107, 0.041, 0.0, 0.0, 0.0), METAL),
            cylinder("tube", 0.042, (0, -0.06, 0), (0, -0.192, 0)),
        ),
        (
            cylinder("tube", 0.042, (0, 0, -0.101), (0, 0, -0.04)),
            capsule("bend", 0.04, (0, 0, -0.06), (0.0525, 0, 0)),
            cylinder("drum", 0.0425, (0.0525, -0.067, 0), (0.0525, 0.069, 0)),
        ),
        (
            cylinder("drum", 0.043, (0, 0, 0.067), (0, 0, 0.107)),
            capsule("plate", 0.021, (0, 0, 0.087), (0.0775, -0.08, 0.083)),
            Collision("bend", fore, (0.0775, -0.083, 0.032, 0.0, 0.0, 0.0), METAL),
            cylinder("tube", 0.042, (0.0775, -0.05, 0), (0.0775, -0.169, 0)),
        ),
        (
            cylinder("tube", 0.042, (0, 0, -0.173), (0, 0, -0.13)),
            capsule("bend", 0.032, (0, 0, -0.14), (0, 0.052, -0.085)),
            Collision(
                "plate", Shape("box", (0.074, 0.036, 0.11)), (0, 0.068, -0.05, 0, 0, 0), METAL
            ),
            cylinder("drum", 0.0375, (0, 0.005, 0), (0, 0.086, 0)),
        ),
        (
            cylinder("drum", 0.0375, (0, 0, -0.0045), (0, 0, 0.058)),
            capsule("bend", 0.03, (0, 0, 0.027), (0.076, 0.005, 0.007)),
            cylinder("tube", 0.0375, (0.076, -0.035, 0), (0.076, 0.069, 0)),
        ),
        (cylinder("flange", 0.037, (0, 0, -0.028), (0, 0, 0)),),
    ]


def generate(folder: Path) -> None:
    """Writes the model."""
    write(XARM7, collisions(), _xarm7_shape.links(), folder)
