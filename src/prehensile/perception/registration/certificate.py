"""Whether a rotation by truncated least squares is the best one: a semidefinite relaxation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RotationMatrix
from pydrake.solvers import CsdpSolver, MathematicalProgram

from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.registration.gnc_rotation import gnc_rotation


@dataclass(frozen=True, eq=False)
class RotationCertificate:
    """A rotation, and how much better another one could be.

    Attributes:
        R_WO: (3, 3), the better of the candidate and the one that the relaxation suggests.
        cost: its sum of min(|scene_i - R_WO model_i|^2 / bound^2, 1).
        lower_bound: no rotation costs less, to within the solver's tolerance (some 1e-5 of a
            vector's cost); NaN if it failed.
        inliers: (N,) bool, which vectors agree to within the bound.
        rank_ratio: second largest eigenvalue of the relaxation's matrix by the largest one: zero
            where the relaxation is tight.
        tight: whether the gap is below a thousandth of a vector's cost.
        solved: whether the solver ended as it should.
    """

    R_WO: NDArray[np.float64]
    cost: float
    lower_bound: float
    inliers: NDArray[np.bool_]
    rank_ratio: float
    tight: bool
    solved: bool

    @property
    def gap(self) -> float:
        """What another rotation could save at most, in vectors that would agree."""
        return self.cost - self.lower_bound


def certify_rotation(
    model_vectors: ArrayLike,
    scene_vectors: ArrayLike,
    bound: float,
    R_WO: ArrayLike | None = None,
    *,
    tight_gap: float = 1e-3,
) -> RotationCertificate:
    """A lower bound on truncated least squares over rotations, and the gap of a candidate.

    With unit quaternion q and a sign for each vector, the problem is quadratic in
    x = [q; s_1 q; ...; s_N q]; x x^T becomes a positive semidefinite matrix whose 4 x 4 blocks
    are symmetric, the diagonal ones all equal (Yang and Carlone, "A Quaternion-based Certifiably
    Optimal Solution to the Wahba Problem with Outliers", ICCV 2019). Its size is 4 (N + 1): meant
    for the few vectors that are left after pruning. Drake's CSDP takes some tenths of a second
    for 6 vectors, a second or more for 10 and several for 12.

    Args:
        model_vectors: (N, 3) in O, N >= 1.
        scene_vectors: (N, 3), the partner of each in W.
        bound: greatest error of a right one, > 0, in the vectors' unit.
        R_WO: (3, 3) the candidate; that of :func:`gnc_rotation` if not given.
        tight_gap: the gap below which the answer counts as tight.

    Returns:
        The rotation, its cost and the bound.

    Raises:
        ValueError: if shapes disagree, there is no vector, or a number is not finite or out of
            range.
    """
    estimate = gnc_rotation(model_vectors, scene_vectors, bound)
    model, scene = np.asarray(model_vectors, float), np.asarray(scene_vectors, float)
    candidate = estimate.R_WO if R_WO is None else np.asarray(R_WO, float)
    proper = candidate.shape == (3, 3) and bool(
        np.allclose(candidate @ candidate.T, np.eye(3), atol=1e-6) and np.linalg.det(candidate) > 0
    )
    if not proper:
        raise ValueError("R_WO: not a rotation matrix")
    forms = _quaternion_forms(model / bound, scene / bound)
    if not within(forms, FARTHEST):
        raise ValueError(f"bound: {bound} is too small for vectors so long")
    Z, lower_bound, solved = _relaxation(forms)
    rank_ratio = float("nan")
    if solved:
        values, vectors = np.linalg.eigh(Z[:4, :4])
        other = _rotation_matrix(vectors[:, -1])
        if _cost(other, model, scene, bound) < _cost(candidate, model, scene, bound):
            candidate = other
        values = np.linalg.eigvalsh(Z)
        rank_ratio = float(max(values[-2], 0.0) / values[-1])
    cost = _cost(candidate, model, scene, bound)
    return RotationCertificate(
        R_WO=candidate,
        cost=cost,
        lower_bound=min(lower_bound, cost) if solved else lower_bound,
        inliers=np.linalg.norm(scene - model @ candidate.T, axis=1) <= bound,
        rank_ratio=rank_ratio,
        tight=bool(cost - lower_bound <= tight_gap),
        solved=solved,
    )


def _cost(
    R: NDArray[np.float64],
    model: NDArray[np.float64],
    scene: NDArray[np.float64],
    bound: float,
) -> float:
    squares = (((scene - model @ R.T) / bound) ** 2).sum(axis=1)
    return float(np.minimum(squares, 1).sum())


def _quaternion_forms(
    model: NDArray[np.float64], scene: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 4, 4) forms M_i with q^T M_i q = |scene_i - R(q) model_i|^2 for unit q = [w, x, y, z]."""
    count = len(model)
    forms = np.empty((count, 4, 4))
    a, b = model, scene
    # q^T P q = b . R(q) a (Horn 1987).
    products = b[:, :, None] * a[:, None, :]
    trace = np.trace(products, axis1=1, axis2=2)
    cross = np.cross(a, b)
    forms[:, 0, 0] = trace
    forms[:, 0, 1:] = forms[:, 1:, 0] = cross
    forms[:, 1:, 1:] = products + products.transpose(0, 2, 1) - trace[:, None, None] * np.eye(3)
    squares = (a**2).sum(axis=1) + (b**2).sum(axis=1)
    return squares[:, None, None] * np.eye(4) - 2 * forms


def _relaxation(forms: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, bool]:
    """Minimizes sum of (1 + s_i) / 2 r_i^2 + (1 - s_i) / 2, s_i = +-1, relaxed. Matrix, minimum."""
    size = 4 * (len(forms) + 1)
    program = MathematicalProgram()
    Z = program.NewSymmetricContinuousVariables(size)
    program.AddPositiveSemidefiniteConstraint(Z)
    program.AddLinearEqualityConstraint(np.ones((1, 4)), np.ones(1), np.diag(Z)[:4])
    upper = np.triu_indices(4)
    strict = np.triu_indices(4, 1)
    rows = []
    for i in range(0, size, 4):
        if i:
            block = Z[i : i + 4, i : i + 4]
            rows += [[a, b] for a, b in zip(block[upper], Z[:4, :4][upper], strict=True)]
        for j in range(i + 4, size, 4):
            block = Z[i : i + 4, j : j + 4]
            rows += [[a, b] for a, b in zip(block[strict], block.T[strict], strict=True)]
    for pair in rows:
        program.AddLinearEqualityConstraint(np.array([[1.0, -1.0]]), np.zeros(1), np.array(pair))
    # Costs of the size of one, for the solver.
    scale = 1 / max(1.0, float(np.abs(forms).max()))
    whole = scale * (forms + np.eye(4)).sum(axis=0) / 2
    program.AddLinearCost(whole.ravel(), 0.0, Z[:4, :4].ravel())
    for i, form in enumerate(forms, start=1):
        coupling = scale * (form - np.eye(4)) / 2
        program.AddLinearCost(coupling.ravel(), 0.0, Z[:4, 4 * i : 4 * i + 4].ravel())
    try:
        result = CsdpSolver().Solve(program, None, None)
    except RuntimeError:  # It gives up on numbers of too different size.
        return np.zeros((4, 4)), float("nan"), False
    if not result.is_success():
        return np.zeros((4, 4)), float("nan"), False
    return np.asarray(result.GetSolution(Z), float), result.get_optimal_cost() / scale, True


def _rotation_matrix(q: NDArray[np.float64]) -> NDArray[np.float64]:
    w, x, y, z = q
    return RotationMatrix.ProjectToRotationMatrix(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
    ).matrix()
