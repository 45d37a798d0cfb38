"""KUKA LBR iiwa 7 R800."""

from pathlib import Path

from prehensile.models.generate.robots import _iiwa
from prehensile.models.generate.robots._iiwa import Arm, Axis, diagonal

# The angles and limits are the five-decimal figures that the field's model of this arm uses:
# written out to more digits, the frames of the two would differ by micrometres.
QUARTER, HALF = 1.5708, 3.14159
A170, A120, A175 = 2.96706, 2.0944, 3.05433

ARM = Arm(
    name="iiwa7",
    title="KUKA LBR iiwa 7 R800",
    payload=7.0,
    reach=0.8,
    base=diagonal(3.863, (-0.013, 0.0, 0.07), (0.0141, 0.0171, 0.0178)),
    axes=(
        Axis(
            (0, 0, 0.1575, 0, 0, 0),
            (0, 0, 1),
            A170,
            176,
            1.710422667,
            8.65,
            160,
            7.171875e-5,
            diagonal(2.7025, (0, -0.0347, 0.113), (0.0171, 0.0163, 0.006)),
        ),
        Axis(
            (0, 0, 0.3405, QUARTER, 0, -HALF),
            (0, 1, 0),
            A120,
            176,
            1.710422667,
            5.44,
            160,
            1.737109e-4,
            diagonal(2.7258, (0, 0.0668, 0.0344), (0.017, 0.0061, 0.0162)),
        ),
        Axis(
            (0, 0, 0.5245, 0, 0, 0),
            (0, 0, 1),
            A170,
            110,
            1.745329252,
            5.69,
            160,
            1.266406e-4,
            diagonal(3.175, (0, 0.0296, 0.1265), (0.025, 0.0238, 0.0076)),
        ),
        Axis(
            (0, 0, 0.74, QUARTER, 0, 0),
            (0, -1, 0),
            A120,
            110,
            2.2689280276,
            11.01,
            160,
            7.09765e-5,
            diagonal(2.73, (0, 0.067, 0.034), (0.017, 0.0061, 0.0162)),
        ),
        Axis(
            (0, 0, 0.924, 0, 0, -HALF),
            (0, 0, 1),
            A170,
            110,
            2.4434609528,
            11.78,
            160,
            5.4375e-5,
            diagonal(1.69, (0.0001, 0.021, 0.076), (0.01, 0.0087, 0.00449)),
        ),
        Axis(
            (0, 0, 1.1395, QUARTER, 0, -HALF),
            (0, 1, 0),
            A120,
            40,
            3.1415926536,
            13.76,
            160,
            5.4765e-5,
            diagonal(1.8, (0, 0.0026, 0.0005), (0.0051, 0.0049, 0.0035)),
        ),
        Axis(
            (0, 0, 1.22, 0, 0, 0),
            (0, 0, 1),
            A175,
            40,
            3.1415926536,
            13.17,
            160,
            5.4375e-5,
            diagonal(0.4, (0, 0, 0.0294), (0.0004, 0.0004, 0.0005)),
        ),
    ),
    drum=(0.068, 0.068),
    flange=0.045,
)


def generate(folder: Path) -> None:
    """Writes the model."""
    _iiwa.write(ARM, folder)
