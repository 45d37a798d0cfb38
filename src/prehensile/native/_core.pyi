"""Signatures of the compiled module (cpp/bindings/module.cpp)."""

import numpy as np
from numpy.typing import NDArray

def voxel_downsample[T: (np.float32, np.float64)](
    points: NDArray[T],
    voxel_size: float,
    normals: NDArray[T] | None,
    num_threads: int,
    simd: str | None = None,
) -> tuple[NDArray[T], NDArray[T] | None, NDArray[np.int32]]: ...
def simd_levels() -> list[str]: ...
