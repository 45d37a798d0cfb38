"""The shape of a parallel gripper, as grasp selection needs it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class HandBox(NamedTuple):
    """A box of the hand, aligned with its frame G and symmetric in z [m].

    Attributes:
        x: interval of x.
        y: interval of y.
        width: size along z.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    width: float


@dataclass(frozen=True)
class ParallelGripper:
    """Two mirrored fingers that close evenly along x of the hand's frame G.

    G is the hand's body frame: x is the closing direction, y points from the palm out of the
    hand to the finger tips, z across the fingers.

    Attributes:
        max_width: largest opening command [m].
        pad_offset: distance of each pad's surface from the plane x = 0 at opening zero [m]; at
            opening w the pads are w + 2 pad_offset apart.
        pad_y: interval of y that the pads cover [m].
        pad_width: size of the pads along z [m].
        finger: boxes of the right finger (x > 0) at opening zero; the first reaches from the pad
            to the finger's back and from the tip to the palm.
        body: boxes of the palm and of what carries it, which do not move with the fingers.
    """

    max_width: float
    pad_offset: float
    pad_y: tuple[float, float]
    pad_width: float
    finger: tuple[HandBox, ...]
    body: tuple[HandBox, ...]

    @property
    def p_GPad(self) -> NDArray[np.float64]:
        """(3,) the point midway between the centres of the pads, in G [m]."""
        return np.array([0.0, 0.5 * (self.pad_y[0] + self.pad_y[1]), 0.0])

    @property
    def max_gap(self) -> float:
        """Largest distance between the pads [m]."""
        return self.max_width + 2 * self.pad_offset

    @property
    def finger_thickness(self) -> float:
        """From a pad's surface to the back of the finger at its tip [m]."""
        return self.finger[0].x[1] - self.pad_offset

    def boxes(
        self, width: NDArray[np.float64], retreat: float = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """All boxes of the hand at several openings.

        Args:
            width: (M,) opening commands [m].
            retreat: every box is swept this far back along -y, so that it covers the straight
                approach [m].

        Returns:
            Centres (M, B, 3) in G and full sizes (M, B, 3).
        """
        centres, sizes = [], []
        for part, moves in [
            *((part, sign) for part in self.finger for sign in (-1, 1)),
            *((part, 0) for part in self.body),
        ]:
            low, high = np.array([part.x, part.y]).T
            low[1] -= retreat
            x = 0.5 * (low[0] + high[0])
            y = np.full_like(width, 0.5 * (low[1] + high[1]))
            centre_x = moves * (0.5 * width + x) if moves else np.full_like(width, x)
            centres.append(np.stack([centre_x, y, np.zeros_like(width)], axis=-1))
            size = np.array([high[0] - low[0], high[1] - low[1], part.width])
            sizes.append(np.broadcast_to(size, (len(width), 3)))
        return np.stack(centres, axis=1), np.stack(sizes, axis=1)


# Our model wsg50 on an iiwa's flange; G is the frame of its link "body".
WSG50 = ParallelGripper(
    max_width=0.107,
    pad_offset=0.0,
    pad_y=(0.0861, 0.1182),
    pad_width=0.022,
    finger=(
        HandBox((0.0, 0.0185), (0.0361, 0.1182), 0.022),
        HandBox((0.0055, 0.0255), (0.0361, 0.0662), 0.026),
    ),
    body=(
        HandBox((-0.073, 0.073), (-0.0363, 0.0363), 0.050),
        HandBox((-0.045, 0.045), (-0.12, -0.0363), 0.090),
    ),
)
