"""Distance fields of known objects: built once, kept on disk, looked up in nanoseconds."""

import contextlib
import hashlib
import os
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.native import _core
from prehensile.perception.cloud import PointCloud
from prehensile.perception.mesh import TriangleMesh

_MAGIC = b"PREHDF01"  # The last two digits are the format's version.
_HEADER = struct.Struct("<8s4d3i?3x")  # Magic; origin, spacing; sizes; signed.


class FieldSample(NamedTuple):
    """What a field knows at N points.

    Attributes:
        distances: (N,) to the surface [m]; negative inside if the field is signed.
        gradients: (N, 3) of the distance, expressed in the object's frame O: unit vectors but near
            edges, corners and the medial axis.
    """

    distances: NDArray[np.float64]
    gradients: NDArray[np.float64]


class SurfacePoints(NamedTuple):
    """The points of a surface that are nearest to N others.

    Attributes:
        points: (N, 3) on the surface, expressed in the object's frame O [m].
        normals: (N, 3) unit normals there, outward.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]


class DistanceField:
    """Distance to the surface of a rigid object, in the object's frame O, by a grid of nodes.

    Nodes hold the distance to the nearest surface point and its gradient; between them both are
    interpolated, so that the error is of third order in the spacing where the surface is smooth
    (some micrometres at 3 mm on a household object) and below a spacing at edges and the medial
    axis. Outside the grid, distances are to the surface point that is nearest to the nearest point
    of the grid: upper bounds, that a wider ``margin`` tightens.

    Constant, and may be asked by several threads. Made by :meth:`from_mesh`, :meth:`from_cloud`,
    :meth:`load` or :func:`cached_distance_field`.
    """

    def __init__(self, core: _core.DistanceField) -> None:
        """Wraps the compiled field."""
        self.core = core

    @staticmethod
    def from_mesh(
        mesh: TriangleMesh,
        spacing: float = 0.003,
        margin: float | None = None,
        *,
        signed: bool = True,
        num_threads: int = 1,
    ) -> "DistanceField":
        """The field of a mesh; distances are exact at the nodes.

        Args:
            mesh: in O. Closed pieces may overlap: signs are those of their union, and inside it
                distances may be to a hidden part of a piece.
            spacing: of the nodes [m].
            margin: how far the grid reaches beyond the mesh's bounding box [m]; by default a
                quarter of its diagonal.
            signed: whether the field must tell inside from outside. A mesh that is not closed has
                no inside: its field can only be had without signs.
            num_threads: to share the work; the result is the same.

        Raises:
            ValueError: naming the argument: a spacing or margin that is not positive and finite, or
                so fine that the grid has over 2^28 nodes; ``triangles`` that are not closed or are
                turned inside out though ``signed``.
        """
        grid = _grid(mesh.vertices, spacing, _margin(mesh.vertices, margin))
        triangles = mesh.triangles.astype(np.int32)
        core = _core.DistanceField.from_mesh(mesh.vertices, triangles, *grid, signed, num_threads)
        return DistanceField(core)

    @staticmethod
    def from_cloud(
        cloud: PointCloud,
        spacing: float = 0.003,
        margin: float | None = None,
        *,
        radius: float | None = None,
        num_threads: int = 1,
    ) -> "DistanceField":
        """The field, without signs, of a cloud whose points stand for small discs.

        Args:
            cloud: in O, with unit normals, densely and evenly covering the surface.
            spacing, margin, num_threads: as for :meth:`from_mesh`.
            radius: of the discs [m]; by default the median distance of a point from its third
                nearest neighbour, for which the discs close the surface.

        Raises:
            ValueError: naming the argument; InputError if the cloud is empty or has no normals.
        """
        normals = cloud.require_normals()
        if not len(cloud):
            raise InputError("the cloud is empty")
        if radius is None:
            tree = _core.KdTree(cloud.points)
            _, distances = tree.nearest(cloud.points, min(4, len(cloud)), np.inf, num_threads)
            radius = float(np.median(distances[:, -1])) or spacing
        grid = _grid(cloud.points, spacing, _margin(cloud.points, margin))
        core = _core.DistanceField.from_cloud(cloud.points, normals, radius, *grid, num_threads)
        return DistanceField(core)

    @staticmethod
    def from_values(
        origin: ArrayLike,
        spacing: float,
        distances: ArrayLike,
        gradients: ArrayLike,
        *,
        signed: bool = True,
    ) -> "DistanceField":
        """The field of distances known at the nodes, of a closed form or another's field.

        Args:
            origin: (3,) node (0, 0, 0), in O [m].
            spacing: of the nodes [m].
            distances: (nx, ny, nz) [m], each size at least 2.
            gradients: (nx, ny, nz, 3) of the distances, no longer than 1.
            signed: whether distances are negative inside.

        Raises:
            ValueError: naming the argument.
        """
        corner = np.asarray(origin, dtype=float)
        if corner.shape != (3,):
            raise ValueError(f"origin: expected shape (3,), not {corner.shape}")
        x, y, z = corner
        d, g = np.asarray(distances, dtype=np.float32), np.asarray(gradients, dtype=np.float32)
        if d.ndim != 3 or g.shape != (*d.shape, 3):
            raise ValueError(
                f"distances: expected (nx, ny, nz) and gradients (nx, ny, nz, 3), not {d.shape} "
                f"and {g.shape}"
            )
        nodes = np.concatenate([d[..., None], g], axis=-1).reshape(-1, 4)
        return DistanceField(
            _core.DistanceField((float(x), float(y), float(z)), spacing, d.shape, nodes, signed)
        )

    @property
    def is_signed(self) -> bool:
        """Whether the distance is negative inside; if not, it is never negative."""
        return self.core.is_signed

    @property
    def spacing(self) -> float:
        """Distance of neighbouring nodes [m]."""
        return self.core.spacing

    @property
    def origin(self) -> NDArray[np.float64]:
        """Node (0, 0, 0), in O [m]: the low corner of the box that the grid covers."""
        return np.array(self.core.origin)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of nodes along x, y and z."""
        x, y, z = self.core.sizes
        return x, y, z

    def at(self, p_OQ: ArrayLike, *, num_threads: int = 1) -> FieldSample:
        """Distances and gradients at points Q.

        Args:
            p_OQ: (N, 3) in O, finite.
            num_threads: to share the work.

        Raises:
            ValueError: naming ``points`` if p_OQ is no such array.
        """
        return FieldSample(*self.core.at(p_OQ, num_threads))

    def closest(self, p_OQ: ArrayLike) -> SurfacePoints:
        """Nearest points of the surface to points Q, (N, 3) in O, finite.

        Raises:
            ValueError: naming ``points`` if p_OQ is no such array.
        """
        return SurfacePoints(*self.core.closest(p_OQ))

    def to_bytes(self) -> bytes:
        """The field as it is kept in a file: header, then float32 nodes, little-endian."""
        core = self.core
        header = _HEADER.pack(_MAGIC, *core.origin, core.spacing, *core.sizes, core.is_signed)
        return header + np.ascontiguousarray(core.nodes, dtype="<f4").tobytes()

    def save(self, path: Path | str) -> None:
        """Writes the field to a file (16 bytes a node), whole or not at all."""
        write_atomic(Path(path), self.to_bytes())

    @staticmethod
    def load(path: Path | str) -> "DistanceField":
        """Reads what :meth:`save` wrote; the file is not trusted.

        Raises:
            InputError: if the file cannot be read, is not of this format and version, is cut short
                or too long, or holds numbers that no field has.
        """
        try:
            content = Path(path).read_bytes()
        except OSError as error:
            raise InputError(Finding(f"cannot be read: {error.strerror}", file=str(path))) from None
        if len(content) < _HEADER.size or content[:6] != _MAGIC[:6]:
            raise InputError(Finding("is not a distance field", file=str(path)))
        if content[:8] != _MAGIC:
            raise InputError(
                Finding("is of another version of the format", "build it again", file=str(path))
            )
        _, x, y, z, spacing, *sizes, is_signed = _HEADER.unpack_from(content)
        expected = _HEADER.size + 16 * int(np.prod([int(n) for n in sizes], dtype=object))
        if min(sizes) < 2 or len(content) != expected:
            raise InputError(
                Finding(
                    f"holds {len(content)} bytes, not the {expected} of a grid of {sizes} nodes",
                    "it was cut short or damaged: build it again",
                    file=str(path),
                )
            )
        nodes = np.frombuffer(content, "<f4", offset=_HEADER.size).reshape(-1, 4)
        try:
            core = _core.DistanceField(
                (x, y, z), spacing, tuple(sizes), nodes.astype(np.float32, copy=False), is_signed
            )
        except ValueError as error:
            raise InputError(Finding(str(error), "build it again", file=str(path))) from None
        return DistanceField(core)


def cached_distance_field(
    mesh: TriangleMesh,
    spacing: float = 0.003,
    margin: float | None = None,
    *,
    signed: bool = True,
    cache_dir: Path | str | None = None,
    num_threads: int = 1,
) -> DistanceField:
    """:meth:`DistanceField.from_mesh`, built once and then read from a file.

    The file is named by a hash of the mesh and of the arguments, so that a changed mesh has
    another. Several processes may build the same one at a time; a damaged file is built again.

    Args:
        mesh, spacing, margin, signed, num_threads: as for :meth:`DistanceField.from_mesh`.
        cache_dir: the folder of the files; by default ``prehensile/distance_fields`` below
            ``XDG_CACHE_HOME`` or ``~/.cache``. Where it cannot be written, nothing is kept.

    Raises:
        ValueError: as :meth:`DistanceField.from_mesh`.
    """
    margin = _margin(mesh.vertices, margin)
    digest = hashlib.sha256(_MAGIC + struct.pack("<2d?", spacing, margin, signed))
    digest.update(struct.pack("<2q", len(mesh.vertices), len(mesh.triangles)))
    digest.update(np.ascontiguousarray(mesh.vertices, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(mesh.triangles, dtype="<i8").tobytes())
    path = _cache_folder(cache_dir) / f"{digest.hexdigest()[:32]}.field"
    if path.exists():
        with contextlib.suppress(InputError):  # A damaged one is replaced below.
            return DistanceField.load(path)
    field = DistanceField.from_mesh(mesh, spacing, margin, signed=signed, num_threads=num_threads)
    with contextlib.suppress(OSError):  # A cache that cannot be written costs time only.
        field.save(path)
    return field


def _cache_folder(cache_dir: Path | str | None) -> Path:
    if cache_dir is not None:
        return Path(cache_dir)
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return root / "prehensile" / "distance_fields"


def _margin(points: NDArray[np.float64], margin: float | None) -> float:
    if margin is None:
        return 0.25 * float(np.linalg.norm(np.ptp(points, axis=0)))
    if not (margin >= 0 and np.isfinite(margin)):
        raise ValueError(f"margin: must be finite and at least 0, not {margin}")
    return float(margin)


def _grid(
    points: NDArray[np.float64], spacing: float, margin: float
) -> tuple[tuple[float, float, float], float, tuple[int, int, int]]:
    """Origin, spacing and sizes of the grid around points."""
    if not (spacing > 0 and np.isfinite(spacing)):
        raise ValueError(f"spacing: must be positive and finite, not {spacing}")
    low = points.min(axis=0) - margin
    counts = np.ceil((np.ptp(points, axis=0) + 2 * margin) / spacing) + 1
    if not np.prod(counts) <= _core.MOST_FIELD_NODES:
        raise ValueError(
            f"spacing: {spacing} m needs {np.prod(counts):.3g} nodes for so large an object, more "
            "than 2^28"
        )
    x, y, z = low
    i, j, k = np.maximum(counts, 2)
    return (float(x), float(y), float(z)), float(spacing), (int(i), int(j), int(k))
