"""Poses of known objects in clouds: every method answers with a :class:`RegistrationResult`."""

from prehensile.perception.registration.losses import RobustLoss
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    pose_uncertainty,
)

__all__ = ["RegistrationResult", "RegistrationStatus", "RobustLoss", "pose_uncertainty"]
