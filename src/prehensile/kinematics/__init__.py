"""Frames, Jacobians and paths of poses."""
