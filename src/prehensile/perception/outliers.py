"""Points that stand apart from the rest of their cloud."""

import numpy as np
from numpy.typing import NDArray

from prehensile.native.kd_tree import KdTree
from prehensile.perception.cloud import PointCloud


def statistical_outliers(
    cloud: PointCloud, neighbors: int = 20, std_ratio: float = 2.0, *, num_threads: int = 1
) -> NDArray[np.bool_]:
    """Which points are about as near to their neighbours as the others are to theirs.

    A point is kept if the mean distance to its nearest points, itself counted as the first of
    them, is at most the cloud's mean of that plus `std_ratio` standard deviations (with N - 1; of
    the points that have a neighbour elsewhere). Source: Rusu et al., "Towards 3D point cloud based
    object maps for household environments" (2008), counted as Open3D counts it.

    Args:
        cloud: in any one frame; may be empty.
        neighbors: how many nearest points are looked at, the point itself among them, at least 2;
            all where there are fewer.
        std_ratio: at least 0.
        num_threads: does not change the result.

    Returns:
        (N,) True for what is to be kept: ``cloud.select(mask)``. A point without neighbours in the
        cloud, or all of whose neighbours coincide with it, is not kept.

    Raises:
        ValueError: naming the argument.
    """
    if neighbors < 2:
        raise ValueError(f"neighbors: must be at least 2, not {neighbors}")
    if not 0 <= std_ratio < np.inf:
        raise ValueError(f"std_ratio: must be zero or more and finite, not {std_ratio}")
    if len(cloud) < 2:
        return np.zeros(len(cloud), dtype=bool)
    k = min(neighbors, len(cloud))
    _, distances = KdTree(cloud.points).nearest(cloud.points, k, num_threads=num_threads)
    means = distances.mean(axis=1)
    apart = (means > 0) & np.isfinite(means)
    if apart.sum() < 2:
        return apart
    limit = means[apart].mean() + std_ratio * means[apart].std(ddof=1)
    return apart & (means <= limit)


def radius_outliers(
    cloud: PointCloud, radius: float, min_neighbors: int, *, num_threads: int = 1
) -> NDArray[np.bool_]:
    """Which points have enough others around them.

    Args:
        cloud: in any one frame; may be empty.
        radius: others no further than this count [m].
        min_neighbors: how many others a point needs to be kept, at least 1.
        num_threads: does not change the result.

    Returns:
        (N,) True for what is to be kept: ``cloud.select(mask)``.

    Raises:
        ValueError: naming the argument.
    """
    if min_neighbors < 1:
        raise ValueError(f"min_neighbors: must be at least 1, not {min_neighbors}")
    if not 0 < radius < np.inf:
        raise ValueError(f"radius: must be positive and finite, not {radius}")
    if len(cloud) <= min_neighbors:
        return np.zeros(len(cloud), dtype=bool)
    # The point itself, or one at the same place, is always among the nearest.
    indices, _ = KdTree(cloud.points).nearest(
        cloud.points, min_neighbors + 1, radius, num_threads=num_threads
    )
    return indices[:, -1] >= 0
