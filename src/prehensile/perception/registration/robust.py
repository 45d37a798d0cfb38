"""Poses from correspondences most of which are wrong, without a guess."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.uncertainty import uncertainty_about
from prehensile.perception.registration.voting import vote_for_scale


@dataclass(frozen=True)
class RobustConfig:
    """How :func:`register_correspondences` searches.

    Attributes:
        estimate_scale: whether the scene is a scaled copy of the model.
        ambiguity_ratio: a second pose, far from the first, with at least this part of its inliers
            makes the answer AMBIGUOUS; in (0, 1].
        max_false_alarms: how many poses as good as the one found wrong correspondences may be
            expected to yield by chance; above this the answer is NO_CONSENSUS.
        min_inliers: fewer are no consensus, >= 3.
        max_nodes: of the tree of each search for a clique; most need none.
    """

    estimate_scale: bool = False
    ambiguity_ratio: float = 0.8
    max_false_alarms: float = 1e-3
    min_inliers: int = 3
    max_nodes: int = 20_000

    def __post_init__(self) -> None:
        """Checks the ranges.

        Raises:
            ValueError: if a number is out of its range.
        """
        if not 0 < self.ambiguity_ratio <= 1:
            raise ValueError(f"ambiguity_ratio: must lie in (0, 1], not {self.ambiguity_ratio}")
        if not self.max_false_alarms > 0:
            raise ValueError(f"max_false_alarms: must be positive, not {self.max_false_alarms}")
        if self.min_inliers < 3:
            raise ValueError(f"min_inliers: must be at least 3, not {self.min_inliers}")
        if self.max_nodes < 0:
            raise ValueError(f"max_nodes: must not be negative, not {self.max_nodes}")


@dataclass(frozen=True, eq=False)
class CorrespondenceResult(RegistrationResult):
    """A pose from correspondences; ``inliers`` says which of them agree with it.

    Attributes:
        scale: s of scene = s R_WO model + p_WO; 1 unless it was to be estimated.
        clique_size: of the consistent set that led to the pose.
        clique_proven: whether no larger consistent set exists.
        num_inliers_second: most inliers of a pose far from this one, as far as one was found that
            comes near to this one's number.
        log_false_alarms: log10 of the number of equally good poses to be expected by chance.
    """

    scale: float = 1.0
    clique_size: int = 0
    clique_proven: bool = False
    num_inliers_second: int = 0
    log_false_alarms: float = 0.0


_STATUSES = (
    RegistrationStatus.SUCCESS,
    RegistrationStatus.NO_CONSENSUS,
    RegistrationStatus.AMBIGUOUS,
)


def register_correspondences(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    noise_bound: float,
    config: RobustConfig | None = None,
) -> CorrespondenceResult:
    """The pose that the most correspondences agree with, even if 99 of 100 are wrong.

    Pairs of correspondences vote by the distances of their points, which no pose changes; the
    largest clique of consistent ones gives the rotation (graduated non-convexity on the
    differences of its points), then the translation (a vote per axis); all correspondences that
    agree refine it. The same again without these gives a rival. As TEASER does it (Yang, Shi and
    Carlone, IEEE T-RO 37(2), 2021), with the largest clique by exact search. Whether the
    consensus means anything is judged by the number of poses as good that the same points, wrongly
    matched, would yield by chance (Moisan and Stival 2004).

    Args:
        model_points: (N, 3) in O [m], N <= 2^15.
        scene_points: (N, 3), the partner of each in W [m].
        noise_bound: greatest distance of a right correspondence's scene point from where the pose
            puts it [m], > 0. Of Gaussian noise with standard deviation s per axis, 4 s holds all
            but one in a thousand.
        config: see there.

    Returns:
        ``SUCCESS``; ``NO_CONSENSUS`` (no pose) if no more agree than would by chance;
        ``AMBIGUOUS`` if another pose is about as good; ``DEGENERATE`` if those that agree lie in a
        line, about which the pose may turn.

    Raises:
        ValueError: if shapes disagree, or a number is not finite or out of range.
    """
    config = config or RobustConfig()
    model = np.ascontiguousarray(model_points, float)
    scale = 1.0
    if config.estimate_scale and len(model) >= config.min_inliers:
        scale = vote_for_scale(model, scene_points, noise_bound).estimate
        if scale <= 0:
            return _nothing(len(model), "the distances in the scene vanish")
        model = scale * model
    status, X, inliers, _, second, clique, proven, iterations, false_alarms = (
        _core.robust_registration(
            model,
            scene_points,
            noise_bound,
            config.max_nodes,
            config.ambiguity_ratio,
            config.max_false_alarms,
            config.min_inliers,
        )
    )
    if _STATUSES[status] is RegistrationStatus.NO_CONSENSUS:
        return _nothing(len(model), "no more correspondences agree than would by chance")
    result = consensus_result(
        _STATUSES[status], X, model, np.asarray(scene_points, float), inliers.view(bool),
        noise_bound, iterations,
    )  # fmt: skip
    return replace(
        result,
        scale=scale,
        clique_size=clique,
        clique_proven=proven,
        num_inliers_second=second,
        log_false_alarms=false_alarms,
    )


def consensus_result(
    status: RegistrationStatus,
    X_WO: NDArray[np.float64],
    model: NDArray[np.float64],
    scene: NDArray[np.float64],
    inliers: NDArray[np.bool_],
    noise_bound: float,
    iterations: int,
) -> CorrespondenceResult:
    """What a pose (4, 4) by least squares on its inliers is worth.

    Instead of ``SUCCESS``, ``DEGENERATE`` where a turn about some line moves the inliers by less
    than the noise bound, so that they are no evidence against it.
    """
    a, b = model[inliers], scene[inliers]
    moved = a @ X_WO[:3, :3].T + X_WO[:3, 3]
    squares = float(((b - moved) ** 2).sum())
    center = moved.mean(axis=0)
    arms = moved - center
    information = np.zeros((6, 6))
    scatter = arms.T @ arms
    information[:3, :3] = np.trace(scatter) * np.eye(3) - scatter
    information[3:, 3:] = len(a) * np.eye(3)
    spread = max(float(np.sqrt(np.trace(scatter) / len(a))), 1e-12)
    surplus = 3 * len(a) - 6
    covariance, free = uncertainty_about(
        information,
        squares / surplus if surplus > 0 else 0.0,
        spread,
        X_WO[:3, 3] - center,
        max((0.5 * noise_bound / spread) ** 2, 1e-10),
    )
    message = ""
    if len(free):
        message = "the correspondences that agree lie in a line, to within their noise"
        if status is RegistrationStatus.SUCCESS:
            status = RegistrationStatus.DEGENERATE
    elif status is RegistrationStatus.AMBIGUOUS:
        message = "a pose far from this one has about as many correspondences"
    return CorrespondenceResult(
        status=status,
        X_WO=RigidTransform(RotationMatrix.ProjectToRotationMatrix(X_WO[:3, :3]), X_WO[:3, 3]),
        residual=float(np.sqrt(squares / len(a))),
        inliers=inliers,
        iterations=iterations,
        covariance=covariance,
        free_directions=free,
        message=message,
    )


def _nothing(count: int, message: str) -> CorrespondenceResult:
    return CorrespondenceResult(
        status=RegistrationStatus.NO_CONSENSUS,
        X_WO=None,
        residual=float("nan"),
        inliers=np.zeros(count, bool),
        iterations=0,
        message=message,
    )
