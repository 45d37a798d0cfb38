"""Robust losses: how much a residual counts, so that outliers do not decide.

Each is a function of a residual's length r >= 0 and a scale c > 0, in the same unit (here metres),
equal to r^2 near zero. Minimizing a sum of losses is done by least squares whose weights are the
losses' derivatives by r^2, renewed at each step (Holland and Welsch 1977; Zhang, "Parameter
estimation techniques", Image and Vision Computing 1997).
"""

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray


class RobustLoss(Enum):
    """A loss by name; ``cpp/include/prehensile/robust_loss.h`` has the same ones."""

    LEAST_SQUARES = "least_squares"
    """r^2: every residual counts, a far one most."""
    HUBER = "huber"
    """r^2 up to c, 2 c r - c^2 beyond: convex; an outlier pulls with a constant force."""
    TUKEY = "tukey"
    """c^2 / 3 (1 - (1 - (r/c)^2)^3) up to c, constant beyond."""
    GEMAN_MCCLURE = "geman_mcclure"
    """c^2 r^2 / (c^2 + r^2): an outlier's pull fades, but never ends."""
    TRUNCATED = "truncated"
    """min(r^2, c^2), truncated least squares: a residual beyond c does not count."""

    def loss(self, r: ArrayLike, scale: float) -> NDArray[np.float64]:
        """The losses of residuals.

        Args:
            r: (...) residuals; only their size counts.
            scale: c > 0, in the unit of r.

        Returns:
            (...) losses, in the unit of r^2.

        Raises:
            ValueError: if the scale is not positive.
        """
        r2, c2 = _squares(r, scale)
        if self is RobustLoss.HUBER:
            return np.where(r2 <= c2, r2, 2 * scale * np.sqrt(r2) - c2)
        if self is RobustLoss.TUKEY:
            x = np.minimum(r2 / c2, 1)
            return c2 / 3 * (x * (3 - x * (3 - x)))  # 1 - (1 - x)^3, without the cancellation
        if self is RobustLoss.GEMAN_MCCLURE:
            return c2 * r2 / (c2 + r2)
        if self is RobustLoss.TRUNCATED:
            return np.minimum(r2, c2)
        return r2

    def weight(self, r: ArrayLike, scale: float) -> NDArray[np.float64]:
        """The weights of residuals in reweighted least squares: d loss / d(r^2), 1 at r = 0.

        Args:
            r: (...) residuals; only their size counts.
            scale: c > 0, in the unit of r.

        Returns:
            (...) weights in [0, 1].

        Raises:
            ValueError: if the scale is not positive.
        """
        r2, c2 = _squares(r, scale)
        if self is RobustLoss.HUBER:
            return scale / np.sqrt(np.maximum(r2, c2))
        if self is RobustLoss.TUKEY:
            return (1 - np.minimum(r2 / c2, 1)) ** 2
        if self is RobustLoss.GEMAN_MCCLURE:
            return (c2 / (c2 + r2)) ** 2
        if self is RobustLoss.TRUNCATED:
            return np.where(r2 <= c2, 1.0, 0.0)
        return np.ones_like(r2)


def _squares(r: ArrayLike, scale: float) -> tuple[NDArray[np.float64], float]:
    if not (scale > 0 and np.isfinite(scale)):
        raise ValueError(f"scale: must be positive and finite, not {scale}")
    return np.square(np.asarray(r, dtype=float)), scale * scale
