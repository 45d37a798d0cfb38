"""The configuration that chooses among the formulations, and what compiles it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from prehensile.kinematics.joint_limits import JointLimits
from prehensile.kinematics.tree import PlantTree
from prehensile.native.differential_ik import DifferentialIk, FrameIk

Formulation = Literal["least_squares", "direction", "priorities", "pseudo_inverse"]
Centering = Literal["none", "nullspace", "posture"]

_FORMULATIONS = ("least_squares", "direction", "priorities", "pseudo_inverse")
_CENTERINGS = ("none", "nullspace", "posture")


@dataclass(frozen=True)
class DifferentialIkConfig:
    """Which velocities are wanted of joints that are to achieve J v ≈ V.

    All formulations keep the limits of joints, and all but "pseudo_inverse" the linear constraints
    (see :mod:`prehensile.kinematics.differential_ik.formulations` for the formulas).

    Attributes:
        period: time step h (s, > 0).
        formulation: "least_squares": as near to V as limits permit; the arm slides along them.
            "direction": in exactly the direction of V, as much of it as limits permit.
            "priorities": least squares, level by level, none of which disturbs those before it.
            "pseudo_inverse": least squares without limits, then cut off joint by joint.
        damping: λ of the cost λ² |v|² (>= 0). Keeps velocities small beside singularities. Not used
            by "direction", and by "priorities" in the first level only.
        centering: "nullspace": ε |P (v − v_c)|² with v_c = K (q_0 − q), the rows of P an
            orthonormal basis of the kernel of J; for "priorities" the last level, strictly.
            "posture": ε |v − v_c|², which disturbs the task a little, but is smooth beside
            singularities too, where the kernel of J, and with it P, jumps.
        centering_weight: ε (> 0); "direction" and "priorities" do not use it.
        centering_gain: K in 1/s, one for all joints or one each.
        nominal_position: q_0 (n,); needed for centering.
        direction_weight: w (> 0) in max w α − |P (v − v_c)|².
        rank_tolerance: rows of J count as dependent below this share of the longest row, 0 .. 1.
    """

    period: float = 0.005
    formulation: Formulation = "least_squares"
    damping: float = 0.0
    centering: Centering = "none"
    centering_weight: float = 0.01
    centering_gain: float | tuple[float, ...] = 1.0
    nominal_position: tuple[float, ...] = ()
    direction_weight: float = 100.0
    rank_tolerance: float = 1e-6

    def __post_init__(self) -> None:
        if self.formulation not in _FORMULATIONS:
            raise ValueError(f"formulation: '{self.formulation}' is none of {_FORMULATIONS}")
        if self.centering not in _CENTERINGS:
            raise ValueError(f"centering: '{self.centering}' is none of {_CENTERINGS}")


@dataclass(frozen=True)
class FrameTask:
    """A frame F that is to go somewhere.

    Attributes:
        frame: its number in the tree.
        weights: of the three rotational and three translational velocities; 0 leaves one free.
        axes: whether the weights are along the axes of the "world" or of the "frame".
        priority: 0 first; counts for the formulation "priorities" alone.
        gain: desired velocity per difference of poses (1/s, >= 0). Above 1 / h it overshoots.
        max_angular: greatest desired angular speed (rad/s, > 0).
        max_linear: greatest desired speed of F's origin (m/s, > 0).
    """

    frame: int = 0
    weights: tuple[float, float, float, float, float, float] = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    axes: Literal["world", "frame"] = "world"
    priority: int = 0
    gain: float = 10.0
    max_angular: float = np.inf
    max_linear: float = np.inf


def compile_ik(config: DifferentialIkConfig, limits: JointLimits) -> DifferentialIk:
    """The compiled step for Jacobians and velocities that the caller computes.

    Args:
        config: what is wanted.
        limits: of the n joints, 1 .. 32.

    Raises:
        ValueError: naming what is out of range.
    """
    n = len(limits.velocity)
    centers = config.centering != "none"
    return DifferentialIk(
        limits.lower,
        limits.upper,
        limits.velocity,
        limits.acceleration,
        config.period,
        _FORMULATIONS.index(config.formulation),
        config.damping,
        _CENTERINGS.index(config.centering),
        config.centering_weight,
        np.broadcast_to(np.asarray(config.centering_gain, float), n).copy() if centers else None,
        np.array(config.nominal_position, float) if centers else None,
        config.direction_weight,
        config.rank_tolerance,
    )


def compile_frame_ik(
    config: DifferentialIkConfig,
    limits: JointLimits,
    tree: PlantTree,
    tasks: Sequence[FrameTask],
) -> FrameIk:
    """The compiled step from joint positions to velocities, forward kinematics included.

    Args:
        config: what is wanted.
        limits: of the tree's joints.
        tree: joints and frames.
        tasks: one for each frame that is to go somewhere; poses are given in this order.

    Raises:
        ValueError: naming what is out of range.
    """
    return FrameIk(
        tree.tree,
        compile_ik(config, limits),
        np.array([task.frame for task in tasks], float),
        np.array([task.weights for task in tasks], float),
        np.array([task.axes == "frame" for task in tasks], float),
        np.array([task.priority for task in tasks], float),
        np.array([task.gain for task in tasks], float),
        np.array([task.max_angular for task in tasks], float),
        np.array([task.max_linear for task in tasks], float),
    )
