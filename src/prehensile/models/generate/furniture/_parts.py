"""What tables, bins and cupboards are put together from: boxes that are seen and that touch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from prehensile.models.generate import solids
from prehensile.models.generate.sdf_model import (
    IDENTITY,
    Collision,
    Contact,
    Link,
    Pose,
    Shape,
    Visual,
)

FOOT = 0.008  # m, radius of the balls that furniture stands on
LIFT = 0.001  # m, of its boxes above the ground


@dataclass(frozen=True)
class Block:
    """An axis-aligned box between two corners (m, in the frame of the link)."""

    name: str
    low: tuple[float, float, float]
    high: tuple[float, float, float]

    @property
    def shape(self) -> Shape:
        """The box."""
        size = (round(high - low, 9) for low, high in zip(self.low, self.high, strict=True))
        return Shape("box", tuple(size))

    @property
    def pose(self) -> Pose:
        """Of its centre."""
        x, y, z = (
            round(0.5 * (high + low), 9) for low, high in zip(self.low, self.high, strict=True)
        )
        return (x, y, z, 0.0, 0.0, 0.0)


def collisions(
    blocks: Sequence[Block], contact: Contact, feet: Sequence[Sequence[float]] = ()
) -> tuple[Collision, ...]:
    """The blocks as collision shapes, and balls under them to stand on.

    Two boxes touch in one point, which jumps about the face from step to step; with a ball at each
    corner of its underside a piece of furniture stands still.

    Args:
        blocks: the boxes.
        contact: of all shapes.
        feet: (x, y, z) where the underside stands; all at one height. Blocks that reach down to it
            end ``LIFT`` above.
    """
    ground = feet[0][2] + LIFT if feet else -np.inf
    lifted = [replace(b, low=(*b.low[:2], max(b.low[2], ground))) for b in blocks]
    shapes = [Collision(b.name, b.shape, b.pose, contact) for b in lifted]
    hard = replace(contact, hydroelastic="", modulus=0.0, resolution=0.0)
    for i, (x, y, z) in enumerate(feet):
        pose = (round(x, 9), round(y, 9), round(z + FOOT, 9), 0.0, 0.0, 0.0)
        shapes.append(Collision(f"foot_{i}", Shape("sphere", (FOOT,)), pose, hard))
    return tuple(shapes)


def link(
    name: str,
    mass: float,
    blocks: Sequence[Block],
    contact: Contact,
    visuals: tuple[Visual, ...],
    feet: Sequence[Sequence[float]] = (),
) -> Link:
    """A link made of blocks of one material that stands on ``feet``."""
    inertial = solids.body(mass, [(b.shape, b.pose) for b in blocks])
    return Link(name, IDENTITY, inertial, visuals, collisions(blocks, contact, feet))
