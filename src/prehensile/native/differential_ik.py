"""Steps of differential inverse kinematics, compiled; one takes two or three microseconds.

:mod:`prehensile.kinematics.differential_ik` makes them from configurations and plants, and holds
the formulas.
"""

from prehensile.native._core import DifferentialIk, FrameIk, IkStep

__all__ = ["DifferentialIk", "FrameIk", "IkStep"]
