"""The choice of grasps in a scene."""

import dataclasses as dc
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.grasping.candidates import Candidates, antipodal_candidates
from prehensile.grasping.grasp import Grasp, GraspConfig, GraspResult, GraspStatus
from prehensile.grasping.gripper import ParallelGripper
from prehensile.grasping.scoring import Evaluation, evaluate
from prehensile.perception.cloud import Box, PointCloud
from prehensile.perception.segmentation import convex_segments


def select_grasps(
    cloud: PointCloud,
    gripper: ParallelGripper,
    obstacles: Sequence[Box],
    config: GraspConfig,
    rng: np.random.Generator,
    *,
    segments: NDArray[np.int64] | None = None,
) -> GraspResult:
    """Good grasps in a cloud of unknown objects, best first.

    Samples antipodal candidates, scores them, turns the good ones so that they close along the
    mean contact normal and scores those too, and keeps the best that differ from one another. It
    knows nothing of an arm: let the caller take the first grasp that its arm can reach.

    Args:
        cloud: the scene in W (z up), one point per voxel of ``config.voxel_size``, without the
            floor and walls of the bin.
        gripper: the hand.
        obstacles: boxes in W that the hand must not touch, such as floor and walls.
        config: settings.
        rng: source of all randomness.
        segments: (N,) labels of the cloud's points by object, -1 for none; by default those of
            :func:`prehensile.perception.convex_segments`.

    Returns:
        The grasps, or the commonest reason why there is none.
    """
    if len(cloud) == 0:
        return GraspResult(GraspStatus.NO_POINTS)
    if segments is None:
        segments = convex_segments(cloud, config.voxel_size)
    counts: Counter[GraspStatus] = Counter()
    for _ in range(config.rounds):
        candidates = antipodal_candidates(cloud, segments, rng, config)
        if len(candidates) == 0:
            return GraspResult(GraspStatus.NO_SIDES)
        evaluation = evaluate(candidates, cloud, segments, gripper, obstacles, config)
        counts.update(evaluation.status)
        best = _distinct(candidates, evaluation, config)
        if len(best) > 0:
            candidates, evaluation = candidates.select(best), evaluation.select(best)
            grasps = _polished(candidates, evaluation, cloud, segments, gripper, obstacles, config)
            return GraspResult(GraspStatus.FOUND, grasps, counts)
    return GraspResult(counts.most_common(1)[0][0], (), counts)


def _polished(
    candidates: Candidates,
    evaluation: Evaluation,
    cloud: PointCloud,
    segments: NDArray[np.int64],
    gripper: ParallelGripper,
    obstacles: Sequence[Box],
    config: GraspConfig,
) -> tuple[Grasp, ...]:
    """Distinct grasps from feasible candidates, each turned to its contacts if that is better."""
    turned = _aligned(candidates, evaluation)
    second = evaluate(turned, cloud, segments, gripper, obstacles, config)
    allowed = turned.R_WP[:, 2, 1] <= -np.cos(config.max_tilt)
    better = allowed & (second.score > evaluation.score)
    R_WP = np.where(better[:, None, None], turned.R_WP, candidates.R_WP)
    final = evaluation.replaced(better, second)
    order = _distinct(dc.replace(candidates, R_WP=R_WP), final, config)
    return tuple(_as_grasp(R_WP[k], final, k, gripper) for k in order)


def _aligned(candidates: Candidates, evaluation: Evaluation) -> Candidates:
    """The candidates, turned to close along their mean contact normals, where they were centred.

    Of all approaches perpendicular to the new closing axis each takes the one nearest to its own.
    """
    x, y = evaluation.contact_axis, candidates.R_WP[:, :, 1]
    y = y - np.sum(x * y, axis=1, keepdims=True) * x
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    R_WP = np.stack([x, y, np.cross(x, y)], axis=-1)
    return dc.replace(candidates, R_WP=R_WP, p_WP=evaluation.p_WP, seed=np.arange(len(candidates)))


def _distinct(
    candidates: Candidates, evaluation: Evaluation, config: GraspConfig
) -> NDArray[np.int64]:
    """Indices of the best feasible candidates, best first, none near a better one.

    Half a turn of the hand about its approach is no difference.
    """
    left = np.argsort(-evaluation.score, kind="stable")
    left = left[np.isfinite(evaluation.score[left])]
    kept = []
    while len(left) > 0 and len(kept) < config.max_grasps:
        best, left = left[0], left[1:]
        kept.append(best)
        distance = np.linalg.norm(evaluation.p_WP[left] - evaluation.p_WP[best], axis=1)
        # The diagonal of R_best^T R; half a turn about y flips its first and last entries.
        d = np.sum(candidates.R_WP[best] * candidates.R_WP[left], axis=1)
        trace = d[:, 1] + np.abs(d[:, 0] + d[:, 2])
        alike = (distance < config.min_distance) & (0.5 * (trace - 1.0) > np.cos(config.min_angle))
        left = left[~alike]
    return np.array(kept, dtype=np.int64)


def _as_grasp(
    R_WP: NDArray[np.float64], evaluation: Evaluation, k: int, gripper: ParallelGripper
) -> Grasp:
    """Row k of the evaluation as a grasp."""
    return Grasp(
        X_WG=RigidTransform(RotationMatrix(R_WP), evaluation.p_WP[k] - R_WP @ gripper.p_GPad),
        width=float(evaluation.width[k]),
        span=float(evaluation.span[k]),
        score=float(evaluation.score[k]),
        breakdown={name: float(term[k]) for name, term in evaluation.terms.items()},
    )
