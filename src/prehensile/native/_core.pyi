"""Signatures of the compiled module (cpp/bindings/module.cpp)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

def voxel_downsample(
    points: NDArray[np.floating],
    voxel_size: float,
    normals: NDArray[np.floating] | None,
    num_threads: int,
    simd: str | None = None,
) -> tuple[NDArray[np.floating], NDArray[np.floating] | None, NDArray[np.int32]]: ...
def simd_levels() -> list[str]: ...

class KinematicTree:
    """Forward kinematics of a tree of n joints, revolute or prismatic, and of frames fixed to it.

    Poses X_WF are (4, 4). Jacobians J_WF are (6, n), rotational rows first, expressed in the
    world W: V_WF = J q̇ is the spatial velocity of F at its origin. Every method raises ValueError,
    naming the argument, for a wrong shape, a number that is not finite or a frame that is none.

    Args:
        parents: (n,) index of the joint that moves the frame P each joint is mounted on, -1 for W.
        X_PJ: (n, 4, 4) pose of each joint's frame J in P while q is zero.
        axes: (n, 3) axis of each joint in J, of any length but zero.
        prismatic: (n,) whether it slides (m) instead of turning (rad).
        frame_parents: (m,) index of the joint that moves the frame that each F is fixed in, -1
            for W.
        X_PF: (m, 4, 4) pose of F in that frame.
    """

    def __init__(
        self,
        parents: ArrayLike,
        X_PJ: ArrayLike,
        axes: ArrayLike,
        prismatic: ArrayLike,
        frame_parents: ArrayLike,
        X_PF: ArrayLike,
    ) -> None: ...
    @property
    def num_joints(self) -> int: ...
    @property
    def num_frames(self) -> int: ...
    def pose(self, q: ArrayLike, frame: int = 0) -> NDArray[np.float64]: ...
    def jacobian(self, q: ArrayLike, frame: int = 0) -> NDArray[np.float64]: ...
    def pose_and_jacobian(
        self, q: ArrayLike, frame: int = 0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def relative_jacobian(
        self, q: ArrayLike, frame: int, measured_in: int, expressed_in: int
    ) -> NDArray[np.float64]:
        """(6, n) Jacobian of V_AF_E, A = measured_in, E = expressed_in, -1 for the world."""
    def poses(self, Q: ArrayLike, frame: int = 0, num_threads: int = 1) -> NDArray[np.float64]:
        """(N, 4, 4) poses for the rows of Q (N, n); the GIL is released."""
    def jacobians(self, Q: ArrayLike, frame: int = 0, num_threads: int = 1) -> NDArray[np.float64]:
        """(N, 6, n) Jacobians for the rows of Q (N, n); the GIL is released."""
    def reach(
        self, frame: int, lower: ArrayLike, upper: ArrayLike
    ) -> tuple[tuple[float, float, float], float]:
        """Centre (in W) and radius of a ball that F's origin does not leave within the limits."""

def sample_configurations(
    lower: Sequence[float],
    upper: Sequence[float],
    seed: int,
    first: int,
    count: int,
    num_threads: int,
) -> NDArray[np.float64]: ...
def add_to_reach(
    tree: KinematicTree,
    frame: int,
    Q: ArrayLike,
    axis: Sequence[float],
    directions: ArrayLike,
    part: str,
    length: float,
    voxel_size: float,
    first: Sequence[int],
    counts: NDArray[np.uint32],
    reached: NDArray[np.uint64],
    manipulability: NDArray[np.float64],
    singular_value: NDArray[np.float64],
    num_threads: int,
) -> int: ...
