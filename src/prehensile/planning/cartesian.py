"""Straight lines of the hand in the workspace."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from pydrake.math import RigidTransform

from prehensile.kinematics.poses import pose_error, straight_line
from prehensile.planning.arm import ArmModel
from prehensile.planning.inverse_kinematics import refine


@dataclass(frozen=True)
class PathResult:
    """A path in joint space, not yet timed.

    Attributes:
        status: ``found``, or which kind of obstacle stood in the way.
        path: waypoints (K, n), to be joined by straight lines; as far as it came on failure.
        reason: why it failed, in words.
    """

    status: Literal["found", "start", "goal", "collision", "limits", "jump", "budget"]
    path: np.ndarray
    reason: str = ""

    @property
    def found(self) -> bool:
        """Whether the path reaches its goal."""
        return self.status == "found"


def plan_cartesian(
    arm: ArmModel,
    q_start: np.ndarray,
    X_WG_goal: RigidTransform,
    *,
    max_translation: float = 0.01,
    max_rotation: float = 0.05,
    max_joint_step: float = 0.15,
    straightness: float = 5e-4,
    check_collisions: bool = True,
) -> PathResult:
    """Moves the gripper frame on a straight line from where it is at q_start to X_WG_goal.

    Inverse kinematics is solved for poses evenly along the line, each from the solution before,
    so that no joint jumps; a line that would need a jump is refused.

    Args:
        arm: the arm and its surroundings.
        q_start: where to start (n,).
        X_WG_goal: where the gripper frame is to end.
        max_translation: distance between neighbouring poses (m).
        max_rotation: angle between neighbouring poses (rad).
        max_joint_step: largest change of a joint between neighbouring poses (rad).
        straightness: largest distance of the hand from the line half-way between two poses (m).
        check_collisions: whether the path has to be free of collisions.

    Returns:
        The path, or why there is none and how far it came.
    """
    poses = straight_line(arm.pose(q_start), X_WG_goal, max_translation, max_rotation)
    path = [np.array(q_start, dtype=float)]

    def failed(status, reason: str) -> PathResult:
        done = f"{len(path) - 1} of {len(poses) - 1} steps done"
        return PathResult(status, np.array(path), f"{reason} ({done})")

    if check_collisions and not arm.is_free(path[0]):
        return failed("collision", f"the start collides: {arm.collisions(path[0])}")
    for X_WA, X_WB in pairwise(poses):
        X, J = arm.pose_and_jacobian(path[-1])
        guess = path[-1] + np.linalg.lstsq(J, pose_error(X, X_WB), rcond=1e-3)[0]
        q, error = refine(arm, X_WB, guess, max_iterations=20)
        if error > 1e-5:
            at_limit = (q <= arm.limits.lower) | (q >= arm.limits.upper)
            names = [n for n, out in zip(arm.joint_names, at_limit, strict=True) if out]
            where = f"; at the limits of {', '.join(names)}" if names else ""
            return failed("limits", f"the line leaves the workspace{where}")
        step = float(np.max(np.abs(q - path[-1])))
        if step > max_joint_step:
            return failed("jump", f"a joint would jump by {step:.2f} rad")
        middle = arm.pose(0.5 * (path[-1] + q)).translation()
        off = float(np.linalg.norm(middle - 0.5 * (X_WA.translation() + X_WB.translation())))
        if off > straightness:
            return failed("jump", f"the hand would leave the line by {1000 * off:.1f} mm")
        if check_collisions and not arm.edge_is_free(path[-1], q):
            return failed("collision", f"the line collides: {arm.collisions(q) or 'on its way'}")
        path.append(q)
    return PathResult("found", np.array(path))
