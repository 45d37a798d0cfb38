"""What a sensor can see of a cloud."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError

from prehensile.perception.cloud import FARTHEST, within

_LARGEST_FACTOR = 1e6  # Beyond it rounding decides what is on the hull.


def visible_points(
    points: NDArray[np.float64], p_WS: ArrayLike, *, radius_factor: float = 100.0
) -> NDArray[np.bool_]:
    """Which points of a surface a sensor at p_WS sees, without making the surface: a mask (N,).

    Points are reflected at a sphere around the sensor; those that lie on the convex hull of the
    reflected points and the sensor are visible (Katz, Tal and Basri, "Direct Visibility of Point
    Sets", SIGGRAPH 2007). The sparser or noisier the points, the smaller the factor should be;
    too small a factor hides points in hollows.

    Args:
        points: (N, 3) positions [m], finite.
        p_WS: (3,) position of the sensor [m].
        radius_factor: the sphere's radius as a multiple of the largest distance, above 1, at most
            1e6.

    Raises:
        ValueError: if a shape is wrong, a value is not finite, a point is where the sensor is, or
            radius_factor is out of range.
    """
    p = np.asarray(points, dtype=np.float64)
    origin = np.asarray(p_WS, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 3 or not np.isfinite(p).all():
        raise ValueError(f"points: expected finite numbers of shape (N, 3), not {p.shape}")
    if origin.shape != (3,) or not np.isfinite(origin).all():
        raise ValueError("p_WS: expected three finite numbers")
    if not 1 < radius_factor <= _LARGEST_FACTOR:
        raise ValueError(f"radius_factor: must be above 1, at most 1e6, not {radius_factor}")
    if len(p) < 4:  # No point of so few can hide another, but by standing right before it.
        return np.ones(len(p), dtype=bool)
    if not within(p, FARTHEST) or not within(origin, FARTHEST):
        raise ValueError(f"points, p_WS: must not lie beyond {FARTHEST:g}")
    ray = p - origin
    distance = np.linalg.norm(ray, axis=1)
    if not distance.min() > 0:
        raise ValueError("points: one of them is where the sensor is")
    radius = radius_factor * distance.max()
    flipped = ray * ((2 * radius - distance) / distance)[:, None]
    try:
        hull = ConvexHull(np.vstack([flipped, np.zeros(3)]))
    except QhullError:  # All in one plane with the sensor: hide nothing by a hull that is none.
        return np.ones(len(p), dtype=bool)
    seen = np.zeros(len(p) + 1, dtype=bool)
    seen[hull.vertices] = True
    return seen[:-1]
