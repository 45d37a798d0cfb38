"""Universal Robots UR5e."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.robots import _ur
from prehensile.models.generate.robots._arm import QUARTER, turned
from prehensile.models.generate.robots._ur import SIZE_1, SIZE_3, Member
from prehensile.models.generate.robots._ur_shape import Build
from prehensile.models.generate.sdf_model import Inertial


def _round(
    mass: float,
    com: tuple[float, float, float],
    across: float,
    along: float,
    pitch: float = 0.0,
) -> Inertial:
    """A link like a cylinder, whose axis is turned by ``pitch`` about y from z."""
    inertia = (across, across, along, 0.0, 0.0, 0.0)
    return turned(Inertial(mass, com, inertia), (0.0, pitch, 0.0))


# Masses and centres of mass are the maker's; their inertias are those of cylinders.
UR5E = Member(
    name="ur5e",
    title="Universal Robots UR5e",
    payload=5.0,
    reach=0.85,
    mass=20.6,
    build=Build(
        d1=0.1625,
        a2=0.425,
        a3=0.3922,
        d4=0.1333,
        d5=0.0997,
        d6=0.0996,
        foot=0.075,
        top=0.0985,
        shoulder=0.0595,
        shoulder_lid=0.064,
        shoulder_face=0.0735,
        upper_lids=(0.204, 0.204),
        upper_axis=0.138,
        upper_tube=(0.0535, 0.0535),
        elbow=0.0585,
        elbow_face=0.0602,
        elbow_lid=-0.044,
        forearm_axis=0.0065,
        forearm_tube=(0.0475, 0.0385),
        forearm_end=-0.047,
        wrist=0.0385,
        wrist_1_face=0.0596,
        wrist_2_face=0.054,
        wrist_3_face=0.0532,
        wrist_lid=0.0565,
        flange=0.0375,
    ),
    inertials=(
        _round(3.761, (0.0, -0.00193, -0.02561), 0.0102675, 0.00666),
        _round(8.058, (-0.2125, 0.0, 0.11336), 0.1338858354, 0.0151074, QUARTER),
        _round(2.846, (-0.2422, 0.0, 0.0265), 0.0312093676, 0.004095, QUARTER),
        _round(1.37, (0.0, -0.01634, -0.0018), 0.0025599, 0.0021942),
        _round(1.3, (0.0, 0.01634, -0.0018), 0.0025599, 0.0021942),
        _round(0.365, (0.0, 0.0, -0.001159), 0.0000989041, 0.0001321172),
    ),
    sizes=(SIZE_3, SIZE_3, SIZE_3, SIZE_1, SIZE_1, SIZE_1),
    speeds=(np.pi,) * 6,
)


def generate(folder: Path) -> None:
    """Writes the model."""
    _ur.generate(UR5E, folder)
