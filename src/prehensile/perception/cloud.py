"""Point clouds with normals, and boxes that cut them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.errors import InputError


class Box(NamedTuple):
    """A solid box: its pose in a frame W (or any other) and its full edge lengths.

    Attributes:
        X_WB: pose of the box's frame B, whose origin is the centre of the box.
        size: (3,) edge lengths along B's axes [m].
    """

    X_WB: RigidTransform
    size: NDArray[np.float64]


@dataclass(frozen=True)
class Cloud:
    """Points with unit normals, all in one frame; row i of each array is one point.

    Attributes:
        points: (N, 3) positions [m].
        normals: (N, 3) unit normals, pointing out of the surface.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Checks shapes and finiteness.

        Raises:
            InputError: if the shapes disagree or a value is not finite.
        """
        fields = {"points": self.points, "normals": self.normals}
        faults = [
            f"{name} has shape {value.shape}; expected ({len(self.points)}, 3)"
            for name, value in fields.items()
            if value.shape != (len(self.points), 3)
        ] + [
            f"{name} holds values that are not finite"
            for name, value in fields.items()
            if not np.isfinite(value).all()
        ]
        if faults:
            raise InputError(*faults)

    def __len__(self) -> int:
        """The number of points."""
        return len(self.points)

    def select(self, index: NDArray[np.bool_] | NDArray[np.int64]) -> "Cloud":
        """The cloud of the points chosen by a mask (N,) or by indices (M,)."""
        return Cloud(self.points[index], self.normals[index])

    def transformed(self, X_AB: RigidTransform) -> "Cloud":
        """This cloud, given in B, expressed in A."""
        R_AB = np.asarray(X_AB.rotation().matrix(), dtype=float)
        return Cloud(rotate(self.points, R_AB) + X_AB.translation(), rotate(self.normals, R_AB))


def rotate(vectors: NDArray[np.floating], R: NDArray[np.floating]) -> NDArray[np.float64]:
    """R v for every row v of (..., 3) vectors.

    Written out, because the general matrix product starts threads for each such call.
    """
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    out = np.empty(vectors.shape)
    for k in range(3):
        out[..., k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z
    return out


def inside_box(points: NDArray[np.floating], box: Box) -> NDArray[np.bool_]:
    """Which points (..., 3) in W lie inside or on the box: a mask (...).

    A point with a coordinate that is not finite is outside.
    """
    X_BW = box.X_WB.inverse()
    R_BW, p_BW = X_BW.rotation().matrix(), X_BW.translation()
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    inside = np.ones(points.shape[:-1], dtype=bool)
    with np.errstate(invalid="ignore"):
        for k in range(3):
            p_k = R_BW[k, 0] * x + R_BW[k, 1] * y + R_BW[k, 2] * z + p_BW[k]
            inside &= np.abs(p_k) <= 0.5 * box.size[k]
    return inside


def crop(cloud: Cloud, box: Box) -> Cloud:
    """The points of the cloud inside or on the box (both in the same frame), in order."""
    return cloud.select(inside_box(cloud.points, box))
