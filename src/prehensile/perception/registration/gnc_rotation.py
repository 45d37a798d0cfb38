"""Rotations from vectors with wrong partners among them: graduated non-convexity."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core


@dataclass(frozen=True, eq=False)
class RotationEstimate:
    """A rotation by truncated least squares.

    Attributes:
        R_WO: (3, 3).
        inliers: (N,) bool, which vectors agree to within the bound.
        cost: sum of min(|scene_i - R_WO model_i|^2 / bound^2, 1).
        iterations: of weighted least squares.
        converged: whether each weight ended at zero or one.
    """

    R_WO: NDArray[np.float64]
    inliers: NDArray[np.bool_]
    cost: float
    iterations: int
    converged: bool


def gnc_rotation(
    model_vectors: ArrayLike, scene_vectors: ArrayLike, bound: float, *, max_iterations: int = 100
) -> RotationEstimate:
    """Truncated least squares over rotations, without a guess, by graduated non-convexity.

    Solves Wahba's problem with weights, and lets the loss go from a convex one to the truncated one
    meanwhile (Yang, Antonante, Tzoumas and Carlone, "Graduated Non-Convexity for Robust Spatial
    Perception", IEEE RA-L 5(2), 2020). A local method: right up to some 70 to 80 % of wrong
    vectors; :func:`~prehensile.perception.registration.certificate.certify_rotation` says whether
    it was, for few vectors.

    Args:
        model_vectors: (N, 3) in O, N >= 1.
        scene_vectors: (N, 3), the partner of each in W.
        bound: greatest error of a right one, > 0, in the vectors' unit.
        max_iterations: of weighted least squares, at least 1.

    Returns:
        The rotation.

    Raises:
        ValueError: if shapes disagree, there is no vector, or a number is not finite or out of
            range.
    """
    if max_iterations < 1:
        raise ValueError(f"max_iterations: must be at least 1, not {max_iterations}")
    if np.shape(model_vectors) != np.shape(scene_vectors):
        raise ValueError(
            f"scene_vectors: expected shape {np.shape(model_vectors)} as model_vectors, not "
            f"{np.shape(scene_vectors)}"
        )
    R, inliers, cost, iterations, converged = _core.gnc_rotation(
        model_vectors, scene_vectors, bound, max_iterations
    )
    return RotationEstimate(R, inliers.view(bool), cost, iterations, converged)
