"""Trajectories of poses: straight lines and slerp from pose to pose, timed and blended.

A trajectory through poses X_0 ... X_L is made of legs. Leg i adds the displacement d_i = p_i -
p_(i-1) to the position and multiplies the rotation by exp(phi_i), phi_i = log(R_(i-1)^T R_i), as
its progress beta_i(t) runs from 0 to 1:

    p(t) = p_0 + sum_i beta_i d_i,    R(t) = R_0 exp(beta_1 phi_1) exp(beta_2 phi_2) ...

One leg after the other, that is a straight line with slerp. Where the progress of two legs
overlaps, the corner between them is rounded, in position and rotation alike (cumulative curves:
Kim, Kim, Shin, SIGGRAPH 1995). Derivatives are exact for any progress.

Drake's ``PiecewisePose`` is the special case of a linear progress without overlap (or cubic
positions). A ``PathParameterizedTrajectory`` around it would give it any timing law, but returns
a 4x4 matrix with unset entries when it is differentiated (Drake 1.51).
"""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.trajectories import FunctionHandleTrajectory, Trajectory
from scipy.interpolate import PPoly

from prehensile.kinematics.rotations import exp_so3, log_so3
from prehensile.kinematics.timing import Law, law_polynomial

Array = NDArray[np.float64]

Blend = Literal["parabolic", "quintic"]
"""How the speed of a leg rises and falls: at constant acceleration, or without a jump in it."""

# Deviation from a rounded corner, per window width and change of velocity: the integral of the
# ramp over its first half.
_DEVIATION: dict[Blend, float] = {"parabolic": 1.0 / 8.0, "quintic": 3.0 / 32.0}


class PoseState(NamedTuple):
    """Pose of frame B in W at an instant, its spatial velocity and acceleration.

    Attributes:
        X_WB: the pose.
        V_WB: (6,) measured and expressed in W, rotational first, of B's origin.
        A_WB: (6,) likewise.
    """

    X_WB: RigidTransform
    V_WB: Array
    A_WB: Array


class PoseTrajectory:
    """The pose of a frame B in W over time, held before the start and after the end.

    Made by :func:`pose_trajectory`, :func:`blended_trajectory` or
    :func:`~prehensile.kinematics.keyframe_timing.time_keyframes`.

    Attributes:
        poses: X_0 ... X_L.
        start_time, end_time: in s.
    """

    def __init__(
        self,
        poses: Sequence[RigidTransform],
        progress: Sequence[PPoly],
        end_time: float | None = None,
    ) -> None:
        """Makes the trajectory of poses and legs.

        Args:
            poses: X_0 ... X_L, at least one.
            progress: beta_i(t) of the L legs, scalar, from 0 to 1 on its own interval, constant
                before and after.
            end_time: default: when the last leg ends (0 if there is none).
        """
        if not poses:
            raise ValueError("poses: at least one is needed")
        if len(poses) != len(progress) + 1:
            raise ValueError(f"progress must have {len(poses) - 1} entries, got {len(progress)}")
        self.poses = tuple(poses)
        self.progress = tuple(progress)
        # As plain numbers: a call of PPoly takes longer than everything else in state().
        self._pieces = [(b.x.tolist(), b.c.T.tolist()) for b in progress]
        self._spans = [(float(b.x[0]), float(b.x[-1])) for b in progress]
        self._p = np.array([X.translation() for X in poses])
        self._R = [X.rotation().matrix() for X in poses]
        self._d = np.diff(self._p, axis=0)
        self._phi = [log_so3(A.T @ B) for A, B in pairwise(self._R)]
        self.start_time = min((a for a, _ in self._spans), default=0.0)
        last = max((b for _, b in self._spans), default=0.0)
        self.end_time = last if end_time is None else float(end_time)

    def state(self, t: float) -> PoseState:
        """Pose, velocity and acceleration at a time."""
        legs = range(len(self._spans))
        # Legs before the first that is not over have been gone through.
        first = next((i for i in legs if t < self._spans[i][1]), len(self._spans))
        p, R = self._p[first].copy(), self._R[first]
        V, A = np.zeros(6), np.zeros(6)
        for i in legs[first:]:
            start, end = self._spans[i]
            if t <= start:
                break
            if t < end:
                beta, beta_1, beta_2 = _evaluate(*self._pieces[i], t)
            else:
                beta, beta_1, beta_2 = 1.0, 0.0, 0.0
            p += beta * self._d[i]
            V[3:] += beta_1 * self._d[i]
            A[3:] += beta_2 * self._d[i]
            axis = R @ self._phi[i]
            A[:3] += beta_2 * axis + beta_1 * _cross(V[:3], axis)
            V[:3] += beta_1 * axis
            R = R @ exp_so3(beta * self._phi[i])
        return PoseState(RigidTransform(RotationMatrix(R), p), V, A)

    def value(self, t: float) -> RigidTransform:
        """X_WB at a time."""
        return self.state(t).X_WB

    def velocity(self, t: float) -> Array:
        """V_WB at a time, (6,), measured and expressed in W, rotational first."""
        return self.state(t).V_WB

    def acceleration(self, t: float) -> Array:
        """A_WB at a time, (6,), measured and expressed in W, rotational first."""
        return self.state(t).A_WB

    def drake_velocity(self) -> Trajectory:
        """V_WB over time for Drake, (6, 1), with its derivative; such as for a TrajectorySource.

        It calls back into Python at every evaluation.
        """

        def derivative(t: float, order: int) -> Array:
            if order > 1:
                raise ValueError("derivative_order: there is no second derivative")
            return self.acceleration(t) if order == 1 else self.velocity(t)

        trajectory = FunctionHandleTrajectory(
            lambda t: self.velocity(t)[:, None], 6, 1, self.start_time, self.end_time
        )
        trajectory.set_derivative(lambda t, order: derivative(t, order)[:, None])
        return trajectory

    def drake_pose(self) -> Trajectory:
        """X_WB over time for Drake, as a 4x4 matrix; it calls back into Python."""
        return FunctionHandleTrajectory(
            lambda t: self.value(t).GetAsMatrix4(), 4, 4, self.start_time, self.end_time
        )


def pose_trajectory(
    times: ArrayLike, poses: Sequence[RigidTransform], law: Law = "quintic"
) -> PoseTrajectory:
    """From pose to pose on straight lines with slerp, each leg by the same timing law.

    With ``cubic`` and ``quintic`` the frame comes to rest at every pose; ``linear`` is the
    first-order hold.

    Args:
        times: (K,) when each pose is reached, increasing, in s.
        poses: K poses X_WB.
        law: of each leg.

    Raises:
        ValueError: times of another number, not increasing or not finite; no such law.
    """
    times = np.asarray(times, float)
    if times.shape != (len(poses),):
        raise ValueError(f"times must be ({len(poses)},), got {times.shape}")
    if not (np.all(np.isfinite(times)) and np.all(np.diff(times) > 0.0)):
        raise ValueError("times must increase and be finite")
    law_polynomial(law)  # there is such a law, even where there is no leg
    progress = [law_progress(a, b, law) for a, b in pairwise(times)]
    return PoseTrajectory(poses, progress)


def law_progress(start: float, end: float, law: Law) -> PPoly:
    """The progress of a leg by a timing law between two times, start < end.

    Raises:
        ValueError: no time between them, or no such law.
    """
    duration = end - start
    if not 0.0 < duration < np.inf:
        raise ValueError(f"start, end: must be finite and increase, got {start}, {end}")
    powers = [c / duration**k for k, c in enumerate(law_polynomial(law).coef)]
    return PPoly(np.array(powers[::-1])[:, None], [start, end])


def blended_trajectory(
    durations: ArrayLike,
    poses: Sequence[RigidTransform],
    distances: ArrayLike,
    blend: Blend = "quintic",
    start_time: float = 0.0,
) -> PoseTrajectory:
    """Past the poses on straight lines with rounded corners, at rest only at both ends.

    Each leg is passed at constant speed; at every pose the speed of one leg falls while that of
    the next rises. The trajectory lasts longer than the sum of the durations by half of the first
    and half of the last ramp.

    Args:
        durations: (K - 1,) time that each leg would take at its constant speed, in s, > 0.
        poses: K poses X_WB, K >= 2.
        distances: (K,) how far from each pose the frame's origin may pass, in m, >= 0. The ramps
            of two corners never overlap, so that it may be less; the rotation is rounded along
            with it. The first and the last are ignored: the trajectory starts and ends there, and
            its speed rises over the whole first leg and falls over the whole last one.
        blend: the shape of the ramps.
        start_time: in s.

    Raises:
        ValueError: fewer than two poses, another number of durations or distances, or out of range.
    """
    T, r = np.asarray(durations, float), np.asarray(distances, float)
    if len(poses) < 2:
        raise ValueError(f"poses: at least two are needed, got {len(poses)}")
    if T.shape != (len(poses) - 1,) or not np.all((T > 0.0) & np.isfinite(T)):
        raise ValueError(f"durations must be {len(poses) - 1} positive numbers, got {T}")
    if not np.isfinite(start_time):
        raise ValueError(f"start_time must be finite, got {start_time}")
    if r.shape != (len(poses),) or not np.all(r >= 0.0):
        raise ValueError(f"distances must be {len(poses)} numbers >= 0, got {r}")
    if blend not in get_args(Blend):
        raise ValueError(f"blend must be one of {', '.join(get_args(Blend))}, got {blend!r}")
    p = np.array([X.translation() for X in poses])
    v = np.diff(p, axis=0) / T[:, None]
    windows = np.empty(len(poses))
    windows[0], windows[-1] = T[0], T[-1]
    for j in range(1, len(poses) - 1):
        turn = _DEVIATION[blend] * float(np.linalg.norm(v[j] - v[j - 1]))
        room = min(T[j - 1], T[j])
        windows[j] = room if turn * room <= r[j] else r[j] / turn
    nominal = start_time + 0.5 * windows[0] + np.concatenate([[0.0], np.cumsum(T)])
    progress = [
        _ramp_progress(nominal[i], nominal[i + 1], windows[i], windows[i + 1], blend)
        for i in range(len(T))
    ]
    return PoseTrajectory(poses, progress)


def _ramp_progress(start: float, end: float, rise: float, fall: float, blend: Blend) -> PPoly:
    """Progress that rises about ``start``, runs at 1 / (end - start), falls about ``end``."""
    T = end - start
    breaks = [start - 0.5 * rise, start + 0.5 * rise, end - 0.5 * fall, end + 0.5 * fall]
    # Coefficients of (t - break)^k, k = 0..4; a ramp without width is left out below.
    c = np.zeros((5, 3))
    c[:2, 1] = 0.5 * rise / T, 1.0 / T
    c[:2, 2] = 1.0 - 0.5 * fall / T, 1.0 / T
    for ramp, width in ((0, rise), (2, fall)):
        if width > 0.0 and blend == "parabolic":
            c[2, ramp] = 0.5 / (width * T)
        elif width > 0.0:  # speed 3 u^2 - 2 u^3 of u = (t - break) / width
            c[3:, ramp] = 1.0 / (width**2 * T), -0.5 / (width**3 * T)
    c[2:, 2] *= -1.0
    keep = np.diff(breaks) > 1e-12 * T
    knots = [b for b, k in zip(breaks, keep, strict=False) if k] + [breaks[-1]]
    return PPoly(c[::-1, keep], knots)


def _evaluate(
    breaks: list[float], coefficients: list[list[float]], t: float
) -> tuple[float, float, float]:
    """A piecewise polynomial and its first two derivatives (Horner's scheme)."""
    piece = min(max(bisect_right(breaks, t) - 1, 0), len(coefficients) - 1)
    x = t - breaks[piece]
    value = slope = bend = 0.0
    for c in coefficients[piece]:
        bend = bend * x + 2.0 * slope
        slope = slope * x + value
        value = value * x + c
    return value, slope, bend


def _cross(a: Array, b: Array) -> Array:
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )
