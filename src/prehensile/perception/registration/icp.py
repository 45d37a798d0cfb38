"""Iterative closest points: the pose of a model near a first guess.

Partners by proximity, the pose by least squares over the partners, and again. Frames: O is the
model's, W the scene's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud
from prehensile.perception.registration.losses import RobustLoss
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    residual_limit,
)
from prehensile.perception.registration.uncertainty import uncertainty_about


class IcpKind(Enum):
    """What is made small between a scene point and its partner on the model."""

    POINT_TO_POINT = "point_to_point"
    """Their distance (Besl and McKay, PAMI 1992)."""
    POINT_TO_PLANE = "point_to_plane"
    """The scene point's distance from the model's tangent plane (Chen and Medioni 1992)."""
    GENERALIZED = "generalized"
    """The distance between patches of surface on both sides (Segal, Haehnel and Thrun,
    "Generalized-ICP", RSS 2009)."""


class IcpDirection(Enum):
    """For the points of which side a partner is looked for on the other."""

    SCENE_TO_MODEL = "scene_to_model"
    """Right for partial views: what the camera did not see has no say."""
    MODEL_TO_SCENE = "model_to_scene"
    """Right for models that are seen whole amid other things."""
    BOTH = "both"


@dataclass(frozen=True)
class IcpConfig:
    """How to align.

    Attributes:
        kind: what is made small.
        direction: where partners are looked for.
        max_distance: pairs further apart are left out [m], > 0; inf for no limit.
        max_normal_angle: pairs whose normals enclose more are left out [rad], 0 to pi; None: the
            angle does not matter.
        kept_fraction: the part of the pairs that counts, the nearest ones, in (0, 1]: trimmed ICP
            (Chetverikov, Svirko, Stepanov and Krsek, ICPR 2002).
        loss: how the residuals count. A residual is in metres for every kind.
        loss_scale: scale of the loss [m], > 0.
        graduated: whether the loss, ``GEMAN_MCCLURE`` or ``TRUNCATED``, is approached from a convex
            one (graduated non-convexity, Yang et al., RA-L 2020).
        color_weight: the part in [0, 1) of squared differences of grey values (0 to 1) in the sum
            (Park, Zhou and Koltun, "Colored point cloud registration revisited", ICCV 2017; theirs
            is 0.032). Both clouds must have colors.
        coarse_points: the first steps are made with about so many points of the scene, evenly
            taken, until they become small; 0: with all.
        max_iterations: at least 1.
        tolerance: done when a step moves the points by less, root mean square [m].
        min_overlap: fewer inliers than this part of the scene: ``LOW_OVERLAP``, 0 to 1.
        max_residual: a larger residual (root mean square, in the end) is no fit: ``LOW_OVERLAP``
            [m]; None: a quarter of the model's root mean square radius, as clouds leave that do not
            resemble the model.
        min_eigenvalue_ratio: weaker constraints than this, of the strongest: ``DEGENERATE``. That
            partners lie beside the points feigns some, less so in denser models.
    """

    kind: IcpKind = IcpKind.POINT_TO_PLANE
    direction: IcpDirection = IcpDirection.SCENE_TO_MODEL
    max_distance: float = np.inf
    max_normal_angle: float | None = None
    kept_fraction: float = 1.0
    loss: RobustLoss = RobustLoss.LEAST_SQUARES
    loss_scale: float = 0.01
    graduated: bool = False
    color_weight: float = 0.0
    coarse_points: int = 500
    max_iterations: int = 100
    tolerance: float = 1e-5
    min_overlap: float = 0.3
    max_residual: float | None = None
    min_eigenvalue_ratio: float = 5e-3


class IcpModel:
    """A model made ready once for many registrations: index, normals, colour gradients.

    Where the cloud has no normals they are estimated from its 12 nearest neighbours.
    """

    def __init__(self, cloud: PointCloud) -> None:
        """Builds the index.

        Args:
            cloud: the model's points in O, at least one.

        Raises:
            ValueError: if the cloud is empty.
        """
        self.cloud = cloud
        self.native = _native_cloud(cloud, "model", tree=True, normals=True)


def icp(
    scene: PointCloud,
    model: PointCloud | IcpModel,
    X_WO_guess: RigidTransform,
    config: IcpConfig | None = None,
    *,
    history: list[RigidTransform] | None = None,
) -> RegistrationResult:
    """Aligns a model to a scene from a first guess.

    Args:
        scene: points in W.
        model: points in O; an :class:`IcpModel` spares preparing it at every call.
        X_WO_guess: where to start.
        config: how; the defaults if not given.
        history: the pose before every step and the last one are appended to it.

    Returns:
        The pose. ``LOW_OVERLAP`` and no pose if too few points have partners in reach; with a pose,
        if too few are inliers or the residual is no fit's. ``DEGENERATE`` is judged by the
        distances from tangent planes, whatever the kind: along a plane a model can slide. The
        covariance supposes errors of the points that are independent and as large as the residuals;
        point to point it is too small, since partners lie beside the points.

    Raises:
        ValueError: if a cloud is empty, a setting is out of range, or the clouds lack the colors
            that the configuration needs; the message names it.
    """
    config = config or IcpConfig()
    prepared = _prepared(model)
    (found,) = _run(scene, prepared, [X_WO_guess], config, 1, history is not None)
    if history is not None:
        history.extend(_pose(X) for X in found["history"])
    return _result(found, config, prepared)


def icp_many_starts(
    scene: PointCloud,
    model: PointCloud | IcpModel,
    X_WO_guesses: Sequence[RigidTransform],
    config: IcpConfig | None = None,
    *,
    num_threads: int = 1,
    ambiguity_ratio: float = 1.2,
    distinct_distance: float | None = None,
) -> RegistrationResult:
    """Aligns from several guesses and returns the pose that explains the scene best.

    Poses are compared by the mean squared distance of the scene's points to the model, each capped
    at the limit that the configuration sets (``max_distance``, the scale of a robust loss).

    Args:
        scene: points in W.
        model: points in O.
        X_WO_guesses: where to start, at least one.
        config: how; the defaults if not given.
        num_threads: of the guesses in parallel, at least 1; it does not change the result.
        ambiguity_ratio: another pose whose mean squared distance is no more than this times the
            best one's makes the answer ``AMBIGUOUS``, at least 1.
        distinct_distance: poses differ if they lay the model's points apart by more than this, root
            mean square [m]; a fifth of the model's root mean square radius if not given.

    Returns:
        As :func:`icp`; the message tells of the rivals.

    Raises:
        ValueError: as :func:`icp`, and if there is no guess.
    """
    if not X_WO_guesses:
        raise ValueError("X_WO_guesses: there is none")
    if not ambiguity_ratio >= 1:
        raise ValueError(f"ambiguity_ratio: must be at least 1, not {ambiguity_ratio}")
    if distinct_distance is not None and not distinct_distance >= 0:
        raise ValueError(f"distinct_distance: must be at least 0, not {distinct_distance}")
    config = config or IcpConfig()
    prepared = _prepared(model)
    found = _run(scene, prepared, X_WO_guesses, config, num_threads, False)
    best = min(found, key=lambda one: one["score"])
    result = _result(best, config, prepared)
    points = prepared.cloud.points
    mean = points.mean(axis=0)
    moments = (points - mean).T @ (points - mean) / len(points)
    limit = distinct_distance
    if limit is None:
        limit = 0.2 * float(np.sqrt(np.trace(moments)))
    rivals = [
        one
        for one in found
        if one["score"] <= ambiguity_ratio * best["score"]
        and _model_distance(one["X_WO"], best["X_WO"], mean, moments) > limit
    ]
    if not rivals or not result.succeeded:
        return result
    return RegistrationResult(
        **{
            **vars(result),
            "status": RegistrationStatus.AMBIGUOUS,
            "message": f"from {len(rivals)} of {len(X_WO_guesses)} guesses came a different pose "
            "that explains the scene as well",
        }
    )


def _prepared(model: PointCloud | IcpModel) -> IcpModel:
    return model if isinstance(model, IcpModel) else IcpModel(model)


def _native_cloud(cloud: PointCloud, name: str, *, tree: bool, normals: bool) -> _core.IcpCloud:
    if not len(cloud):
        raise ValueError(f"{name}: the cloud has no points")
    intensities = None
    if cloud.colors is not None:
        # Luma as of ITU-R BT.601.
        intensities = cloud.colors @ np.array([0.299, 0.587, 0.114]) / 255
    return _core.IcpCloud(cloud.points, cloud.normals, intensities, tree, normals)


def _run(
    scene: PointCloud,
    model: IcpModel,
    X_WO_guesses: Sequence[RigidTransform],
    config: IcpConfig,
    num_threads: int,
    keep_history: bool,
) -> list[dict[str, Any]]:
    angle = config.max_normal_angle
    if angle is not None and not 0 <= angle <= np.pi:
        raise ValueError(f"max_normal_angle: must be from 0 to pi, not {angle}")
    for name in ("min_overlap", "min_eigenvalue_ratio"):
        value = getattr(config, name)
        if not 0 <= value <= 1:
            raise ValueError(f"{name}: must be from 0 to 1, not {value}")
    if config.max_residual is not None and not config.max_residual > 0:
        raise ValueError(f"max_residual: must be positive, not {config.max_residual}")
    native_scene = _native_cloud(
        scene,
        "scene",
        tree=config.direction is not IcpDirection.SCENE_TO_MODEL,
        normals=config.kind is IcpKind.GENERALIZED or angle is not None,
    )
    return _core.icp(
        native_scene,
        model.native,
        np.stack([X.GetAsMatrix4() for X in X_WO_guesses]),
        kind=config.kind.value,
        direction=config.direction.value,
        max_distance=config.max_distance,
        min_normal_cosine=-2.0 if angle is None else float(np.cos(angle)),
        kept_fraction=config.kept_fraction,
        loss=config.loss.value,
        loss_scale=config.loss_scale,
        graduated=config.graduated,
        color_weight=config.color_weight,
        coarse_points=config.coarse_points,
        max_iterations=config.max_iterations,
        tolerance=config.tolerance,
        keep_history=keep_history,
        num_threads=num_threads,
    )


def _result(found: dict[str, Any], config: IcpConfig, model: IcpModel) -> RegistrationResult:
    """What the kernel found, judged."""
    inliers = found["inliers"].astype(bool)
    iterations = found["iterations"]
    if found["outcome"] == "too_few_pairs":
        return RegistrationResult(
            status=RegistrationStatus.LOW_OVERLAP,
            X_WO=None,
            residual=np.nan,
            inliers=inliers,
            iterations=iterations,
            message="too few points have a partner in reach",
        )
    X_WO = _pose(found["X_WO"])
    status, message = RegistrationStatus.SUCCESS, ""
    covariance, free = None, None
    overlap = float(inliers.mean())
    limit = residual_limit(model.cloud.points, config.max_residual)
    length_scale = found["length_scale"]
    if length_scale > 0:
        covariance, free = uncertainty_about(
            found["information"],
            found["plane_variance"],
            length_scale,
            X_WO.translation() - found["centroid"],
            config.min_eigenvalue_ratio,
        )
    if overlap < config.min_overlap:
        status = RegistrationStatus.LOW_OVERLAP
        message = f"only {overlap:.0%} of the scene's points are inliers"
    elif free is None or len(free):
        status = RegistrationStatus.DEGENERATE
        message = "the geometry leaves motions free"
    elif not found["residual"] <= limit:
        status = RegistrationStatus.LOW_OVERLAP
        message = f"the partners lie {found['residual']:.3g} m apart: no fit"
    elif found["outcome"] == "out_of_iterations":
        status = RegistrationStatus.NOT_CONVERGED
        message = f"still moving after {iterations} iterations"
    return RegistrationResult(
        status=status,
        X_WO=X_WO,
        residual=found["residual"],
        inliers=inliers,
        iterations=iterations,
        covariance=covariance,
        free_directions=free,
        message=message,
    )


def _pose(matrix: NDArray[np.float64]) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(matrix[:3, :3]), matrix[:3, 3])


def _model_distance(
    X_A: NDArray[np.float64],
    X_B: NDArray[np.float64],
    mean: NDArray[np.float64],
    moments: NDArray[np.float64],
) -> float:
    """Root mean square distance between the places of the model's points in two poses [m]."""
    difference = X_A - X_B
    shift = difference[:3, :3] @ mean + difference[:3, 3]
    turn = np.einsum("ij,jk,ik->", difference[:3, :3], moments, difference[:3, :3])
    return float(np.sqrt(shift @ shift + turn))
