"""All solutions of inverse kinematics in closed form, for arms whose axes allow it.

An arm is given by the lines that its joints turn about at q = 0, in W (product of exponentials), so
that base pose, tool, zero positions and signs of joints are arbitrary:
``SrsArm(axes, points, X_WG0, lower, upper, tolerance)`` with unit directions and points of the
lines (n, 3), the pose of the tool frame G at q = 0 and the joint limits (n,). It raises ValueError,
saying what does not hold, if the arm is not of the type to within the tolerance (m and rad). The
solutions are as exact as that. ``prehensile.kinematics.analytic_ik`` takes all of it from a plant.
"""

from prehensile.native._core import ArmAngleChoice, IkSolutions, PieperArm, SrsArm, UrArm

__all__ = ["STATUSES", "ArmAngleChoice", "IkSolutions", "PieperArm", "SrsArm", "UrArm"]

STATUSES = ("solved", "too far", "too near", "limits")
"""What the numbers in the status array of ``solve_batch`` stand for."""
