"""Surface normals of clouds from the neighbours of each point.

For normals from the pixel grid of a depth image see :mod:`prehensile.perception.depth`.
"""

import numpy as np
from numpy.typing import NDArray

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud


def estimate_normals(
    cloud: PointCloud,
    *,
    radius: float | None = None,
    neighbors: int | None = None,
    voxel_size: float | None = None,
    num_threads: int = 1,
) -> PointCloud:
    """The cloud with the normal at each point: along the least variance among its neighbours.

    The neighbours are all points within a radius, or the nearest so many, or those in the point's
    voxel and the 26 around it; the point itself is one. With voxels, moments are summed once for
    each, so the time does not grow with the number of neighbours; all points of a voxel get one
    answer, and an edge is rounded over a voxel more.
    Normals look towards the point's own sensor where the cloud has sensor_origins, and upward
    (n_z ≥ 0) where it has none.

    A normal is zero where the neighbours do not say one: fewer than three, all at one place or on a
    line (narrower than some 0.3 % of their length), or spread as little in a second direction.

    With a radius, sums are taken in single precision from each point; a neighbour whose distance is
    within some 1e-6 of the radius may count or not. The points are sorted into cells, so their
    order does not matter for speed; the time grows with the number of neighbours.

    Args:
        cloud: in any one frame; may be empty.
        radius: of the neighbourhood [m], such as five times the distance between points. Give
            this, `neighbors` or `voxel_size`.
        neighbors: how many, at least 3.
        voxel_size: edge of the voxels of the grid through the origin [m].
        num_threads: does not change the result.

    Raises:
        ValueError: not exactly one of radius, neighbors and voxel_size, a value out of range, a
            radius so small that the cloud spans more than 2¹⁹ of them, or a voxel so small that a
            point lies more than 2²⁰ of them from the origin.
    """
    normals, _ = _estimate(cloud, radius, neighbors, voxel_size, num_threads)
    estimated = cloud.replace(normals=normals)
    return estimated if cloud.sensor_origins is None else orient_normals(estimated)


def surface_variation(
    cloud: PointCloud,
    *,
    radius: float | None = None,
    neighbors: int | None = None,
    voxel_size: float | None = None,
    num_threads: int = 1,
) -> NDArray[np.float64]:
    """How far the surface bends or how noisy it is around each point: (N,), 0 to 1/3.

    The least eigenvalue of the neighbours' covariance over the sum of all three: 0 on a plane or
    line, 1/3 where they spread alike in all directions (Pauly, Gross and Kobbelt, "Efficient
    simplification of point-sampled surfaces", 2002). On a sphere of radius R it is near r² / (8
    R²) for a neighbourhood of radius r. 0 where fewer than three points are neighbours.

    Args:
        cloud, radius, neighbors, voxel_size, num_threads: as in :func:`estimate_normals`.

    Raises:
        ValueError: as in :func:`estimate_normals`.
    """
    return _estimate(cloud, radius, neighbors, voxel_size, num_threads)[1]


def orient_normals(
    cloud: PointCloud, toward: NDArray[np.floating] | tuple[float, float, float] | None = None
) -> PointCloud:
    """The cloud with its normals turned to look towards a position.

    Args:
        cloud: with normals.
        toward: (3,) one position, or (N, 3) one for each point [m], in the cloud's frame; the
            cloud's sensor_origins if not given.

    Raises:
        InputError: the cloud lacks normals, or sensor_origins where `toward` is not given.
        ValueError: `toward` has another shape, or is not finite.
    """
    normals = cloud.require_normals()
    if toward is None:
        goal = cloud.require_sensor_origins()
    else:
        goal = np.asarray(toward, dtype=float)
        if goal.shape not in ((3,), cloud.points.shape):
            raise ValueError(f"toward: expected shape (3,) or (N, 3), not {goal.shape}")
        if not np.isfinite(goal).all():
            raise ValueError("toward: must be finite")
    away = np.einsum("ij,ij->i", normals, goal - cloud.points) < 0
    return cloud.replace(normals=np.where(away[:, None], -normals, normals))


def _estimate(
    cloud: PointCloud,
    radius: float | None,
    neighbors: int | None,
    voxel_size: float | None,
    num_threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Normals (N, 3) with n_z ≥ 0 and surface variations (N,)."""
    if sum(value is not None for value in (radius, neighbors, voxel_size)) != 1:
        raise ValueError("radius, neighbors, voxel_size: give one of the three")
    if radius is not None:
        return _core.normals_within_radius(cloud.points, radius, num_threads)
    if voxel_size is not None:
        return _core.normals_of_voxels(cloud.points, voxel_size, num_threads)
    return _core.normals_of_nearest(cloud.points, neighbors, num_threads)
