"""What every registration answers, and how far to believe it.

Frames: O is the object, whose model is known; W is the frame of the scene. A registration looks
for X_WO, the pose that lays the model onto the scene.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform


class RegistrationStatus(Enum):
    """How a registration ended; only ``SUCCESS`` is to be believed as it stands."""

    SUCCESS = "success"
    """A pose that the data determine."""
    DEGENERATE = "degenerate"
    """The geometry leaves a motion free (a plane, a sphere, a body of revolution, too few
    points): ``free_directions`` says which."""
    AMBIGUOUS = "ambiguous"
    """Poses far from each other explain the scene equally well: a symmetric object or view."""
    LOW_OVERLAP = "low_overlap"
    """Too small a part of the scene lies near the model."""
    NOT_CONVERGED = "not_converged"
    """The iterations ran out."""
    NO_CONSENSUS = "no_consensus"
    """A search found no pose that enough of the data agree with."""
    INFEASIBLE = "infeasible"
    """No pose satisfies the constraints, or the solver gave up."""


@dataclass(frozen=True, eq=False)
class RegistrationResult:
    """A pose and what is known of its quality.

    Attributes:
        status: whether to believe it, and why not.
        X_WO: the pose found; None where there is none at all (never a pose made up).
        residual: root mean square distance of the inliers [m]; NaN where there is no pose.
        inliers: (N,) bool, which points of the scene (or which correspondences) took part.
        iterations: iterations of the method's outer loop.
        covariance: (6, 6) of the pose's error as a small motion of the object [rotation vector;
            translation of O's origin], expressed in W [rad^2, rad m, m^2]; None where it is not
            known. Along a free direction it is infinite in truth; there it is left out, and
            ``free_directions`` names the direction.
        free_directions: (k, 6) unit rows [rotation; translation / length scale] of the motions
            that the data leave free.
        message: what to know beyond the status, for people.
    """

    status: RegistrationStatus
    X_WO: RigidTransform | None
    residual: float
    inliers: NDArray[np.bool_]
    iterations: int
    covariance: NDArray[np.float64] | None = None
    free_directions: NDArray[np.float64] | None = None
    message: str = ""

    @property
    def succeeded(self) -> bool:
        """Whether the status is ``SUCCESS``."""
        return self.status is RegistrationStatus.SUCCESS


MIN_EIGENVALUE_RATIO = 1.5e-3
"""What counts as free: cans and balls of 48 facets seen with a noise of 1 mm reach 0.0008, bottles,
boxes and bananas 0.004 and more."""


def pose_uncertainty(
    information: NDArray[np.float64],
    variance: float,
    length_scale: float,
    *,
    min_eigenvalue_ratio: float = MIN_EIGENVALUE_RATIO,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariance of a pose by least squares, and the motions that the data leave free.

    Rotations are weighed against translations by the length scale L: the eigenvalues compared are
    those of S H S with S = diag(1/L, 1/L, 1/L, 1, 1, 1), for which a turn counts by the way that
    the points move (Gelfand, Ikemoto, Rusinkiewicz and Levoy, "Geometrically stable sampling for
    the ICP algorithm", 3DIM 2003).

    Args:
        information: (6, 6) Gauss-Newton matrix H = sum of J^T J over the residuals, J the
            derivative of a residual [m] by [rotation vector; translation].
        variance: variance of one residual [m^2].
        length_scale: L, the points' root mean square distance from O's origin or the like [m], > 0.
        min_eigenvalue_ratio: an eigenvalue below this part of the largest one is a free motion.

    Returns:
        The covariance (6, 6), variance times the inverse of H over the directions that are not
        free, and the free directions (k, 6), unit rows [rotation vector * L; translation].
    """
    scale = np.array([1 / length_scale] * 3 + [1.0] * 3)
    values, vectors = np.linalg.eigh(scale[:, None] * information * scale)
    free = values <= min_eigenvalue_ratio * max(values[-1], 0.0)
    kept = vectors[:, ~free] * scale[:, None]
    return variance * (kept / values[~free]) @ kept.T, vectors[:, free].T


def residual_limit(model: NDArray[np.float64], max_residual: float | None) -> float:
    """The largest residual of a fit [m]; by default a quarter of the root mean square radius of the
    model's points (N, D)."""
    return 0.25 * float(np.sqrt(model.var(axis=0).sum())) if max_residual is None else max_residual
