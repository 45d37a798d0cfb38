"""From a crop of a scene to the pose of a known object, without a first guess."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.errors import InputError
from prehensile.native import _core
from prehensile.perception.cloud import PointCloud, within
from prehensile.perception.free_space import DepthView
from prehensile.perception.fusion import downsample
from prehensile.perception.normals import estimate_normals
from prehensile.perception.ranges import require_ranges
from prehensile.perception.registration.evidence import (
    Evidence,
    EvidenceConfig,
    in_object,
    weigh,
)
from prehensile.perception.registration.known_object import KnownObject
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.uncertainty import uncertainty_about


@dataclass(frozen=True)
class LocateConfig(EvidenceConfig):
    """How an object is looked for; the first fields are those of EvidenceConfig.

    Attributes:
        num_references: points of the scene that vote for poses, at least 1; more for scenes with
            much else in them. (More do in small scenes.)
        max_candidates: poses from the vote that are refined, at least 1.
        max_finalists: of those, poses apart from each other that are refined on all points.
        min_coverage: part of the object's surface towards the sensor that must be seen where the
            pose says, in [0, 1].
        min_agreement: part of the points near the object that must lie on its surface, in [0, 1].
        min_score: least product of the two, in [0, 1].
        max_violation: part of the object's points that may lie where a depth image shows that
            nothing is; only with views.
        ambiguity: the best pose must fit better than any other by so many standard errors.
    """

    num_references: int = 30
    max_candidates: int = 50
    max_finalists: int = 5
    min_coverage: float = 0.35
    min_agreement: float = 0.35
    min_score: float = 0.6
    max_violation: float = 0.1
    ambiguity: float = 3.0

    def __post_init__(self) -> None:
        """Checks the values.

        Raises:
            ValueError: naming the field that is out of range.
        """
        require_ranges(
            self,
            voxel_fraction=(1e-3, 0.2),
            num_references=(1, 10**6),
            max_candidates=(1, 10**4),
            max_finalists=(1, 10**3),
            tolerance=(1e-6, 1.0),
            max_normal_angle=(0.01, np.pi),
            min_coverage=(0.0, 1.0),
            min_agreement=(0.0, 1.0),
            min_score=(0.0, 1.0),
            max_violation=(0.0, 1.0),
            ambiguity=(0.0, 1e6),
        )


@dataclass(frozen=True, eq=False)
class LocateResult(RegistrationResult):
    """A pose found in a scene, and how well the scene bears it out.

    Attributes:
        coverage: part of the object's surface towards the sensor that the scene shows.
        agreement: part of the scene's points near the object that lie on its surface.
        alternatives: other poses that fit as well, best first; where there are any, the status is
            ``AMBIGUOUS`` or ``DEGENERATE``.
    """

    coverage: float = 0.0
    agreement: float = 0.0
    alternatives: tuple[RigidTransform, ...] = ()


@dataclass(frozen=True, eq=False)
class _Fit:
    """A refined pose, as the kernel answers."""

    X_WO: NDArray[np.float64]
    cost: float
    iterations: int
    information: NDArray[np.float64]
    variance: float


def locate(
    scene: PointCloud,
    model: KnownObject,
    config: LocateConfig | None = None,
    *,
    views: DepthView | Sequence[DepthView] = (),
    num_threads: int = 1,
) -> LocateResult:
    """Finds a known object in a crop of a scene.

    Candidates come from a vote of point pairs; all are refined on the object's distance field
    with few points, those that stay apart with all points, and the best is checked: whether the
    scene shows the surface that the pose promises, whether what is near it agrees with it, and
    whether no other pose fits as well.

    Args:
        scene: points in W from one or several depth cameras, the object and perhaps other things.
            With normals toward the sensors, or with sensor_origins, by which they are estimated.
            Denser than the voxels that it is thinned to.
        model: the object.
        config: see :class:`LocateConfig`.
        views: depth images of the scene, if there are any: poses in space that a camera saw
            through are refused.
        num_threads: at least 1; does not change the result.

    Returns:
        The pose X_WO and its status. ``NO_CONSENSUS``: nothing in the scene looks like the object,
        the pose is the best guess or None. ``LOW_OVERLAP``: what is seen agrees, but it is little
        of the object. ``DEGENERATE``: the pose is free along a direction, as about the axis of a
        body of revolution. ``AMBIGUOUS``: see the alternatives. The inliers are points of the
        scene within the tolerance.

    Raises:
        InputError: if the scene has neither normals nor sensor_origins.
        ValueError: naming the argument.
    """
    config = config or LocateConfig()
    voxel = config.voxel_fraction * model.diameter
    if not within(scene.points, 2**20 * voxel / 3):
        raise ValueError("scene: has points beyond the reach of its voxels; crop it first")
    thinned = _thinned(scene, voxel, num_threads)
    if len(thinned) < 10:
        return _nothing(scene, f"the scene has only {len(thinned)} points with normals")
    votes = model.pairs.vote(
        thinned,
        # Few points vote fast: more of them may.
        num_references=max(config.num_references, 9000 // len(thinned)),
        peaks_per_reference=6,
        max_poses=config.max_candidates,
        num_threads=num_threads,
    )
    if not len(votes.X_WO):
        return _nothing(scene, "no pair of points looks like one of the object's")

    # More points than these only cost time: their noise is no longer what limits the pose.
    points = scene.points[:: max(1, len(scene) // 3000)]
    coarse = _refine(model, points, votes.X_WO, config, coarse=True, num_threads=num_threads)
    apart = _apart(coarse, model)[: config.max_finalists]
    starts = np.stack([fit.X_WO for fit in apart])
    fits = _refine(model, points, starts, config, coarse=False, num_threads=num_threads)
    fits = _apart(fits, model)
    looks = _as_tuple(views)
    evidence = {id(fit): weigh(scene, thinned, model, fit.X_WO, looks, config) for fit in fits}

    # A pose must explain the scene, and the scene the pose: a flat piece lies well on any large
    # flat face. Of poses that do the second alike, the points decide.
    def unexplained(fit: _Fit) -> float:
        found = evidence[id(fit)]
        return fit.cost / _scale(config) ** 2 + (1 - found.coverage) + found.violation

    first = evidence[id(min(fits, key=unexplained))]
    alike = [
        fit
        for fit in fits
        if evidence[id(fit)].coverage > first.coverage - 0.1
        and evidence[id(fit)].violation < first.violation + 0.1
    ]
    best = alike[0]
    others = [
        fit for fit in alike[1:] if _margin(model, points, best, fit, config) < config.ambiguity
    ]
    return _judged(scene, model, config, best, evidence[id(best)], others)


def _as_tuple(views: DepthView | Sequence[DepthView]) -> tuple[DepthView, ...]:
    return (views,) if isinstance(views, DepthView) else tuple(views)


def _thinned(scene: PointCloud, voxel: float, num_threads: int) -> PointCloud:
    """One point with a normal per voxel."""
    bare = PointCloud(scene.points, scene.normals)
    if scene.normals is None:
        if scene.sensor_origins is None and len(scene):
            raise InputError("the scene has neither normals nor sensor_origins")
        fine = downsample(
            PointCloud(scene.points, sensor_origins=scene.sensor_origins),
            voxel / 3,
            num_threads=num_threads,
        )
        estimated = estimate_normals(fine, radius=1.25 * voxel, num_threads=num_threads)
        bare = PointCloud(estimated.points, estimated.normals)
    if not len(bare):
        return bare.replace(normals=np.zeros((0, 3)))
    return downsample(bare, voxel, num_threads=num_threads)


def _scale(config: LocateConfig) -> float:
    """Scale of the loss [m]: of single points, which are noisier than averages."""
    return 1.5 * config.tolerance


def _refine(
    model: KnownObject,
    points: NDArray[np.float64],
    X_WO: NDArray[np.float64],
    config: LocateConfig,
    *,
    coarse: bool,
    num_threads: int,
) -> list[_Fit]:
    """Refined poses, best first."""
    scale = _scale(config)
    answers = _core.refine_poses(
        model.field.core,
        points,
        None,
        X_WO,
        loss="geman_mcclure",
        scale=scale,
        initial_scale=max(0.15 * model.diameter, scale) if coarse else 2 * scale,
        cooling=0.7,
        max_distance=np.inf,
        kept_fraction=1.0,
        min_normal_cosine=-1.0,
        num_coarse_points=100 if coarse else 400,
        num_finalists=1 if coarse else len(X_WO),
        max_coarse_iterations=12,
        max_iterations=1 if coarse else 10,
        tolerance=1e-5,
        inlier_distance=3 * scale,
        num_threads=num_threads,
    )
    fits = [
        _Fit(a[0], a[1], a[2] + a[3], a[6], a[7] / a[8] if a[8] > 0 else np.inf) for a in answers
    ]
    return sorted(fits, key=lambda fit: fit.cost)


def _apart(fits: Sequence[_Fit], model: KnownObject) -> list[_Fit]:
    """The fits without those that lay the object where an earlier one does."""
    p_OQ = model.cloud.points[:12]  # The first points of the cloud are its extremes.
    kept: list[_Fit] = []
    placed: list[NDArray[np.float64]] = []
    for fit in fits:
        p_WQ = p_OQ @ fit.X_WO[:3, :3].T + fit.X_WO[:3, 3]
        if all(np.abs(p_WQ - q).max() > 0.1 * model.diameter for q in placed):
            kept.append(fit)
            placed.append(p_WQ)
    return kept


def _margin(
    model: KnownObject, points: NDArray[np.float64], best: _Fit, other: _Fit, config: LocateConfig
) -> float:
    """By how many standard errors the best pose fits the points better than another one.

    The test of Vuong, "Likelihood ratio tests for model selection and non-nested hypotheses",
    Econometrica 1989: the mean over its standard error of the differences, point by point.
    """
    squared = _scale(config) ** 2

    def losses(fit: _Fit) -> NDArray[np.float64]:
        d = model.field.at(in_object(points, fit.X_WO)).distances
        return d * d / (d * d + squared)

    difference = losses(other) - losses(best)
    error = float(difference.std()) / np.sqrt(len(points))
    return float(difference.mean()) / max(error, 1e-12)


def _judged(
    scene: PointCloud,
    model: KnownObject,
    config: LocateConfig,
    best: _Fit,
    evidence: Evidence,
    others: Sequence[_Fit],
) -> LocateResult:
    """The best pose with its status."""
    distances = np.abs(model.field.at(in_object(scene.points, best.X_WO)).distances)
    inliers = distances < 2 * config.tolerance
    center = scene.points[inliers].mean(axis=0) if inliers.any() else best.X_WO[:3, 3]
    covariance, free = _uncertainty(model, best, center)

    status, message = RegistrationStatus.SUCCESS, ""
    if evidence.violation > config.max_violation:
        status = RegistrationStatus.NO_CONSENSUS
        message = f"{evidence.violation:.0%} of the object would be where a camera saw nothing"
    elif evidence.agreement < config.min_agreement:
        status = RegistrationStatus.NO_CONSENSUS
        message = (
            f"only {evidence.agreement:.0%} of the points around the best pose lie on the object"
        )
    elif evidence.coverage < config.min_coverage:
        status = RegistrationStatus.LOW_OVERLAP
        message = f"only {evidence.coverage:.0%} of the side towards the sensor is seen"
    elif evidence.score < config.min_score:
        status = RegistrationStatus.NO_CONSENSUS
        message = f"coverage {evidence.coverage:.2f} and agreement {evidence.agreement:.2f} are low"
    elif len(free):
        status = RegistrationStatus.DEGENERATE
        message = "the points leave a motion of the object free"
    elif others:
        status = RegistrationStatus.AMBIGUOUS
        message = f"{len(others)} other poses fit as well"
    return LocateResult(
        status=status,
        X_WO=_transform(best.X_WO),
        residual=float(np.sqrt(np.mean(distances[inliers] ** 2))) if inliers.any() else np.nan,
        inliers=inliers,
        iterations=best.iterations,
        covariance=covariance,
        free_directions=free,
        message=message,
        coverage=evidence.coverage,
        agreement=evidence.agreement,
        alternatives=tuple(_transform(other.X_WO) for other in others),
    )


def _uncertainty(
    model: KnownObject, best: _Fit, center: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance and free directions, judged about the middle of the inliers."""
    p_CO = best.X_WO[:3, 3] - center
    x, y, z = p_CO
    # The origin moves by v_O = v_C + w x p_CO.
    shift = np.eye(6)
    shift[3:, :3] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    about_center = shift.T @ best.information @ shift
    return uncertainty_about(about_center, best.variance, 0.25 * model.diameter, p_CO)


def _transform(X_WO: NDArray[np.float64]) -> RigidTransform:
    return RigidTransform(X_WO)


def _nothing(scene: PointCloud, message: str) -> LocateResult:
    return LocateResult(
        RegistrationStatus.NO_CONSENSUS,
        None,
        np.nan,
        np.zeros(len(scene), dtype=bool),
        0,
        message=message,
    )
