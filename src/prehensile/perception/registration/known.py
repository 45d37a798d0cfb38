"""Poses from points whose partners are known: closed forms, in the plane and in space.

Frames: model points are given in O (the object), scene points in W; scene_i = R_WO model_i + p_WO.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.uncertainty import uncertainty_about

# Singular values below this part of the points' spread are rounding errors or as good as that.
_RANK_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class RigidFit:
    """A rotation and translation by least squares, in D = 2 or 3 dimensions.

    Attributes:
        R_WO: (D, D) proper rotation. Where the points leave it open, one of those that fit best.
        p_WO: (D,) position of O's origin [m].
        residual: weighted root mean square distance between partners [m].
        residuals: (N,) distance of each pair [m].
        weights: (N,) as given, or ones.
        status: ``SUCCESS``, or ``DEGENERATE`` where other poses fit as well.
        rotation_information: (D, D), in 2-D (1, 1): second derivative (half of it) of the sum of
            weighted squared distances by a rotation vector in W about the scene's weighted
            centroid [m^2]; for a known rotation, infinite.
        centroid: (D,) the scene's weighted centroid in W [m].
        spread: root mean square distance of the model points from their centroid [m].
    """

    R_WO: NDArray[np.float64]
    p_WO: NDArray[np.float64]
    residual: float
    residuals: NDArray[np.float64]
    weights: NDArray[np.float64]
    status: RegistrationStatus
    rotation_information: NDArray[np.float64]
    centroid: NDArray[np.float64]
    spread: float

    @property
    def succeeded(self) -> bool:
        """Whether the pose is the only best one."""
        return self.status is RegistrationStatus.SUCCESS

    def result(self) -> RegistrationResult:
        """The fit in space as other registrations answer; the inliers are the pairs that weigh.

        The covariance takes the variance from the residuals; with so few points that they leave
        none it is zero.

        Raises:
            ValueError: if this is a fit in the plane.
        """
        if len(self.p_WO) != 3:
            raise ValueError("a fit in the plane has no pose in space")
        used = self.weights > 0
        surplus = 3 * int(used.sum()) - 6
        squares = float(self.weights @ self.residuals**2)
        covariance, free = None, None
        if np.isfinite(self.rotation_information).all():
            information = np.zeros((6, 6))
            information[:3, :3] = self.rotation_information
            information[3:, 3:] = self.weights.sum() * np.eye(3)
            covariance, free = uncertainty_about(
                information,
                squares / surplus if surplus > 0 else 0.0,
                max(self.spread, 1e-12),
                self.p_WO - self.centroid,
                _RANK_TOLERANCE,
            )
        return RegistrationResult(
            status=self.status,
            X_WO=RigidTransform(RotationMatrix.ProjectToRotationMatrix(self.R_WO), self.p_WO),
            residual=self.residual,
            inliers=used,
            iterations=1,
            covariance=covariance,
            free_directions=free,
            message="" if self.succeeded else "other poses fit these points equally well",
        )


def fit_rigid(
    model_points: ArrayLike, scene_points: ArrayLike, weights: ArrayLike | None = None
) -> RigidFit:
    """The rotation and translation that bring points closest to their partners.

    Minimizes the sum of w_i |R_WO model_i + p_WO - scene_i|^2 by the singular value decomposition
    (Arun, Huang and Blostein 1987), over proper rotations only (Umeyama, "Least-squares estimation
    of transformation parameters between two point patterns", PAMI 1991).

    Args:
        model_points: (N, D) in O [m], N >= 1, D = 2 or 3.
        scene_points: (N, D) in W, the partner of each [m].
        weights: (N,) at least 0, not all 0; ones if not given.

    Returns:
        The fit: ``DEGENERATE`` if the rotation is not determined (in space: points on a line; in
        the plane: one point; or partners that fit a reflection so well that rotations tie).

    Raises:
        ValueError: if shapes disagree, there is no point, or a number is not finite.
    """
    model, scene, w = _pairs(model_points, scene_points, weights)
    model_mean = w @ model / w.sum()
    scene_mean = w @ scene / w.sum()
    R, information, determined = _rotation(model - model_mean, scene - scene_mean, w, model, scene)
    return _fit(R, scene_mean - R @ model_mean, model, scene, w, information, determined)


def fit_rotation(
    model_vectors: ArrayLike, scene_vectors: ArrayLike, weights: ArrayLike | None = None
) -> RigidFit:
    """The rotation about the common origin that brings vectors closest to their partners.

    Wahba's problem: minimizes the sum of w_i |R_WO model_i - scene_i|^2 (Markley, "Attitude
    determination using vector observations and the singular value decomposition", 1988).

    Args:
        model_vectors: (N, D) in O, N >= 1, D = 2 or 3.
        scene_vectors: (N, D) in W, the partner of each.
        weights: (N,) at least 0, not all 0; ones if not given.

    Returns:
        The fit, p_WO = 0.

    Raises:
        ValueError: if shapes disagree, there is no vector, or a number is not finite.
    """
    model, scene, w = _pairs(model_vectors, scene_vectors, weights, "vectors")
    R, information, determined = _rotation(model, scene, w, model, scene)
    p = np.zeros(model.shape[1])
    return _fit(R, p, model, scene, w, information, determined)


def fit_translation(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    R_WO: ArrayLike,
    weights: ArrayLike | None = None,
) -> RigidFit:
    """The translation that brings points of known orientation closest to their partners.

    Args:
        model_points: (N, D) in O [m], N >= 1, D = 2 or 3.
        scene_points: (N, D) in W, the partner of each [m].
        R_WO: (D, D) the known rotation.
        weights: (N,) at least 0, not all 0; ones if not given.

    Returns:
        The fit; one point is enough.

    Raises:
        ValueError: if shapes disagree, there is no point, a number is not finite, or R_WO is not
            a rotation.
    """
    model, scene, w = _pairs(model_points, scene_points, weights)
    dimension = model.shape[1]
    R = np.asarray(R_WO, dtype=float)
    if R.shape != (dimension, dimension):
        raise ValueError(f"R_WO: expected shape {(dimension, dimension)}, not {R.shape}")
    if not (np.abs(R @ R.T - np.eye(dimension)).max() < 1e-6 and np.linalg.det(R) > 0):
        raise ValueError("R_WO: is not a rotation")
    p = w @ (scene - model @ R.T) / w.sum()
    size = 1 if dimension == 2 else 3
    return _fit(R, p, model, scene, w, np.full((size, size), np.inf), True)


def _pairs(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    weights: ArrayLike | None,
    kind: str = "points",
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The arguments as arrays, checked."""
    model = np.asarray(model_points, dtype=float)
    scene = np.asarray(scene_points, dtype=float)
    if model.ndim != 2 or model.shape[1] not in (2, 3):
        raise ValueError(f"model_{kind}: expected shape (N, 2) or (N, 3), not {model.shape}")
    if scene.shape != model.shape:
        raise ValueError(
            f"scene_{kind}: expected as many as model_{kind}, {model.shape}, not {scene.shape}"
        )
    if not len(model):
        raise ValueError(f"model_{kind}: there is none")
    w = np.ones(len(model)) if weights is None else np.asarray(weights, dtype=float)
    if w.shape != (len(model),):
        raise ValueError(f"weights: expected shape {(len(model),)}, not {w.shape}")
    for name, array in ((f"model_{kind}", model), (f"scene_{kind}", scene), ("weights", w)):
        if not within(array, FARTHEST):
            raise ValueError(f"{name}: must be finite, and none beyond {FARTHEST:g}")
    if (w < 0).any() or not w.any():
        raise ValueError("weights: must be at least 0 and not all 0")
    return model, scene, w


def _rotation(
    model: NDArray[np.float64],
    scene: NDArray[np.float64],
    w: NDArray[np.float64],
    raw_model: NDArray[np.float64],
    raw_scene: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], bool]:
    """The best rotation of vectors, its information, and whether it is the only one.

    The sum of squares near its minimum is constant + w^T (tr(A) I - A) w for a small turn w, with
    A = sum of w_i scene_i model_i^T times R^T, symmetric, of eigenvalues s_1, ..., +-s_D.
    """
    U, s, Vt = np.linalg.svd((w[:, None] * scene).T @ model)
    signs = np.ones(len(s))
    signs[-1] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    signed = signs * s
    turns = np.array([signed.sum()]) if len(s) == 2 else signed.sum() - signed
    axes = np.eye(1) if len(s) == 2 else U
    # Rounding: of the products, and of the coordinates before a mean was taken off.
    spread = np.sqrt(w @ (model**2).sum(axis=1)) * np.sqrt(w @ (scene**2).sum(axis=1))
    size = max(np.abs(raw_model).max(), np.abs(raw_scene).max())
    rounding = 1e-15 * size * w.sum() * (np.abs(model).max() + np.abs(scene).max())
    # The last number stands for what is lost below the least numbers there are.
    determined = bool(turns.min() > _RANK_TOLERANCE * spread + 10 * rounding + 1e-280 * w.max())
    return (U * signs) @ Vt, (axes * turns) @ axes.T, determined


def _fit(
    R: NDArray[np.float64],
    p: NDArray[np.float64],
    model: NDArray[np.float64],
    scene: NDArray[np.float64],
    w: NDArray[np.float64],
    information: NDArray[np.float64],
    determined: bool,
) -> RigidFit:
    residuals = np.linalg.norm(model @ R.T + p - scene, axis=1)
    total = w.sum()
    return RigidFit(
        R_WO=R,
        p_WO=p,
        residual=float(np.sqrt(w @ residuals**2 / total)),
        residuals=residuals,
        weights=w,
        status=RegistrationStatus.SUCCESS if determined else RegistrationStatus.DEGENERATE,
        rotation_information=information,
        centroid=w @ scene / total,
        spread=float(np.sqrt(w @ ((model - w @ model / total) ** 2).sum(axis=1) / total)),
    )
