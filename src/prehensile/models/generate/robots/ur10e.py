"""Universal Robots UR10e."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.robots import _ur
from prehensile.models.generate.robots._arm import QUARTER, turned
from prehensile.models.generate.robots._ur import SIZE_2, SIZE_3, SIZE_4, Member
from prehensile.models.generate.robots._ur_shape import Build
from prehensile.models.generate.sdf_model import Inertial

# All mass properties are the maker's, the inertias in the axes of the maker's DH frames.
_WRIST = (0.00296, 0.00222, 0.00258, -0.00001, 0.0, -0.00024)
UR10E = Member(
    name="ur10e",
    title="Universal Robots UR10e",
    payload=12.5,
    reach=1.3,
    mass=33.5,
    build=Build(
        d1=0.1807,
        a2=0.6127,
        a3=0.57155,
        d4=0.17415,
        d5=0.11985,
        d6=0.11655,
        foot=0.095,
        top=0.0987,
        shoulder=0.0755,
        shoulder_lid=0.086,
        shoulder_face=0.0947,
        upper_lids=(0.266, 0.249),
        upper_axis=0.1762,
        upper_tube=(0.0715, 0.0585),
        elbow=0.0605,
        elbow_face=0.0985,
        elbow_lid=-0.017,
        forearm_axis=0.0433,
        forearm_tube=(0.0555, 0.0475),
        forearm_end=-0.018,
        wrist=0.0465,
        wrist_1_face=0.1062,
        wrist_2_face=0.0669,
        wrist_3_face=0.068,
        wrist_lid=0.0575,
        flange=0.044,
    ),
    inertials=(
        turned(
            Inertial(
                7.369,
                (0.021, -0.027, 0.0),
                (0.03408, 0.03529, 0.02156, 0.00002, -0.00425, 0.00008),
            ),
            (QUARTER, 0.0, 0.0),
        ),
        Inertial(
            13.051,
            (-0.2327, 0.0, 0.158),
            (0.02814, 0.77068, 0.76943, 0.00005, -0.01561, 0.00002),
        ),
        Inertial(
            3.989,
            (-0.33155, 0.0, 0.068),
            (0.01014, 0.30928, 0.30646, 0.00008, 0.00916, 0.0),
        ),
        turned(Inertial(2.1, (0.0, -0.018, 0.007), _WRIST), (QUARTER, 0.0, 0.0)),
        turned(Inertial(1.98, (0.0, 0.018, -0.007), _WRIST), (-QUARTER, 0.0, 0.0)),
        Inertial(0.615, (0.0, 0.0, -0.026), (0.0004, 0.00041, 0.00034, 0.0, 0.0, 0.0)),
    ),
    sizes=(SIZE_4, SIZE_4, SIZE_3, SIZE_2, SIZE_2, SIZE_2),
    speeds=(2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0, np.pi, np.pi, np.pi, np.pi),
)


def generate(folder: Path) -> None:
    """Writes the model."""
    _ur.generate(UR10E, folder)
