"""Refinement of a pose by a distance field that keeps the object out of where it cannot be.

Three terms: scene points lie on the surface (robustly), the surface is not where a camera saw
through, and no corner of the object is behind a table top or wall. The last is a hard constraint,
the one before it a price, because single pixels err.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception.body_evidence import Body, BodyEvidence, EvidenceConfig
from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.free_space import DepthView
from prehensile.perception.registration.constraints import HalfSpaces, corner_points
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    pose_uncertainty,
)
from prehensile.perception.registration.sequential_qp import Quadratic, minimize_over_poses

Array = NDArray[np.float64]


def refine_constrained(
    scene_points: ArrayLike,
    body: Body,
    X_WO_guess: RigidTransform,
    *,
    half_spaces: HalfSpaces | None = None,
    views: DepthView | Sequence[DepthView] = (),
    config: EvidenceConfig | None = None,
    min_inliers: float = 0.3,
    max_violation: float = 1e-4,
) -> RegistrationResult:
    """The pose near a guess that explains the scene best and is possible.

    Minimizes sum of rho(phi(X_OW p_i)) + weight * sum of squared free-space violations subject to
    n_k . (X_WO c_j) >= d_k, by sequential quadratic programming; the scale of the Geman-McClure
    loss rho falls from ``max_distance`` to ``loss_scale``.

    Args:
        scene_points: (N, 3) points that may be the object's, in W [m].
        body: the object's shape; its corners, or else its samples, are what the half-spaces hold.
        X_WO_guess: where to start.
        half_spaces: where the object may be; everywhere if None.
        views: depth images whose free space counts; one or several.
        config: scales and weights; ``max_pixels``, ``farthest`` and ``occluder_margin`` do not
            matter here.
        min_inliers: with a smaller part of the scene near the surface the status is LOW_OVERLAP.
        max_violation: how far beyond a half-space counts as beyond [m].

    Returns:
        The pose; its inliers lie within three ``loss_scale`` of the surface. The covariance is
        that of the unconstrained data, an upper bound where constraints hold with equality. The
        message tells how much of the surface lies in free space.

    Raises:
        ValueError: if an argument has a wrong shape, is not finite, or there is no point.
    """
    config = config or EvidenceConfig()
    points = np.ascontiguousarray(scene_points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or not within(points, FARTHEST):
        raise ValueError(f"scene_points: expected (N, 3) finite numbers, not {points.shape}")
    if not len(points):
        raise ValueError("scene_points: there is no point")
    if not within(X_WO_guess.translation(), FARTHEST):
        raise ValueError("X_WO_guess: must be finite")
    if not 0 <= min_inliers <= 1:
        raise ValueError(f"min_inliers: must be from 0 to 1, not {min_inliers}")
    if not max_violation >= 0:
        raise ValueError(f"max_violation: must be at least 0, not {max_violation}")
    limits = half_spaces or HalfSpaces(np.zeros((0, 3)), np.zeros(0))
    normals, offsets = limits.unit(3)
    corners = corner_points(body.corners, body.points)
    length_scale = float(np.sqrt((body.points**2).sum(axis=1).mean()))
    images = [views] if isinstance(views, DepthView) else views
    data = BodyEvidence([body], images, (), config)

    R = np.array(X_WO_guess.rotation().matrix())
    p = np.array(X_WO_guess.translation())
    scale, iterations, found = config.max_distance, 0, None
    while found is None or scale > config.loss_scale:
        scale = config.max_distance if found is None else max(0.5 * scale, config.loss_scale)

        def cost(R: Array, p: Array, scale: float = scale) -> Quadratic:
            here = data.at(points, _matrix(R, p), scale)
            return Quadratic(here.cost, here.gradient[0], here.information[0])

        last = scale <= config.loss_scale
        found = minimize_over_poses(
            cost,
            corners,
            normals,
            offsets,
            R,
            p,
            basis=np.eye(6),
            length_scale=length_scale,
            max_iterations=30 if last else 5,
            tolerance=1e-5,
        )
        R, p = found.R_WO, found.p_WO
        iterations += found.iterations
    evidence = data.at(points, _matrix(R, p), config.loss_scale)
    near = np.abs(body.field.at((points - p) @ R).distances) < 3 * config.loss_scale
    covariance, free = pose_uncertainty(evidence.information[0], 1.0, length_scale)
    status, message = RegistrationStatus.SUCCESS, f"{evidence.in_free:.0%} in free space"
    if found.violation > max_violation:
        status = RegistrationStatus.INFEASIBLE
        message = f"the object is {found.violation:.2g} m beyond a half-space"
    elif near.mean() < min_inliers:
        status = RegistrationStatus.LOW_OVERLAP
        message = f"{near.mean():.0%} of the points are near the surface"
    elif len(free):
        status, message = RegistrationStatus.DEGENERATE, "the points leave a motion free"
    elif not found.converged:
        status, message = RegistrationStatus.NOT_CONVERGED, "the iterations ran out"
    return RegistrationResult(
        status,
        RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p),
        evidence.residual,
        near,
        iterations,
        covariance,
        free,
        message,
    )


def _matrix(R: Array, p: Array) -> Array:
    X = np.zeros((1, 4, 4))
    X[0, :3, :3], X[0, :3, 3], X[0, 3, 3] = R, p, 1.0
    return X
