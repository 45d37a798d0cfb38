"""Pose estimation with any loss over a distance field, by general nonlinear optimization."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix
from scipy.optimize import minimize

from prehensile.perception.cloud import FARTHEST, PointCloud, rotate, within
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.registration.losses import RobustLoss
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.uncertainty import uncertainty_about
from prehensile.perception.turns import rotation_of

Loss = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Losses (N,) of signed distances (N,) [m], and their derivatives (N,)."""

Constraint = Callable[[RigidTransform], NDArray[np.float64]]
"""A vector (M,) of a pose X_WO that must not be negative anywhere; smooth."""

_FEWEST_POINTS = 6
_STEP = 1e-6  # Of the finite differences of constraints, in units of the variables.


def estimate_pose_nonlinear(
    scene: PointCloud,
    field: DistanceField,
    X_WO_guess: RigidTransform,
    loss: RobustLoss | Loss = RobustLoss.HUBER,
    constraints: Sequence[Constraint] = (),
    *,
    scale: float = 0.003,
    max_iterations: int = 200,
    tolerance: float = 1e-6,
    inlier_distance: float | None = None,
    min_overlap: float = 0.5,
) -> RegistrationResult:
    """Minimizes the mean of any loss of the points' distances from a model, under constraints.

    The pose has the least number of parameters: a rotation vector and a translation, relative to
    the guess, about the middle of the scene; rotations are measured by the way that they move the
    points. Without constraints by BFGS, with constraints by sequential quadratic programs (SLSQP):
    Nocedal and Wright, "Numerical Optimization", chapters 6 and 18. Slower than
    :func:`~prehensile.perception.registration.refine_pose` by two orders of magnitude, and good
    for losses that it does not know: one that punishes only penetration, say.

    Args:
        scene: points in W.
        field: of the object, in O; signed, if the loss tells the sides apart.
        X_WO_guess: where the object may be, less than half a turn from the answer.
        loss: by name, with ``scale``; or a function that gives losses and their derivatives by
            the signed distance.
        constraints: functions of the pose whose values must not be negative.
        scale: of a named loss [m].
        max_iterations: of the optimizer.
        tolerance: at which the optimizer stops: of the gradient of the mean loss without
            constraints, of its change with them; relative to scale^2 (or to the square of the
            scene's size, if that is smaller).
        inlier_distance: a point no further from the model is an inlier [m]; None for 3 scales.
        min_overlap: least part of the scene that must be inliers.

    Returns:
        The pose; covariance (of least squares over the inliers, as if nothing constrained the
        pose) and status as for ``refine_pose``; INFEASIBLE if a constraint is violated in the end.

    Raises:
        ValueError: naming the argument that is out of range.
    """
    for name, value, least in (("scale", scale, 1e-9), ("tolerance", tolerance, 0.0)):
        if not (value > least and np.isfinite(value)):
            raise ValueError(f"{name}: must be above {least:g} and finite, not {value}")
    if not max_iterations >= 1:
        raise ValueError(f"max_iterations: must be at least 1, not {max_iterations}")
    if not 0 <= min_overlap <= 1:
        raise ValueError(f"min_overlap: must be from 0 to 1, not {min_overlap}")
    if inlier_distance is not None and not inlier_distance > 0:
        raise ValueError(f"inlier_distance: must be positive, not {inlier_distance}")
    if not within(X_WO_guess.translation(), FARTHEST):
        raise ValueError("X_WO_guess: must be finite")
    if len(scene) < _FEWEST_POINTS:
        none = np.zeros(len(scene), dtype=bool)
        text = f"{len(scene)} points do not determine a pose"
        return RegistrationResult(
            RegistrationStatus.DEGENERATE, None, np.nan, none, 0, message=text
        )
    mean = scene.points.mean(axis=0)
    length = max(float(np.sqrt(np.square(scene.points - mean).sum(axis=1).mean())), 1e-9)
    evaluate = _named(loss, scale) if isinstance(loss, RobustLoss) else loss

    # Variables: x = [rotation vector * length; translation] / length, all of order one. The object
    # turns about the scene's mean.
    R_guess = X_WO_guess.rotation().matrix()
    p_guess = X_WO_guess.translation() - mean

    def pose(x: NDArray[np.float64]) -> RigidTransform:
        R = rotation_of(x[:3])
        return RigidTransform(RotationMatrix(R @ R_guess), mean + length * x[3:] + R @ p_guess)

    # A scale beyond the scene's size would make every slope look small.
    unit = min(scale, length) ** 2 * len(scene)

    def cost(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        X_WO = pose(x)
        d, g_W, _ = _look_up(scene, field, X_WO)
        losses, slopes = evaluate(d)
        # A turn w and a step v of the object move a point by -(v + w x (p - mean - length x_3..))
        # as the object sees it; the rotation vector's own derivative is the left Jacobian.
        force = -np.asarray(slopes)[:, None] * g_W
        turn = np.cross(scene.points - mean - length * x[3:], force).sum(axis=0)
        gradient = np.concatenate([_left_jacobian(x[:3]).T @ turn, length * force.sum(axis=0)])
        return float(np.sum(losses)) / unit, gradient / unit

    def violations(x: NDArray[np.float64]) -> NDArray[np.float64]:
        X_WO = pose(x)
        return np.concatenate([np.atleast_1d(c(X_WO)) for c in constraints])

    def slopes_of_violations(x: NDArray[np.float64]) -> NDArray[np.float64]:
        steps = _STEP * np.eye(6)
        return np.stack([violations(x + h) - violations(x - h) for h in steps], axis=-1) / (
            2 * _STEP
        )

    if constraints:
        answer = minimize(
            cost, np.zeros(6), jac=True, method="SLSQP",
            constraints={"type": "ineq", "fun": violations, "jac": slopes_of_violations},
            options={"maxiter": max_iterations, "ftol": tolerance},
        )  # fmt: skip
        converged = bool(answer.success)
    else:
        options = {"maxiter": max_iterations, "gtol": tolerance}
        answer = minimize(cost, np.zeros(6), jac=True, method="BFGS", options=options)
        # Status 2: no further progress at the precision of the numbers.
        converged = bool(answer.success) or answer.status == 2
    X_WO = pose(answer.x)
    limit = 3 * scale if inlier_distance is None else inlier_distance
    worst = float(violations(answer.x).min()) if constraints else 0.0
    status, message = RegistrationStatus.SUCCESS, ""
    d, g_W, _ = _look_up(scene, field, X_WO)
    inliers = np.abs(d) <= limit
    count = int(inliers.sum())
    covariance = free = None
    residual = float(np.sqrt(np.square(d[inliers]).mean())) if count else np.nan
    if count > _FEWEST_POINTS:
        g = g_W[inliers]
        J = np.concatenate([np.cross(scene.points[inliers] - mean, g), g], axis=1)
        variance = float(np.square(d[inliers]).sum()) / (count - _FEWEST_POINTS)
        covariance, free = uncertainty_about(J.T @ J, variance, length, X_WO.translation() - mean)
    if worst < -1e-6:
        status = RegistrationStatus.INFEASIBLE
        message = f"a constraint is {worst:.3g} in the end: {answer.message}"
    elif count < min_overlap * len(scene):
        status = RegistrationStatus.LOW_OVERLAP
        message = f"{count} of {len(scene)} points lie within {limit:.4g} m of the model"
    elif free is None or len(free):
        status = RegistrationStatus.DEGENERATE
        message = f"the points leave {6 if free is None else len(free)} motions free"
    elif not converged:
        status, message = RegistrationStatus.NOT_CONVERGED, str(answer.message)
    return RegistrationResult(
        status, X_WO, residual, inliers, int(answer.nit), covariance, free, message
    )


def _look_up(
    scene: PointCloud, field: DistanceField, X_WO: RigidTransform
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Distances of the scene's points, their gradients in W, and the points in O."""
    R_WO = X_WO.rotation().matrix()
    p_OQ = rotate(scene.points - X_WO.translation(), R_WO.T)
    d, g_O = field.at(p_OQ)
    return d, rotate(g_O, R_WO), p_OQ


def _named(loss: RobustLoss, scale: float) -> Loss:
    return lambda d: (loss.loss(d, scale), 2 * d * loss.weight(d, scale))


def _left_jacobian(w: NDArray[np.float64]) -> NDArray[np.float64]:
    """J with exp(w + dw) = exp(J dw) exp(w) to first order (Barfoot, "State Estimation for
    Robotics", section 7.1).
    """
    angle = float(np.linalg.norm(w))
    K = _skew(w)
    if angle < 1e-4:
        return np.eye(3) + 0.5 * K + K @ K / 6
    a, b = (1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    return np.eye(3) + a * K + b * K @ K


def _skew(w: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z = w
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
