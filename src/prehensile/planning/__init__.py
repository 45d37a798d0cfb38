"""Inverse kinematics, collision-free paths, time parameterization, and plans of whole picks.

Everything is a function of an :class:`~prehensile.planning.arm.ArmModel` and arrays; a plan that
cannot be made is a result that says why.
"""
