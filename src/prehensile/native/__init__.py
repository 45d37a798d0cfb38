"""Compiled kernels: arrays in, arrays out. They know neither Drake nor any other room.

The library below is ``prehensile::core`` (``cpp/include/prehensile``), which C++ programs can use
without Python. Every kernel takes ``num_threads`` explicitly, releases the GIL, and gives the same
result, bit for bit, whatever the number of threads and the SIMD level of the processor.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core

__all__ = ["VoxelCloud", "simd_levels", "voxel_downsample"]


@dataclass(frozen=True)
class VoxelCloud:
    """A cloud with one point per occupied voxel, in the order in which the voxels first occur.

    Attributes:
        points: (V, 3) centroid of the points in each voxel, in the dtype of the input.
        normals: (V, 3) unit mean normal of each voxel, or None if none were given. Zero where the
            normals of a voxel cancel or none of them is finite.
        counts: (V,) int32 number of input points in each voxel.
    """

    points: NDArray[np.floating]
    normals: NDArray[np.floating] | None
    counts: NDArray[np.int32]


def voxel_downsample(
    points: ArrayLike,
    voxel_size: float,
    *,
    normals: ArrayLike | None = None,
    num_threads: int = 1,
) -> VoxelCloud:
    """Replaces the points in each voxel by their centroid.

    Voxel (i, j, k) holds the points with i = floor(x · (1 / voxel_size)) and so on, computed in
    double precision. The grid is tied to the origin of the frame in which the points are given and
    not to the cloud, so clouds of one frame share their voxels. Sums are taken in double precision
    in the order of the input.

    Points with a non-finite coordinate, such as pixels without return, are dropped. A non-finite
    normal adds nothing to the mean normal of its voxel; its point still counts.

    Args:
        points: (N, 3) float32 or float64, N < 2³¹, in any one frame.
        voxel_size: edge length of a voxel, in the unit of the points.
        normals: (N, 3) unit normals, one for each point, in the same frame; converted to the dtype
            of the points.
        num_threads: number of threads to share the work, at least 1. It does not change the result.

    Returns:
        The voxels' centroids, normals and counts.

    Raises:
        TypeError: points or normals are not floating-point numbers.
        ValueError: an array is not (N, 3); normals and points differ in number; voxel_size is not
            positive and finite, or so small that a point lies more than 2²⁰ voxels from the origin;
            num_threads is less than 1. The message names the argument.
    """
    points_array = _rows("points", points)
    normals_array = None
    if normals is not None:
        normals_array = _rows("normals", normals).astype(points_array.dtype, copy=False)
    return VoxelCloud(*_core.voxel_downsample(points_array, voxel_size, normals_array, num_threads))


def simd_levels() -> list[str]:
    """The SIMD levels that this processor can run, slowest first; kernels use the last.

    "baseline" (x86-64-v2, or the compiler's default on other processors), "avx2", "avx512".
    """
    return _core.simd_levels()


def _rows(name: str, values: ArrayLike) -> NDArray[np.floating]:
    """Returns values as a C-contiguous (N, 3) array of float32 or float64."""
    array = np.asarray(values)
    if array.dtype not in (np.float32, np.float64):
        raise TypeError(f"{name}: expected float32 or float64, not {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name}: expected shape (N, 3), not {array.shape}")
    return np.ascontiguousarray(array)
