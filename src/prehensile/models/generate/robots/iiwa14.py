"""KUKA LBR iiwa 14 R820."""

from math import pi, radians
from pathlib import Path

from prehensile.models.generate.robots import _iiwa
from prehensile.models.generate.robots._iiwa import Arm, Axis, diagonal

ARM = Arm(
    name="iiwa14",
    title="KUKA LBR iiwa 14 R820",
    payload=14.0,
    reach=0.82,
    base=diagonal(5.0, (-0.1, 0.0, 0.07), (0.05, 0.06, 0.03)),
    axes=(
        Axis(
            (0, 0, 0.1575, 0, 0, 0),
            (0, 0, 1),
            radians(170),
            320,
            radians(85),
            8.57,
            160,
            1.321e-4,
            diagonal(5.76, (0, -0.03, 0.12), (0.033, 0.0333, 0.0123)),
        ),
        Axis(
            (0, 0, 0.36, pi / 2, 0, pi),
            (0, 1, 0),
            radians(120),
            320,
            radians(85),
            8.57,
            160,
            1.321e-4,
            diagonal(6.35, (0.0003, 0.059, 0.042), (0.0305, 0.011, 0.0304)),
        ),
        Axis(
            (0, 0, 0.5645, 0, 0, 0),
            (0, 0, 1),
            radians(170),
            176,
            radians(100),
            8.74,
            160,
            1.321e-4,
            diagonal(3.5, (0, 0.03, 0.13), (0.025, 0.0238, 0.0076)),
        ),
        Axis(
            (0, 0, 0.78, pi / 2, 0, 0),
            (0, -1, 0),
            radians(120),
            176,
            radians(75),
            11.36,
            160,
            1.321e-4,
            diagonal(3.5, (0, 0.067, 0.034), (0.017, 0.006, 0.0164)),
        ),
        Axis(
            (0, 0, 0.9645, 0, 0, pi),
            (0, 0, 1),
            radians(170),
            110,
            radians(130),
            12.23,
            100,
            1.321e-4,
            diagonal(3.5, (0.0001, 0.021, 0.076), (0.01, 0.0087, 0.00449)),
        ),
        Axis(
            (0, 0, 1.18, pi / 2, 0, pi),
            (0, 1, 0),
            radians(120),
            40,
            radians(135),
            15.72,
            160,
            4.54e-5,
            diagonal(1.8, (0, 0.0006, 0.0004), (0.0049, 0.0047, 0.0036)),
        ),
        Axis(
            (0, 0, 1.261, 0, 0, 0),
            (0, 0, 1),
            radians(175),
            40,
            radians(135),
            15.72,
            160,
            4.54e-5,
            diagonal(1.2, (0, 0, 0.02), (0.001, 0.001, 0.001)),
        ),
    ),
    drum=(0.0855, 0.068),
    flange=0.045,
)


def generate(folder: Path) -> None:
    """Writes the model."""
    _iiwa.write(ARM, folder)
