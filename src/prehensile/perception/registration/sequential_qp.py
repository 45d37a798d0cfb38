"""Least squares over poses subject to inequalities: Gauss-Newton steps that are quadratic programs.

A pose is moved by [w; v]: R <- exp(w) R about its own origin, p <- p + v, all in the frame W of
the scene. Each step minimizes the Gauss-Newton model of the cost subject to the linearized
constraints (sequential quadratic programming; Nocedal and Wright, "Numerical Optimization",
chapter 18) and is shortened until the merit function, the cost plus a multiple of the violations,
has fallen.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from prehensile.perception.turns import rotation_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Quadratic:
    """A cost near a pose: cost + 2 gradient . d + d . information d, for a motion d = [w; v].

    Attributes:
        cost: sum of (weighted, robust) squared residuals [m^2].
        gradient: (6,) sum of J^T r.
        information: (6, 6) sum of J^T J.
    """

    cost: float
    gradient: Array
    information: Array


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where :func:`minimize_over_poses` ended.

    Attributes:
        R_WO: (3, 3) rotation.
        p_WO: (3,) translation [m].
        quadratic: the cost there.
        active: (k, 6) gradients of the constraints that hold with equality.
        violation: largest violation of a constraint [m].
        iterations: steps taken.
        converged: whether the last step was below the tolerance.
    """

    R_WO: Array
    p_WO: Array
    quadratic: Quadratic
    active: Array
    violation: float
    iterations: int
    converged: bool


def moved(R: Array, p: Array, motion: Array) -> tuple[Array, Array]:
    """The pose (R, p) after a motion [w; v] of W: exp(w) R and p + v."""
    return rotation_of(motion[:3]) @ R, p + motion[3:]


def nearest_in_polyhedron(point: Array, A: Array, c: Array) -> tuple[Array, Array] | None:
    """The point x nearest to the given one with A x >= c; None if there is no such x.

    Least distance programming by non-negative least squares (Lawson and Hanson, "Solving Least
    Squares Problems", chapter 23).

    Args:
        point: (n,).
        A: (k, n) rows of any length but zero.
        c: (k,).

    Returns:
        x (n,) and the multipliers (k,) >= 0 of ||x - point||^2 / 2.
    """
    slack = c - A @ point
    if not len(c) or slack.max() <= 0:
        return point, np.zeros(len(c))
    rows = np.linalg.norm(A, axis=1)
    scale = np.abs(slack / rows).max()
    E = np.vstack([(A / rows[:, None]).T, slack / rows / scale])
    f = np.zeros(len(E))
    f[-1] = 1.0
    u, residual = nnls(E, f, maxiter=30 * len(c) + 100)
    if residual < 1e-9:
        return None
    r = f - E @ u
    return point - scale * r[:-1] / r[-1], scale * u / r[-1] / rows


def minimize_over_poses(
    evaluate: Callable[[Array, Array], Quadratic],
    points_O: Array,
    normals: Array,
    offsets: Array,
    R_WO: Array,
    p_WO: Array,
    *,
    basis: Array,
    length_scale: float,
    max_iterations: int = 50,
    tolerance: float = 1e-7,
) -> Minimum:
    """Minimizes a cost over poses that keep points of the object in half-spaces.

    Args:
        evaluate: (R_WO, p_WO) -> the cost and its Gauss-Newton model.
        points_O: (M, 3) points of the object that are constrained.
        normals: (k, 3) unit normals in W, pointing to the allowed side.
        offsets: (k,) every point x must satisfy normal . x >= offset [m].
        R_WO: (3, 3) where to start.
        p_WO: (3,) where to start [m].
        basis: (6, m) the motions [w; v] that are allowed.
        length_scale: size of the object [m]; makes rotations comparable with translations.
        max_iterations: most steps.
        tolerance: a step that moves less than this many length scales ends the search.
    """
    scaled = basis * np.array([1 / length_scale] * 3 + [1.0] * 3)[:, None]
    R, p, here = R_WO, p_WO, evaluate(R_WO, p_WO)
    damping, price = 1e-9, 0.0
    iterations, converged = 0, False
    while iterations < max_iterations and not converged:
        iterations += 1
        A, gaps = _linearized(points_O, normals, offsets, R, p)
        H = scaled.T @ here.information @ scaled
        b = scaled.T @ here.gradient
        H = H + (damping * max(np.trace(H), 1e-300) + 1e-300) * np.eye(len(H))
        step, multipliers = constrained_step(H, b, A @ scaled, -gaps)
        price = max(price, 2.0 * float(multipliers.max(initial=0.0)))
        motion = scaled @ step
        size = float(np.linalg.norm(step)) / length_scale
        merit = here.cost + 2 * price * np.maximum(-gaps, 0).sum()
        accepted = False
        for _ in range(12):
            R_new, p_new = moved(R, p, motion)
            new = evaluate(R_new, p_new)
            _, gaps_new = _linearized(points_O, normals, offsets, R_new, p_new)
            if new.cost + 2 * price * np.maximum(-gaps_new, 0).sum() <= merit * (1 + 1e-12):
                R, p, here, accepted = R_new, p_new, new, True
                break
            motion = 0.5 * motion
        damping = max(0.2 * damping, 1e-9) if accepted else max(10 * damping, 1e-4)
        converged = size < tolerance or damping > 1e6
    A, gaps = _linearized(points_O, normals, offsets, R, p)
    active = gaps < 1e-5 * length_scale
    return Minimum(
        R, p, here, A[active], float(np.maximum(-gaps, 0).max(initial=0.0)), iterations, converged
    )


def _linearized(
    points_O: Array, normals: Array, offsets: Array, R: Array, p: Array
) -> tuple[Array, Array]:
    """Gradients (k M, 6) by [w; v] and values (k M,) of normal . x - offset for every point."""
    arms = points_O @ R.T
    turning = np.cross(arms[None, :, :], normals[:, None, :])
    sliding = np.broadcast_to(normals[:, None, :], turning.shape)
    gaps = normals @ (arms + p).T - offsets[:, None]
    return np.concatenate([turning, sliding], axis=2).reshape(-1, 6), gaps.reshape(-1)


def constrained_step(H: Array, b: Array, A: Array, c: Array) -> tuple[Array, Array]:
    """The d with A d >= c that minimizes d . H d / 2 + b . d, and the multipliers.

    Where no d satisfies the constraints, the step that best undoes the violations.
    """
    L = np.linalg.cholesky(H)
    unconstrained = _solved(L, -b)  # as y = L^T d
    found = nearest_in_polyhedron(unconstrained, _solved(L, A.T).T, c)
    if found is not None:
        return _solved(L.T, found[0]), found[1]
    violated = c > 0
    normal = A[violated].T @ A[violated]
    rhs = A[violated].T @ c[violated]
    step = _solved(normal + 1e-3 * np.trace(normal) * np.eye(len(normal)), rhs)
    return step, np.full(len(c), np.linalg.norm(b) + np.linalg.norm(H @ step), dtype=np.float64)


def _solved(A: NDArray[np.floating], b: Array) -> Array:
    return np.asarray(np.linalg.solve(A, b), dtype=np.float64)
