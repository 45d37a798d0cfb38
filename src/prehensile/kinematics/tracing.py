"""Joint paths that carry a frame along a path of poses, by inverse kinematics from pose to pose.

A redundant arm has many. Here it is the one that stays nearest to a nominal configuration at each
pose, and shy of the joint limits: q(s) minimizes

    1/2 |q - q_nominal|^2 + sum_i 15 m_i^2 u_i^4  such that the frame is at X(s),

u_i being how deep joint i is in a margin m_i before its limit, 0 to 1. Without the second term a
joint would stop dead at its limit, and no time law could follow that quickly. Unlike the integral
of a pseudo-inverse q(s) depends on the pose alone (as long as it is followed without a jump), so
that a closed path of the frame is a closed path of the joints, and nothing drifts over repetitions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform
from scipy.interpolate import CubicSpline

from prehensile.kinematics.poses import pose_distance
from prehensile.kinematics.rotations import log_so3
from prehensile.kinematics.tree import PlantTree

Array = NDArray[np.float64]

_POSE_ERROR = 1e-10  # m and rad, at which a pose counts as solved
_POSTURE_STEP = 1e-9  # rad, at which the nearest configuration counts as found
_SINGULAR = 0.02  # singular value of the Jacobian below which steps are damped
_LARGEST_STEP = 0.4  # rad or m, of one joint in one iteration
_LIMIT_GAP = 1e-3  # rad or m that traced positions keep from the limits, if they can
_SHY_MARGIN, _SHY_FRACTION = 0.3, 0.15  # m_i: rad or m, and at most this part of the range
_SHY_WEIGHT = 15.0


@dataclass(frozen=True)
class TracingConfig:
    """How a path of poses is traced.

    Attributes:
        tolerance: largest deviation of the frame from its path half-way between two solved poses,
            where it is about the largest, in m and in rad, in (0, 0.01].
        translation: first distance between two solved poses, in m, in (0, 0.2].
        rotation: first angle between two solved poses, in rad, in (0, 0.5].
        max_joint_step: largest change of a joint between two solved poses, in rad or m, in (0, 1].
        max_refinements: how often the number of solved poses may double, 1 to 8.
    """

    tolerance: float = 1e-4
    translation: float = 0.04
    rotation: float = 0.15
    max_joint_step: float = 0.3
    max_refinements: int = 4

    def __post_init__(self) -> None:
        for name, largest in (
            ("tolerance", 0.01),
            ("translation", 0.2),
            ("rotation", 0.5),
            ("max_joint_step", 1.0),
        ):
            value = getattr(self, name)
            if not 0.0 < value <= largest:
                raise ValueError(f"{name} must be in (0, {largest:g}], got {value}")
        if not 1 <= self.max_refinements <= 8:
            raise ValueError(f"max_refinements must be 1 to 8, got {self.max_refinements}")


@dataclass(frozen=True)
class TracedPath:
    """A joint path q(s) along a path of poses.

    Attributes:
        status: ``found``, or why not: the start configuration is not at the start pose; a pose
            is out of reach (``unreachable``) or only within reach beyond joint limits
            (``limits``); joints would have to jump (``jump``).
        path: the joint path, twice continuously differentiable, (n,) at each s; None unless found.
        reason: why it failed, in words.
        at: path parameter at which it failed.
    """

    status: Literal["found", "start", "unreachable", "limits", "jump"]
    path: CubicSpline | None = None
    reason: str = ""
    at: float = 0.0

    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return self.status == "found"


def trace_path(
    tree: PlantTree,
    frame: int,
    pose: Callable[[float], RigidTransform],
    s_start: float,
    s_end: float,
    q_start: ArrayLike,
    *,
    q_nominal: ArrayLike | None = None,
    at_rest: bool = False,
    config: TracingConfig | None = None,
) -> TracedPath:
    """Finds the joint path along a path of poses.

    Poses evenly along the path are solved, each from the one before, and a cubic spline goes
    through the solutions; their number doubles until the frame stays within the tolerance
    half-way between them and no joint makes too large a step.

    Args:
        tree: the arm.
        frame: number of the frame in the tree.
        pose: X_WF(s), continuous.
        s_start, s_end: where the path begins and ends, s_start < s_end.
        q_start: (n,) at the first pose, and not far from ``q_nominal``.
        q_nominal: (n,) what a redundant arm stays near to; default ``q_start``.
        at_rest: whether q'(s) is to be zero at both ends, as it is where s is a time at which the
            frame rests.
        config: tolerances.

    Raises:
        ValueError: s_start and s_end do not increase; q_start or q_nominal of another shape or not
            finite; no such frame.
    """
    config = config or TracingConfig()
    if not 0.0 < s_end - s_start < np.inf:
        raise ValueError(f"s_start, s_end: must be finite and increase, got {s_start}, {s_end}")
    q_start = checked_positions(tree, q_start, "q_start")
    posture = posture_near(tree, q_start if q_nominal is None else q_nominal)
    distance, angle = pose_distance(_pose(tree, frame, q_start), pose(s_start))
    if distance > config.tolerance or angle > config.tolerance:
        off = f"{1e3 * distance:.2f} mm and {angle:.4f} rad"
        return TracedPath("start", None, f"the start is {off} from the path", s_start)
    knots, refinements = _first_knots(pose, s_start, s_end, config), 0
    while True:
        Q = np.empty((len(knots), len(q_start)))
        q = q_start
        for k, s in enumerate(knots):
            q, error = nearest_configuration(tree, frame, pose(s), q, posture)
            if error > 1e3 * _POSE_ERROR:
                return _unsolved(tree, q, posture, s, error)
            Q[k] = q
        if np.abs(Q[0] - q_start).max() > 0.1 * config.max_joint_step:
            return TracedPath("start", None, "q_start is not the one nearest to q_nominal", s_start)
        spline = CubicSpline(knots, Q, bc_type="clamped" if at_rest else "not-a-knot")
        fault = _check(tree, frame, pose, spline, config)
        if fault is None:
            return TracedPath("found", spline)
        if refinements == config.max_refinements:
            return fault
        knots = np.linspace(s_start, s_end, 2 * len(knots) - 1)
        refinements += 1


@dataclass(frozen=True)
class Posture:
    """What a redundant arm stays near to, and the limits that it stays within.

    Attributes:
        nominal: (n,) configuration.
        lower, upper: (n,) limits.
        margin: (n,) m_i, where it begins to shy away from a limit; 0 for not at all.
    """

    nominal: Array
    lower: Array
    upper: Array
    margin: Array

    def gradient(self, q: Array) -> tuple[Array, Array]:
        """First derivatives and diagonal second derivatives of what is minimized, (n,) each."""
        m = np.maximum(self.margin, 1e-9)
        low = np.clip((self.lower + m - q) / m, 0.0, 1.0)
        high = np.clip((q - self.upper + m) / m, 0.0, 1.0)
        slope = 4.0 * _SHY_WEIGHT * self.margin * (high**3 - low**3)
        return q - self.nominal + slope, 1.0 + 12.0 * _SHY_WEIGHT * (high**2 + low**2)


def checked_positions(tree: PlantTree, q: ArrayLike, name: str) -> Array:
    """Positions of a tree's joints, (n,), checked.

    Raises:
        ValueError: of another shape or not finite; the message begins with the name.
    """
    q = np.asarray(q, float)
    if q.shape != (len(tree.joints),) or not np.isfinite(q).all():
        raise ValueError(f"{name} must be {len(tree.joints)} finite numbers, got {q}")
    return q


def posture_near(tree: PlantTree, q_nominal: ArrayLike) -> Posture:
    """The posture of a nominal configuration within the limits of a tree.

    The margins are such that the nominal configuration is outside of them.
    """
    q = checked_positions(tree, q_nominal, "q_nominal")
    # A spline through solutions may pass a little beyond them.
    lower = np.minimum(tree.lower + _LIMIT_GAP, q)
    upper = np.maximum(tree.upper - _LIMIT_GAP, q)
    room = np.minimum(q - lower, upper - q)
    margin = np.minimum(np.minimum(_SHY_MARGIN, _SHY_FRACTION * (upper - lower)), room)
    return Posture(q, lower, upper, margin)


def nearest_configuration(
    tree: PlantTree,
    frame: int,
    X_WF: RigidTransform,
    q_guess: ArrayLike,
    posture: Posture,
    max_iterations: int = 100,
) -> tuple[Array, float]:
    """The configuration of best posture with a frame at a pose, found from a guess.

    Newton's method on the pose and, in the null space of the Jacobian, on the posture; damped near
    singularities (Nakamura and Hanafusa 1986). Joints that a step would take beyond their limits
    are held there and the step is found anew without them.

    Args:
        tree: the arm.
        frame: number of the frame in the tree.
        X_WF: where the frame is to be.
        q_guess: (n,) where to start.
        posture: which of the solutions.
        max_iterations: when to give up.

    Returns:
        The configuration (n,), within the limits, and the error of its pose, the larger of m and
        rad.
    """
    q = np.clip(np.asarray(q_guess, float), posture.lower, posture.upper)
    R_goal, p_goal = X_WF.rotation().matrix(), X_WF.translation()
    error = np.empty(6)
    size = np.inf
    for _ in range(max_iterations):
        X = tree.tree.pose(q, frame)
        error[:3] = log_so3(R_goal @ X[:3, :3].T)
        error[3:] = p_goal - X[:3, 3]
        size = float(np.abs(error).max())
        step = _step(tree.tree.jacobian(q, frame), error, q, posture)
        if size < _POSE_ERROR and float(np.abs(step).max()) < _POSTURE_STEP:
            break
        q = np.clip(q + step, posture.lower, posture.upper)
    return q, size


def _step(J: Array, error: Array, q: Array, posture: Posture) -> Array:
    """One step: J step = error, and otherwise down the gradient of the posture."""
    gradient, curvature = posture.gradient(q)
    # In joint units in which the curvature is one.
    scale = 1.0 / np.sqrt(curvature)
    J_scaled, downhill = J * scale, -gradient * scale
    step = np.zeros(len(q))
    free = np.ones(len(q), dtype=bool)
    while free.any():
        U, S, Vt = np.linalg.svd(J_scaled[:, free], full_matrices=False)
        damping = max(0.0, 1.0 - (S[-1] / _SINGULAR) ** 2) * _SINGULAR**2
        rows = S > 1e-9
        U, S, Vt = U[:, rows], S[rows], Vt[rows]
        down = downhill[free]
        part = Vt.T @ (S / (S**2 + damping) * (U.T @ error)) + down - Vt.T @ (Vt @ down)
        trial = step.copy()
        trial[free] = scale[free] * part
        beyond = free & ((q + trial < posture.lower) | (q + trial > posture.upper))
        if not beyond.any():
            step = trial
            break
        # These go to their limits; the others take care of what is left of the error.
        step[beyond] = (np.clip(q + trial, posture.lower, posture.upper) - q)[beyond]
        error = error - J[:, beyond] @ step[beyond]
        free &= ~beyond
    return step * min(1.0, _LARGEST_STEP / max(float(np.abs(step).max()), 1e-300))


def _pose(tree: PlantTree, frame: int, q: Array) -> RigidTransform:
    return RigidTransform(tree.tree.pose(q, frame))


def _first_knots(
    pose: Callable[[float], RigidTransform], s_start: float, s_end: float, config: TracingConfig
) -> Array:
    """Evenly spaced parameters, dense enough for the distance and angle that the path covers."""
    samples = [pose(s) for s in np.linspace(s_start, s_end, 33)]
    steps = [pose_distance(A, B) for A, B in pairwise(samples)]
    # The fastest part of the path sets the spacing.
    distance, angle = (32.0 * max(step[k] for step in steps) for k in (0, 1))
    intervals = max(distance / config.translation, angle / config.rotation, 8.0)
    return np.linspace(s_start, s_end, int(np.ceil(intervals)) + 1)


def _check(
    tree: PlantTree,
    frame: int,
    pose: Callable[[float], RigidTransform],
    spline: CubicSpline,
    config: TracingConfig,
) -> TracedPath | None:
    """What is wrong with the joint path between its knots; None if nothing is."""
    knots = spline.x
    steps = np.abs(np.diff(spline(knots), axis=0)).max(axis=1)
    k = int(np.argmax(steps))
    if steps[k] > config.max_joint_step:
        joint = tree.joints[int(np.argmax(np.abs(spline(knots[k + 1]) - spline(knots[k]))))]
        reason = f"joint {joint} would jump by {steps[k]:.2f}"
        return TracedPath("jump", None, reason, float(knots[k]))
    for s in 0.5 * (knots[1:] + knots[:-1]):
        distance, angle = pose_distance(_pose(tree, frame, spline(s)), pose(s))
        if max(distance, angle) > config.tolerance:
            reason = f"the frame would leave its path by {1e3 * distance:.2f} mm, {angle:.4f} rad"
            return TracedPath("jump", None, reason, float(s))
    fine = np.linspace(knots[0], knots[-1], 8 * len(knots))
    Q = spline(fine)
    k, j = np.unravel_index(int(np.argmax(np.maximum(tree.lower - Q, Q - tree.upper))), Q.shape)
    if not tree.lower[j] <= Q[k, j] <= tree.upper[j]:
        reason = f"joint {tree.joints[j]} would pass its limit between two poses"
        return TracedPath("limits", None, reason, float(fine[k]))
    return None


def _unsolved(tree: PlantTree, q: Array, posture: Posture, s: float, error: float) -> TracedPath:
    """The result for a pose that could not be solved."""
    held = (q <= posture.lower) | (q >= posture.upper)
    names = [name for name, out in zip(tree.joints, held, strict=True) if out]
    if names:
        reason = f"from here it needs more of {', '.join(names)} than the limits allow"
        return TracedPath("limits", None, reason, float(s))
    reason = f"the path leaves the workspace ({1e3 * error:.2g} mm or mrad short)"
    return TracedPath("unreachable", None, reason, float(s))
