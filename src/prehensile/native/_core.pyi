"""Signatures of the compiled module (cpp/bindings/module.cpp)."""

import numpy as np
from numpy.typing import NDArray

def voxel_downsample(
    points: NDArray[np.floating],
    voxel_size: float,
    normals: NDArray[np.floating] | None,
    num_threads: int,
    simd: str | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating] | None, NDArray[np.int32]]: ...
def simd_levels() -> list[str]: ...
