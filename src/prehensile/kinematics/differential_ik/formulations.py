"""The formulations of differential inverse kinematics, each a pure function.

J v = V for joint velocities v (n,), a Jacobian J (k, n) and a desired velocity V (k,): six rows for
the pose of one frame, fewer if parts of it are free, more for several frames
(:func:`stack_tasks`). Where two formulas use P, its rows are an orthonormal basis of the kernel of
J. The numbers of equations are those of R. Tedrake, "Robotic Manipulation", chapter 3.

These functions prepare their solver at every call. Loops call
:func:`~prehensile.kinematics.differential_ik.config.compile_ik` once instead.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.kinematics.differential_ik.config import DifferentialIkConfig, compile_ik
from prehensile.kinematics.differential_ik.constraints import LinearConstraints
from prehensile.kinematics.differential_ik.result import DifferentialIkResult, result_of
from prehensile.kinematics.joint_limits import JointLimits

Array = NDArray[np.float64]


def pseudo_inverse(J: ArrayLike, V: ArrayLike, *, tolerance: float = 1e-9) -> Array:
    """v = J⁺ V, the shortest of the v for which |J v − V| is least (equations 19 and 20).

    Args:
        J: (k, n).
        V: (k,).
        tolerance: singular values below this share of the greatest count as zero.

    Returns:
        (n,) joint velocities; without regard to any limit.
    """
    J, V = _task(J, V)
    return np.linalg.pinv(J, rcond=tolerance) @ V


def damped(J: ArrayLike, V: ArrayLike, *, damping: float, threshold: float | None = None) -> Array:
    """v = J^T (J J^T + λ² I)⁻¹ V, which minimizes |J v − V|² + λ² |v|².

    With a threshold, the damping begins where the smallest singular value σ falls below it:
    λ² = (1 − (σ / threshold)²) damping². Y. Nakamura and H. Hanafusa, "Inverse kinematic solutions
    with singularity robustness for robot manipulator control", 1986; S. Chiaverini, B. Siciliano,
    O. Egeland, "Review of the damped least-squares inverse kinematics", 1994.

    Args:
        J: (k, n).
        V: (k,).
        damping: λ (>= 0), or its greatest value if there is a threshold.
        threshold: singular value below which to damp (> 0).

    Returns:
        (n,) joint velocities; without regard to any limit.
    """
    J, V = _task(J, V)
    if not 0 <= damping < np.inf:
        raise ValueError("damping: expected >= 0 and finite")
    U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
    squared = damping**2
    if threshold is not None:
        if not threshold > 0:
            raise ValueError("threshold: expected > 0")
        squared *= max(0.0, 1.0 - (sigma[-1] / threshold) ** 2)
    denominator = sigma**2 + squared
    factor = np.divide(sigma, denominator, out=np.zeros_like(sigma), where=denominator > 0)
    return Vt.T @ (factor * (U.T @ V))


def velocity_limited(
    J: ArrayLike, V: ArrayLike, v_max: ArrayLike, *, constraints: LinearConstraints | None = None
) -> DifferentialIkResult:
    """min |J v − V|² subject to |v| ≤ v_max (equation 21).

    Where several v do, the shortest (by a regularization of 1e-12 |v|² times the square of J's
    longest row).

    Args:
        J: (k, n).
        V: (k,).
        v_max: (n,) greatest speeds (>= 0).
        constraints: further linear constraints on v.
    """
    J, V = _task(J, V)
    limits = replace(JointLimits.unlimited(J.shape[1]), velocity=np.asarray(v_max, float))
    zero = np.zeros(J.shape[1])
    return _step(DifferentialIkConfig(), limits, zero, zero, J, V, constraints)


def limited(
    J: ArrayLike,
    V: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    limits: JointLimits,
    *,
    period: float,
    damping: float = 0.0,
    constraints: LinearConstraints | None = None,
) -> DifferentialIkResult:
    """min |J v_n − V|² + λ² |v_n|² within limits of position, velocity and acceleration.

    Equation 22, of which the constraint q_min ≤ q + h v_n ≤ q_max is made sharper: a joint
    approaches the end of its range only so fast that it can stop there
    (:func:`velocity_interval`). The plain constraint leads to states in which nothing is feasible.

    Args:
        J: (k, n).
        V: (k,).
        q: (n,) positions.
        v: (n,) velocities of the last step.
        limits: of the joints.
        period: h (s, > 0).
        damping: λ.
        constraints: further linear constraints on v_n.
    """
    config = DifferentialIkConfig(period=period, damping=damping)
    return _step(config, limits, q, v, *_task(J, V), constraints)


def centered(
    J: ArrayLike,
    V: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    limits: JointLimits,
    *,
    period: float,
    nominal_position: ArrayLike,
    gain: float = 1.0,
    weight: float = 0.01,
    constraints: LinearConstraints | None = None,
) -> DifferentialIkResult:
    """min |J v_n − V|² + ε |P (v_n − K (q_0 − q))|², limits as in :func:`limited` (equation 23).

    Without active limits the second term does not disturb the first. With active ones it does, by
    a share of the order of ε; :func:`prioritized` does not.

    Args:
        J: (k, n).
        V: (k,).
        q: (n,) positions.
        v: (n,) velocities of the last step.
        limits: of the joints.
        period: h (s, > 0).
        nominal_position: q_0 (n,).
        gain: K (1/s).
        weight: ε (> 0).
        constraints: further linear constraints on v_n.
    """
    config = DifferentialIkConfig(
        period=period,
        centering="nullspace",
        centering_weight=weight,
        centering_gain=gain,
        nominal_position=tuple(np.asarray(nominal_position, float)),
    )
    return _step(config, limits, q, v, *_task(J, V), constraints)


def direction_preserving(
    J: ArrayLike,
    V: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    limits: JointLimits,
    *,
    period: float,
    nominal_position: ArrayLike | None = None,
    gain: float = 1.0,
    weight: float = 100.0,
    constraints: LinearConstraints | None = None,
) -> DifferentialIkResult:
    """max w α − |P (v_n − K (q_0 − q))|² subject to J v_n = α V, 0 ≤ α ≤ 1, and limits (24).

    This is the program of Drake's ``DoDifferentialInverseKinematics`` (w = 100, the rows of P there
    not normalized), but for the sharper limits of position, and that a V longer than the joints'
    speeds permit is shortened first, so that α does not lose against the centering. For w large
    enough α is the greatest possible, and the centering chooses among what is left (an exact
    penalty).

    If v_n = 0 is out of reach of the limits of acceleration there may be no such v_n: the result is
    then BRAKING.

    Args:
        J: (k, n).
        V: (k,).
        q: (n,) positions.
        v: (n,) velocities of the last step.
        limits: of the joints.
        period: h (s, > 0).
        nominal_position: q_0 (n,); without it, the shortest v_n.
        gain: K (1/s).
        weight: w (> 0).
        constraints: further linear constraints on v_n.
    """
    config = DifferentialIkConfig(period=period, formulation="direction", direction_weight=weight)
    if nominal_position is not None:
        config = replace(
            config,
            centering="nullspace",
            centering_gain=gain,
            nominal_position=tuple(np.asarray(nominal_position, float)),
        )
    return _step(config, limits, q, v, *_task(J, V), constraints)


def prioritized(
    tasks: Sequence[tuple[ArrayLike, ArrayLike]],
    q: ArrayLike,
    v: ArrayLike,
    limits: JointLimits,
    *,
    period: float,
    nominal_position: ArrayLike | None = None,
    gain: float = 1.0,
    constraints: LinearConstraints | None = None,
) -> DifferentialIkResult:
    """Lexicographic least squares: level by level min |J_i v_n − V_i|², limits kept at every one.

    Level i moves in the common kernel of J_1 … J_{i−1} alone, v = v_{i−1} + Z y, so that what the
    levels before it have achieved, possible or not, stays as it is; all limits and constraints
    hold for v. The last level is the centering, min |v_n − K (q_0 − q)|². O. Kanoun, F. Lamiraux,
    P.-B. Wieber, "Kinematic control of redundant manipulators: generalizing the task-priority
    framework to inequality task", IEEE T-RO 27(4), 2011; A. Escande, N. Mansard, P.-B. Wieber,
    "Hierarchical quadratic programming", IJRR 33(7), 2014.

    Args:
        tasks: pairs J_i (k_i, n), V_i (k_i,), the first the most important.
        q: (n,) positions.
        v: (n,) velocities of the last step.
        limits: of the joints.
        period: h (s, > 0).
        nominal_position: q_0 (n,); without it, no centering.
        gain: K (1/s).
        constraints: further linear constraints on v_n.
    """
    if not tasks:
        raise ValueError("tasks: expected at least one")
    pairs = [_task(J, V) for J, V in tasks]
    J, V = np.vstack([J for J, _ in pairs]), np.concatenate([V for _, V in pairs])
    config = DifferentialIkConfig(period=period, formulation="priorities")
    if nominal_position is not None:
        config = replace(
            config,
            centering="nullspace",
            centering_gain=gain,
            nominal_position=tuple(np.asarray(nominal_position, float)),
        )
    return _step(config, limits, q, v, J, V, constraints, [len(V) for _, V in pairs])


def stack_tasks(
    tasks: Sequence[tuple[ArrayLike, ArrayLike]], weights: Sequence[float]
) -> tuple[Array, Array]:
    """Several tasks as one: min Σ w_i |J_i v − V_i|² is least squares with rows times √w_i.

    Args:
        tasks: pairs J_i (k_i, n), V_i (k_i,).
        weights: w_i (> 0).

    Returns:
        J (k, n) and V (k,).
    """
    if len(weights) != len(tasks) or not (np.asarray(weights) > 0).all():
        raise ValueError("weights: expected one above 0 for each task")
    pairs = [_task(J, V) for J, V in tasks]
    roots = np.sqrt(weights)
    return (
        np.vstack([root * J for root, (J, _) in zip(roots, pairs, strict=True)]),
        np.concatenate([root * V for root, (_, V) in zip(roots, pairs, strict=True)]),
    )


def velocity_interval(
    q: ArrayLike, v: ArrayLike, limits: JointLimits, period: float
) -> tuple[Array, Array]:
    """The next velocities v_n that keep all limits now and can keep them ever after.

    For every joint the intersection of

    1. |v_n − v| ≤ a h, which is never given up;
    2. |v_n| ≤ v_max, as far as 1 permits (a joint that is too fast slows down);
    3. −B(q − q_min) ≤ v_n ≤ B(q_max − q), as far as 1 and 2 permit.

    B(d) is the greatest speed towards the end of its range, d away, from which a joint can still
    stop there: a joint that moves for one period h at speed s and slows down by a h in each further
    one comes to rest after h ((k + 1) s − a h k (k + 1) / 2) with k = floor(s / (a h)); B is the
    inverse of that piecewise linear function, with the limit sqrt(2 a d) for h → 0. It is
    continued as an odd function: beyond the end, −B is the velocity of a return that ends at rest
    on it.

    From any state that it has led to, the interval is not empty but for rounding. A joint that
    starts beyond its range, or too fast to stop within it, brakes at full deceleration and comes
    back by the law B, or faster if the task wants it.

    In discrete time such viable states are those of A. Del Prete, "Joint position and velocity
    bounds in discrete-time acceleration/torque control of robot arms", IEEE RA-L 3(1), 2018; there
    the acceleration is constant over a period, here the velocity is, as commands by position are.

    Args:
        q: (n,) positions.
        v: (n,) velocities of the last step.
        limits: the limits.
        period: h (s, > 0).

    Returns:
        (n,) least and (n,) greatest velocities.
    """
    lower, upper, _ = compile_ik(DifferentialIkConfig(period=period), limits).velocity_interval(
        q, v
    )
    return lower, upper


def _task(J: ArrayLike, V: ArrayLike) -> tuple[Array, Array]:
    J, V = np.asarray(J, float), np.asarray(V, float)
    if J.ndim != 2 or not np.isfinite(J).all():
        raise ValueError("J: expected finite numbers (k, n)")
    if V.shape != (len(J),) or not np.isfinite(V).all():
        raise ValueError(f"V: expected {len(J)} finite numbers")
    return J, V


def _step(
    config: DifferentialIkConfig,
    limits: JointLimits,
    q: ArrayLike,
    v: ArrayLike,
    J: Array,
    V: Array,
    constraints: LinearConstraints | None,
    level_sizes: list[int] | None = None,
) -> DifferentialIkResult:
    ik = compile_ik(config, limits)
    rows = () if constraints is None else (constraints.A, constraints.lower, constraints.upper)
    return result_of(ik.step(q, v, J, V, None, level_sizes, *rows), J, V)
