"""Inverse kinematics by damped least squares from several starts."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydrake.math import RigidTransform

from prehensile.kinematics.poses import pose_error
from prehensile.planning.arm import ArmModel

# Metres are weighted against radians as by a hand of this size.
_METRE = 3.0
# Weight of the damping that stays at a singularity (Sugihara 2011 recommends 1e-3 and less).
_DAMPING = 1e-4


@dataclass(frozen=True)
class IkResult:
    """Outcome of inverse kinematics.

    Attributes:
        status: ``solved``; ``unreachable`` (no start comes near, with or without joint limits);
            ``limits`` (only outside the joint limits); ``collision`` (every solution collides).
        q: joint positions (n,): the solution, or the nearest that was found.
        reason: why it failed, in words.
        starts: number of starts that were tried.
    """

    status: Literal["solved", "unreachable", "limits", "collision"]
    q: np.ndarray
    reason: str = ""
    starts: int = 1

    @property
    def solved(self) -> bool:
        """Whether q reaches the pose within limits (and free of collisions if that was asked)."""
        return self.status == "solved"


def refine(
    arm: ArmModel,
    X_WG: RigidTransform,
    q_guess: np.ndarray,
    *,
    tolerance: float = 1e-6,
    max_iterations: int = 50,
    within_limits: bool = True,
) -> tuple[np.ndarray, float]:
    """Newton's method with damping from one guess; joints stop at their limits.

    Levenberg and Marquardt's step with damping proportional to the squared error (Sugihara,
    "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", 2011). A joint
    at a limit that wants to pass it is left out of the step.

    Returns:
        Joint positions (n,) and the larger of the position error (m) and rotation error (rad).
    """
    lower, upper = arm.limits.lower, arm.limits.upper
    q = np.clip(q_guess, lower, upper) if within_limits else np.array(q_guess, dtype=float)
    n = len(q)
    diagonal = np.arange(n)
    best_q, best_error, stalled = q, np.inf, 0
    for _ in range(max_iterations):
        X, J = arm.pose_and_jacobian(q)
        error = pose_error(X, X_WG)
        size = max(float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:])))
        if size < best_error:
            stalled = stalled + 1 if size > 0.9 * best_error else 0
            best_q, best_error = q, size
        else:
            stalled += 1
        if size < tolerance or stalled > 8:
            break
        error[3:] *= _METRE
        J = J.copy()
        J[3:] *= _METRE
        gradient = J.T @ error
        if within_limits:
            blocked = ((q <= lower) & (gradient < 0.0)) | ((q >= upper) & (gradient > 0.0))
            J[:, blocked] = 0.0
            gradient[blocked] = 0.0
        H = J.T @ J
        H[diagonal, diagonal] += 0.5 * float(error @ error) + _DAMPING * min(1.0, size)
        H[diagonal, diagonal] += 1e-12
        step = np.linalg.solve(H, gradient)
        q = q + np.clip(step, -0.8, 0.8)
        if within_limits:
            q = np.clip(q, lower, upper)
    return best_q, best_error


def starting_points(
    arm: ArmModel, q_guess: np.ndarray, rng: np.random.Generator, max_starts: int
) -> Iterator[np.ndarray]:
    """The guess, then random configurations within the limits."""
    yield q_guess
    lower = np.maximum(arm.limits.lower, -np.pi)
    upper = np.minimum(arm.limits.upper, np.pi)
    for _ in range(max_starts - 1):
        yield rng.uniform(lower, upper)


def solve_ik(
    arm: ArmModel,
    X_WG: RigidTransform,
    q_guess: np.ndarray,
    *,
    rng: np.random.Generator | None = None,
    max_starts: int = 20,
    collision_free: bool = True,
    tolerance: float = 1e-6,
) -> IkResult:
    """Joint positions that bring the gripper frame to X_WG.

    Args:
        arm: the arm and its surroundings.
        X_WG: where the gripper frame is to be.
        q_guess: first start (n,); the solution is near it when there is one near it.
        rng: of the further starts; seed 0 if it is not given.
        max_starts: how many starts to try (>= 1).
        collision_free: solutions that collide are passed over.
        tolerance: largest error of position (m) and rotation (rad) of a solution.

    Returns:
        The first solution, or why there is none.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    best_q, best_error, colliding = q_guess, np.inf, None
    count = 0
    for start in starting_points(arm, q_guess, rng, max_starts):
        count += 1
        q, error = refine(arm, X_WG, start, tolerance=tolerance)
        if error < tolerance:
            if not collision_free or arm.is_free(q):
                return IkResult("solved", q, starts=count)
            colliding = q if colliding is None else colliding
        elif error < best_error:
            best_q, best_error = q, error
    if colliding is not None:
        reason = f"every solution collides: {arm.collisions(colliding)}"
        return IkResult("collision", colliding, reason, count)
    q, error = refine(arm, X_WG, best_q, tolerance=tolerance, within_limits=False)
    if error < tolerance:
        q = (q + np.pi) % (2.0 * np.pi) - np.pi
        outside = (q < arm.limits.lower) | (q > arm.limits.upper)
        names = ", ".join(name for name, out in zip(arm.joint_names, outside, strict=True) if out)
        return IkResult("limits", best_q, f"only beyond the limits of {names}", count)
    reason = f"out of reach: the nearest configuration is {best_error:.3f} m or rad away"
    return IkResult("unreachable", best_q, reason, count)
