"""The best pose of all, for small clouds, with a bound on what is left to gain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.native import _core
from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus


@dataclass(frozen=True, eq=False)
class BranchAndBoundResult(RegistrationResult):
    """A pose and how far from the best one it can be.

    Attributes:
        cost: sum of min(distance, max_distance)^2 over the scene points [m^2].
        lower_bound: no pose costs less [m^2].
        nodes: boxes of rotations that were bounded; ``iterations`` is the same number.
    """

    cost: float = 0.0
    lower_bound: float = 0.0
    nodes: int = 0

    @property
    def gap(self) -> float:
        """What another pose could save at most [m^2]."""
        return self.cost - self.lower_bound


def branch_and_bound(
    scene_points: ArrayLike,
    model_points: ArrayLike,
    *,
    gap_distance: float | None = None,
    max_distance: float = np.inf,
    max_nodes: int = 100_000,
    time_limit: float = np.inf,
) -> BranchAndBoundResult:
    """Global minimum of the sum of squared distances to the nearest model points, over all poses.

    Boxes of rotation vectors, and for each of them boxes of translations, are split until no box
    can hold a pose that is better by more than the gap; whatever improves on the best pose is made
    a local minimum by iterative closest points (Yang, Li, Campbell and Jia, "Go-ICP", PAMI 38(11),
    2016). The time grows steeply with the part of the bounds that the gap is: some tens of points
    in space take seconds, in the plane milliseconds. Of poses that are equally good (a symmetric
    object) one is found.

    Args:
        scene_points: (N, 3) in W [m], N >= 1; or (N, 2): then only turns and shifts in the plane.
        model_points: (M, 3) or (M, 2) in O [m], M >= 1.
        gap_distance: the search ends when the mean squared distance is known to within the square
            of this [m]; a hundredth of the model's radius if not given.
        max_distance: distances beyond it count as it (truncated least squares) [m].
        max_nodes: boxes of rotations at most.
        time_limit: about the most seconds; a search ended by it depends on the machine's speed.

    Returns:
        ``SUCCESS`` if the gap was reached, else ``NOT_CONVERGED``, with the best pose so far and
        the bound that holds for it. Inliers are the scene points within max_distance. The best
        pose may still mean nothing: ``DEGENERATE`` where inliers or model lie on a line (in the
        plane: at one place), ``LOW_OVERLAP`` where there are no inliers. That the best pose is
        a good one only ``residual`` tells: unlike clouds have a best pose, too.

    Raises:
        ValueError: if shapes disagree, there are no points, or a number is not finite or out of
            range.
    """
    scene, model = np.asarray(scene_points, float), np.asarray(model_points, float)
    for name, points in (("scene_points", scene), ("model_points", model)):
        if points.ndim != 2 or points.shape[1] not in (2, 3) or not len(points):
            raise ValueError(f"{name}: expected shape (N, 3) or (N, 2), N >= 1, not {points.shape}")
        if not within(points, FARTHEST):
            raise ValueError(f"{name}: must be finite, and none beyond {FARTHEST:g}")
    if scene.shape[1] != model.shape[1]:
        raise ValueError(f"scene_points: in {scene.shape[1]} dimensions, the model is not")
    planar = scene.shape[1] == 2
    if planar:
        scene, model = (np.pad(points, ((0, 0), (0, 1))) for points in (scene, model))
    if gap_distance is None:
        gap_distance = 0.01 * float(np.linalg.norm(model - model.mean(axis=0), axis=1).max())
    if not 0 <= gap_distance <= FARTHEST:
        raise ValueError(f"gap_distance: must be from 0 to {FARTHEST:g}, not {gap_distance}")
    X_OW, cost, lower_bound, closed, nodes = _core.branch_and_bound(
        scene, model, max_distance, len(scene) * gap_distance**2, planar, max_nodes, time_limit
    )
    X_WO = RigidTransform(RotationMatrix.ProjectToRotationMatrix(X_OW[:3, :3]), X_OW[:3, 3])
    moved = scene @ X_OW[:3, :3].T + X_OW[:3, 3]
    squares = ((moved[:, None] - model) ** 2).sum(axis=2).min(axis=1)
    inliers = squares <= max_distance * max_distance
    residual = float(np.sqrt(squares[inliers].mean())) if inliers.any() else float("nan")
    status, message = RegistrationStatus.SUCCESS, ""
    if not closed:
        status = RegistrationStatus.NOT_CONVERGED
        message = "a limit ended the search: better poses are not excluded"
    elif not inliers.any():
        status, message = RegistrationStatus.LOW_OVERLAP, "no scene point reaches the model"
    elif _turns_free(scene[inliers]) or _turns_free(model):
        status = RegistrationStatus.DEGENERATE
        message = "the points lie on a line, or at one place, and leave turns free"
    return BranchAndBoundResult(
        status=status,
        X_WO=X_WO.inverse(),
        residual=residual,
        inliers=inliers,
        iterations=nodes,
        message=message,
        cost=cost,
        lower_bound=lower_bound,
        nodes=nodes,
    )


def _turns_free(points: NDArray[np.float64]) -> bool:
    """Whether a turn moves none of the points: in space (N, 3) about a line that they lie on, in
    the plane (z = 0 for all of them) about the place where all are."""
    planar = not points[:, 2].any()
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    spread = np.pad(spread, (0, 3))
    return bool(spread[0 if planar else 1] <= 1e-9 * max(spread[0], np.abs(points).max()))
