"""The fastest motion along a path within velocity and acceleration limits."""

import numpy as np

from prehensile.planning.blend import SmoothPath


def fastest_profile(path: SmoothPath, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Squared path speed at which the path is passed in the least time, at rest at both ends.

    Reachability analysis (Pham and Pham, "A new approach to time-optimal path parameterization
    based on reachability analysis", 2018): backward, the largest speed from which the end can
    still be reached; forward, the largest acceleration that stays below it. The path
    acceleration is constant on each interval, where q'' is constant too, so the joint
    acceleration is linear there and holding its limit at both ends holds it everywhere.

    Args:
        path: the path, with M intervals.
        velocity: largest joint velocities on each interval, (M, n) or (n,).
        acceleration: largest joint accelerations, (n,).

    Returns:
        (ds/dt)^2 at the ends of the intervals, (M + 1,).
    """
    h = np.diff(path.s)
    M = len(h)
    # Joint acceleration at both ends of an interval: p u + r x, with u = d2s/dt2 and x = (ds/dt)^2
    # at its start (at its end x is larger by 2 h u).
    curvature = path.curvature
    p = np.concatenate([path.slope_start, path.slope_end + 2.0 * h[:, None] * curvature], axis=1)
    r = np.concatenate([curvature, curvature], axis=1)
    a = np.tile(acceleration, 2)

    # |p u + r x| <= a as u between alpha -+ ... : the bounds of u are (-+a - r x) / p.
    flat = np.abs(p) < 1e-9
    p_safe = np.where(flat, 1.0, p)
    beta = np.where(flat, 0.0, -r / p_safe)
    alpha = np.where(flat, np.inf, a / np.abs(p_safe))
    # u <= x's upper bounds: alpha + beta x; u >= lower bounds: -alpha + beta x. One more lower
    # bound: the speed does not become negative, u >= -x / (2 h).
    low_alpha = np.concatenate([-alpha, np.zeros((M, 1))], axis=1)
    low_beta = np.concatenate([beta, -0.5 / h[:, None]], axis=1)

    # The largest x at the start of each interval, from the limits of that interval alone.
    steepest = np.maximum(np.abs(path.slope_start), np.abs(path.slope_end))
    with np.errstate(divide="ignore"):
        x_max = np.min((velocity / steepest) ** 2, axis=1)
        x_flat = np.where(flat & (np.abs(r) > 1e-12), a / np.abs(r), np.inf)
    closing = low_beta[:, :, None] - beta[:, None, :]
    gap = alpha[:, None, :] - low_alpha[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        x_pair = np.where(closing > 1e-12, gap / closing, np.inf)
    x_start = np.minimum(x_max, np.minimum(x_flat.min(axis=1), x_pair.min(axis=(1, 2))))
    # The speed at a node also obeys the velocity limit of the interval before it.
    x_start[1:] = np.minimum(x_start[1:], x_max[:-1])

    x = np.zeros(M + 1)
    for i in range(M - 1, 0, -1):  # at i = 0 the path starts at rest
        slope = low_beta[i] + 0.5 / h[i]
        room = 0.5 * x[i + 1] / h[i] - low_alpha[i]
        rising = slope > 1e-12
        x[i] = min(x_start[i], float(np.min(room[rising] / slope[rising], initial=np.inf)))
    reachable = x
    x = np.zeros(M + 1)
    for i in range(M):
        u = min(float(np.min(alpha[i] + beta[i] * x[i])), 0.5 * (reachable[i + 1] - x[i]) / h[i])
        x[i + 1] = max(0.0, x[i] + 2.0 * h[i] * u)
    return np.minimum(x, reachable)


def sample_profile(path: SmoothPath, x: np.ndarray, period: float) -> np.ndarray:
    """Path parameters at times 0, period, 2 period ... of a motion with squared speeds x.

    Args:
        path: the path, with M intervals.
        x: (ds/dt)^2 at the ends of the intervals, (M + 1,); zero at no two neighbours.
        period: time between samples (s).

    Returns:
        Path parameters (T,); the last is the path's end, reached within the last period.
    """
    h = np.diff(path.s)
    speed = np.sqrt(x)
    t = np.concatenate([[0.0], np.cumsum(2.0 * h / (speed[:-1] + speed[1:]))])
    times = np.arange(int(np.ceil(t[-1] / period - 1e-9)) + 1) * period
    i = np.clip(np.searchsorted(t, times, side="right") - 1, 0, len(h) - 1)
    d = np.minimum(times, t[-1]) - t[i]
    u = 0.5 * (x[i + 1] - x[i]) / h[i]
    return np.clip(path.s[i] + d * (speed[i] + 0.5 * d * u), 0.0, path.s[-1])
