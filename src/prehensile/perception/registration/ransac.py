"""Poses from correspondences by random samples of three."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from prehensile.native import _core
from prehensile.perception.registration.result import RegistrationStatus
from prehensile.perception.registration.robust import CorrespondenceResult, consensus_result


def ransac_pose(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    max_distance: float,
    *,
    seed: int = 0,
    max_samples: int = 100_000,
    confidence: float = 0.999,
    max_false_alarms: float = 1e-3,
) -> CorrespondenceResult:
    """The pose that the most correspondences agree with, among those of random triples.

    Triples whose edges differ in length are dropped at once; each better pose is refined on its
    inliers; the search ends when a triple of right correspondences would have been drawn with the
    confidence asked for (Fischler and Bolles 1981; Chum, Matas and Kittler, "Locally optimized
    RANSAC", DAGM 2003). With a part w of right correspondences this takes some 7 / w^3 samples, 7
    million at 1 %: there,
    :func:`~prehensile.perception.registration.register_correspondences` is the way.

    Args:
        model_points: (N, 3) in O [m], N <= 2^15.
        scene_points: (N, 3), the partner of each in W [m].
        max_distance: greatest distance of a right correspondence's scene point from where the pose
            puts it [m], > 0.
        seed: of the samples; the same seed gives the same answer.
        max_samples: triples drawn at most.
        confidence: in (0, 1).
        max_false_alarms: how many poses as good as the one found the samples may be expected to
            yield by chance; above this the answer is NO_CONSENSUS.

    Returns:
        ``SUCCESS``; ``NO_CONSENSUS`` (no pose) if no more agree than would by chance;
        ``NOT_CONVERGED`` if the samples ran out before the confidence was reached; ``DEGENERATE``
        if those that agree lie in a line. ``iterations`` counts the samples.

    Raises:
        ValueError: if shapes disagree, or a number is not finite or out of range.
    """
    if not max_false_alarms > 0:
        raise ValueError(f"max_false_alarms: must be positive, not {max_false_alarms}")
    X, flags, count, samples, _, confident, false_alarms = _core.ransac_pose(
        model_points, scene_points, max_distance, seed, max_samples, confidence
    )
    inliers = flags.view(bool)
    if count < 3 or false_alarms > np.log10(max_false_alarms):
        return CorrespondenceResult(
            status=RegistrationStatus.NO_CONSENSUS,
            X_WO=None,
            residual=float("nan"),
            inliers=np.zeros(len(inliers), bool),
            iterations=samples,
            message="no more correspondences agree than would by chance",
            log_false_alarms=false_alarms,
        )
    status = RegistrationStatus.SUCCESS if confident else RegistrationStatus.NOT_CONVERGED
    model, scene = np.asarray(model_points, float), np.asarray(scene_points, float)
    result = consensus_result(status, X, model, scene, inliers, max_distance, samples)
    message = result.message if confident else "the samples ran out before the confidence"
    return replace(result, log_false_alarms=false_alarms, message=message)
