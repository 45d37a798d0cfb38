"""Points and normals of one depth image.

The camera frame C is optical: z forward, x right, y down. Pixel (row v, column u) sees along
``K^-1 [u, v, 1]``.
"""

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import InputError


def unproject(
    depth: NDArray[np.floating],
    K: NDArray[np.floating],
    *,
    min_depth: float = 0.05,
    max_depth: float = 10.0,
) -> NDArray[np.float64]:
    """The point that each pixel sees.

    Args:
        depth: (H, W) depth along the optical axis [m].
        K: (3, 3) pinhole intrinsics [pixels], without skew.
        min_depth: depths below it are no measurement [m], > 0.
        max_depth: depths above it are no measurement [m].

    Returns:
        (H, W, 3) points in the camera frame C; NaN where there is no measurement (zero, not
        finite, or out of range).

    Raises:
        InputError: if a shape is wrong or K is not a pinhole without skew.
    """
    z = _valid_depth(depth, min_depth, max_depth)
    x, y = _ray_slopes(z.shape, K)
    return np.stack([x * z, y * z, z], axis=-1)


def normals_from_depth(
    depth: NDArray[np.floating],
    K: NDArray[np.floating],
    *,
    window: int = 5,
    max_residual: float = 0.002,
    max_incidence: float = np.deg2rad(83.0),
    min_depth: float = 0.05,
    max_depth: float = 10.0,
) -> NDArray[np.float64]:
    """Surface normals from the pixel grid, pointing toward the camera.

    Under a pinhole the inverse depth of a plane is an affine function of the pixel, so the plane
    of a window of pixels is a least-squares fit of three numbers, made by sums along rows and
    columns. Each pixel then takes the plane of one of nine windows that contain it (centred on
    it, or with it on the rim): its own, unless another fits several times better, as happens
    near an edge of depth or a crease, but not on a surface that is merely curved. Thus no normal
    mixes the two sides of an edge; a pixel that no window fits (a speck, a sliver, a flying
    pixel) gets none. Choosing the smoothest of the windows around a pixel is
    Kuwahara's filter (1976); planes in inverse depth are those of Fan et al., "Three-Filters-to-
    Normal" (2021).

    Args:
        depth: (H, W) depth along the optical axis [m].
        K: (3, 3) pinhole intrinsics [pixels], without skew.
        window: edge of the window [pixels], odd, >= 3.
        max_residual: largest root mean square distance of a window's pixels to its plane, and of
            the pixel itself, along the optical axis [m].
        max_incidence: largest angle between normal and line of sight [rad]; flatter views carry
            no usable normal.
        min_depth: as for :func:`unproject`.
        max_depth: as for :func:`unproject`.

    Returns:
        (H, W, 3) unit normals in C with ``normal . point < 0``; NaN where there is none.

    Raises:
        InputError: if a shape or the window is wrong.
    """
    if window < 3 or window % 2 == 0:
        raise InputError(f"window is {window}; it must be odd and at least 3")
    z = _valid_depth(depth, min_depth, max_depth)
    x, y = _ray_slopes(z.shape, K)
    H, W = z.shape
    normals = np.full((H, W, 3), np.nan)
    if min(H, W) < window:
        return normals
    w = 1.0 / z  # NaN spreads through the sums to every window that contains it

    r = window // 2
    ones, ramp = np.ones(window), np.arange(-r, r + 1.0)
    row_sum = _correlate(w, ones, axis=1)
    mean = _correlate(row_sum, ones, axis=0) / window**2
    moment = window * (ramp @ ramp)  # the sum of u^2 over the window
    slope_u = _correlate(_correlate(w, ramp, axis=1), ones, axis=0) / moment
    slope_v = _correlate(row_sum, ramp, axis=0) / moment
    square = _correlate(_correlate(w * w, ones, axis=1), ones, axis=0) / window**2
    variance = square - mean**2 - (slope_u**2 + slope_v**2) * (moment / window**2)
    # An error dw of the inverse depth is an error z^2 dw of the depth.
    residual = np.sqrt(np.maximum(variance, 0.0)) / mean**2
    residual[np.isnan(residual)] = np.inf

    def normals_of(
        v: NDArray[np.int64], u: NDArray[np.int64], at: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        """Which pixels (v, u) the windows with flat indices ``at`` fit, and their normals."""
        a, b = slope_u.take(at), slope_v.take(at)
        at_v, at_u = np.divmod(at, W - 2 * r)
        fitted = mean.take(at) + a * (u - at_u - r) + b * (v - at_v - r)
        # n . p = d is (n / d) . K^-1 [u, v, 1] = 1/z; so n / d has these components in C.
        x_here, y_here = x[0, u], y[v, 0]
        m_x, m_y = a * K[0, 0], b * K[1, 1]
        m_z = fitted - m_x * x_here - m_y * y_here
        length = np.sqrt(m_x * m_x + m_y * m_y + m_z * m_z)
        cosine = fitted / (length * np.sqrt(x_here * x_here + y_here * y_here + 1.0))
        fits = (
            (residual.take(at) <= max_residual)
            & (np.abs(w[v, u] - fitted) <= max_residual * fitted * fitted)
            & (cosine >= np.cos(max_incidence))
        )
        return fits, np.stack([m_x, m_y, m_z], axis=-1) / -length[:, None]

    # Windows are named by their flat indices in `residual`. A pixel whose own window fits to a
    # twentieth of the bound keeps it without a look at the others.
    own = np.full((H, W), np.inf)
    own[r : H - r, r : W - r] = residual
    v, u = np.nonzero(np.isfinite(z))
    at = np.clip(v - r, 0, H - 1 - 2 * r) * (W - 2 * r) + np.clip(u - r, 0, W - 1 - 2 * r)
    unsettled = np.nonzero(own[v, u] > 0.05 * max_residual)[0]
    v0, u0 = v[unsettled], u[unsettled]
    best, best_at = 0.4 * own[v0, u0], at[unsettled]
    for dv in (-r, 0, r):
        for du in (-r, 0, r):
            v1, u1 = v0 + dv - r, u0 + du - r
            ok = (v1 >= 0) & (v1 < H - 2 * r) & (u1 >= 0) & (u1 < W - 2 * r)
            trial_at = np.where(ok, v1 * (W - 2 * r) + u1, 0)
            trial = np.where(ok, residual.take(trial_at), np.inf)
            better = trial < best
            best = np.where(better, trial, best)
            best_at = np.where(better, trial_at, best_at)
    at[unsettled] = best_at
    fits, n_C = normals_of(v, u, at)
    normals[v[fits], u[fits]] = n_C[fits]
    return normals


def _valid_depth(
    depth: NDArray[np.floating], min_depth: float, max_depth: float
) -> NDArray[np.float64]:
    """The depth as float64, with NaN where it is no measurement."""
    if depth.ndim != 2:
        raise InputError(f"depth has shape {depth.shape}; expected (H, W)")
    if not 0 < min_depth < max_depth:
        raise InputError(f"min_depth {min_depth} and max_depth {max_depth} are not a range above 0")
    return np.where((depth >= min_depth) & (depth <= max_depth), depth, np.nan).astype(np.float64)


def _ray_slopes(
    shape: tuple[int, ...], K: NDArray[np.floating]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """x/z of each column (1, W) and y/z of each row (H, 1) of the lines of sight."""
    if K.shape != (3, 3) or not np.isfinite(K).all() or K[0, 0] <= 0 or K[1, 1] <= 0:
        raise InputError(
            "K is not a (3, 3) matrix of pinhole intrinsics with positive focal length"
        )
    if K[0, 1] != 0 or K[1, 0] != 0 or not np.array_equal(K[2], [0, 0, 1]):
        raise InputError("K has skew or a last row other than [0, 0, 1]; rectify the image first")
    x = (np.arange(shape[1])[None, :] - K[0, 2]) / K[0, 0]
    y = (np.arange(shape[0])[:, None] - K[1, 2]) / K[1, 1]
    return x, y


def _correlate(
    a: NDArray[np.float64], weights: NDArray[np.float64], axis: int
) -> NDArray[np.float64]:
    """Sliding sums with the weights along an axis, only where the window fits."""
    n = a.shape[axis] - len(weights) + 1
    total = np.zeros([n if i == axis else s for i, s in enumerate(a.shape)])
    for i, weight in enumerate(weights):
        if weight != 0:
            part = a[i : i + n] if axis == 0 else a[:, i : i + n]
            total += part if weight == 1 else weight * part
    return total
