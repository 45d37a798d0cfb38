"""Poses from known correspondences inside half-spaces, by convex relaxation.

That every point p + R m lies in a half-space is linear in R and p; only the rotation is not
convex. Relaxed, R may be any point of a convex set that contains the rotations. The optimum of
the relaxed problem is a lower bound of the true one's; where its R is a rotation, it is the true
optimum, certified. Where it is not, the relaxation shrinks the object to explain the data.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from prehensile.perception.registration.constraints import (
    HalfSpaces,
    Moments,
    corner_points,
    translations_inside,
)
from prehensile.perception.registration.known import fit_rigid
from prehensile.perception.registration.result import RegistrationResult, RegistrationStatus
from prehensile.perception.registration.sequential_qp import nearest_in_polyhedron

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ConvexFit:
    """A relaxed pose, the true pose that is made of it, and how far they are apart.

    Attributes:
        registration: the pose after the relaxed R is replaced by the nearest rotation and the
            object is moved by the smallest translation into the half-spaces. SUCCESS only if the
            relaxation is tight; INFEASIBLE if there is no pose, relaxed or true; NOT_CONVERGED
            where there is one that the bound does not certify. ``iterations`` is 1.
        R_WO: (d, d) relaxed R, perhaps no rotation; None if infeasible.
        p_WO: (d,) relaxed translation [m]; None if infeasible.
        lower_bound: no pose inside the half-spaces has a smaller sum of squares [m^2].
        cost: the sum of squares at ``registration.X_WO`` [m^2]; infinite without a pose.
        rotation_error: largest |s - 1| of the singular values s of the relaxed R; 1 for a shrunk
            R of determinant <= 0. Zero where the relaxation is tight.
    """

    registration: RegistrationResult
    R_WO: Array | None
    p_WO: Array | None
    lower_bound: float
    cost: float
    rotation_error: float

    @property
    def gap(self) -> float:
        """How much better than the pose found any pose could be at most [m^2], >= 0."""
        return max(self.cost - self.lower_bound, 0.0)


def fit_rigid_convex(
    model_points: ArrayLike,
    scene_points: ArrayLike,
    half_spaces: HalfSpaces,
    *,
    constrained_points: ArrayLike | None = None,
    weights: ArrayLike | None = None,
    relaxation: Literal["convex_hull", "columns"] = "convex_hull",
    objective: Literal["distances", "correlation"] = "distances",
    tight: float = 1e-3,
) -> ConvexFit:
    """The relaxation of :func:`.fit_rigid_constrained` to a convex program.

    In the plane R = [[a, -b], [b, a]] with a^2 + b^2 <= 1: a second-order cone program. In space
    ``convex_hull`` is the convex hull of the rotations: R is the linear image of a positive
    semidefinite 4 x 4 matrix of trace 1, which stands for q q^T with a unit quaternion q
    (Saunderson, Parrilo and Willsky, "Semidefinite descriptions of the convex hull of rotation
    matrices", SIAM J. Optimization 2015). ``columns`` only keeps the columns of R within the unit
    ball, a second-order cone program that also reflections satisfy: cheaper and looser.

    The objective ``distances`` is the sum of w |p + R m - s|^2 as it stands, quadratic in R: it
    gains by a smaller R where points are noisy or held off, so that it is seldom exactly tight.
    ``correlation`` puts in |R m| = |m|, which is true of every rotation and makes the objective
    linear in R but for the mean: over the convex hull its bound is never lower, since |R m| <= |m|
    there, and without constraints it is tight. (``columns`` has no such R, and is loose with it.)

    Args:
        model_points: (N, d) points m in O [m], d = 2 or 3.
        scene_points: (N, d) points s in W [m], the partner of each.
        half_spaces: where the object may be.
        constrained_points: (M, d) points of O that must be there; the model points if None.
        weights: (N,) >= 0; all 1 if None.
        relaxation: for d = 3; for d = 2 there is only the disk, which is the convex hull.
        objective: see above.
        tight: largest ``rotation_error`` to count as tight.

    Returns:
        The fit; for d = 2 the pose is the planar one in W's x-y plane.

    Raises:
        ValueError: if an argument has a wrong shape, is not finite or is not a known name.
    """
    if relaxation not in ("convex_hull", "columns"):
        raise ValueError(f"relaxation: must be 'convex_hull' or 'columns', not {relaxation!r}")
    if objective not in ("distances", "correlation"):
        raise ValueError(f"objective: must be 'distances' or 'correlation', not {objective!r}")
    if not tight >= 0:
        raise ValueError(f"tight: must be at least 0, not {tight}")
    unconstrained = fit_rigid(model_points, scene_points, weights)
    model, scene = np.asarray(model_points, float), np.asarray(scene_points, float)
    d = model.shape[1]
    normals, offsets = half_spaces.unit(d)
    corners = corner_points(constrained_points, model)
    w = unconstrained.weights
    moments = Moments.of(model, scene, w)
    used = w > 0

    program = MathematicalProgram()
    x, G = _add_relaxed_rotation(program, d, relaxation)
    p = program.NewContinuousVariables(d, "p")
    variables = np.concatenate([x, p])
    # n . (p + R m) is linear in R's entries, row by row, with the coefficients n m^T.
    turned = np.einsum("ki,mj->kmij", normals, corners).reshape(-1, d * d) @ G
    rows = np.hstack([turned, np.repeat(normals, len(corners), axis=0)])
    lower = np.repeat(offsets, len(corners))
    if len(rows):
        program.AddLinearConstraint(rows, lower, np.full(len(rows), np.inf), variables)
    # In units of the model's size, so that the solver's tolerances mean something.
    unit = moments.length_scale() ** 2 * moments.total
    Q, b, c = _objective(G, moments, objective)
    program.AddQuadraticCost(Q / unit, b / unit, c / unit, variables, is_convex=True)
    solution = ClarabelSolver().Solve(program, None, None)
    if not solution.is_success():
        why = "the relaxation has no solution: no pose keeps the object inside the half-spaces"
        answer = RegistrationResult(
            RegistrationStatus.INFEASIBLE, None, np.nan, used, 1, message=why
        )
        return ConvexFit(answer, None, None, np.inf, np.inf, np.inf)

    R_relaxed = (G @ solution.GetSolution(x)).reshape(d, d)
    p_relaxed = solution.GetSolution(p)
    lower_bound = float(solution.get_optimal_cost()) * unit
    U, singular, Vt = np.linalg.svd(R_relaxed)
    proper = np.ones(d)
    proper[-1] = np.sign(np.linalg.det(U) * np.linalg.det(Vt))
    R_WO = (U * proper) @ Vt
    error = float(np.abs(proper * singular - 1).max())
    mean = R_relaxed @ moments.model_mean + p_relaxed
    allowed = translations_inside(R_WO, corners, normals, offsets)
    inside = nearest_in_polyhedron(mean - R_WO @ moments.model_mean, *allowed)
    if inside is None:
        why = "the relaxed R is no rotation, and the nearest rotation fits nowhere"
        answer = RegistrationResult(
            RegistrationStatus.INFEASIBLE, None, np.nan, used, 1, message=why
        )
        return ConvexFit(answer, R_relaxed, p_relaxed, lower_bound, np.inf, error)
    cost = moments.cost(R_WO, inside[0])
    is_tight = error <= tight
    R_3, p_3 = np.eye(3), np.zeros(3)
    R_3[:d, :d], p_3[:d] = R_WO, inside[0]
    answer = RegistrationResult(
        RegistrationStatus.SUCCESS if is_tight else RegistrationStatus.NOT_CONVERGED,
        RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_3), p_3),
        float(np.sqrt(cost / moments.total)),
        used,
        1,
        message="the relaxation is tight"
        if is_tight
        else f"the relaxation is not tight: R is {error:.2g} away from a rotation",
    )
    return ConvexFit(answer, R_relaxed, p_relaxed, lower_bound, cost, error)


def _no_pose(used: NDArray[np.bool_], why: str) -> RegistrationResult:
    return RegistrationResult(RegistrationStatus.INFEASIBLE, None, np.nan, used, 1, message=why)


def _add_relaxed_rotation(program: Any, d: int, relaxation: str) -> tuple[Any, Array]:
    """Variables x in a convex set, and the (d^2, n) matrix G: R's entries, row by row, are G x."""
    if d == 2:
        x = program.NewContinuousVariables(2, "ab")
        program.AddLorentzConeConstraint(np.eye(3, 2, -1), np.array([1.0, 0, 0]), x)
        return x, np.array([[1.0, 0], [0, -1], [0, 1], [1, 0]])
    if relaxation == "columns":
        R = program.NewContinuousVariables(3, 3, "R")
        for column in R.T:
            program.AddLorentzConeConstraint(np.eye(4, 3, -1), np.array([1.0, 0, 0, 0]), column)
        return R.reshape(-1), np.eye(9)
    Z = program.NewSymmetricContinuousVariables(4, "Z")
    program.AddPositiveSemidefiniteConstraint(Z)
    program.AddLinearEqualityConstraint(np.ones((1, 4)), np.ones(1), np.diagonal(Z))
    # The rotation of a unit quaternion [w, x, y, z] in the products of its numbers, in the order
    # ww, wx, wy, wz, xx, xy, xz, yy, yz, zz.
    G = np.zeros((9, 10))
    G[[0, 4, 8], 0] = 1
    G[[0, 4, 8], [4, 7, 9]] = 1
    G[[0, 0, 4, 4, 8, 8], [7, 9, 4, 9, 4, 7]] = -1
    G[[1, 3, 2, 6, 5, 7], [5, 5, 6, 6, 8, 8]] = 2
    G[[3, 2, 7], [3, 2, 1]] = 2
    G[[1, 6, 5], [3, 2, 1]] = -2
    return Z[np.triu_indices(4)], G


def _objective(G: Array, moments: Moments, objective: str) -> tuple[Array, Array, float]:
    """The sum of squares y . Q y / 2 + b . y + c of y = [x, p]."""
    d = len(moments.model_mean)
    away = np.hstack([np.kron(np.eye(d), moments.model_mean) @ G, np.eye(d)])
    Q = 2 * moments.total * away.T @ away
    b = -2 * moments.total * away.T @ moments.scene_mean
    b[: G.shape[1]] -= 2 * G.T @ moments.C.reshape(-1)
    c = moments.total * float(moments.scene_mean @ moments.scene_mean) + moments.S
    if objective == "correlation":
        c += float(np.trace(moments.M))
    else:
        Q[: G.shape[1], : G.shape[1]] += 2 * G.T @ np.kron(np.eye(d), moments.M) @ G
    return Q, b, c
