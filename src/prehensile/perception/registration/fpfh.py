"""Fast point feature histograms: what the surface around a point looks like, wherever it is."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud


def fpfh(cloud: PointCloud, radius: float, *, num_threads: int = 1) -> NDArray[np.float64]:
    """The feature of each point: three histograms of angles, each of eleven bins.

    A rigid motion does not change them. Rusu, Blodow and Beetz, "Fast point feature histograms
    (FPFH) for 3D registration", ICRA 2009; a neighbour's histogram weighs by the inverse of its
    squared distance, as in the implementations in use.

    Args:
        cloud: points with normals; those of zero length leave their points out. Normals must be
            oriented alike in all clouds that are to be compared.
        radius: of the neighbourhood [m], > 0; some five times the distance of the points.
        num_threads: at least 1; does not change the result.

    Returns:
        (N, 33): histograms of theta, alpha and phi. Each sums to 200, or is zero where a point has
        no normal or no neighbour.

    Raises:
        InputError: if the cloud has no normals.
        ValueError: naming the argument.
    """
    return _core.fpfh(cloud.points, cloud.require_normals(), radius, num_threads)


def match_features(
    a: ArrayLike,
    b: ArrayLike,
    *,
    mutual: bool = True,
    max_ratio: float = 1.0,
    num_threads: int = 1,
) -> NDArray[np.int64]:
    """Pairs of features that are nearest to each other (exact, by Euclidean distance).

    Args:
        a: (N, 33) features.
        b: (M, 33) features.
        mutual: keep only pairs in which each is the other's nearest; else one pair for every row
            of a.
        max_ratio: keep only pairs whose distance is at most this part of that from the row of a to
            the second nearest of b, in (0, 1] (Lowe's ratio test, IJCV 2004).
        num_threads: at least 1; does not change the result.

    Returns:
        (K, 2) rows of a and of b, ordered by the first.

    Raises:
        ValueError: naming the argument.
    """
    if not 0 < max_ratio <= 1:
        raise ValueError(f"max_ratio: must lie in (0, 1], not {max_ratio}")
    nearest, distance, second = _core.nearest_features(a, b, num_threads)
    rows = np.arange(len(nearest))
    keep = (nearest >= 0) & (distance <= max_ratio * second)
    if mutual:
        back = _core.nearest_features(b, a, num_threads)[0]
        keep &= np.append(back, -1)[nearest] == rows
    return np.stack([rows[keep], nearest[keep].astype(np.int64)], axis=1)
