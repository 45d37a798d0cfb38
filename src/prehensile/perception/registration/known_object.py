"""What is prepared once of an object, so that it can be found fast."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import InputError
from prehensile.perception.cloud import PointCloud
from prehensile.perception.distance_field import DistanceField, cached_distance_field
from prehensile.perception.mesh import TriangleMesh
from prehensile.perception.registration.point_pairs import PointPairModel


@dataclass(frozen=True, eq=False)
class KnownObject:
    """An object of known shape, in its frame O; nothing in it changes.

    Attributes:
        cloud: points evenly spread over the surface, with outward normals.
        field: distance to the surface.
        pairs: table of the cloud's point pairs.
        diameter: longest distance of two points of the cloud [m].
    """

    cloud: PointCloud
    field: DistanceField
    pairs: PointPairModel
    diameter: float

    @staticmethod
    def from_mesh(
        mesh: TriangleMesh,
        *,
        num_points: int = 300,
        field_spacing: float | None = None,
        cache_dir: Path | str | None = None,
    ) -> "KnownObject":
        """Prepares a mesh: seconds for the distance field, which is kept on disk.

        Args:
            mesh: in O, its triangles counter-clockwise seen from outside; closed or not.
            num_points: of the cloud, 20 to 2000. The time to look for the object grows with it.
            field_spacing: of the distance field's nodes [m]; by default 1/80 of the diagonal of
                the bounding box.
            cache_dir: where the field is kept; see
                :func:`~prehensile.perception.distance_field.cached_distance_field`.

        Raises:
            ValueError: naming the argument.
        """
        if not 20 <= num_points <= 2000:
            raise ValueError(f"num_points: must lie in [20, 2000], not {num_points}")
        points = _surface_points(mesh, 30 * num_points)
        if field_spacing is None:
            field_spacing = mesh.diameter() / 80
        try:
            field = cached_distance_field(mesh, field_spacing, cache_dir=cache_dir)
        except ValueError as error:
            if "triangles" not in str(error):
                raise
            # Not closed, as most scanned meshes: no inside, but all that is needed here.
            field = cached_distance_field(mesh, field_spacing, signed=False, cache_dir=cache_dir)
        return _prepared(points, num_points, field)

    @staticmethod
    def from_cloud(
        cloud: PointCloud, *, num_points: int = 300, field_spacing: float | None = None
    ) -> "KnownObject":
        """Prepares a cloud that covers all of an object's surface.

        Args:
            cloud: in O, with outward normals, at least `num_points` of them, dense.
            num_points: see :meth:`from_mesh`.
            field_spacing: see :meth:`from_mesh`.

        Raises:
            InputError: if the cloud has no normals or too few points.
            ValueError: naming the argument.
        """
        if not 20 <= num_points <= 2000:
            raise ValueError(f"num_points: must lie in [20, 2000], not {num_points}")
        cloud.require_normals()
        if len(cloud) < num_points:
            raise InputError(f"the cloud has {len(cloud)} points; expected at least {num_points}")
        if field_spacing is None:
            field_spacing = float(np.linalg.norm(np.ptp(cloud.points, axis=0))) / 80
        return _prepared(cloud, num_points, DistanceField.from_cloud(cloud, field_spacing))


def _prepared(dense: PointCloud, num_points: int, field: DistanceField) -> KnownObject:
    cloud = dense.select(_spread(dense.points, num_points))
    pairs = PointPairModel(cloud)
    return KnownObject(cloud, field, pairs, pairs.diameter)


def _surface_points(mesh: TriangleMesh, count: int) -> PointCloud:
    """So many points at random, by area, with their triangles' normals; always the same ones."""
    rng = np.random.default_rng(0)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    doubled_areas = np.linalg.norm(normals, axis=1)
    if not doubled_areas.sum() > 0:
        raise ValueError("mesh: its triangles have no area")
    chosen = rng.choice(len(a), count, p=doubled_areas / doubled_areas.sum())
    u, v = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    points = (1 - u) * a[chosen] + u * (1 - v) * b[chosen] + u * v * c[chosen]
    return PointCloud(points, normals[chosen] / doubled_areas[chosen, None])


def _spread(points: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Rows of points far from each other: each the farthest from all before it."""
    rows = np.zeros(count, dtype=np.int64)
    squared = np.full(len(points), np.inf)
    for k in range(1, count):
        squared = np.minimum(squared, np.sum((points - points[rows[k - 1]]) ** 2, axis=1))
        rows[k] = squared.argmax()
    return rows
