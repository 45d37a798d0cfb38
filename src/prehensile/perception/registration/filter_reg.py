"""The filter form of soft correspondences: the sums run over the scene's points only.

Gaussians stand around the scene's points, and each model point is drawn to the mean of those near
it. The Gaussians do not move, so what is far away is left out at no cost. Frames: O is the model's,
W the scene's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.native.kd_tree import KdTree
from prehensile.perception.cloud import FARTHEST, PointCloud, rotate, within
from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.point_drift import bounding_volume
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    residual_limit,
)
from prehensile.perception.registration.uncertainty import uncertainty_about

# Gaussians are cut off beyond so many sigma.
_REACH = 3.0


@dataclass(frozen=True)
class FilterRegConfig:
    """How to filter.

    Attributes:
        point_to_plane: whether only the distances along the model's normals count, which the model
            must then have; fewer steps are needed.
        outlier_weight: which part of the model is expected to be unseen or to belong to nothing,
            in [0, 1).
        outlier_volume: see :class:`~prehensile.perception.registration.PointDriftConfig`.
        sigma: standard deviation of the first Gaussians [m]; None: a fifth of the model's root mean
            square radius.
        min_sigma: it is not made smaller [m]; None: the median distance between neighbours in the
            scene, below which the Gaussians no longer blend.
        shrinkage: sigma shrinks at least by this factor at each step, in (0, 1]; 1: only as the
            residuals tell, which parts of the model that are not in view keep large.
        max_iterations: at least 1.
        tolerance: done when a step moves the points, root mean square, and changes sigma by less
            [m].
        min_overlap: a smaller part of the scene near the model: ``LOW_OVERLAP``, 0 to 1.
        max_residual: inliers further from the model than this, root mean square, are no fit:
            ``LOW_OVERLAP`` [m]; None: a quarter of the model's root mean square radius.
        min_eigenvalue_ratio: a weaker constraint, of the strongest: ``DEGENERATE``.
    """

    point_to_plane: bool = False
    outlier_weight: float = 0.1
    outlier_volume: float | None = None
    sigma: float | None = None
    min_sigma: float | None = None
    shrinkage: float = 0.9
    max_iterations: int = 200
    tolerance: float = 1e-5
    min_overlap: float = 0.3
    max_residual: float | None = None
    min_eigenvalue_ratio: float = 5e-3


def filter_registration(
    scene: PointCloud,
    model: PointCloud,
    X_WO_guess: RigidTransform,
    config: FilterRegConfig | None = None,
    *,
    num_threads: int = 1,
) -> RegistrationResult:
    """Aligns a model to a scene by Gaussian filtering of the scene.

    Gao and Tedrake, "FilterReg: Robust and efficient probabilistic point-set registration using
    Gaussian filter and twist parameterization", CVPR 2019. The width of the Gaussians follows the
    residuals, as in coherent point drift, but shrinks steadily.

    Args:
        scene: points in W, at least two.
        model: points in O.
        X_WO_guess: where to start.
        config: how; the defaults if not given.
        num_threads: at least 1; it does not change the result.

    Returns:
        The pose. Its covariance counts the points as independent, and knows nothing of the bias
        that clouds of differently placed samples bring. Inliers are scene points within three
        sigma of the model. ``LOW_OVERLAP`` and no pose if no model point is near the scene.

    Raises:
        ValueError: if a cloud is too small or a setting out of range; the message names it.
        InputError: if the model has no normals and needs them.
    """
    config = config or FilterRegConfig()
    _check(scene, model, config)
    if not within(X_WO_guess.translation(), FARTHEST):
        raise ValueError("X_WO_guess: must be finite")
    order = _core.spatial_order(model.points)
    points = model.points[order]
    normals = model.require_normals()[order] if config.point_to_plane else None
    center = points.mean(axis=0)
    radius = max(float(np.sqrt(((points - center) ** 2).sum(axis=1).mean())), 1e-9)
    tree = KdTree(scene.points)
    narrowest = config.min_sigma
    if narrowest is None:
        narrowest = max(float(np.median(tree.nearest(scene.points, k=2)[1][:, 1])), 1e-6 * radius)
    sigma = max(config.sigma or 0.2 * radius, narrowest)
    volume = config.outlier_volume or bounding_volume(scene.points)
    odds = config.outlier_weight / (1 - config.outlier_weight) * len(scene) / volume
    gaussians = _core.GaussianSums(scene.points)

    X_WO = RigidTransform(X_WO_guess)
    iterations = 0
    information = np.zeros((6, 6))
    while True:
        iterations += 1
        q = rotate(points, X_WO.rotation().matrix()) + X_WO.translation()
        uniform = odds * (2 * np.pi * sigma**2) ** 1.5
        _, k, *kd, kd2 = gaussians.at(q, sigma, uniform, _REACH, num_threads).T
        weights = k / np.maximum(k + uniform, 1e-300)
        if weights.sum() < 1e-6:
            return _nothing(scene, iterations)
        inverse = 1 / np.where(k > 0, k, np.inf)
        targets = q + np.stack(kd, axis=1) * inverse[:, None]
        C = weights @ q / weights.sum()
        if normals is None:
            fit = fit_rigid(q, targets, weights)
            R, p = fit.R_WO, fit.p_WO
            information[:3, :3] = fit.rotation_information
            information[3:, 3:] = weights.sum() * np.eye(3)
        else:
            n = rotate(normals, X_WO.rotation().matrix())
            R, p, information = _plane_step(q, targets, n, weights, C, radius)
        moved = rotate(q, R) + p
        gain = weights @ (((q - targets) ** 2).sum(axis=1) - ((moved - targets) ** 2).sum(axis=1))
        variance = (weights @ (kd2 * inverse) - gain) / (3 * weights.sum())
        fitting = min(float(np.sqrt(max(variance, 0.0))), config.shrinkage * sigma)
        before, sigma = sigma, max(fitting, narrowest)
        way = float(np.sqrt(((moved - q) ** 2).sum(axis=1).mean()))
        X_WO = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p) @ X_WO
        converged = way <= config.tolerance and abs(sigma - before) <= config.tolerance
        if converged or iterations == config.max_iterations:
            break

    covariance, free = uncertainty_about(
        information, sigma**2, radius, X_WO.translation() - C, config.min_eigenvalue_ratio
    )
    model_tree = KdTree(model.points)
    near = rotate(scene.points - X_WO.translation(), X_WO.rotation().matrix().T)
    indices, distances = model_tree.nearest(near, max_distance=3 * sigma)
    inliers = indices[:, 0] >= 0
    off = float(np.sqrt(np.square(distances[inliers]).mean())) if inliers.any() else np.inf
    overlap = float(inliers.mean())
    status, message = RegistrationStatus.SUCCESS, ""
    if overlap < config.min_overlap:
        status = RegistrationStatus.LOW_OVERLAP
        message = f"only {overlap:.0%} of the scene lie near the model"
    elif len(free):
        status, message = RegistrationStatus.DEGENERATE, "the geometry leaves motions free"
    elif not off <= residual_limit(model.points, config.max_residual):
        status = RegistrationStatus.LOW_OVERLAP
        message = f"the scene lies {off:.3g} m from the model: no fit"
    elif not converged:
        status = RegistrationStatus.NOT_CONVERGED
        message = f"still moving after {iterations} iterations"
    residuals = np.linalg.norm(moved - targets, axis=1)
    return RegistrationResult(
        status=status,
        X_WO=X_WO,
        residual=float(np.sqrt(weights @ residuals**2 / weights.sum())),
        inliers=inliers,
        iterations=iterations,
        covariance=covariance,
        free_directions=free,
        message=message,
    )


def _check(scene: PointCloud, model: PointCloud, config: FilterRegConfig) -> None:
    if len(scene) < 2:
        raise ValueError(f"scene: needs at least two points, not {len(scene)}")
    if not len(model):
        raise ValueError("model: the cloud has no points")
    if not 0 <= config.outlier_weight < 1:
        raise ValueError(f"outlier_weight: must be in [0, 1), not {config.outlier_weight}")
    for name in ("outlier_volume", "sigma", "min_sigma", "max_residual"):
        value = getattr(config, name)
        if value is not None and not 0 < value <= FARTHEST:
            raise ValueError(f"{name}: must be positive and at most {FARTHEST:g}, not {value}")
    for name in ("min_overlap", "min_eigenvalue_ratio"):
        if not 0 <= getattr(config, name) <= 1:
            raise ValueError(f"{name}: must be from 0 to 1, not {getattr(config, name)}")
    if not config.tolerance >= 0:
        raise ValueError(f"tolerance: must be at least 0, not {config.tolerance}")
    if not 0 < config.shrinkage <= 1:
        raise ValueError(f"shrinkage: must be in (0, 1], not {config.shrinkage}")
    if not config.max_iterations >= 1:
        raise ValueError(f"max_iterations: must be at least 1, not {config.max_iterations}")


def _nothing(scene: PointCloud, iterations: int) -> RegistrationResult:
    return RegistrationResult(
        status=RegistrationStatus.LOW_OVERLAP,
        X_WO=None,
        residual=np.nan,
        inliers=np.zeros(len(scene), dtype=bool),
        iterations=iterations,
        message="no point of the model is near the scene",
    )


def _plane_step(
    q: NDArray[np.float64],
    targets: NDArray[np.float64],
    n: NDArray[np.float64],
    weights: NDArray[np.float64],
    C: NDArray[np.float64],
    length_scale: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The rotation and translation of one Gauss-Newton step, and its matrix about C."""
    J = np.concatenate([np.cross(q - C, n), n], axis=1)
    r = ((q - targets) * n).sum(axis=1)
    H = (weights[:, None] * J).T @ J
    scale = np.array([1 / length_scale] * 3 + [1.0] * 3)
    step = -scale * (
        np.linalg.pinv(scale[:, None] * H * scale, rcond=1e-9, hermitian=True)
        @ (scale * (J.T @ (weights * r)))
    )
    turn, shift = step[:3], step[3:]
    # Cayley's rotation: that of the turn up to third order, and a rotation exactly.
    S = 0.5 * np.array([[0, -turn[2], turn[1]], [turn[2], 0, -turn[0]], [-turn[1], turn[0], 0]])
    R = np.asarray(np.linalg.solve(np.eye(3) - S, np.eye(3) + S), dtype=float)
    return R, C + shift - R @ C, H
