"""Poses and Jacobians of the frames of a kinematic tree; a call takes about a microsecond.

:func:`prehensile.kinematics.tree.tree_from_plant` makes one from a Drake plant.
"""

from prehensile.native._core import KinematicTree

__all__ = ["KinematicTree"]
