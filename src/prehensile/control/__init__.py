"""Control of joints: gains, the inertia that they work against, and the controllers themselves.

:mod:`~prehensile.control.gains` and :mod:`~prehensile.control.inertia` are functions on arrays and
plants, :mod:`~prehensile.control.pendulum` is the smallest geared joint, and
:mod:`~prehensile.control.joint_controller` puts one of Drake's controllers on a robot in a diagram.
"""
