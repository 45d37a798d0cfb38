"""Planes in clouds: the one with most points, and all flat pieces."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud


class Plane(NamedTuple):
    """The plane of the points p with normal . p = offset.

    Attributes:
        normal: (3,) unit normal.
        offset: distance from the origin along the normal [m].
    """

    normal: NDArray[np.float64]
    offset: float

    def heights(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Signed distances (...) of points (..., 3) from the plane, along its normal [m]."""
        return points @ self.normal - self.offset


@dataclass(frozen=True, eq=False)
class PlaneSearch:
    """What :func:`ransac_plane` found.

    Attributes:
        plane: the plane, or None if the points span none (fewer than three, or all on a line).
        inliers: (N,) which points lie on it.
        iterations: how many samples were drawn.
    """

    plane: Plane | None
    inliers: NDArray[np.bool_]
    iterations: int


def ransac_plane(
    cloud: PointCloud,
    max_distance: float,
    *,
    seed: int = 0,
    confidence: float = 0.999,
    max_iterations: int = 10_000,
) -> PlaneSearch:
    """The plane with the most points near it, by random samples of three.

    The best sample's plane is then fitted to its inliers by least squares (Fischler and Bolles,
    "Random Sample Consensus", 1981). Sampling stops when a better plane has been missed with at
    most the probability 1 - confidence.

    Args:
        cloud: the cloud. Its sensors see the plane from the side that the normal points to; where
            they are not known the normal points up (z >= 0).
        max_distance: largest distance of an inlier [m], > 0.
        seed: of the samples, >= 0; the same seed gives the same plane.
        confidence: in (0, 1).
        max_iterations: most samples drawn.

    Raises:
        ValueError: naming the argument.
    """
    planes, inliers, iterations = _core.ransac_plane(
        cloud.points, max_distance, confidence, max_iterations, seed
    )
    mask = inliers.view(np.bool_)
    if not len(planes):
        return PlaneSearch(None, mask, iterations)
    normal, offset = planes[0, :3], float(planes[0, 3])
    side = normal[2]
    if cloud.sensor_origins is not None:
        side = np.mean(cloud.sensor_origins[mask] @ normal - offset)
    if side < 0:
        normal, offset = -normal, -offset
    return PlaneSearch(Plane(normal, offset), mask, iterations)


def plane_regions(
    cloud: PointCloud,
    radius: float,
    *,
    max_angle: float = np.deg2rad(10.0),
    max_distance: float = 0.005,
    min_points: int = 50,
) -> tuple[NDArray[np.int64], list[Plane]]:
    """The flat pieces of a cloud, grown from its flattest points.

    A region takes in the neighbours of its points whose normals agree with its plane and that lie
    near it; its plane is fitted anew by least squares whenever it has grown by half (after
    Poppinga et al., "Fast plane detection and polygonalization", IROS 2008).

    Args:
        cloud: points with normals.
        radius: points no further apart are neighbours [m]; about twice their spacing.
        max_angle: largest angle between a point's normal and its region's plane [rad].
        max_distance: largest distance of a point from its region's plane [m].
        min_points: smaller regions are given up.

    Returns:
        (N,) labels 0, 1, ... by decreasing number of points, -1 for points of no plane; and the
        planes, their normals on the side of the points' normals.

    Raises:
        InputError: if the cloud has no normals.
        ValueError: naming the argument.
    """
    labels, planes = _core.grow_planes(
        cloud.points, cloud.require_normals(), radius, max_angle, max_distance, max(min_points, 0)
    )
    return labels, [Plane(row[:3], float(row[3])) for row in planes]
