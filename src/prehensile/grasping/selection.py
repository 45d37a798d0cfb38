"""The choice of grasps in a scene."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.grasping.candidates import Candidates, antipodal_candidates
from prehensile.grasping.grasp import Grasp, GraspConfig, GraspResult, GraspStatus
from prehensile.grasping.gripper import ParallelGripper
from prehensile.grasping.scoring import Evaluation, evaluate
from prehensile.perception.cloud import Box, Cloud
from prehensile.perception.segmentation import convex_segments


def select_grasps(
    cloud: Cloud,
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
    candidates = antipodal_candidates(cloud, segments, rng, config)
    if len(candidates) == 0:
        return GraspResult(GraspStatus.NO_SIDES)
    first = evaluate(candidates, cloud, segments, gripper, obstacles, config)
    best = np.argsort(-first.score, kind="stable")[: 8 * config.max_grasps]
    best = best[np.isfinite(first.score[best])]
    turned = _aligned(candidates, first, best, config)
    second = evaluate(turned, cloud, segments, gripper, obstacles, config)

    counts = Counter(first.status)
    grasps = _distinct(
        _as_grasps(candidates, first, gripper) + _as_grasps(turned, second, gripper), config
    )
    if grasps:
        return GraspResult(GraspStatus.FOUND, grasps, counts)
    return GraspResult(counts.most_common(1)[0][0], (), counts)


def _aligned(
    candidates: Candidates,
    evaluation: Evaluation,
    rows: NDArray[np.int64],
    config: GraspConfig,
) -> Candidates:
    """The candidates ``rows``, turned to close along their mean contact normal."""
    x = evaluation.contact_axis[rows]
    ok = np.abs(x[:, 2]) < np.sin(config.max_tilt)
    rows, x = rows[ok], x[ok]
    # Keep the approach: of all y perpendicular to the new x, the one nearest to the old y.
    y = candidates.R_WP[rows, :, 1]
    y = y - np.sum(x * y, axis=1, keepdims=True) * x
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    R_WP = np.stack([x, y, np.cross(x, y)], axis=-1)
    turned = Candidates(R_WP, evaluation.p_WP[rows], candidates.segment[rows])
    return turned.select(R_WP[:, 2, 1] <= -np.cos(config.max_tilt))


def _as_grasps(
    candidates: Candidates, evaluation: Evaluation, gripper: ParallelGripper
) -> list[Grasp]:
    """The feasible candidates as grasps."""
    grasps = []
    for k in np.nonzero(np.isfinite(evaluation.score))[0]:
        R = candidates.R_WP[k]
        grasps.append(
            Grasp(
                RigidTransform(
                    RotationMatrix(R), evaluation.p_WP[k] - R @ gripper.p_GPad
                ),
                float(evaluation.width[k]),
                float(evaluation.span[k]),
                float(evaluation.score[k]),
                {name: float(term[k]) for name, term in evaluation.terms.items()},
            )
        )
    return grasps


def _distinct(grasps: list[Grasp], config: GraspConfig) -> tuple[Grasp, ...]:
    """The best grasps, none near a better one; half a turn of the hand is no difference."""
    kept: list[Grasp] = []
    for grasp in sorted(grasps, key=lambda g: -g.score):
        if len(kept) == config.max_grasps:
            break
        if not any(_alike(grasp, other, config) for other in kept):
            kept.append(grasp)
    return tuple(kept)


def _alike(a: Grasp, b: Grasp, config: GraspConfig) -> bool:
    """Whether two grasps are near each other in place and orientation."""
    if np.linalg.norm(a.X_WG.translation() - b.X_WG.translation()) >= config.min_distance:
        return False
    R_AB = a.X_WG.rotation().matrix().T @ b.X_WG.rotation().matrix()
    # tr(R diag(-1, 1, -1)) is the trace after half a turn about y.
    trace = max(np.trace(R_AB), R_AB[1, 1] - R_AB[0, 0] - R_AB[2, 2])
    return bool(0.5 * (trace - 1.0) > np.cos(config.min_angle))
