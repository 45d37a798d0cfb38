"""Differential inverse kinematics: from desired velocities of frames to velocities of joints."""

from prehensile.kinematics.differential_ik.config import (
    DifferentialIkConfig,
    FrameTask,
    compile_frame_ik,
    compile_ik,
)
from prehensile.kinematics.differential_ik.constraints import (
    LinearConstraints,
    at_most,
    collision_constraints,
    distance_constraints,
    equal,
    point_jacobian,
    stack_constraints,
    virtual_walls,
)
from prehensile.kinematics.differential_ik.formulations import (
    centered,
    damped,
    direction_preserving,
    limited,
    prioritized,
    pseudo_inverse,
    stack_tasks,
    velocity_interval,
    velocity_limited,
)
from prehensile.kinematics.differential_ik.result import DifferentialIkResult, DifferentialIkStatus
from prehensile.kinematics.joint_limits import JointLimits

__all__ = [
    "DifferentialIkConfig",
    "DifferentialIkResult",
    "DifferentialIkStatus",
    "FrameTask",
    "JointLimits",
    "LinearConstraints",
    "at_most",
    "centered",
    "collision_constraints",
    "compile_frame_ik",
    "compile_ik",
    "damped",
    "direction_preserving",
    "distance_constraints",
    "equal",
    "limited",
    "point_jacobian",
    "prioritized",
    "pseudo_inverse",
    "stack_constraints",
    "stack_tasks",
    "velocity_interval",
    "velocity_limited",
    "virtual_walls",
]
