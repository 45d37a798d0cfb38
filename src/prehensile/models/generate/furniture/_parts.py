"""What tables, bins and cupboards are put together from: boxes that are seen and that touch."""

from collections.abc import Sequence
from dataclasses import dataclass

from prehensile.models.generate import solids
from prehensile.models.generate.sdf_model import (
    IDENTITY,
    Collision,
    Contact,
    Inertial,
    Link,
    Pose,
    Shape,
    Visual,
)


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


def inertial(mass: float, blocks: Sequence[Block]) -> Inertial:
    """Mass properties of blocks of one material."""
    return solids.body(mass, [(b.shape, b.pose) for b in blocks])


def collisions(blocks: Sequence[Block], contact: Contact) -> tuple[Collision, ...]:
    """The blocks as collision shapes."""
    return tuple(Collision(b.name, b.shape, b.pose, contact) for b in blocks)


def link(
    name: str,
    mass: float,
    blocks: Sequence[Block],
    contact: Contact,
    visuals: tuple[Visual, ...],
    pose: Pose = IDENTITY,
) -> Link:
    """A link made of blocks of one material."""
    return Link(name, pose, inertial(mass, blocks), visuals, collisions(blocks, contact))
