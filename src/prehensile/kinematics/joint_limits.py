"""Limits of position, velocity and acceleration of joints."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.kinematics.tree import PlantTree

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointLimits:
    """Limits of n joints; each array is (n,).

    Attributes:
        lower, upper: positions (rad or m), may be infinite.
        velocity: greatest speeds (>= 0; 0 holds a joint; may be infinite).
        acceleration: greatest accelerations (> 0, may be infinite).
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        n = np.size(self.lower)
        for name, values in vars(self).items():
            array = np.array(values, dtype=float)
            if array.shape != (n,) or np.isnan(array).any():
                raise ValueError(f"{name}: expected {n} numbers")
            object.__setattr__(self, name, array)

    def contain(self, q: ArrayLike, tolerance: float = 0.0) -> bool:
        """Whether all positions of q, (n,) or (K, n), lie within the limits."""
        q = np.asarray(q, float)
        return bool(np.all(q >= self.lower - tolerance) and np.all(q <= self.upper + tolerance))

    def scaled(self, velocity: float, acceleration: float) -> "JointLimits":
        """The same limits with velocity and acceleration times the given factors."""
        return replace(
            self, velocity=self.velocity * velocity, acceleration=self.acceleration * acceleration
        )

    @staticmethod
    def unlimited(num_joints: int) -> "JointLimits":
        """No limits at all."""
        infinite = np.full(num_joints, np.inf)
        return JointLimits(-infinite, infinite, infinite, infinite)

    @staticmethod
    def of_tree(tree: PlantTree, *, acceleration_time: float = 0.1) -> "JointLimits":
        """The limits of a plant's joints.

        Args:
            tree: from :func:`prehensile.kinematics.tree.tree_from_plant`.
            acceleration_time: where the model states no acceleration limit, full speed is reached
                in this time (s); infinite accelerations where it states no speed either.
        """
        fallback = tree.velocity / acceleration_time
        acceleration = np.where(np.isfinite(tree.acceleration), tree.acceleration, fallback)
        return JointLimits(tree.lower, tree.upper, tree.velocity, acceleration)
