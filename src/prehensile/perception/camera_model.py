"""The intrinsics of a camera: which ray each pixel sees, lens distortion included.

The camera frame C is optical: z forward, x right, y down. Pixel (u, v) is column u, row v; whole
numbers are the centres of pixels.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform
from pydrake.systems.sensors import CameraInfo

from prehensile.errors import InputError

_STEPS = 20  # of Newton's method; a lens needs four or five
_SOLVED = 1e-9  # of a slope; a pixel is some 1e-3


class Distortion(Enum):
    """How a lens moves what it images: the models of librealsense for the D400 family.

    With r^2 = x^2 + y^2, f = 1 + k1 r^2 + k2 r^4 + k3 r^6 and coefficients (k1, k2, p1, p2, k3),
    the ray with slopes x, y is imaged at the slopes

    - Brown and Conrady: x f + 2 p1 x y + p2 (r^2 + 2 x^2), y f + 2 p2 x y + p1 (r^2 + 2 y^2)
      (OpenCV's plumb-bob model);
    - modified: the same, but with x f, y f for x, y in the terms of p1 and p2 (r^2 remains);
    - inverse: a name of old firmware for cameras that librealsense's ``rsutil.h`` has come to
      project by the modified model, and so does this.

    (Duane C. Brown, "Decentering Distortion of Lenses", 1966.)
    """

    NONE = "none"
    BROWN_CONRADY = "brown_conrady"
    MODIFIED_BROWN_CONRADY = "modified_brown_conrady"
    INVERSE_BROWN_CONRADY = "inverse_brown_conrady"


@dataclass(frozen=True)
class CameraModel:
    """Intrinsics of a camera.

    Attributes:
        width: columns of the image.
        height: rows of the image.
        fx: focal length along the rows [pixels].
        fy: focal length along the columns [pixels].
        cx: column of the principal point [pixels].
        cy: row of the principal point [pixels].
        distortion: model of the lens, or its name.
        coefficients: (k1, k2, p1, p2, k3) of the lens.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: Distortion = Distortion.NONE
    coefficients: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Checks the numbers.

        Raises:
            InputError: naming each that is wrong.
        """
        faults = []
        for name in ("width", "height"):
            value = getattr(self, name)
            if not 1 <= value <= 32768 or value != int(value):
                faults.append(f"{name} is {value}; expected a whole number from 1 to 32768")
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                faults.append(f"{name} is {value}; a focal length must be positive and finite")
        for name in ("cx", "cy"):
            if not np.isfinite(getattr(self, name)):
                faults.append(f"{name} is not finite")
        coefficients = tuple(float(c) for c in self.coefficients)
        if len(coefficients) != 5 or not np.isfinite(coefficients).all():
            faults.append("coefficients must be five finite numbers (k1, k2, p1, p2, k3)")
        try:
            object.__setattr__(self, "distortion", Distortion(self.distortion))
        except ValueError:
            known = ", ".join(model.value for model in Distortion)
            faults.append(f"distortion '{self.distortion}' is unknown; there are {known}")
        if faults:
            raise InputError(*faults)
        object.__setattr__(self, "coefficients", coefficients)
        if self.distortion is not Distortion.NONE and not any(coefficients):
            object.__setattr__(self, "distortion", Distortion.NONE)

    @classmethod
    def from_K(cls, K: ArrayLike, width: int, height: int) -> "CameraModel":
        """The pinhole with the intrinsic matrix K (3, 3) [pixels].

        Raises:
            InputError: if K is not a pinhole without skew.
        """
        matrix = np.asarray(K, dtype=float)
        if matrix.shape != (3, 3):
            raise InputError(f"K has shape {matrix.shape}; expected (3, 3)")
        if matrix[0, 1] != 0 or matrix[1, 0] != 0 or not np.array_equal(matrix[2], [0, 0, 1]):
            raise InputError("K has skew or a last row other than [0, 0, 1]; rectify the image")
        return cls(width, height, matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])

    @classmethod
    def from_drake(cls, info: CameraInfo) -> "CameraModel":
        """The pinhole of Drake's CameraInfo."""
        return cls(
            info.width(),
            info.height(),
            info.focal_x(),
            info.focal_y(),
            info.center_x(),
            info.center_y(),
        )

    @property
    def K(self) -> NDArray[np.float64]:
        """The intrinsic matrix (3, 3) [pixels], without the distortion."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def project(self, p_C: ArrayLike) -> NDArray[np.float64]:
        """Where points are imaged.

        Args:
            p_C: (..., 3) points in C [m].

        Returns:
            (..., 2) pixels (u, v), inside the image or not; NaN for points that are not in front
            of the camera.
        """
        p = np.asarray(p_C, dtype=float)
        if p.ndim < 1 or p.shape[-1] != 3:
            raise InputError(f"p_C has shape {p.shape}; expected (..., 3)")
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = np.where(p[..., 2:] > 0, p[..., :2] / p[..., 2:], np.nan)
            distorted, _ = self._distort(slopes)
        return distorted * [self.fx, self.fy] + [self.cx, self.cy]

    def unproject(self, pixels: ArrayLike, depth: ArrayLike = 1.0) -> NDArray[np.float64]:
        """The points that pixels see at a depth.

        The distortion is inverted by Newton's method.

        Args:
            pixels: (..., 2) pixels (u, v), not necessarily whole numbers.
            depth: depth along the optical axis [m], one or (...).

        Returns:
            (..., 3) points in C [m]; NaN where no ray is imaged at the pixel, as may be far
            outside of what the distortion was fitted to.
        """
        uv = np.asarray(pixels, dtype=float)
        if uv.ndim < 1 or uv.shape[-1] != 2:
            raise InputError(f"pixels has shape {uv.shape}; expected (..., 2)")
        target = (uv - [self.cx, self.cy]) / [self.fx, self.fy]
        slopes = target
        if self.distortion is not Distortion.NONE:
            with np.errstate(all="ignore"):
                for _ in range(_STEPS):
                    at, J = self._distort(slopes)
                    e_x, e_y = at[..., 0] - target[..., 0], at[..., 1] - target[..., 1]
                    (a, b), (c, d) = J
                    determinant = a * d - b * c
                    step = np.stack([d * e_x - b * e_y, a * e_y - c * e_x], axis=-1)
                    slopes = slopes - step / determinant[..., None]
                at, ((a, b), (c, d)) = self._distort(slopes)
                # Beyond where the image folds over, the inverse is another lens's.
                solved = (np.abs(at - target).max(axis=-1) < _SOLVED) & (a * d - b * c > 0)
            slopes = np.where(solved[..., None], slopes, np.nan)
        z = np.asarray(depth, dtype=float)
        return np.stack(np.broadcast_arrays(slopes[..., 0] * z, slopes[..., 1] * z, z), axis=-1)

    @cached_property
    def rays(self) -> NDArray[np.float32]:
        """(2, height, width) slopes x/z and y/z of the ray that each pixel sees; made once."""
        v, u = np.mgrid[0 : self.height, 0 : self.width]
        p = self.unproject(np.stack([u, v], axis=-1))
        return np.ascontiguousarray(np.moveaxis(p[..., :2], -1, 0), dtype=np.float32)

    def _distort(
        self, slopes: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], Sequence[Sequence[NDArray[np.float64]]]]:
        """Slopes (..., 2) as imaged, and the derivatives [[x_x, x_y], [y_x, y_y]] (...)."""
        x, y = slopes[..., 0], slopes[..., 1]
        k1, k2, p1, p2, k3 = self.coefficients
        r2 = x * x + y * y
        f = 1 + ((k3 * r2 + k2) * r2 + k1) * r2
        f_r2 = (3 * k3 * r2 + 2 * k2) * r2 + k1  # df / dr^2
        xf, yf = x * f, y * f
        xf_x, xf_y, yf_y = f + 2 * x * x * f_r2, 2 * x * y * f_r2, f + 2 * y * y * f_r2
        if self.distortion is Distortion.BROWN_CONRADY:
            # The tangential terms are of the undistorted slopes s, t ...
            s, t, s_x, s_y, t_x, t_y = x, y, 1.0, 0.0, 0.0, 1.0
        else:
            s, t, s_x, s_y, t_x, t_y = xf, yf, xf_x, xf_y, xf_y, yf_y  # ... or of these.
        distorted = np.stack(
            [
                xf + 2 * p1 * s * t + p2 * (r2 + 2 * s * s),
                yf + 2 * p2 * s * t + p1 * (r2 + 2 * t * t),
            ],
            axis=-1,
        )
        J = (
            (
                xf_x + 2 * p1 * (s_x * t + s * t_x) + p2 * (2 * x + 4 * s * s_x),
                xf_y + 2 * p1 * (s_y * t + s * t_y) + p2 * (2 * y + 4 * s * s_y),
            ),
            (
                xf_y + 2 * p2 * (s_x * t + s * t_x) + p1 * (2 * x + 4 * t * t_x),
                yf_y + 2 * p2 * (s_y * t + s * t_y) + p1 * (2 * y + 4 * t * t_y),
            ),
        )
        return distorted, J


class PosedCamera(NamedTuple):
    """A calibrated camera: its model, and the pose of its optical frame C in W."""

    model: CameraModel
    X_WC: RigidTransform
