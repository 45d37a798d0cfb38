"""Poses from known correspondences when the object must not enter half-spaces.

A table top, the walls of a bin and a floor are half-spaces that no point of an object can be in.
Noise and bad returns pull an unconstrained fit into them. Here the pose is found by nonlinear
optimization over rotations proper; :mod:`.convex_constraints` has the convex relaxations.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix
from scipy.linalg import null_space
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.sequential_qp import (
    Minimum,
    Quadratic,
    minimize_over_poses,
    nearest_in_polyhedron,
)

Array = NDArray[np.float64]


_MOST_STARTS = 100_000


class HalfSpaces(NamedTuple):
    """The points x of W with normal . x >= offset for every row.

    Attributes:
        normals: (k, d) of any length but zero, pointing to the allowed side; d is 2 or 3.
        offsets: (k,) [m, times the length of the normal].
    """

    normals: ArrayLike
    offsets: ArrayLike

    @classmethod
    def box(cls, lower: ArrayLike, upper: ArrayLike) -> "HalfSpaces":
        """The inside of a box along the axes of W; infinite where a side is open.

        Args:
            lower: (d,) smallest coordinates [m], -inf for none.
            upper: (d,) largest coordinates [m], inf for none.
        """
        low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        eye = np.eye(len(low))
        normals, offsets = np.vstack([eye, -eye]), np.concatenate([low, -high])
        bounded = np.isfinite(offsets)
        return cls(normals[bounded], offsets[bounded])

    def unit(self, dimensions: int) -> tuple[Array, Array]:
        """Unit normals (k, d) and their offsets (k,).

        Raises:
            ValueError: if shapes disagree, a number is not finite or a normal is zero.
        """
        normals, offsets = np.asarray(self.normals, float), np.asarray(self.offsets, float)
        if offsets.ndim != 1 or normals.shape != (len(offsets), dimensions):
            raise ValueError(
                f"half_spaces: normals {normals.shape} and offsets {offsets.shape} must be "
                f"(k, {dimensions}) and (k,)"
            )
        length = np.linalg.norm(normals, axis=1)
        if not (within(normals, FARTHEST) and np.isfinite(offsets).all() and (length > 0).all()):
            raise ValueError("half_spaces: must be finite, and no normal zero")
        if not within(offsets / length, FARTHEST):
            raise ValueError(f"half_spaces: a plane lies beyond {FARTHEST:g} m")
        return normals / length[:, None], offsets / length


class Moments(NamedTuple):
    """All that the sum of squared distances of pairs of points needs of them.

    sum w |p + R m - s|^2 = W |p + R m0 - s0|^2 - 2 tr(R^T C) + tr(R M R^T) + S.

    Attributes:
        total: W, the sum of the weights.
        scene_mean: (d,) s0.
        model_mean: (d,) m0.
        C: (d, d) sum of w (s - s0) (m - m0)^T.
        M: (d, d) sum of w (m - m0) (m - m0)^T.
        S: sum of w |s - s0|^2.
    """

    total: float
    scene_mean: Array
    model_mean: Array
    C: Array
    M: Array
    S: float

    @classmethod
    def of(cls, model: Array, scene: Array, weights: Array) -> "Moments":
        """The moments of points (N, d) with weights (N,)."""
        total = float(weights.sum())
        s0, m0 = weights @ scene / total, weights @ model / total
        s, m = scene - s0, model - m0
        weighted = weights[:, None] * m
        S = float(weights @ (s * s).sum(axis=1))
        return cls(total, s0, m0, s.T @ weighted, m.T @ weighted, S)

    def cost(self, R: Array, p: Array) -> float:
        """Sum of w |p + R m - s|^2 for any matrix R."""
        away = p + R @ self.model_mean - self.scene_mean
        shape = np.trace(R @ self.M @ R.T) - 2 * np.sum(R * self.C)
        return max(float(self.total * away @ away + shape + self.S), 0.0)

    def length_scale(self) -> float:
        """Root mean square distance of the model's points from their mean [m]; 1 if that is 0."""
        return float(np.sqrt(np.trace(self.M) / self.total)) or 1.0


def fit_rigid_constrained(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    half_spaces: HalfSpaces,
    *,
    constrained_points: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    X_WO_guess: RigidTransform | None = None,
    num_starts: int = 8,
    seed: int = 0,
) -> RegistrationResult:
    """The pose nearest to known correspondences that keeps the object inside half-spaces.

    Minimizes sum_i w_i |p + R m_i - s_i|^2 over rotations R and translations p, subject to
    n_k . (p + R c_j) >= d_k for every half-space k and constrained point c_j. Only the corners of
    the constrained points' convex hull are looked at. Local optimization from several starts: the
    unconstrained optimum, the guess, and random rotations, each first pushed out of the half-
    spaces by the smallest translation.

    Args:
        model_points: (N, d) points m in O [m], d = 2 or 3.
        scene_points: (N, d) points s in W [m], the partner of each.
        half_spaces: where the object may be.
        constrained_points: (M, d) points of O that must be there; the model points if None.
        weights: (N,) >= 0; all 1 if None.
        X_WO_guess: one more start.
        num_starts: starts without the guess, 1 to 100 000.
        seed: of the random starts.

    Returns:
        For d = 2 the pose is the planar one in W's x-y plane. ``residual`` is over all points with
        weight; the covariance is that of motions along the constraints that hold with equality,
        and ``free_directions`` tells what neither points nor constraints determine. INFEASIBLE if
        no start led to a pose inside the half-spaces.

    Raises:
        ValueError: if an argument has a wrong shape or is not finite.
    """
    if not 1 <= num_starts <= _MOST_STARTS:
        raise ValueError(f"num_starts: must be 1 to {_MOST_STARTS}, not {num_starts}")
    if X_WO_guess is not None and not np.isfinite(X_WO_guess.translation()).all():
        raise ValueError("X_WO_guess: must be finite")
    unconstrained = fit_rigid(model_points, scene_points, weights)
    model, scene = np.asarray(model_points, float), np.asarray(scene_points, float)
    dimensions = model.shape[1]
    normals, offsets = half_spaces.unit(dimensions)
    corners = _embedded(corner_points(constrained_points, model))
    normals = _embedded(normals)
    w = unconstrained.weights
    moments = Moments.of(_embedded(model), _embedded(scene), w)
    scale = moments.length_scale()
    basis = np.eye(6) if dimensions == 3 else np.eye(6)[:, [2, 3, 4]]
    first = np.eye(3)
    first[:dimensions, :dimensions] = unconstrained.R_WO
    starts = [first, *_turned(first, dimensions, num_starts - 1, seed)]
    if X_WO_guess is not None:
        starts.append(np.array(X_WO_guess.rotation().matrix()))
    best: Minimum | None = None
    for R in starts:
        p = moments.scene_mean - R @ moments.model_mean
        inside = nearest_in_polyhedron(p, *translations_inside(R, corners, normals, offsets))
        found = minimize_over_poses(
            lambda R, p: _quadratic(moments, R, p),
            corners,
            normals,
            offsets,
            R,
            p if inside is None else inside[0],
            basis=basis,
            length_scale=scale,
        )
        if found.violation > 1e-6 * scale:
            continue
        if best is None or found.quadratic.cost < best.quadratic.cost - 1e-12 * moments.S:
            best = found
    if best is None:
        return RegistrationResult(
            RegistrationStatus.INFEASIBLE,
            None,
            np.nan,
            w > 0,
            0,
            message="no pose was found that keeps the object inside the half-spaces",
        )
    residual_freedom = dimensions * int((w > 0).sum())
    answer = _answer(moments, w > 0, residual_freedom, best, basis, scale)
    if answer.succeeded and not unconstrained.succeeded and not len(best.active):
        # Points that coincide in the scene, say: the distances stay the same for any turn.
        message = "other poses fit these points equally well"
        answer = replace(answer, status=RegistrationStatus.DEGENERATE, message=message)
    return answer


def corner_points(constrained_points: ArrayLike | None, model: Array) -> Array:
    """The corners of the convex hull of the points to constrain (the model's if None).

    Raises:
        ValueError: if they are not (M, d) finite numbers with M >= 1.
    """
    if constrained_points is None:
        points = model
    else:
        points = np.asarray(constrained_points, float)
        if points.ndim != 2 or points.shape[1] != model.shape[1] or not len(points):
            raise ValueError(
                f"constrained_points: expected (M, {model.shape[1]}), not {points.shape}"
            )
        if not within(points, FARTHEST):
            raise ValueError(f"constrained_points: must be finite, none beyond {FARTHEST:g}")
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:  # Flat, or too few: all of them.
        return points


def translations_inside(
    R: Array, corners: Array, normals: Array, offsets: Array
) -> tuple[Array, Array]:
    """The translations p that keep the corners inside: rows (A, c) with A p >= c."""
    if not len(normals):
        return normals, offsets
    return normals, offsets - (normals @ R @ corners.T).min(axis=1)


def _embedded(vectors: Array) -> Array:
    """Rows (., 2) in the x-y plane of space; rows (., 3) as they are."""
    return vectors if vectors.shape[1] == 3 else np.pad(vectors, ((0, 0), (0, 1)))


def _quadratic(moments: Moments, R: Array, p: Array) -> Quadratic:
    """The sum of squared distances near a pose in space: r = p + R m - s, J = [-[R m]x, I]."""
    away = p + R @ moments.model_mean - moments.scene_mean
    arm = R @ moments.model_mean
    about_mean = R @ moments.M @ R.T
    spread = about_mean + moments.total * np.outer(arm, arm)
    mixed = R @ moments.C.T  # sum of w (R m) s^T about the means
    twist = np.array(
        [mixed[1, 2] - mixed[2, 1], mixed[2, 0] - mixed[0, 2], mixed[0, 1] - mixed[1, 0]]
    )  # sum of w (R m) x s about the means
    gradient = moments.total * np.concatenate([np.cross(arm, away), away])
    gradient[:3] -= twist
    information = np.zeros((6, 6))
    information[:3, :3] = np.trace(spread) * np.eye(3) - spread
    hat = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
    information[:3, 3:] = moments.total * hat
    information[3:, :3] = moments.total * hat.T
    information[3:, 3:] = moments.total * np.eye(3)
    return Quadratic(moments.cost(R, p), gradient, information)


def _turned(first: Array, dimensions: int, count: int, seed: int) -> list[Array]:
    """More rotations (3, 3) to start from: evenly around in the plane, random in space."""
    if dimensions == 3:
        rng = np.random.default_rng(seed)
        quaternions = rng.normal(size=(count, 4))
        return [Rotation.from_quat(q).as_matrix() for q in quaternions]
    turns = 2 * np.pi * np.arange(1, count + 1) / (count + 1)
    return [Rotation.from_rotvec([0, 0, t]).as_matrix() @ first for t in turns]


def _answer(
    moments: Moments,
    used: NDArray[np.bool_],
    num_residuals: int,
    best: Minimum,
    basis: Array,
    scale: float,
) -> RegistrationResult:
    """The result at a minimum, with what the points and the active constraints leave unsure."""
    lengths = np.array([1 / scale] * 3 + [1.0] * 3)
    unit = basis * lengths[:, None]
    if len(best.active):
        unit = unit @ null_space(best.active @ unit, rcond=1e-6)
    values, vectors = np.linalg.eigh(unit.T @ best.quadratic.information @ unit)
    free = values <= 1e-9 * moments.total
    directions = unit @ vectors
    variance = best.quadratic.cost / max(num_residuals - len(values), 1)
    kept = directions[:, ~free]
    status, message = RegistrationStatus.SUCCESS, f"{len(best.active)} constraints are active"
    if not best.converged:
        status, message = RegistrationStatus.NOT_CONVERGED, "the iterations ran out"
    elif free.any():
        status = RegistrationStatus.DEGENERATE
        message = "a motion is left free: the points are too few, equal or on a line"
    return RegistrationResult(
        status,
        RigidTransform(RotationMatrix.ProjectToRotationMatrix(best.R_WO), best.p_WO),
        float(np.sqrt(best.quadratic.cost / moments.total)),
        used,
        best.iterations,
        variance * (kept / values[~free]) @ kept.T,
        (directions[:, free] / lengths[:, None]).T,
        message,
    )
