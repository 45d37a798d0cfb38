"""Points and normals of one depth image.

The camera frame C is optical: z forward, x right, y down.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import InputError
from prehensile.native import _core
from prehensile.perception.camera_model import CameraModel, Distortion


@dataclass(frozen=True)
class DepthConfig:
    """What counts as a measurement, and how normals are made from the pixel grid."""

    # Depths below are no measurement [m]; above 0.
    min_depth: float = 0.05
    # Depths above are no measurement [m]; above min_depth.
    max_depth: float = 10.0
    # What a unit of an image of whole numbers is [m]; above 0.
    depth_unit: float = 0.001
    # Edge of the windows that planes are fitted to [pixels]; odd, 3 to 17.
    window: int = 5
    # Largest root mean square distance of a window's pixels to its plane, and of the pixel itself,
    # along the optical axis [m]; above 0. What the noise below explains is allowed in addition.
    max_residual: float = 0.002
    # Largest angle between normal and line of sight [rad]; flatter views carry no usable normal.
    max_incidence: float = float(np.deg2rad(83.0))
    # The standard deviation of the depth z is noise_constant + noise_quadratic z^2 [m], [1/m];
    # 0 or more. A larger window then averages more of it, and rounds off more: in a bin 0.9 m away
    # 7 pixels suit a noise of 0.001 and 0.002 that differs from pixel to pixel, and 11 that of a
    # D415 (DepthNoiseConfig), 0 and 0.0026, which neighbours share.
    noise_constant: float = 0.0
    noise_quadratic: float = 0.0

    def limits(self) -> tuple[float, float, int, float, float, float, float]:
        """The settings in the order of the native calls.

        Raises:
            InputError: if the window is out of range; the native calls check the rest.
        """
        if not 3 <= self.window <= 17:
            raise InputError(f"window: must be odd, from 3 to 17, not {self.window}")
        return (
            self.min_depth,
            self.max_depth,
            self.window,
            self.max_residual,
            self.max_incidence,
            self.noise_constant,
            self.noise_quadratic,
        )


def unproject(
    depth: NDArray[np.generic],
    camera: CameraModel,
    config: DepthConfig | None = None,
    *,
    num_threads: int = 1,
) -> NDArray[np.float64]:
    """The point that each pixel sees.

    Args:
        depth: (H, W) depth along the optical axis: floats in metres or whole numbers in
            ``config.depth_unit``.
        camera: the camera's intrinsics, of the same size.
        config: the range of depths and their unit; ``DepthConfig()`` if None.
        num_threads: threads to share the work, at least 1; the result is the same.

    Returns:
        (H, W, 3) points in C; NaN where there is no measurement (zero, not finite, or out of
        range).

    Raises:
        InputError: naming the argument, if a shape or a setting is wrong.
    """
    config = config or DepthConfig()
    view = native_view(depth, camera, config, np.eye(4))
    return _checked(lambda: _core.unproject_depth(view, config.limits(), num_threads))


def normals_from_depth(
    depth: NDArray[np.generic],
    camera: CameraModel,
    config: DepthConfig | None = None,
    *,
    num_threads: int = 1,
) -> NDArray[np.float64]:
    """Surface normals from the pixel grid, pointing toward the camera.

    Under a pinhole the inverse depth of a plane is an affine function of the pixel, so the plane
    of a window of pixels is a least-squares fit of three numbers (for a lens that distorts, its
    derivative at the pixel takes the pinhole's place). Each pixel then takes the plane of one of
    nine windows that contain it (centred on it, or with it on the rim): its own, unless another
    fits several times better, as happens near an edge of depth or a crease, but not on a surface
    that is merely curved. Thus no normal mixes the two sides of an edge; a pixel that no window
    fits (a speck, a sliver, a flying pixel) gets none. A window may lack two fifths of its pixels,
    but not the middle one. Choosing the smoothest of the windows
    around a pixel is Kuwahara's filter (1976); planes in inverse depth are those of Fan et al.,
    "Three-Filters-to-Normal" (2021).

    Args:
        depth: as for :func:`unproject`.
        camera: the camera's intrinsics, of the same size.
        config: window and tolerances; ``DepthConfig()`` if None.
        num_threads: threads to share the work, at least 1; the result is the same.

    Returns:
        (H, W, 3) unit normals in C with ``normal . point < 0``; NaN where there is none.

    Raises:
        InputError: naming the argument, if a shape or a setting is wrong.
    """
    config = config or DepthConfig()
    view = native_view(depth, camera, config, np.eye(4))
    return _checked(lambda: _core.depth_normals(view, config.limits(), num_threads))


def native_view(
    depth: NDArray[np.generic],
    camera: CameraModel,
    config: DepthConfig,
    X_WC: NDArray[np.float64],
    colors: NDArray[np.generic] | None = None,
    name: str = "depth",
) -> tuple[Any, ...]:
    """A depth image and its camera as the native functions take them.

    Args:
        depth: as for :func:`unproject`.
        camera: the camera's intrinsics, of the same size.
        config: for the unit of whole numbers.
        X_WC: (4, 4) pose of C.
        colors: (H, W, 3 or 4) uint8 or None.
        name: of the image, for messages.

    Raises:
        InputError: if an image has another shape than the camera, or is not one of numbers.
    """
    image = np.asarray(depth)
    expected = (camera.height, camera.width)
    if image.shape != expected:
        raise InputError(f"{name} has shape {image.shape}; its camera says (H, W) = {expected}")
    if np.issubdtype(image.dtype, np.floating):
        scale = 1.0
        with np.errstate(over="ignore"):
            image = np.ascontiguousarray(image, dtype=np.float32)
    elif np.issubdtype(image.dtype, np.integer):
        scale = config.depth_unit
        if not 0 < scale < np.inf:
            raise InputError(f"depth_unit is {scale}; it must be positive and finite")
        dtype = np.uint16 if image.dtype == np.uint16 else np.float32
        image = np.ascontiguousarray(image, dtype=dtype)
    else:
        raise InputError(f"{name} holds {image.dtype}; expected floats [m] or whole numbers")
    if colors is not None:
        colors = np.asarray(colors)
        fits = colors.shape in ((*expected, 3), (*expected, 4)) and colors.dtype == np.uint8
        if not fits:
            raise InputError(
                f"the color image of {name} holds {colors.dtype} of shape {colors.shape}; expected "
                f"uint8 of {(*expected, 3)}"
            )
        colors = np.ascontiguousarray(colors[:, :, :3])
    pinhole = camera.distortion is Distortion.NONE
    return (
        image,
        scale,
        (camera.fx, camera.fy, camera.cx, camera.cy),
        None if pinhole else camera.rays,
        X_WC,
        colors,
    )


def _checked(call: Any) -> Any:
    """The result of a native call, its complaints as InputError."""
    try:
        return call()
    except ValueError as error:
        raise InputError(str(error)) from None
