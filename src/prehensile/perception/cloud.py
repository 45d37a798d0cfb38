"""Point clouds, and boxes that cut them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform

from prehensile.errors import InputError
from prehensile.native import _core


class Box(NamedTuple):
    """A solid box: its pose in a frame W (or any other) and its full edge lengths.

    Attributes:
        X_WB: pose of the box's frame B, whose origin is the centre of the box.
        size: (3,) edge lengths along B's axes [m].
    """

    X_WB: RigidTransform
    size: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points and what is known of each, all in one frame; row i of each array is point i.

    Whatever array-like is given becomes an array of the type below.

    Attributes:
        points: (N, 3) positions [m], finite (and none beyond 1e30).
        normals: (N, 3) unit normals, pointing out of the surface; None if not known. Zero where a
            single one is not known.
        colors: (N, 3) uint8 red, green, blue; None if not known.
        labels: (N,) int64 to which segment or object each belongs, -1 for none; None if not known.
        sensor_origins: (N, 3) where the sensor was that saw each point [m]; one position (3,) may
            be given for all. None if not known.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None = None
    colors: NDArray[np.uint8] | None = None
    labels: NDArray[np.int64] | None = None
    sensor_origins: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        """Converts the arrays and checks them.

        Raises:
            InputError: if shapes disagree or a number is not finite.
        """
        count = len(np.atleast_1d(np.asarray(self.points)))
        faults = []
        for name, dtype, shape in _FIELDS:
            value = getattr(self, name)
            if value is None and name != "points":
                continue
            expected = (count, *shape)
            try:
                array = _converted(value, dtype)
            except (TypeError, ValueError, OverflowError) as error:
                faults.append(f"{name} cannot be an array of {np.dtype(dtype)}: {error}")
                continue
            if name == "sensor_origins" and array.shape == (3,):
                array = np.broadcast_to(array, expected)
            if array.shape != expected:
                faults.append(f"{name} has shape {array.shape}; expected {expected}")
            elif not within(array, _LIMITS.get(name, FARTHEST)):
                faults.append(
                    f"{name} holds values that are not finite"
                    + (", or vectors longer than one" if name == "normals" else " or beyond 1e30")
                )
            object.__setattr__(self, name, array)
        if faults:
            raise InputError(*faults)

    def __len__(self) -> int:
        """The number of points."""
        return len(self.points)

    def require_normals(self) -> NDArray[np.float64]:
        """The normals (N, 3).

        Raises:
            InputError: if the cloud has none.
        """
        if self.normals is None:
            raise InputError("the cloud has no normals; estimate them first")
        return self.normals

    def require_sensor_origins(self) -> NDArray[np.float64]:
        """Where the sensor was that saw each point, (N, 3).

        Raises:
            InputError: if the cloud does not know.
        """
        if self.sensor_origins is None:
            raise InputError("the cloud has no sensor_origins; give the position of its camera")
        return self.sensor_origins

    def replace(self, **fields: Any) -> "PointCloud":
        """This cloud with some fields replaced, by name."""
        own = {name: getattr(self, name) for name, _, _ in _FIELDS}
        return PointCloud(**{**own, **fields})

    def select(self, index: NDArray[np.bool_] | NDArray[np.integer]) -> "PointCloud":
        """The cloud of the points chosen by a mask (N,) or by indices (M,)."""
        known = {name: getattr(self, name) for name, _, _ in _FIELDS}
        return PointCloud(**{name: v[index] for name, v in known.items() if v is not None})

    def transformed(self, X_AB: RigidTransform) -> "PointCloud":
        """This cloud, given in B, expressed in A."""
        R_AB = np.asarray(X_AB.rotation().matrix(), dtype=float)
        p_AB = X_AB.translation()
        return self.replace(
            points=rotate(self.points, R_AB) + p_AB,
            normals=None if self.normals is None else rotate(self.normals, R_AB),
            sensor_origins=None
            if self.sensor_origins is None
            else rotate(self.sensor_origins, R_AB) + p_AB,
        )


FARTHEST = 1e30
"""Coordinates beyond this are not places [m]: products of a few of them would overflow."""

_LIMITS = {"normals": 1.001}

_FIELDS: tuple[tuple[str, Any, tuple[int, ...]], ...] = (
    ("points", np.float64, (3,)),
    ("normals", np.float64, (3,)),
    ("colors", np.uint8, (3,)),
    ("labels", np.int64, ()),
    ("sensor_origins", np.float64, (3,)),
)


def within(array: NDArray[Any], limit: float) -> bool:
    """Whether all values lie within -limit and limit; NaN does not."""
    return not array.size or bool(array.max() <= limit and array.min() >= -limit)


def _converted(value: Any, dtype: Any) -> NDArray[Any]:
    """The value as an array of a type, refusing what would lose its meaning."""
    array = np.asarray(value)
    if np.issubdtype(dtype, np.integer) and array.size:
        if not np.issubdtype(array.dtype, np.integer):
            raise TypeError(f"its values are {array.dtype}")
        info = np.iinfo(dtype)
        if array.min() < info.min or array.max() > info.max:
            raise OverflowError(f"values outside {info.min} to {info.max}")
    elif np.iscomplexobj(array):
        raise TypeError(f"its values are {array.dtype}")
    return np.asarray(array, dtype=dtype)


def merge(clouds: Sequence[PointCloud]) -> PointCloud:
    """All points of several clouds of one frame, in order.

    A field stays if every cloud that holds a point has it. To bring views of calibrated cameras
    into one frame first, see :meth:`PointCloud.transformed`.
    """
    clouds = [c for c in clouds if len(c)]
    if not clouds:
        return PointCloud(np.zeros((0, 3)))
    fields = {}
    for name, _, _ in _FIELDS:
        values = [getattr(c, name) for c in clouds]
        fields[name] = None if any(v is None for v in values) else np.concatenate(values)
    return PointCloud(**fields)


def rotate(vectors: NDArray[np.floating], R: NDArray[np.floating]) -> NDArray[np.float64]:
    """R v for every row v of (..., 3) vectors.

    Written out, because the general matrix product starts threads for each such call.
    """
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    out = np.empty(vectors.shape)
    for k in range(3):
        out[..., k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z
    return out


def inside_box(points: ArrayLike, box: Box) -> NDArray[np.bool_]:
    """Which points (..., 3) in W lie inside or on the box: a mask (...).

    A point with a coordinate that is not finite is outside.

    Raises:
        ValueError: if the shape is wrong, the box's size is not three finite numbers of at least
            0, or its pose is not finite.
    """
    rows = _rows(points)
    size = np.asarray(box.size, dtype=float)
    if size.shape != (3,) or not (np.isfinite(size) & (size >= 0)).all():
        raise ValueError(f"box: its size must be three finite numbers of at least 0, not {size}")
    if not np.isfinite(box.X_WB.translation()).all():
        raise ValueError("box: its pose must be finite")
    mask = _core.inside_box(rows, box.X_WB.inverse().GetAsMatrix4(), size)
    return mask.view(np.bool_).reshape(np.shape(points)[:-1])


def inside_half_space(points: ArrayLike, normal: ArrayLike, offset: float) -> NDArray[np.bool_]:
    """Which points p (..., 3) have normal . p >= offset: a mask (...).

    A point with a coordinate that is not finite has not.

    Args:
        points: (..., 3) positions [m].
        normal: (3,) normal of the plane, not zero, pointing into the half-space that is meant.
        offset: the plane's distance from the origin along the normal, times its length [m].

    Raises:
        ValueError: if a shape is wrong, normal or offset is not finite, or normal is zero.
    """
    if not np.any(normal):
        raise ValueError("normal: must not be zero")
    mask = _core.inside_half_space(_rows(points), normal, offset)
    return mask.view(np.bool_).reshape(np.shape(points)[:-1])


def crop(cloud: PointCloud, box: Box) -> PointCloud:
    """The points of the cloud inside or on the box (both in the same frame), in order.

    A crop by pose is one by the box's ``X_WB``.
    """
    return cloud.select(inside_box(cloud.points, box))


def _rows(points: ArrayLike) -> NDArray[np.floating]:
    """Points (..., 3) as contiguous rows of float32 or float64."""
    array = np.asarray(points)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise ValueError(f"points: expected shape (..., 3), not {array.shape}")
    dtype = array.dtype if array.dtype in (np.float32, np.float64) else np.float64
    return np.ascontiguousarray(array.reshape(-1, 3), dtype=dtype)
