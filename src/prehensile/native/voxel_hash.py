"""Nearest neighbours among points that may be added at any time."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core


class VoxelHash:
    """Points in voxels, for nearest neighbours up to a fixed distance.

    Where the points do not change, :class:`prehensile.native.kd_tree.KdTree` is the one to take.

    Args:
        max_distance: how far neighbours may be, and the edge of the voxels [m].

    Raises:
        ValueError: it is not positive and finite.
    """

    def __init__(self, max_distance: float) -> None:
        self._voxels = _core.VoxelHash(max_distance)

    def __len__(self) -> int:
        """The number of points."""
        return len(self._voxels)

    def insert(self, points: ArrayLike) -> None:
        """Adds points, whose indices follow those of the points that are there.

        Waits for other threads' queries under way, and they for it.

        Args:
            points: (N, 3) finite, less than 2²⁰ voxels from the origin of their frame.

        Raises:
            ValueError: naming the argument; no point is added then.
        """
        self._voxels.insert(points)

    def nearest(
        self, queries: ArrayLike, num_threads: int = 1
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """The nearest point to each query; of several the one with the smallest index.

        Args:
            queries: (M, 3) in the frame of the points, finite.
            num_threads: does not change the result.

        Returns:
            (M,) indices, -1 where none is near enough, and (M,) distances [m], infinite there.

        Raises:
            ValueError: naming the argument.
        """
        return self._voxels.nearest(queries, num_threads)
