"""Registration in the plane, step by step: small enough to be looked at.

Poses are (3, 3) homogeneous matrices X_WO. For points in space see
:func:`~prehensile.perception.registration.icp` and
:func:`~prehensile.perception.registration.coherent_point_drift`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native.kd_tree import KdTree
from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.point_drift import PointDriftConfig, drift
from prehensile.perception.registration.result import RegistrationStatus, residual_limit


@dataclass(frozen=True, eq=False)
class PlanarStep:
    """One step on the way.

    Attributes:
        X_WO: (3, 3) the pose before the step.
        correspondences: (N,) for each scene point the model point it is matched with at that pose;
            -1 for none. None where correspondences are soft.
    """

    X_WO: NDArray[np.float64]
    correspondences: NDArray[np.int32] | None


@dataclass(frozen=True, eq=False)
class PlanarResult:
    """A pose in the plane.

    Attributes:
        status: ``SUCCESS``, ``NOT_CONVERGED``, ``DEGENERATE`` (the partners fix no rotation) or
            ``LOW_OVERLAP`` (no pose: fewer than two points have partners; or with a pose that is no
            fit).
        X_WO: (3, 3) the pose; None where there is none.
        residual: root mean square distance of the inliers from their partners [m].
        inliers: (N,) bool, which scene points took part.
        iterations: steps made.
        history: the steps; the last one has the final pose.
    """

    status: RegistrationStatus
    X_WO: NDArray[np.float64] | None
    residual: float
    inliers: NDArray[np.bool_]
    iterations: int
    history: list[PlanarStep]

    @property
    def succeeded(self) -> bool:
        """Whether the status is ``SUCCESS``."""
        return self.status is RegistrationStatus.SUCCESS


def planar_pose(angle: float, translation: ArrayLike) -> NDArray[np.float64]:
    """The pose (3, 3) of a frame turned by an angle [rad] and moved by a translation (2,) [m]."""
    X = np.eye(3)
    c, s = np.cos(angle), np.sin(angle)
    X[:2, :2] = [[c, -s], [s, c]]
    X[:2, 2] = translation
    return X


def icp_2d(
    scene: ArrayLike,
    model: ArrayLike,
    X_WO_guess: ArrayLike,
    *,
    max_distance: float = np.inf,
    kept_fraction: float = 1.0,
    max_iterations: int = 100,
) -> PlanarResult:
    """Iterative closest points, point to point, in the plane (Besl and McKay, PAMI 1992).

    Each scene point is matched with the nearest model point. It has converged when no match
    changes, which must happen if nothing is left out, since every step lessens the same sum.

    Args:
        scene: (N, 2) in W [m], N >= 2.
        model: (M, 2) in O [m], M >= 1.
        X_WO_guess: (3, 3) where to start.
        max_distance: pairs further apart are left out [m], > 0.
        kept_fraction: the part of the pairs that counts, the nearest ones, in (0, 1] (trimmed ICP).
        max_iterations: at least 1.

    Returns:
        The pose and the way to it.

    Raises:
        ValueError: if an argument is malformed; the message names it.
    """
    s, m, X = _arguments(scene, model, X_WO_guess)
    if not max_distance > 0:
        raise ValueError(f"max_distance: must be positive, not {max_distance}")
    if not 0 < kept_fraction <= 1:
        raise ValueError(f"kept_fraction: must be in (0, 1], not {kept_fraction}")
    if max_iterations < 1:
        raise ValueError(f"max_iterations: must be at least 1, not {max_iterations}")
    tree = KdTree(_flat(m))
    history: list[PlanarStep] = []
    previous, status, residual = None, RegistrationStatus.NOT_CONVERGED, np.nan
    while True:
        in_O = (s - X[:2, 2]) @ X[:2, :2]
        index, distance = tree.nearest(_flat(in_O), max_distance=max_distance)
        partners = _trimmed(index[:, 0].copy(), distance[:, 0], kept_fraction)
        history.append(PlanarStep(X, partners))
        kept = partners >= 0
        if kept.sum() < 2:
            return PlanarResult(
                RegistrationStatus.LOW_OVERLAP, None, np.nan, kept, len(history) - 1, history
            )
        residual = float(np.sqrt(np.mean(distance[kept, 0] ** 2)))
        if status is RegistrationStatus.DEGENERATE:
            break
        if previous is not None and np.array_equal(partners, previous):
            status = RegistrationStatus.SUCCESS
            break
        if len(history) > max_iterations:
            break
        fit = fit_rigid(m[partners[kept]], s[kept])
        if not fit.succeeded:
            status = RegistrationStatus.DEGENERATE
        X = np.eye(3)
        X[:2, :2], X[:2, 2] = fit.R_WO, fit.p_WO
        previous = partners
    return PlanarResult(status, X, residual, kept, len(history) - 1, history)


def point_drift_2d(
    scene: ArrayLike,
    model: ArrayLike,
    X_WO_guess: ArrayLike | None = None,
    config: PointDriftConfig | None = None,
) -> PlanarResult:
    """Rigid coherent point drift in the plane.

    Args:
        scene: (N, 2) in W [m], N >= 2.
        model: (M, 2) in O [m], M >= 1.
        X_WO_guess: (3, 3) where to start; identity if not given.
        config: how; the defaults if not given.

    Returns:
        The pose and the way to it, without correspondences.

    Raises:
        ValueError: if an argument is malformed; the message names it.
    """
    config = config or PointDriftConfig()
    s, m, X = _arguments(scene, model, np.eye(3) if X_WO_guess is None else X_WO_guess)
    X4 = np.eye(4)
    X4[:2, :2], X4[:2, 3] = X[:2, :2], X[:2, 2]
    found = drift(_flat(s), _flat(m), X4, 2, config, keep_history=True)
    planar = np.ix_([0, 1, 3], [0, 1, 3])
    history = [PlanarStep(pose[planar], None) for pose in found["history"]]
    inliers, iterations = found["probabilities"] > 0.5, found["iterations"]
    if found["num_explained"] <= 1e-6:
        return PlanarResult(
            RegistrationStatus.LOW_OVERLAP, None, np.nan, inliers, iterations, history
        )
    scale = found["num_explained"] * max(found["length_scale"], 1e-12) ** 2
    residual = float(np.sqrt(2) * found["sigma"])
    status = RegistrationStatus.SUCCESS
    if found["num_explained"] < config.min_overlap * len(s):
        status = RegistrationStatus.LOW_OVERLAP
    elif found["rotation_information"][2, 2] <= config.min_eigenvalue_ratio * scale:
        status = RegistrationStatus.DEGENERATE
    elif not residual <= residual_limit(m, config.max_residual):
        status = RegistrationStatus.LOW_OVERLAP
    elif not found["converged"]:
        status = RegistrationStatus.NOT_CONVERGED
    return PlanarResult(status, history[-1].X_WO, residual, inliers, iterations, history)


def _arguments(
    scene: ArrayLike, model: ArrayLike, X_WO_guess: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The arguments as arrays, checked."""
    s, m, X = (np.asarray(a, dtype=float) for a in (scene, model, X_WO_guess))
    for name, points, least in (("scene", s, 2), ("model", m, 1)):
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"{name}: expected shape (N, 2), not {points.shape}")
        if len(points) < least:
            raise ValueError(f"{name}: needs at least {least} points, not {len(points)}")
        if not within(points, FARTHEST):
            raise ValueError(f"{name}: must be finite, and none beyond {FARTHEST:g}")
    rigid = X.shape == (3, 3) and bool(
        np.abs(X[:2, :2] @ X[:2, :2].T - np.eye(2)).max() < 1e-6
        and np.linalg.det(X[:2, :2]) > 0
        and np.array_equal(X[2], [0, 0, 1])
        and np.isfinite(X).all()
    )
    if not rigid:
        raise ValueError("X_WO_guess: is no pose in the plane")
    return s, m, X


def _flat(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of the plane (N, 2) as points in space (N, 3), z = 0."""
    return np.concatenate([points, np.zeros((len(points), 1))], axis=1)


def _trimmed(
    partners: NDArray[np.int32], distances: NDArray[np.float64], kept_fraction: float
) -> NDArray[np.int32]:
    """The partners, -1 for all but the nearest part of those that have one."""
    found = np.flatnonzero(partners >= 0)
    kept = int(np.ceil(kept_fraction * len(found)))
    partners[found[np.argsort(distances[found], kind="stable")[kept:]]] = -1
    return partners
