"""What a Jacobian tells about a place: rank, manipulability, how near a singularity is.

A Jacobian J is (m, n): V = J v for joint velocities v (n,) and a task velocity V (m,). The measures
take any m, and stacks (..., m, n) where they say so. A J that is not finite or of another shape
raises ValueError.

Units. The geometric Jacobian of a frame, (6, n), gives three angular velocities (rad/s) and then
three translational ones (m/s). Singular values, condition number and manipulability of all six
rows add radians to metres: their values change with the unit of length, and so may the order of
two configurations. :func:`task_rows` therefore takes one part alone, or both with a characteristic
length L that turns the translational rows into v / L, all in 1/s. A usual L is the reach of the
arm, or the distance from the frame to the point that matters in the task. The rank does not depend
on L, but for its tolerance.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native.kinematic_tree import KinematicTree

Part = Literal["rotational", "translational", "both"]


def task_rows(J: ArrayLike, part: Part, *, length: float | None = None) -> NDArray[np.float64]:
    """The rows of a geometric Jacobian that are to be measured, in one unit.

    Args:
        J: (..., 6, n), rotational rows first.
        part: "rotational" (rows in 1), "translational" (m per unit of the joint), or "both".
        length: characteristic length L (m, > 0) by which the translational rows are divided;
            needed for "both", may be given for "translational".

    Returns:
        (..., 3, n), or (..., 6, n) for both.

    Raises:
        ValueError: J has not six rows, an unknown part, no length for both or not a positive one.
    """
    J = np.array(J, dtype=float)
    if J.ndim < 2 or J.shape[-2] != 6:
        raise ValueError(f"J: expected (..., 6, n), not {J.shape}")
    if length is not None:
        if not (length > 0 and np.isfinite(length)):
            raise ValueError(f"length: must be positive and finite, not {length}")
        J[..., 3:, :] /= length
    match part:
        case "rotational":
            return J[..., :3, :]
        case "translational":
            return J[..., 3:, :]
        case "both":
            if length is None:
                raise ValueError("length: needed to compare rotations with translations")
            return J
    raise ValueError(f"part: must be rotational, translational or both, not {part!r}")


def singular_values(J: ArrayLike) -> NDArray[np.float64]:
    """Singular values σ₁ ≥ σ₂ ≥ ... ≥ 0 of J (..., m, n): (..., min(m, n)).

    With n ≥ m, joint velocities of |v| ≤ 1 make a task speed of σ₁ in the best direction and of
    σₘ in the worst.
    """
    return np.asarray(np.linalg.svd(_finite(J), compute_uv=False), dtype=float)


def rank(J: ArrayLike, *, tolerance: float | None = None) -> int:
    """Number of task directions in which the joints can move at all.

    Args:
        J: (m, n).
        tolerance: a singular value counts as zero if it is at most this share of the largest
            (0..1); default: max(m, n) times the rounding unit 2.2e-16, what rounding in J makes
            of a zero. Take 1e-3, say, to ask for directions of practical use.

    Raises:
        ValueError: J is no matrix, or the tolerance is out of range.
    """
    J = np.asarray(J, dtype=float)
    if J.ndim != 2:
        raise ValueError(f"J: expected (m, n), not {J.shape}")
    least = max(J.shape) * float(np.finfo(float).eps) if tolerance is None else tolerance
    if not 0.0 <= least <= 1.0:
        raise ValueError(f"tolerance: must be in 0..1, not {tolerance}")
    sigma = singular_values(J)
    return int(np.count_nonzero(sigma > least * sigma.max(initial=0.0)))


def condition_number(J: ArrayLike) -> NDArray[np.float64]:
    """σ₁ / σₘ of J (..., m, n): 1 where all directions are equally fast, infinite if singular.

    With fewer joints than rows (n < m) it is infinite too. Shape (...).
    """
    J = _finite(J)
    sigma = singular_values(J)
    if J.shape[-1] < J.shape[-2]:
        return np.full(sigma.shape[:-1], np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = sigma[..., 0] / sigma[..., -1]
    return np.where(sigma[..., -1] > 0, ratio, np.inf)


def manipulability(J: ArrayLike) -> NDArray[np.float64]:
    """√det(J Jᵀ), the product of the singular values of J (..., m, n); 0 if singular or n < m.

    Proportional to the volume of the velocity ellipsoid. Shape (...). T. Yoshikawa,
    "Manipulability of Robotic Mechanisms", International Journal of Robotics Research 4(2), 1985.
    """
    J = _finite(J)
    sigma = singular_values(J)
    if J.shape[-1] < J.shape[-2]:
        return np.zeros(sigma.shape[:-1])
    return np.prod(sigma, axis=-1)


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid about the origin: {A u : |u| ≤ 1} with A = axes · diag(radii).

    Attributes:
        axes: (m, m), orthogonal of determinant 1, whose columns are the principal axes in the frame
            that the Jacobian is expressed in.
        radii: (m,) half lengths along them, in descending order for velocities and ascending for
            forces; 0 or infinite in directions that are lost.
    """

    axes: NDArray[np.float64]
    radii: NDArray[np.float64]


def velocity_ellipsoid(J: ArrayLike, *, joint_speeds: ArrayLike | None = None) -> Ellipsoid:
    """The task velocities {J v : |v| ≤ 1}: long where the arm moves fast.

    Args:
        J: (m, n), of one unit (see :func:`task_rows`).
        joint_speeds: (n,) the speeds that count as one (rad/s, m/s), such as the joints' limits:
            {J v : |v / joint_speeds| ≤ 1}, which also makes prismatic joints comparable with
            revolute ones. Default: 1 for all.

    Source: Yoshikawa 1985; Siciliano et al., "Robotics", section 3.9.
    """
    J = np.asarray(J, dtype=float)
    if joint_speeds is not None:
        J = J * _per_joint("joint_speeds", joint_speeds, J)
    axes, radii = _principal(J)
    return Ellipsoid(axes, radii)


def force_ellipsoid(J: ArrayLike, *, joint_efforts: ArrayLike | None = None) -> Ellipsoid:
    """The task forces {F : |Jᵀ F| ≤ 1}, held statically by joint efforts τ = Jᵀ F of |τ| ≤ 1.

    Its axes are those of the velocity ellipsoid and its radii the inverses: where the arm is fast
    it is weak.

    Args:
        J: (m, n), of one unit (see :func:`task_rows`).
        joint_efforts: (n,) the efforts that count as one (N m, N), such as the actuators' limits.
            Default: 1 for all.

    Returns:
        An ellipsoid with infinite radii where the structure holds any force.
    """
    J = np.asarray(J, dtype=float)
    if joint_efforts is not None:
        J = J / _per_joint("joint_efforts", joint_efforts, J)
    axes, radii = _principal(J)
    with np.errstate(divide="ignore"):
        return Ellipsoid(axes, 1.0 / radii)


@dataclass(frozen=True)
class PathSingularity:
    """How near a path comes to a singularity.

    Attributes:
        distances: (K,) smallest singular value at each configuration: how much J must change (in
            the 2-norm) to lose rank.
        closest: index of the smallest of them.
        lost: (m,) the unit task direction that is slowest there; its sign means nothing.
    """

    distances: NDArray[np.float64]
    closest: int
    lost: NDArray[np.float64]


def singularity_along(
    tree: KinematicTree,
    path: ArrayLike,
    frame: int = 0,
    *,
    part: Part = "translational",
    length: float | None = None,
) -> PathSingularity:
    """Distance to singularity at each configuration of a path.

    Args:
        tree: of n joints.
        path: (K, n) configurations, K ≥ 1.
        frame: number of the frame that moves.
        part, length: what of its velocity counts, see :func:`task_rows`.

    Raises:
        ValueError: bad path, frame, part or length.
    """
    J = task_rows(tree.jacobians(path, frame), part, length=length)
    if len(J) == 0:
        raise ValueError("path: has no configuration")
    m, n = J.shape[-2:]
    distances = singular_values(J)[:, -1] if n >= m else np.zeros(len(J))
    closest = int(np.argmin(distances))
    axes, _ = _principal(J[closest])
    return PathSingularity(distances, closest, axes[:, -1])


def _finite(J: ArrayLike) -> NDArray[np.float64]:
    """A matrix or a stack of them, checked."""
    J = np.asarray(J, dtype=float)
    if J.ndim < 2 or not np.isfinite(J).all():
        raise ValueError(f"J: expected finite numbers (..., m, n), got {J}")
    return J


def _per_joint(name: str, values: ArrayLike, J: NDArray[np.float64]) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=float)
    if J.ndim != 2:
        raise ValueError(f"J: expected (m, n), not {J.shape}")
    if array.shape != J.shape[1:] or not (np.isfinite(array) & (array > 0)).all():
        raise ValueError(f"{name}: expected {J.shape[1]} positive numbers, got {values}")
    return array


def _principal(J: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left singular vectors (m, m) of determinant 1 and as many singular values."""
    J = _finite(J)
    if J.ndim != 2 or J.shape[0] < 1:
        raise ValueError(f"J: expected (m, n), not {J.shape}")
    U, sigma, _ = np.linalg.svd(J)
    if np.linalg.det(U) < 0:
        U[:, 0] = -U[:, 0]
    return U, np.concatenate([sigma, np.zeros(len(U) - len(sigma))])
