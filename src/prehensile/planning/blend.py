"""Rounding the corners of a polyline, so that it can be passed without stopping."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SmoothPath:
    """A path q(s) of unit speed on lines, cut into intervals of constant second derivative.

    Attributes:
        s: ends of the M intervals (M + 1,), increasing from 0.
        q: positions at the ends (M + 1, n).
        slope_start: dq/ds at the start of each interval (M, n).
        slope_end: dq/ds at its end (M, n).
        leg: index of the polyline's leg that each interval lies on, (M,).
    """

    s: np.ndarray
    q: np.ndarray
    slope_start: np.ndarray
    slope_end: np.ndarray
    leg: np.ndarray

    @property
    def curvature(self) -> np.ndarray:
        """d2q/ds2 on each interval (M, n)."""
        return (self.slope_end - self.slope_start) / np.diff(self.s)[:, None]

    def position(self, s: np.ndarray) -> np.ndarray:
        """Positions (K, n) at path parameters s (K,)."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.leg) - 1)
        d = (s - self.s[i])[:, None]
        return self.q[i] + d * (self.slope_start[i] + 0.5 * d * self.curvature[i])


def round_corners(
    path: np.ndarray, deviation: float, *, max_interval: float = 0.05, corner_intervals: int = 4
) -> SmoothPath:
    """Replaces each corner of a polyline by a parabola that is tangent to both legs.

    A parabola takes at most half of either leg, and passes the corner at no more than the given
    distance; a path of many short legs becomes a quadratic B-spline.

    Args:
        path: corners (K, n), K >= 2, no two neighbours equal.
        deviation: largest distance from a corner, Euclidean in joint space (rad, > 0).
        max_interval: largest interval on a line (rad); short paths get at least 16 intervals.
        corner_intervals: intervals that a parabola is cut into.
    """
    difference = np.diff(path, axis=0)
    length = np.linalg.norm(difference, axis=1)
    direction = difference / length[:, None]
    max_interval = min(max_interval, float(np.sum(length)) / 16)
    turn = np.linalg.norm(np.diff(direction, axis=0), axis=1)
    # The parabola with tangents of length d passes the corner at d |u2 - u1| / 4.
    cut = np.zeros(len(path))
    cut[1:-1] = np.minimum(
        0.5 * np.minimum(length[:-1], length[1:]), 4.0 * deviation / np.maximum(turn, 1e-12)
    )
    steps: list[float] = []
    starts: list[np.ndarray] = []
    ends: list[np.ndarray] = []
    legs: list[int] = []
    for k, u in enumerate(direction):
        straight = length[k] - cut[k] - cut[k + 1]
        if straight > 1e-9:
            count = int(np.ceil(straight / max_interval - 1e-9))
            steps += [straight / count] * count
            starts += [u] * count
            ends += [u] * count
            legs += [k] * count
        if cut[k + 1] > 0.0:
            fractions = np.linspace(0.0, 1.0, corner_intervals + 1)[:, None]
            slopes = (1.0 - fractions) * u + fractions * direction[k + 1]
            steps += [2.0 * cut[k + 1] / corner_intervals] * corner_intervals
            starts += list(slopes[:-1])
            ends += list(slopes[1:])
            legs += [k if i < corner_intervals // 2 else k + 1 for i in range(corner_intervals)]
    step, slope_start, slope_end = np.array(steps), np.array(starts), np.array(ends)
    q = np.vstack(
        [path[:1], path[0] + np.cumsum(0.5 * (slope_start + slope_end) * step[:, None], axis=0)]
    )
    s = np.concatenate([[0.0], np.cumsum(step)])
    return SmoothPath(s, q, slope_start, slope_end, np.array(legs))
