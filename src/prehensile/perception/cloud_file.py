"""Point clouds in files: PLY and PCD."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.perception.cloud import PointCloud
from prehensile.perception.pcd import format_pcd, parse_pcd
from prehensile.perception.ply import format_ply, parse_ply

_MAX_BYTES = 2 << 30


def read_cloud(path: Path | str) -> PointCloud:
    """Reads a point cloud from a PLY or PCD file, by its suffix.

    Known are positions, normals, colours (red, green, blue as bytes or as parts of one; PCD's
    packed rgb) and labels; other properties are passed over. Points that are not finite (pixels
    without return) are dropped. The viewpoint of a PCD file, where it is not the origin, becomes
    the sensor origin of all its points; for PLY ``sensor_x``, ``sensor_y``, ``sensor_z`` hold it.

    Raises:
        InputError: the file's format is not known, or it is broken, too large, or has no points'
            coordinates.
        OSError: it cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".ply", ".pcd"):
        raise InputError(
            Finding(f"{suffix!r} is no format of clouds", "use .ply or .pcd", str(path))
        )
    if path.stat().st_size > _MAX_BYTES:
        raise InputError(Finding("the file is larger than 2 GiB", "split it", str(path)))
    data = path.read_bytes()
    try:
        if suffix == ".pcd":
            fields, viewpoint = parse_pcd(data)
            origin = viewpoint[:3] if viewpoint[:3].any() else None
        else:
            elements = parse_ply(data)
            if "vertex" not in elements:
                raise InputError("the PLY file has no element 'vertex'")
            fields, origin = elements["vertex"], None
        return _cloud(fields, origin)
    except InputError as error:
        raise InputError(
            *(Finding(f.message, f.mend, str(path), f.line, f.key) for f in error.findings)
        ) from None


def write_cloud(path: Path | str, cloud: PointCloud) -> None:
    """Writes a point cloud to a PLY or PCD file, by its suffix; binary, whole or not at all.

    Positions and normals are written in double precision, so that reading gives the same cloud.
    PCD has one viewpoint for a whole file: sensor origins that differ become fields
    ``sensor_x``, ``sensor_y``, ``sensor_z``, as in PLY.

    Raises:
        InputError: the suffix is neither .ply nor .pcd.
        OSError: it cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".ply", ".pcd"):
        raise InputError(
            Finding(f"{suffix!r} is no format of clouds", "use .ply or .pcd", str(path))
        )
    normals = ("normal_x", "normal_y", "normal_z") if suffix == ".pcd" else ("nx", "ny", "nz")
    fields: dict[str, NDArray[Any]] = {}
    for names, values in (
        (("x", "y", "z"), cloud.points),
        (normals, cloud.normals),
        (("sensor_x", "sensor_y", "sensor_z"), cloud.sensor_origins),
    ):
        if values is not None:
            fields |= {name: values[:, i] for i, name in enumerate(names)}
    if cloud.labels is not None:
        if len(cloud) and np.abs(cloud.labels).max() >= 2**31:
            raise InputError(Finding("labels do not fit 32 bits", "number them anew", str(path)))
        fields["label"] = cloud.labels.astype(np.int32)
    if suffix == ".ply":
        if cloud.colors is not None:
            fields |= {n: cloud.colors[:, i] for i, n in enumerate(("red", "green", "blue"))}
        write_atomic(path, format_ply({"vertex": fields}))
        return
    if cloud.colors is not None:
        red, green, blue = cloud.colors.astype(np.uint32).T
        fields["rgb"] = (red << 16 | green << 8 | blue).astype(np.uint32)
    viewpoint = np.array([0.0, 0, 0, 1, 0, 0, 0])
    origins = cloud.sensor_origins
    if origins is not None and len(origins) and (origins == origins[0]).all() and origins[0].any():
        for name in ("sensor_x", "sensor_y", "sensor_z"):
            del fields[name]
        viewpoint[:3] = origins[0]
    write_atomic(path, format_pcd(fields, viewpoint))


def _cloud(fields: Mapping[str, NDArray[Any]], origin: NDArray[np.float64] | None) -> PointCloud:
    """The cloud of a file's fields."""

    def columns(*names: str) -> NDArray[np.float64] | None:
        if any(n not in fields or fields[n].ndim != 1 for n in names):
            return None
        return np.stack([fields[n] for n in names], axis=1).astype(np.float64)

    points = columns("x", "y", "z")
    if points is None:
        raise InputError("the file has no coordinates x, y and z")
    normals = columns("nx", "ny", "nz")
    if normals is None:
        normals = columns("normal_x", "normal_y", "normal_z")
    kept: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    if normals is not None:
        unknown = ~np.isfinite(normals).all(axis=1)
        normals[unknown] = 0.0
    origins = columns("sensor_x", "sensor_y", "sensor_z")
    if origins is not None and not np.isfinite(origins).all():
        raise InputError("the file has sensor origins that are not finite")
    if origins is None and origin is not None:
        origins = np.broadcast_to(origin, points.shape)
    labels = fields.get("label")
    if labels is not None and (labels.ndim != 1 or not np.issubdtype(labels.dtype, np.integer)):
        labels = None
    return PointCloud(
        points[kept],
        normals=None if normals is None else normals[kept],
        colors=_colors(fields, kept),
        labels=None if labels is None else labels[kept].astype(np.int64),
        sensor_origins=None if origins is None else origins[kept],
    )


def _colors(
    fields: Mapping[str, NDArray[Any]], kept: NDArray[np.bool_]
) -> NDArray[np.uint8] | None:
    names = ("red", "green", "blue")
    if all(n in fields and fields[n].ndim == 1 for n in names):
        values = np.stack([fields[n] for n in names], axis=1)
        if np.issubdtype(values.dtype, np.floating):  # Parts of one.
            values = np.round(255 * np.clip(np.nan_to_num(values.astype(np.float64)), 0, 1))
        return np.clip(values[kept], 0, 255).astype(np.uint8)
    packed = fields.get("rgb", fields.get("rgba"))
    if packed is None or packed.ndim != 1 or packed.dtype.itemsize != 4:
        return None
    bits = np.ascontiguousarray(packed[kept]).view(np.uint32)
    return np.stack([bits >> 16, bits >> 8, bits], axis=1).astype(np.uint8)
