"""Motions of a hand through keyframes: in times of one's own or in the least time.

    motion = time_keyframes(tree, 0, q_start, keyframes)

A motion holds the pose of the hand, its opening and, if an arm is to carry it, the joint positions
as functions of time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.polynomial import Polynomial
from pydrake.trajectories import (
    CompositeTrajectory,
    PathParameterizedTrajectory,
    PiecewisePolynomial,
    Trajectory,
)
from scipy.interpolate import CubicSpline, PPoly

from prehensile.kinematics.joint_limits import JointLimits
from prehensile.kinematics.keyframes import Keyframe, check_keyframes
from prehensile.kinematics.timing import Law, law_polynomial, least_duration
from prehensile.kinematics.tracing import TracedPath, TracingConfig, checked_positions, trace_path
from prehensile.kinematics.trajectories import (
    Blend,
    PoseTrajectory,
    blended_trajectory,
    law_progress,
)
from prehensile.kinematics.tree import PlantTree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TimingConfig:
    """How keyframes are timed.

    Attributes:
        law: of a leg that starts and ends at rest.
        blend: shape of the rounded corners.
        speed: factor on the velocity limits, in (0, 1].
        acceleration: factor on the acceleration limits, in (0, 1].
        tracing: tolerances of the joint path.
    """

    law: Law = "quintic"
    blend: Blend = "quintic"
    speed: float = 1.0
    acceleration: float = 1.0
    tracing: TracingConfig = field(default_factory=TracingConfig)

    def __post_init__(self) -> None:
        law_polynomial(self.law)
        for name in ("speed", "acceleration"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be in (0, 1], got {getattr(self, name)}")


@dataclass(frozen=True)
class KeyframeMotion:
    """A motion through keyframes.

    Attributes:
        status: ``found``, or why not, as in :class:`~prehensile.kinematics.tracing.TracedPath`.
        names: of the keyframes.
        times: (K,) when each is reached (passed nearest, if blended).
        poses: pose of the hand over time; None unless found.
        widths: opening of the hand over time, (1, 1); None unless found or without any width.
        joints: joint positions over time, (n, 1), with derivatives; None without an arm.
        q_end: (n,) joint positions at the end, empty without an arm.
        limited_by: for each stretch between two stops which limit of which joint sets its time.
        reason: why it failed, in words, with the keyframes between which it did.
    """

    status: str
    names: tuple[str, ...]
    times: Array
    poses: PoseTrajectory | None = None
    widths: PiecewisePolynomial | None = None
    joints: Trajectory | None = None
    q_end: Array = field(default_factory=lambda: np.empty(0))
    limited_by: tuple[str, ...] = ()
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether there is a motion."""
        return self.status == "found"

    @property
    def arrivals(self) -> dict[str, float]:
        """When each keyframe is reached, by name, in s."""
        return dict(zip(self.names, map(float, self.times), strict=False))

    @property
    def duration(self) -> float:
        """How long it lasts, in s, the last dwell included."""
        return self.poses.end_time if self.poses is not None else 0.0


def keyframe_motion(
    keyframes: Sequence[Keyframe],
    durations: ArrayLike,
    *,
    law: Law = "quintic",
    blend: Blend = "quintic",
) -> KeyframeMotion:
    """Motion of the hand through keyframes in given times.

    Args:
        keyframes: K of them.
        durations: (K - 1,) time of each leg, in s; dwells come on top, and at the ends of a blended
            stretch half of its first and last leg's.
        law: of legs that start and end at rest.
        blend: shape of the rounded corners.

    Raises:
        ValueError: fewer than two keyframes, one that is out of range, or wrong durations.
    """
    check_keyframes(keyframes)
    durations = np.asarray(durations, float)
    if durations.shape != (len(keyframes) - 1,) or not (
        np.all(durations > 0.0) and np.isfinite(durations).all()
    ):
        raise ValueError(f"durations must be {len(keyframes) - 1} positive numbers")
    build = _Builder(keyframes)
    for first, last in _stretches(keyframes):
        build.stretch(_stretch(keyframes, first, last, durations[first:last], law, blend), 1.0)
    return build.motion()


def time_keyframes(
    tree: PlantTree,
    frame: int,
    q_start: ArrayLike,
    keyframes: Sequence[Keyframe],
    *,
    q_nominal: ArrayLike | None = None,
    limits: JointLimits | None = None,
    config: TimingConfig | None = None,
) -> KeyframeMotion:
    """Motion of an arm's hand through keyframes, each stretch in the least time of its law.

    The joint path of each leg is traced (:func:`~prehensile.kinematics.tracing.trace_path`), and
    its time follows from the joint limits, which hold at every instant
    (:func:`~prehensile.kinematics.timing.least_duration`). In a blended stretch the legs keep the
    proportions of their times one by one.

    Args:
        tree: the arm.
        frame: number of the hand's frame G in the tree.
        q_start: (n,) where the arm is, with the hand at the first keyframe.
        keyframes: K of them.
        q_nominal: (n,) what a redundant arm stays near to; default ``q_start``.
        limits: of velocity and acceleration; default the tree's
            (:meth:`~prehensile.kinematics.joint_limits.JointLimits.of_tree`).
        config: law and factors.

    Returns:
        The motion, or why there is none and between which keyframes.

    Raises:
        ValueError: fewer than two keyframes or one that is out of range; another number of joints,
            or a joint with neither limit.
    """
    config = config or TimingConfig()
    check_keyframes(keyframes)
    n = len(tree.joints)
    limits = JointLimits.of_tree(tree) if limits is None else limits
    if limits.velocity.shape != (n,):
        raise ValueError(f"limits: expected those of {n} joints")
    v_max, a_max = config.speed * limits.velocity, config.acceleration * limits.acceleration
    for name, unlimited in zip(tree.joints, np.isinf(np.minimum(v_max, a_max)), strict=True):
        if unlimited:  # it would be there in no time
            raise ValueError(f"limits: joint {name} has none")
    q_start = checked_positions(tree, q_start, "q_start")
    q_nominal = q_start if q_nominal is None else checked_positions(tree, q_nominal, "q_nominal")

    def trace(poses: PoseTrajectory, q: Array, at_rest: bool) -> TracedPath:
        return trace_path(
            tree, frame, poses.value, poses.start_time, poses.end_time, q,
            q_nominal=q_nominal, at_rest=at_rest, config=config.tracing,
        )  # fmt: skip

    build = _Builder(keyframes)
    q = q_start
    for first, last in _stretches(keyframes):
        legs = []
        q_leg = q
        for i in range(first, last):
            X_WA, X_WB = keyframes[i].X_WG, keyframes[i + 1].X_WG
            line = PoseTrajectory([X_WA, X_WB], [law_progress(0.0, 1.0, "linear")])
            traced = trace(line, q_leg, False)
            if traced.path is None:
                names = f"from {keyframes[i].name} to {keyframes[i + 1].name}, "
                at = f"after {100 * traced.at:.0f} % of the way"
                return build.failed(traced.status, f"{names}{at}: {traced.reason}")
            legs.append((traced.path, least_duration(traced.path, v_max, a_max, config.law)))
            q_leg = traced.path(1.0)
        if last == first + 1:
            path, least = legs[0]
            law: Law = config.law
            poses = _stretch(keyframes, first, last, [1.0], law, config.blend)
        else:
            # Legs so short that their time is next to nothing still need some.
            longest = max(duration.duration for _, duration in legs)
            nominal = [max(d.duration, 1e-3 * longest, 1e-6) for _, d in legs]
            poses = _stretch(keyframes, first, last, nominal, config.law, config.blend)
            traced = trace(poses, q, True)
            if traced.path is None:
                names = f"from {keyframes[first].name} to {keyframes[last].name}, "
                at = f"after {100 * traced.at / poses.end_time:.0f} % of the time"
                return build.failed(traced.status, f"{names}{at}: {traced.reason}")
            path, law = traced.path, "linear"
            least = least_duration(path, v_max, a_max, law)
        limit = f"{least.limit} of {tree.joints[least.joint]}" if least.joint >= 0 else ""
        build.stretch(poses, least.duration / poses.end_time, path, law, limit)
        q = path(path.x[-1])
    return build.motion()


def _stretches(keyframes: Sequence[Keyframe]) -> list[tuple[int, int]]:
    """First and last keyframe of each stretch between two stops."""
    stops = [i for i, k in enumerate(keyframes) if k.blend == 0.0]
    return list(pairwise(stops))


def _stretch(
    keyframes: Sequence[Keyframe],
    first: int,
    last: int,
    durations: ArrayLike,
    law: Law,
    blend: Blend,
) -> PoseTrajectory:
    """The poses of one stretch, from time 0 on."""
    poses = [k.X_WG for k in keyframes[first : last + 1]]
    if last == first + 1:
        (duration,) = np.asarray(durations, float)
        return PoseTrajectory(poses, [law_progress(0.0, float(duration), law)])
    distances = [k.blend for k in keyframes[first : last + 1]]
    return blended_trajectory(durations, poses, distances, blend)


class _Builder:
    """Puts stretches and dwells one after the other."""

    def __init__(self, keyframes: Sequence[Keyframe]) -> None:
        self._keyframes = keyframes
        self._progress: list[PPoly] = []
        self._times = [0.0]
        self._joints: list[Trajectory] = []
        self._limits: list[str] = []
        self._q = np.empty(0)
        self._t = keyframes[0].dwell

    def stretch(
        self,
        poses: PoseTrajectory,
        factor: float,
        path: CubicSpline | None = None,
        law: Law = "linear",
        limit: str = "",
    ) -> None:
        """Adds a stretch with its times multiplied by a factor, and the dwell that follows."""
        start, end = self._t, self._t + factor * poses.end_time
        reached = [0.5 * (a.x[-1] + b.x[0]) for a, b in pairwise(poses.progress)] + [poses.end_time]
        self._times += [start + factor * float(t) for t in reached]
        dwell = self._keyframes[len(self._times) - 1].dwell
        self._t = end + dwell
        if factor > 0.0:
            self._progress += [_stretched(beta, factor, start) for beta in poses.progress]
        else:  # nothing moves
            self._progress += [PPoly([[0.0]], [start, start]) for _ in poses.progress]
        if path is None:
            return
        self._limits.append(limit)
        q_first, self._q = path(path.x[0]), path(path.x[-1])
        if not self._joints and start > 0.0:
            self._joints.append(_held(q_first, 0.0, start))
        if end > start:
            self._joints.append(_timed(path, law, start, end))
        if dwell > 0.0:
            self._joints.append(_held(self._q, end, self._t))

    def motion(self) -> KeyframeMotion:
        """The whole."""
        return KeyframeMotion(
            "found",
            tuple(k.name for k in self._keyframes),
            np.array(self._times),
            PoseTrajectory([k.X_WG for k in self._keyframes], self._progress, self._t),
            self._widths(),
            self._joint_positions(),
            self._q,
            tuple(self._limits),
        )

    def _joint_positions(self) -> Trajectory | None:
        if self._joints:
            return CompositeTrajectory(self._joints)
        # Of an arm that has no way to go, the place.
        return PiecewisePolynomial(self._q[:, None]) if len(self._q) else None

    def failed(self, status: str, reason: str) -> KeyframeMotion:
        """No motion."""
        names = tuple(k.name for k in self._keyframes)
        return KeyframeMotion(status, names, np.array(self._times), reason=reason)

    def _widths(self) -> PiecewisePolynomial | None:
        """First-order hold through the widths: each is reached at the end of its dwell."""
        given = [k.width for k in self._keyframes if k.width is not None]
        if not given:
            return None
        knots, width = [(0.0, given[0])], given[0]
        for k, t in zip(self._keyframes, self._times, strict=True):
            if k.dwell > 0.0 or k.width is None:
                knots.append((t, width))
            width = width if k.width is None else k.width
            knots.append((t + k.dwell, width))
        knots.append((self._t, width))
        times, values = zip(
            *(b for a, b in pairwise([(-1.0, 0.0), *knots]) if b[0] > a[0]), strict=True
        )
        if len(times) == 1:
            return PiecewisePolynomial(np.array([[values[0]]]))
        return PiecewisePolynomial.FirstOrderHold(times, np.array([values]))


def _stretched(beta: PPoly, factor: float, start: float) -> PPoly:
    """A progress with its time multiplied by a factor and moved."""
    degree = np.arange(beta.c.shape[0])[::-1, None]
    return PPoly(beta.c / factor**degree, start + factor * beta.x)


def _timed(path: CubicSpline, law: Law, start: float, end: float) -> Trajectory:
    """The joint path run through from one time to another, as Drake has it."""
    q = PiecewisePolynomial.CubicHermite(path.x, path(path.x).T, path(path.x, 1).T)
    duration, first, length = end - start, path.x[0], path.x[-1] - path.x[0]
    # PiecewisePolynomial counts time from the start of a segment.
    powers = [length * c / duration**k for k, c in enumerate(law_polynomial(law).coef)]
    powers[0] += first
    scaling = PiecewisePolynomial([np.array([[Polynomial(np.array(powers))]])], [start, end])
    return PathParameterizedTrajectory(q, scaling)


def _held(q: Array, start: float, end: float) -> Trajectory:
    return PiecewisePolynomial.ZeroOrderHold([start, end], np.column_stack([q, q]))
