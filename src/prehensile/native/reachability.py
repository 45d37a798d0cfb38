"""Random configurations, and what a frame reaches in them, voxel by voxel.

The kernels of :mod:`prehensile.kinematics.reachability`, which makes a map with them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core
from prehensile.native.kinematic_tree import KinematicTree


def sample_configurations(
    lower: ArrayLike,
    upper: ArrayLike,
    count: int,
    *,
    seed: int,
    first: int = 0,
    num_threads: int = 1,
) -> NDArray[np.float64]:
    """Rows of an endless table of configurations, uniform within joint limits.

    Every number depends on the seed, its row and its joint alone (SplitMix64 by index), so that the
    table is the same however it is cut into calls and shared among threads.

    Args:
        lower, upper: (n,) finite limits.
        count: number of rows.
        seed: 0 .. 2⁶⁴ - 1.
        first: number of the first row.

    Returns:
        (count, n).

    Raises:
        ValueError: naming the argument.
    """
    low = [float(x) for x in np.asarray(lower, dtype=float).ravel()]
    high = [float(x) for x in np.asarray(upper, dtype=float).ravel()]
    for name, value in (("seed", seed), ("first", first), ("count", count)):
        if not 0 <= value < 2**64:
            raise ValueError(f"{name}: must be 0 .. 2^64 - 1, not {value}")
    return _core.sample_configurations(low, high, seed, first, count, num_threads)


@dataclass(frozen=True)
class ReachVoxels:
    """A box of voxels, and what has been found in each so far; see :func:`add_to_reach`.

    Voxel (i, j, k) of the world holds the points with i = floor(x · (1 / voxel_size)) and so on,
    and is element (i, j, k) - first of the arrays, all of shape (nx, ny, nz).

    Attributes:
        voxel_size: edge length (m).
        first: indices of the voxel in the arrays' first corner.
        counts: uint32 number of configurations that put the frame's origin there.
        directions: uint64, bit d set if the axis has been seen near direction d there.
        manipulability: largest √det(J Jᵀ) there.
        singular_value: largest value there of the smallest singular value of J.
    """

    voxel_size: float
    first: tuple[int, int, int]
    counts: NDArray[np.uint32]
    directions: NDArray[np.uint64]
    manipulability: NDArray[np.float64]
    singular_value: NDArray[np.float64]


def add_to_reach(
    tree: KinematicTree,
    Q: ArrayLike,
    voxels: ReachVoxels,
    *,
    frame: int,
    axis: Sequence[float],
    directions: ArrayLike,
    part: str,
    length: float,
    num_threads: int = 1,
) -> int:
    """Adds configurations to the voxels, in place; their order and the threads do not matter.

    Args:
        tree: of n joints.
        Q: (N, n).
        voxels: with writable, C-contiguous arrays.
        frame: number of the frame.
        axis: (3,) unit vector in the frame, whose direction in the world is looked at.
        directions: (D, 3) unit vectors in the world, D ≤ 64; the axis counts for the nearest.
        part: rows of the Jacobian that are measured: "rotational", "translational" or "both".
        length: by which translational rows are divided (m).

    Returns:
        How many of the configurations put the frame outside the box.

    Raises:
        ValueError: naming the argument.
    """
    return _core.add_to_reach(
        tree,
        frame,
        Q,
        [float(x) for x in axis],
        directions,
        part,
        length,
        voxels.voxel_size,
        list(voxels.first),
        voxels.counts,
        voxels.directions,
        voxels.manipulability,
        voxels.singular_value,
        num_threads,
    )
