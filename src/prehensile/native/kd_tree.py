"""Exact nearest neighbours among points in space."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core


class Neighbors(NamedTuple):
    """All neighbours of several queries, those of query i at ``slice(start[i], start[i + 1])``.

    Attributes:
        start: (M + 1,) int64 where the neighbours of each query begin; the last is their number.
        indices: (K,) int32 which points, nearest first for each query.
        distances: (K,) how far they are [m].
    """

    start: NDArray[np.int64]
    indices: NDArray[np.int32]
    distances: NDArray[np.float64]


class KdTree:
    """A k-d tree of points (N, 3), which are copied.

    Of neighbours at equal distance, the one with the smaller index counts as nearer. Queries may
    run on several threads at once; the GIL is released. Queries that lie near their predecessors
    are found faster.

    Args:
        points: (N, 3) in any one frame, finite, N < 2³¹; may be empty.

    Raises:
        ValueError: naming the argument.
    """

    def __init__(self, points: ArrayLike) -> None:
        self._tree = _core.KdTree(points)

    def __len__(self) -> int:
        """The number of points."""
        return len(self._tree)

    def nearest(
        self,
        queries: ArrayLike,
        k: int = 1,
        max_distance: float = float("inf"),
        num_threads: int = 1,
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """The k nearest points of each query, nearest first.

        Args:
            queries: (M, 3) in the frame of the points, finite.
            k: how many, at least 1.
            max_distance: points further away do not count [m].
            num_threads: does not change the result.

        Returns:
            (M, k) int32 indices, -1 where there are fewer, and (M, k) distances [m], infinite
            there.

        Raises:
            ValueError: naming the argument.
        """
        return self._tree.nearest(queries, k, max_distance, num_threads)

    def within_radius(self, queries: ArrayLike, radius: float, num_threads: int = 1) -> Neighbors:
        """All points no further than the radius from each query.

        Args:
            queries: (M, 3) in the frame of the points, finite.
            radius: at least 0 [m].
            num_threads: does not change the result.

        Raises:
            ValueError: naming the argument.
        """
        counts, indices, distances = self._tree.within_radius(queries, radius, num_threads)
        start = np.zeros(len(counts) + 1, dtype=np.int64)
        np.cumsum(counts, out=start[1:])
        return Neighbors(start, indices, distances)
