"""Refinement of a known object's pose on its distance field, in well under a millisecond."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.perception.cloud import FARTHEST, PointCloud, within
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.registration.losses import RobustLoss
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.uncertainty import uncertainty_about

_FEWEST_POINTS = 6
_EXACT = 0.05  # Of the scale: root mean square distances that are as good as none.
_TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)


@dataclass(frozen=True)
class RefineConfig:
    """How a pose is refined.

    Attributes:
        loss: how a point's distance from the model counts.
        scale: of the loss, in the end [m], > 0: beyond some of it, points are outliers. A few
            times the depth noise.
        initial_scale: of the loss, at first [m]: about how far off the points are with the guess.
            The loss is narrowed from one iteration to the next (graduated non-convexity).
        cooling: factor by which, in (0, 1).
        max_distance: beyond it a point does not count at all, in the end [m]; at first it is wider
            by as much as the loss.
        kept_fraction: part of the points that counts, those nearest to the model, in (0, 1]:
            below 1, trimmed least squares.
        min_normal_cosine: points whose normal deviates more from the field's gradient do not count;
            in [-1, 1), where -1 does without the scene's normals.
        spread: four further starts are tried, turned from the guess by this angle about the axes of
            a tetrahedron at the middle of the object [rad], and the best goes on; 0 for none. With
            0.7 the basin grows from some 45 degrees to over 60, for about twice the time.
        num_coarse_points: points of the scene that the first iterations look at.
        num_finalists: of all starts, how many go on to all points.
        max_coarse_iterations, max_iterations: on few points, and on all.
        tolerance: an iteration that moves the points by less ends the refinement [m]; 4000 points
            with a noise of 1 mm determine where the object is to some 5e-5.
        inlier_distance: a point no further from the model is an inlier [m]; None for 3 scales.
        min_overlap: least part of the scene that must be inliers.
        ambiguity: poses whose mean loss exceeds the best one's by less than this part of it (or by
            next to nothing), and that lie further from it than 5 % of the object's diameter, make
            the result ambiguous.
    """

    loss: RobustLoss = RobustLoss.GEMAN_MCCLURE
    scale: float = 0.003
    initial_scale: float = 0.1
    cooling: float = 0.7
    max_distance: float = np.inf
    kept_fraction: float = 1.0
    min_normal_cosine: float = -1.0
    spread: float = 0.0
    num_coarse_points: int = 300
    num_finalists: int = 1
    max_coarse_iterations: int = 40
    max_iterations: int = 30
    tolerance: float = 3e-5
    inlier_distance: float | None = None
    min_overlap: float = 0.5
    ambiguity: float = 0.1


class RefinedPoses(NamedTuple):
    """What came of many starts.

    Attributes:
        best: the best one; AMBIGUOUS if another far from it is about as good.
        results: for each start, in order; None for one that was not among the finalists.
        costs: (S,) mean loss of each start [m^2]; of those that were no finalists, on few points.
    """

    best: RegistrationResult
    results: Sequence[RegistrationResult | None]
    costs: NDArray[np.float64]


def refine_pose(
    scene: PointCloud,
    field: DistanceField,
    X_WO_guess: RigidTransform,
    config: RefineConfig | None = None,
    *,
    num_threads: int = 1,
) -> RegistrationResult:
    """Lays a known object onto a cloud, from a guess of its pose.

    Minimizes the sum of a robust loss over the points' distances from the model, by damped
    Gauss-Newton steps on the distance field (Fitzgibbon, "Robust registration of 2D and 3D point
    sets", Image and Vision Computing 2003): no correspondences are searched for. The first
    iterations look at few points with a wide loss. Deterministic.

    Args:
        scene: points in W, with normals if ``min_normal_cosine`` asks for them.
        field: of the object, in O.
        X_WO_guess: where the object may be.
        config: see there.
        num_threads: to share the starts that ``spread`` makes; the result is the same.

    Returns:
        The pose; LOW_OVERLAP if few points lie near the model, DEGENERATE if the points leave
        motions free (on a plane, a sphere, a body of revolution, or fewer than six),
        NOT_CONVERGED if the iterations ran out. ``iterations`` are those on few and on all points.

    Raises:
        ValueError: naming a field of the config that is out of range.
        InputError: if normals are asked for and the scene has none.
    """
    config = config or RefineConfig()
    if not within(X_WO_guess.translation(), FARTHEST):
        raise ValueError("X_WO_guess: must be finite")
    starts = [X_WO_guess]
    if 0 < config.spread <= np.pi:  # Else none, or an error.
        low, size = field.origin, np.array(field.shape) - 1
        centre = low + 0.5 * field.spacing * size
        for axis in _TETRAHEDRON:
            turn = RigidTransform(AngleAxis(config.spread, axis), centre)
            starts.append(X_WO_guess @ turn @ RigidTransform(-centre))
    return _refine(scene, field, starts, config, num_threads, judge_ambiguity=False).best


def refine_poses(
    scene: PointCloud,
    field: DistanceField,
    X_WO_guesses: Sequence[RigidTransform],
    config: RefineConfig | None = None,
    *,
    num_threads: int = 1,
) -> RefinedPoses:
    """:func:`refine_pose` from many guesses, in parallel.

    Of all, the ``num_finalists`` best after the iterations on few points go on to all points.
    ``spread`` is not used.

    Raises:
        ValueError: if there is no guess, or naming a field of the config that is out of range.
        InputError: if normals are asked for and the scene has none.
    """
    if not X_WO_guesses:
        raise ValueError("X_WO_guesses: none")
    if not all(within(X.translation(), FARTHEST) for X in X_WO_guesses):
        raise ValueError("X_WO_guesses: must be finite")
    return _refine(
        scene, field, X_WO_guesses, config or RefineConfig(), num_threads, judge_ambiguity=True
    )


def _refine(
    scene: PointCloud,
    field: DistanceField,
    starts: Sequence[RigidTransform],
    config: RefineConfig,
    num_threads: int,
    *,
    judge_ambiguity: bool,
) -> RefinedPoses:
    if not 0 <= config.min_overlap <= 1:
        raise ValueError(f"min_overlap: must be from 0 to 1, not {config.min_overlap}")
    if config.num_coarse_points < 1:
        raise ValueError(f"num_coarse_points: must be at least 1, not {config.num_coarse_points}")
    if not config.ambiguity >= 0:
        raise ValueError(f"ambiguity: must be at least 0, not {config.ambiguity}")
    if config.inlier_distance is not None and not config.inlier_distance > 0:
        raise ValueError(f"inlier_distance: must be positive, not {config.inlier_distance}")
    if not 0 <= config.spread <= np.pi:
        raise ValueError(f"spread: must be from 0 to pi, not {config.spread}")
    if len(scene) < _FEWEST_POINTS:
        none = np.zeros(len(scene), dtype=bool)
        message = f"{len(scene)} points do not determine a pose"
        best = RegistrationResult(
            RegistrationStatus.DEGENERATE, None, np.nan, none, 0, message=message
        )
        return RefinedPoses(best, [None] * len(starts), np.full(len(starts), np.nan))
    answers = _core.refine_poses(
        field.core,
        scene.points,
        scene.require_normals() if config.min_normal_cosine > -1 else None,
        np.array([X.GetAsMatrix4() for X in starts]),
        config.loss.value,
        config.scale,
        config.initial_scale,
        config.cooling,
        config.max_distance,
        config.kept_fraction,
        config.min_normal_cosine,
        config.num_coarse_points,
        config.num_finalists,
        config.max_coarse_iterations,
        config.max_iterations,
        config.tolerance,
        _inlier_distance(config),
        num_threads,
    )
    results = [_result(answer, config) if answer[5] else None for answer in answers]
    costs = np.array([answer[1] for answer in answers])
    finalists = [i for i, result in enumerate(results) if result is not None]
    winner = min(finalists, key=lambda i: costs[i])
    best = results[winner]
    assert best is not None
    if judge_ambiguity and best.succeeded and best.X_WO is not None:
        rivals = [i for i in range(len(starts)) if _is_rival(i, winner, answers, field, config)]
        if rivals:
            best = RegistrationResult(
                RegistrationStatus.AMBIGUOUS,
                best.X_WO,
                best.residual,
                best.inliers,
                best.iterations,
                best.covariance,
                best.free_directions,
                f"starts {winner} and {rivals[0]} end far apart and explain the scene alike",
            )
    return RefinedPoses(best, results, costs)


def _inlier_distance(config: RefineConfig) -> float:
    return 3 * config.scale if config.inlier_distance is None else config.inlier_distance


def _result(answer: "_core.RefinedPose", config: RefineConfig) -> RegistrationResult:
    """Judges one finalist."""
    X, _, coarse, fine, converged, _, information, sum_squares, sum_weights = answer[:9]
    mean, length, inliers, count, residual = answer[9:]
    inliers = inliers.view(np.bool_)
    X_WO = RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3])
    status, message = RegistrationStatus.SUCCESS, ""
    covariance = free = None
    if sum_weights > _FEWEST_POINTS:
        variance = sum_squares / (sum_weights - _FEWEST_POINTS)
        covariance, free = uncertainty_about(
            information, variance, max(length, 1e-9), X[:3, 3] - mean
        )
    if count < config.min_overlap * len(inliers):
        status = RegistrationStatus.LOW_OVERLAP
        limit = _inlier_distance(config)
        message = f"{count} of {len(inliers)} points lie within {limit:.4g} m of the model"
    elif free is None or len(free):
        status = RegistrationStatus.DEGENERATE
        message = f"the points leave {6 if free is None else len(free)} motions free"
    elif not converged:
        status, message = RegistrationStatus.NOT_CONVERGED, "the iterations ran out"
    return RegistrationResult(
        status, X_WO, residual, inliers, coarse + fine, covariance, free, message
    )


def _is_rival(
    i: int,
    winner: int,
    answers: "Sequence[_core.RefinedPose]",
    field: DistanceField,
    config: RefineConfig,
) -> bool:
    """Whether a start ended far from the best one and explains the scene about as well."""
    # Costs on few points vary by their choice: they are compared with more generosity.
    slack = config.ambiguity if answers[i][5] else 2 * config.ambiguity
    # Without noise, costs are those of interpolation, which differ without meaning.
    least = (_EXACT * config.scale) ** 2
    if i == winner or answers[i][1] > (1 + slack) * answers[winner][1] + least:
        return False
    low = field.origin
    high = low + field.spacing * (np.array(field.shape) - 1)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1)
    moved = [X[:3, :3] @ corners + X[:3, 3:] for X in (answers[i][0], answers[winner][0])]
    apart = np.linalg.norm(moved[0] - moved[1], axis=0).max()
    return bool(apart > 0.05 * np.linalg.norm(high - low))
