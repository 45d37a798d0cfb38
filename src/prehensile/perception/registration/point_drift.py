"""Coherent point drift: every scene point belongs to every model point, to a degree.

The model's points are the centres of Gaussians of one common width; expectation maximization moves
them, and narrows them, until they explain the scene best. Frames: O is the model's, W the scene's.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    residual_limit,
)
from prehensile.perception.registration.uncertainty import uncertainty_about


@dataclass(frozen=True)
class PointDriftConfig:
    """How to drift.

    Attributes:
        outlier_weight: which part of the scene is expected to belong to nothing, in [0, 1).
        outlier_volume: over how large a region such points are spread evenly [m^3; m^2 in the
            plane]; None: the scene's bounding box. Myronenko and Song take as many units of volume
            as the scene has points, having scaled it to unit variance.
        sigma: standard deviation of the first Gaussians [m]; None: of all pairs of points, so that
            everything sees everything.
        max_iterations: at least 1.
        tolerance: done when a step moves the points, root mean square, and changes sigma by less
            [m].
        min_overlap: a smaller part of the scene explained: ``LOW_OVERLAP``, 0 to 1.
        max_residual: a larger residual is no fit: ``LOW_OVERLAP`` [m]; None: a quarter of the
            model's root mean square radius.
        min_eigenvalue_ratio: a weaker constraint, of the strongest: ``DEGENERATE``.
    """

    outlier_weight: float = 0.1
    outlier_volume: float | None = None
    sigma: float | None = None
    max_iterations: int = 200
    tolerance: float = 1e-6
    min_overlap: float = 0.3
    max_residual: float | None = None
    min_eigenvalue_ratio: float = 1e-4


def coherent_point_drift(
    scene: PointCloud,
    model: PointCloud,
    X_WO_guess: RigidTransform | None = None,
    config: PointDriftConfig | None = None,
    *,
    num_threads: int = 1,
    history: list[RigidTransform] | None = None,
) -> RegistrationResult:
    """Aligns a model to a scene by rigid coherent point drift.

    Myronenko and Song, "Point set registration: coherent point drift", PAMI 2010, without a change
    of scale. It suits full views: where the scene shows a part of the model only, the rest of the
    model is drawn to that part as well.

    Args:
        scene: points in W.
        model: points in O.
        X_WO_guess: where to start; identity if not given.
        config: how; the defaults if not given.
        num_threads: at least 1; it does not change the result.
        history: the pose before every step and the last one are appended to it.

    Returns:
        The pose. Its covariance counts the points as independent, and knows nothing of the bias
        that clouds of differently placed samples bring. Inliers are scene points that belong to
        the model rather than to nothing. The residual is the root mean square distance from the
        partners, sigma times the square root of 3. ``LOW_OVERLAP`` and no pose if the Gaussians
        explain nothing; with a pose, if they explain little or the residual is no fit's.

    Raises:
        ValueError: if a cloud is empty or a setting out of range; the message names it.
    """
    config = config or PointDriftConfig()
    found = drift(
        scene.points,
        model.points,
        np.eye(4) if X_WO_guess is None else X_WO_guess.GetAsMatrix4(),
        3,
        config,
        num_threads=num_threads,
        keep_history=history is not None,
    )
    if history is not None:
        history.extend(_pose(X) for X in found["history"])
    inliers = found["probabilities"] > 0.5
    if found["num_explained"] <= 1e-6:
        return RegistrationResult(
            status=RegistrationStatus.LOW_OVERLAP,
            X_WO=None,
            residual=np.nan,
            inliers=inliers,
            iterations=found["iterations"],
            message="the Gaussians explain nothing of the scene",
        )
    X_WO = _pose(found["X_WO"])
    information = np.zeros((6, 6))
    information[:3, :3] = found["rotation_information"]
    information[3:, 3:] = found["num_explained"] * np.eye(3)
    covariance, free = uncertainty_about(
        information,
        found["sigma"] ** 2,
        max(found["length_scale"], 1e-12),
        X_WO.translation() - found["centroid"],
        config.min_eigenvalue_ratio,
    )
    overlap = found["num_explained"] / len(scene)
    residual = float(np.sqrt(3) * found["sigma"])
    status, message = RegistrationStatus.SUCCESS, ""
    if overlap < config.min_overlap:
        status = RegistrationStatus.LOW_OVERLAP
        message = f"only {overlap:.0%} of the scene belong to the model"
    elif len(free):
        status, message = RegistrationStatus.DEGENERATE, "the points leave turns free"
    elif not residual <= residual_limit(model.points, config.max_residual):
        status = RegistrationStatus.LOW_OVERLAP
        message = f"the partners lie {residual:.3g} m apart: no fit"
    elif not found["converged"]:
        status = RegistrationStatus.NOT_CONVERGED
        message = f"still moving after {found['iterations']} iterations"
    return RegistrationResult(
        status=status,
        X_WO=X_WO,
        residual=residual,
        inliers=inliers,
        iterations=found["iterations"],
        covariance=covariance,
        free_directions=free,
        message=message,
    )


def drift(
    scene: NDArray[np.float64],
    model: NDArray[np.float64],
    X_WO_guess: NDArray[np.float64],
    dimension: int,
    config: PointDriftConfig,
    *,
    num_threads: int = 1,
    keep_history: bool = False,
) -> dict[str, Any]:
    """The kernel's answer, for points (N, 3) in space or in the plane z = 0.

    Keys: those of ``prehensile::PointDriftResult``.
    """
    for name, points in (("scene", scene), ("model", model)):
        if not len(points):
            raise ValueError(f"{name}: there is no point")
    for key in ("sigma", "max_residual"):
        value = getattr(config, key)
        if value is not None and not value > 0:
            raise ValueError(f"{key}: must be positive, not {value}")
    for key in ("min_overlap", "min_eigenvalue_ratio"):
        if not 0 <= getattr(config, key) <= 1:
            raise ValueError(f"{key}: must be from 0 to 1, not {getattr(config, key)}")
    volume = config.outlier_volume
    return _core.coherent_point_drift(
        scene,
        model,
        X_WO_guess,
        dimension=dimension,
        outlier_weight=config.outlier_weight,
        outlier_volume=bounding_volume(scene[:, :dimension]) if volume is None else volume,
        sigma=config.sigma or 0.0,
        max_iterations=config.max_iterations,
        tolerance=config.tolerance,
        keep_history=keep_history,
        num_threads=num_threads,
    )


def bounding_volume(points: NDArray[np.float64]) -> float:
    """Volume of the axis-aligned bounding box of (N, D) points; no side counts as less than a
    hundredth of the longest, so that flat clouds have a volume."""
    sides = np.ptp(points, axis=0)
    longest = float(sides.max())
    volume = float(np.prod(np.maximum(sides, 0.01 * longest)))
    return volume if volume > 0 else 1.0


def _pose(matrix: NDArray[np.float64]) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(matrix[:3, :3]), matrix[:3, 3])
