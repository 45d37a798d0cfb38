"""Splitting a cloud into objects, by what is known of the scene and by shape alone."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core
from prehensile.perception.cloud import Box, PointCloud, inside_box

_MOST_SEGMENTS = 4096  # Their matrix takes 128 MiB.


def convex_segments(
    cloud: PointCloud,
    voxel_size: float,
    *,
    max_concavity: float = np.deg2rad(10.0),
    max_step: float = 0.6,
    min_points: int = 12,
) -> NDArray[np.int64]:
    """Labels pieces of the cloud that are connected without a concave edge or a step.

    Household objects are mostly convex and meet their neighbours in concave edges, so points in
    adjacent voxels belong together if the surface between them is flat or convex (Stein,
    Schoeler, Papon and Woergoetter, "Object Partitioning using Local Convexity", CVPR 2014).
    Voxels on the edge itself average both sides and would bridge it; so pieces are first grown
    without any point that has a concave edge or a step beside it, and such points then join the
    piece next to them.

    Args:
        cloud: one point per voxel, as :func:`prehensile.perception.fuse` gives.
        voxel_size: edge of those voxels [m].
        max_concavity: two adjacent points are apart if their normals turn toward each other by
            more than this within a voxel's length [rad].
        max_step: two adjacent points with like normals are apart if they lie further from each
            other along the normal than this [voxels].
        min_points: smaller pieces are labelled -1.

    Returns:
        (N,) labels 0, 1, ... by decreasing number of points; -1 for points of no piece.

    Raises:
        InputError: if the cloud has no normals.
        ValueError: naming the argument.
    """
    if not 0 <= max_concavity <= np.pi:
        raise ValueError(f"max_concavity: must be from 0 to pi, not {max_concavity}")
    if not max_step >= 0:
        raise ValueError(f"max_step: must be at least 0, not {max_step}")
    normals = cloud.require_normals()
    return _core.convex_segments(
        cloud.points, normals, voxel_size, max_concavity, max_step, max(min_points, 0)
    )


def resting_pairs(cloud: PointCloud, labels: ArrayLike, voxel_size: float) -> NDArray[np.int64]:
    """How much of each segment is seen to lie under each other one.

    Where something stands or leans on a surface, a patch that faces upward meets one that does
    not, in a concave edge.

    Args:
        cloud: one point per voxel.
        labels: (N,) segments 0..L-1 of its points, -1 for none.
        voxel_size: edge of the voxels [m].

    Returns:
        (L, L) matrix; entry [a, b] counts the adjacent points that show b resting on a.

    Raises:
        InputError: if the cloud has no normals.
        ValueError: naming the argument.
    """
    labels = _labels(labels, cloud)
    count = int(labels.max(initial=-1)) + 1
    if count > _MOST_SEGMENTS:
        raise ValueError(f"labels: {count} segments are more than {_MOST_SEGMENTS}")
    return _core.resting_pairs(cloud.points, cloud.require_normals(), labels, voxel_size, count)


def euclidean_clusters(
    points: NDArray[np.float64], tolerance: float, *, min_points: int = 1
) -> NDArray[np.int64]:
    """Labels the pieces of a cloud that lie apart from each other.

    Two points belong together if a chain of points leads from one to the other in steps no longer
    than the tolerance (Rusu, "Semantic 3D Object Maps", 2009, section 6.2). Exact; a grid finds
    the neighbours.

    Args:
        points: (N, 3) positions [m].
        tolerance: longest step [m], > 0.
        min_points: smaller pieces are labelled -1.

    Returns:
        (N,) labels 0, 1, ... by decreasing number of points; -1 for points of no piece.

    Raises:
        ValueError: naming the argument: points not finite, or more than a million tolerances from
            the origin; tolerance not positive.
    """
    return _core.euclidean_clusters(points, tolerance, max(min_points, 0))


def subtract(cloud: PointCloud, solids: Sequence[Box], *, margin: float) -> PointCloud:
    """The points that known solids (a table, the walls of a bin) do not account for, in order.

    Args:
        cloud: the cloud.
        solids: boxes, in the cloud's frame.
        margin: points no further than this from a solid along its faces' normals are its own [m].

    Raises:
        ValueError: if margin is negative or not finite.
    """
    if not 0 <= margin < np.inf:
        raise ValueError(f"margin: must be at least 0 and finite, not {margin}")
    kept = np.ones(len(cloud), dtype=bool)
    for solid in solids:
        grown = Box(solid.X_WB, np.asarray(solid.size) + 2 * margin)
        kept &= ~inside_box(cloud.points, grown)
    return cloud.select(kept)


def nearest_segment(cloud: PointCloud, labels: ArrayLike, p_W: ArrayLike) -> PointCloud:
    """The object of interest: the segment with the point nearest to p_W (3,), as a cloud.

    Points labelled -1 are passed over; without any segment the result is empty.

    Raises:
        ValueError: naming the argument.
    """
    labels = _labels(labels, cloud)
    goal = np.asarray(p_W, dtype=np.float64)
    if goal.shape != (3,) or not np.isfinite(goal).all():
        raise ValueError(f"p_W: expected three finite numbers, not {p_W}")
    own = np.nonzero(labels >= 0)[0]
    if not len(own):
        return cloud.select(own)
    distance = np.linalg.norm(cloud.points[own] - goal, axis=1)
    return cloud.select(labels == labels[own[np.argmin(distance)]])


def _labels(labels: ArrayLike, cloud: PointCloud) -> NDArray[np.int64]:
    """Labels as whole numbers, one for each point."""
    array = np.asarray(labels)
    if array.shape != (len(cloud),):
        raise ValueError(f"labels: expected shape ({len(cloud)},), not {array.shape}")
    if array.size and not np.issubdtype(array.dtype, np.integer):
        raise ValueError(f"labels: expected whole numbers, not {array.dtype}")
    return array.astype(np.int64)
