"""prehensile: perception, planning and control for robotic manipulation, built on Drake."""

__version__ = "0.1.0"
