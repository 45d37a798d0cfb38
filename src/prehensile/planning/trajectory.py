"""Paths with times: smooth, within the limits, at rest at both ends."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import BsplineBasis
from pydrake.trajectories import BsplineTrajectory

from prehensile.errors import InputError
from prehensile.kinematics.joint_limits import JointLimits
from prehensile.planning.blend import round_corners
from prehensile.planning.time_optimal import fastest_profile, sample_profile


@dataclass(frozen=True)
class TimedPath:
    """A motion of n joints, at rest at both ends: a cubic B-spline with uniform knots.

    Attributes:
        path: the waypoints it was made of (K, n).
        trajectory: positions over time, defined on [0, duration].
        duration: seconds.
    """

    path: np.ndarray
    trajectory: BsplineTrajectory
    duration: float

    def value(self, t: float) -> np.ndarray:
        """Joint positions (n,) at time t, held before the start and after the end."""
        return self.trajectory.value(min(max(t, 0.0), self.duration)).ravel()

    @property
    def q_end(self) -> np.ndarray:
        """Where it ends (n,)."""
        return self.path[-1]

    def sample(self, period: float = 0.02) -> np.ndarray:
        """Positions (T, n) every `period` seconds (at most), with both ends."""
        times = np.linspace(0.0, self.duration, max(2, int(np.ceil(self.duration / period)) + 1))
        return self.trajectory.vector_values(times).T


def join_paths(*paths: np.ndarray) -> np.ndarray:
    """Paths (K_i, n) one after the other, the shared ends once; repeated waypoints are dropped."""
    path = np.vstack(paths)
    moved = np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9
    return path[np.concatenate([[True], moved])]


def time_parameterize(
    path: np.ndarray,
    limits: JointLimits,
    *,
    speed: float | Sequence[float] | np.ndarray = 1.0,
    deviation: float = 0.02,
    smoothing: float = 0.08,
    period: float = 0.01,
) -> TimedPath:
    """The quick and smooth motion along a path within velocity and acceleration limits.

    Corners are rounded within `deviation`; the rounded path is passed in the least time
    (:func:`~prehensile.planning.time_optimal.fastest_profile`); that motion is averaged over a
    sliding window, and its samples are the control points of a cubic B-spline. Averages of
    velocities and accelerations within limits are within limits, and so are the derivatives of a
    B-spline, which are averages of its control points' differences: the limits hold at every
    instant. The jerk is at most twice the acceleration limit over `smoothing`.

    Args:
        path: waypoints (K, n), joined by straight lines; one waypoint means standing still.
        limits: velocity and acceleration limits of the joints.
        speed: factor on the velocity limits, one or one for each leg (K - 1,), in (0, 1].
        deviation: how far the path may pass from its corners (Euclidean, rad).
        smoothing: width of the sliding window (s); it is about what the motion takes longer.
        period: time between control points (s).

    Raises:
        InputError: if the path is empty or not finite, or a factor is out of range.
    """
    path = np.atleast_2d(np.asarray(path, dtype=float))
    if path.ndim != 2 or len(path) == 0 or path.shape[1] != len(limits.lower):
        raise InputError(f"a path has shape (K, {len(limits.lower)}), not {path.shape}")
    if not np.all(np.isfinite(path)):
        raise InputError("a path must be finite")
    factors = np.broadcast_to(np.asarray(speed, dtype=float), (max(len(path) - 1, 1),))
    if not np.all((factors > 0.0) & (factors <= 1.0)):
        raise InputError("speed factors lie in (0, 1]")
    moved = np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9
    corners = np.vstack([path[:1], path[1:][moved]])
    if len(corners) == 1:
        samples = corners
    else:
        smooth = round_corners(corners, deviation)
        velocity = factors[: len(path) - 1][moved][smooth.leg][:, None] * limits.velocity
        x = fastest_profile(smooth, velocity, limits.acceleration)
        samples = smooth.position(sample_profile(smooth, x, period))
        samples[0], samples[-1] = path[0], path[-1]
    window = max(1, round(smoothing / period))
    samples = _average(samples, window)
    # Three equal control points at an end: there at rest, with no acceleration.
    control = np.vstack([samples[:1]] * 2 + [samples] + [samples[-1:]] * 2)
    knots = (np.arange(len(control) + 4) - 3.0) * period
    trajectory = BsplineTrajectory(BsplineBasis(4, knots), list(control[:, :, None]))
    return TimedPath(path, trajectory, float(trajectory.end_time()))


def _average(samples: np.ndarray, window: int) -> np.ndarray:
    """Mean of each `window` samples in a row, as if the ends went on forever."""
    padded = np.vstack([samples[:1]] * (window - 1) + [samples] + [samples[-1:]] * (window - 1))
    # Differences are averaged and summed, so that the ends stay exact to rounding.
    total = np.cumsum(np.vstack([np.zeros_like(padded[:1]), padded - padded[0]]), axis=0)
    mean = (total[window:] - total[:-window]) / window + padded[0]
    mean[-1] = samples[-1]
    return mean
