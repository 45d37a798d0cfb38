"""Timing laws along a path, and the shortest time that joint limits allow.

A timing law s(tau) takes a path from s = 0 to s = 1 while tau = t / T goes from 0 to 1. Joints that
follow q(s) have the velocities q' s' / T and the accelerations (q' s'' + q'' s'^2) / T^2, so that
the least duration T within limits is a maximum over the path, in closed form (Lynch and Park,
*Modern Robotics*, sections 9.2 and 9.4).
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

Law = Literal["linear", "cubic", "quintic"]
"""``linear`` moves at constant speed (first-order hold); ``cubic`` starts and stops at rest;
``quintic`` does so without a jump in acceleration."""

LAWS: dict[Law, Polynomial] = {
    "linear": Polynomial([0.0, 1.0]),
    "cubic": Polynomial([0.0, 0.0, 3.0, -2.0]),
    "quintic": Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0]),
}
"""The laws as polynomials s(tau) on [0, 1]."""

_INTERVALS = 4096


def law_polynomial(law: Law) -> Polynomial:
    """The polynomial of a timing law, s(tau).

    Raises:
        ValueError: no such law.
    """
    if law not in get_args(Law):
        raise ValueError(f"law must be one of {', '.join(get_args(Law))}, got {law!r}")
    return LAWS[law]


@dataclass(frozen=True)
class Duration:
    """The least duration of a path.

    Attributes:
        duration: seconds.
        joint: number of the joint that does not allow less; -1 if nothing moves
            that has a limit.
        limit: which of its limits.
        at: path parameter s, as a fraction of the path, where it is met.
    """

    duration: float
    joint: int = -1
    limit: Literal["none", "velocity", "acceleration"] = "none"
    at: float = 0.0


def least_duration(
    path: PPoly, velocity: ArrayLike, acceleration: ArrayLike, law: Law = "quintic"
) -> Duration:
    """The least time in which joints follow a path with a timing law.

    The limits hold at every instant, not only at samples: what they can change by between two of
    the 4096 samples is added (their derivatives are bounded), which costs some 0.2 % of the time.
    The jumps of velocity with which the linear law starts and stops are not counted.

    Args:
        path: q(s) with continuous second derivative, piecewise cubic, values (n,), on any
            interval; such as a ``scipy.interpolate.CubicSpline``.
        velocity: (n,) largest absolute velocities, > 0, inf for none; or one for all.
        acceleration: (n,) largest absolute accelerations, > 0, inf for none; or one for all.
        law: how s runs over the interval.

    Returns:
        The duration and what sets it.

    Raises:
        ValueError: a limit that is not positive or limits of another number of joints, a path that
            is not finite, or no such law.
    """
    s = law_polynomial(law)
    n = path.c.shape[2:]
    limits = []
    for name, limit in (("velocity", velocity), ("acceleration", acceleration)):
        limit = np.asarray(limit, float)
        if limit.shape not in ((), n) or not np.all(limit > 0.0):
            raise ValueError(f"{name}: expected {n} positive numbers, got {limit}")
        limits.append(limit)
    v_max, a_max = limits
    if not (np.isfinite(path.c).all() and np.isfinite(path.x).all()):
        raise ValueError("path: must be finite")
    start, length = float(path.x[0]), float(path.x[-1] - path.x[0])
    # The derivatives by s on [0, 1].
    first, second, third = (path.derivative(k) for k in (1, 2, 3))
    tau = np.linspace(0.0, 1.0, _INTERVALS + 1)
    h = 1.0 / _INTERVALS
    s1, s2, s3 = (s.deriv(k)(tau)[:, None] for k in (1, 2, 3))
    at = start + length * s(tau)
    q1, q2 = length * first(at), length**2 * second(at)
    # Largest derivatives over the whole path: second ones are linear and third ones constant
    # between knots; first ones are quadratic, at most (knot distance)^2 / 8 q''' beyond their ends.
    q3_max = length**3 * np.abs(third(path.x[:-1])).max(axis=0)
    q2_max = length**2 * np.abs(second(path.x)).max(axis=0)
    gap = float(np.diff(path.x).max()) / length
    q1_max = length * np.abs(first(path.x)).max(axis=0) + gap**2 / 8.0 * q3_max
    s1_max, s2_max, s3_max = (float(np.abs(values).max()) for values in (s1, s2, s3))
    rate = q1 * s1
    bend = q1 * s2 + q2 * s1**2
    bend_slope = q1_max * s3_max + 3.0 * q2_max * s1_max * s2_max + q3_max * s1_max**3
    # Largest values on each interval: at one of its ends, and half an interval's slope more.
    bend_most = np.maximum(np.abs(bend[1:]), np.abs(bend[:-1])) + 0.5 * h * bend_slope
    rate_most = np.maximum(np.abs(rate[1:]), np.abs(rate[:-1])) + 0.5 * h * bend_most
    ratios = np.array([rate_most.max(axis=0) / v_max, np.sqrt(bend_most.max(axis=0) / a_max)])
    which, joint = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    duration = float(ratios[which, joint])
    if duration <= 0.0:
        return Duration(0.0)
    k = int(np.argmax(np.abs(rate if which == 0 else bend)[:, joint]))
    limit = "velocity" if which == 0 else "acceleration"
    # Rounding must not push the fastest joint over its limit.
    return Duration(duration * (1.0 + 1e-12), int(joint), limit, float(s(tau[k])))
