"""The shape of a parallel gripper, as grasp selection needs it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class ParallelGripper:
    """Two fingers that close symmetrically along x of the hand's frame G.

    G is the hand's body frame: x is the closing direction, y points from the palm out of the
    hand to the finger tips, z across the fingers. All parts are boxes aligned with G and
    symmetric in x and z; y intervals say where they lie.

    Attributes:
        max_width: largest opening command [m].
        pad_offset: distance of each pad's surface from the plane x = 0 at opening zero [m]; at
            opening w the pads are w + 2 pad_offset apart.
        pad_y: interval of y that the pads cover [m].
        pad_width: size of the pads along z [m].
        finger_thickness: from a pad's surface to the back of the finger, along x [m].
        finger_width: size of a finger along z [m].
        palm_size: (x, z) size of the palm's box [m].
        palm_y: interval of y of the palm's box [m]; the fingers begin where it ends.
        wrist_size: (x, z) size of a box around what carries the palm [m].
        wrist_y: interval of y of that box [m].
    """

    max_width: float
    pad_offset: float
    pad_y: tuple[float, float]
    pad_width: float
    finger_thickness: float
    finger_width: float
    palm_size: tuple[float, float]
    palm_y: tuple[float, float]
    wrist_size: tuple[float, float]
    wrist_y: tuple[float, float]

    @property
    def p_GPad(self) -> NDArray[np.float64]:
        """(3,) the point midway between the centres of the pads, in G [m]."""
        return np.array([0.0, 0.5 * (self.pad_y[0] + self.pad_y[1]), 0.0])

    @property
    def max_gap(self) -> float:
        """Largest distance between the pads [m]."""
        return self.max_width + 2 * self.pad_offset

    def boxes(
        self, width: NDArray[np.float64], retreat: float = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The hand as four boxes: left finger, right finger, palm, wrist.

        Args:
            width: (M,) opening commands [m].
            retreat: every box is swept this far back along -y, so that it covers the straight
                approach [m].

        Returns:
            Centres (M, 4, 3) in G and full sizes (M, 4, 3).
        """
        half_x = 0.5 * width + self.pad_offset + 0.5 * self.finger_thickness
        still = np.zeros_like(half_x)
        finger = (self.finger_thickness, self.finger_width, (self.palm_y[1], self.pad_y[1]))
        parts = [
            (-half_x, *finger),
            (half_x, *finger),
            (still, *self.palm_size, self.palm_y),
            (still, *self.wrist_size, self.wrist_y),
        ]
        centres, sizes = [], []
        for x, size_x, size_z, (low, high) in parts:
            y = 0.5 * (low - retreat + high)
            centres.append(np.stack([x, still + y, still], axis=-1))
            sizes.append(np.broadcast_to([size_x, high - low + retreat, size_z], (len(x), 3)))
        return np.stack(centres, axis=1), np.stack(sizes, axis=1)


# Schunk WSG 50 with finger tips on an iiwa's flange; G is the frame of its link "body".
WSG50 = ParallelGripper(
    max_width=0.107,
    pad_offset=0.0025,
    pad_y=(0.098, 0.119),
    pad_width=0.022,
    finger_thickness=0.015,
    finger_width=0.022,
    palm_size=(0.146, 0.050),
    palm_y=(-0.0365, 0.0365),
    wrist_size=(0.09, 0.09),
    wrist_y=(-0.12, -0.0365),
)
