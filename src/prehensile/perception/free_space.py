"""Depth images as views of a scene, and the free space that they prove.

A ray of a depth camera says where the surface is and, all along the way to it, where nothing is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core
from prehensile.perception.camera_model import Distortion, PosedCamera


@dataclass(frozen=True, eq=False)
class DepthView:
    """A depth image and the camera that took it.

    Attributes:
        depth: (H, W) depth along the optical axis [m]; anything but a finite number above 0 is no
            measurement. float32 is taken without a copy.
        camera: where it was taken from, without distortion; depth images of a D400 are rectified.
        ignored: (H, W) bool, pixels that are not to be looked at; None for none.
    """

    depth: NDArray[np.floating]
    camera: PosedCamera
    ignored: NDArray[np.bool_] | None = None

    def native(self) -> tuple[NDArray[np.float32], Any, Any, NDArray[np.uint8] | None]:
        """What the kernels take.

        Raises:
            ValueError: if a shape is wrong, the depth is not one of floats, or the camera has
                distortion.
        """
        model, X_WC = self.camera
        if not np.issubdtype(np.asarray(self.depth).dtype, np.floating):
            # Whole numbers are some camera's units, most likely millimetres.
            held = np.asarray(self.depth).dtype
            raise ValueError(f"depth: expected floats in metres, not {held}")
        depth = np.ascontiguousarray(self.depth, dtype=np.float32)
        if depth.shape != (model.height, model.width):
            raise ValueError(f"depth: expected {(model.height, model.width)}, not {depth.shape}")
        if model.distortion is not Distortion.NONE:
            raise ValueError("camera: has distortion; rectify the depth image first")
        ignored = self.ignored
        if ignored is None:
            return depth, model.K, X_WC.GetAsMatrix4(), None
        mask = np.ascontiguousarray(ignored, dtype=bool)
        if mask.shape != depth.shape:
            raise ValueError(f"ignored: expected {depth.shape}, not {mask.shape}")
        return depth, model.K, X_WC.GetAsMatrix4(), mask.view(np.uint8)


def free_space_violation(
    points_W: ArrayLike, views: DepthView | Sequence[DepthView], *, margin: float = 0.01
) -> NDArray[np.float64]:
    """How far points lie in space that a camera saw through.

    A point projected into an image is contradicted by it where the measured depth is greater than
    its own by more than the margin. Points out of the image, behind a surface or at a pixel
    without measurement are not contradicted (Schmidt, Newcombe and Fox, "DART: dense articulated
    real-time tracking", RSS 2014).

    Args:
        points_W: (..., 3) points in W [m], such as the surfaces of many poses of an object at once.
        views: one view or several.
        margin: allowance for noise and for what one pixel mixes [m].

    Returns:
        (...) the largest violation over the views along the camera's axis [m]; 0 for none.

    Raises:
        ValueError: if an argument has a wrong shape or is not finite.
    """
    points = np.asarray(points_W, dtype=float)
    if points.ndim < 1 or points.shape[-1] != 3:
        raise ValueError(f"points_W: expected (..., 3), not {points.shape}")
    rows = points.reshape(-1, 3)
    worst = np.zeros(len(rows))
    for view in [views] if isinstance(views, DepthView) else views:
        np.maximum(worst, _core.free_space_violation(rows, [view.native()], margin), out=worst)
    return worst.reshape(points.shape[:-1])
