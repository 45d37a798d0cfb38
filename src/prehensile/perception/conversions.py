"""Point clouds from and to Drake's and Open3D's, and from bare arrays."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.perception import BaseField, Fields
from pydrake.perception import PointCloud as DrakePointCloud

from prehensile.errors import InputError
from prehensile.perception.cloud import PointCloud


def cloud_from_rows(
    points: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    labels: ArrayLike | None = None,
    sensor_origin: ArrayLike | None = None,
) -> PointCloud:
    """A cloud of those rows whose points are finite: of an image's pixels, those with a return.

    A normal that is not finite becomes zero (not known).

    Args:
        points: (..., 3) positions [m].
        normals: (..., 3) unit normals.
        colors: (..., 3) or (..., 4) uint8 red, green, blue (the fourth channel is dropped).
        labels: (...) integers.
        sensor_origin: (3,) position of the sensor that saw them all [m].

    Raises:
        InputError: if a shape does not fit the points'.
    """
    p = np.asarray(points, dtype=np.float64)
    if p.ndim < 2 or p.shape[-1] != 3:
        raise InputError(f"points has shape {p.shape}; expected (..., 3)")
    kept = np.isfinite(p).all(axis=-1)
    fields: dict[str, Any] = {"points": p[kept]}
    for name, value, channels in (
        ("normals", normals, (3,)),
        ("colors", colors, (3, 4)),
        ("labels", labels, ()),
    ):
        if value is None:
            continue
        array = np.asarray(value)
        shapes = [(*p.shape[:-1], c) for c in channels] or [p.shape[:-1]]
        if array.shape not in shapes:
            raise InputError(f"{name} has shape {array.shape}; expected {shapes[0]}")
        fields[name] = array[kept][..., :3] if channels else array[kept]
    if "normals" in fields:
        unknown = ~np.isfinite(fields["normals"]).all(axis=-1)
        fields["normals"] = np.where(unknown[:, None], 0.0, fields["normals"])
    return PointCloud(**fields, sensor_origins=None if sensor_origin is None else sensor_origin)  # pyright: ignore[reportArgumentType]


def from_drake(cloud: DrakePointCloud, *, sensor_origin: ArrayLike | None = None) -> PointCloud:
    """The finite points of Drake's cloud, with its normals and colours if it has them.

    Args:
        cloud: Drake's cloud.
        sensor_origin: (3,) position of the sensor that saw it, in the cloud's frame [m].

    Raises:
        InputError: if it has no positions.
    """
    if not cloud.has_xyzs():
        raise InputError("cloud has no field xyzs")
    return cloud_from_rows(
        cloud.xyzs().T,
        normals=cloud.normals().T if cloud.has_normals() else None,
        colors=cloud.rgbs().T if cloud.has_rgbs() else None,
        sensor_origin=sensor_origin,
    )


def to_drake(cloud: PointCloud) -> DrakePointCloud:
    """Drake's cloud with positions, normals and colours as far as known (single precision)."""
    fields = int(BaseField.kXYZs)
    if cloud.normals is not None:
        fields |= int(BaseField.kNormals)
    if cloud.colors is not None:
        fields |= int(BaseField.kRGBs)
    result = DrakePointCloud(len(cloud), Fields(fields))
    result.mutable_xyzs()[:] = cloud.points.T
    if cloud.normals is not None:
        result.mutable_normals()[:] = cloud.normals.T
    if cloud.colors is not None:
        result.mutable_rgbs()[:] = cloud.colors.T
    return result


def from_open3d(cloud: Any, *, sensor_origin: ArrayLike | None = None) -> PointCloud:
    """The finite points of an ``open3d.geometry.PointCloud``, with normals and colours.

    Args:
        cloud: Open3D's cloud.
        sensor_origin: (3,) position of the sensor that saw it, in the cloud's frame [m].
    """
    colors = np.asarray(cloud.colors)
    return cloud_from_rows(
        np.asarray(cloud.points).reshape(-1, 3),
        normals=np.asarray(cloud.normals) if cloud.has_normals() else None,
        colors=_bytes(colors) if cloud.has_colors() else None,
        sensor_origin=sensor_origin,
    )


def to_open3d(cloud: PointCloud) -> Any:
    """An ``open3d.geometry.PointCloud`` with positions, normals and colours as far as known.

    Raises:
        InputError: if Open3D is not installed.
    """
    try:
        import open3d  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError("Open3D is not installed; pip install open3d") from None
    vectors = open3d.utility.Vector3dVector
    result = open3d.geometry.PointCloud(vectors(cloud.points))
    if cloud.normals is not None:
        result.normals = vectors(cloud.normals)
    if cloud.colors is not None:
        result.colors = vectors(cloud.colors / 255.0)
    return result


def _bytes(parts: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Colours in [0, 1] as bytes."""
    return np.round(255 * np.clip(parts, 0, 1)).astype(np.uint8)
