"""Poses of known objects in clouds: every method answers with a :class:`RegistrationResult`."""

from prehensile.perception.registration.known import (
    RigidFit,
    fit_rigid,
    fit_rotation,
    fit_translation,
)
from prehensile.perception.registration.losses import RobustLoss
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    pose_uncertainty,
)

__all__ = [
    "RegistrationResult",
    "RegistrationStatus",
    "RigidFit",
    "RobustLoss",
    "fit_rigid",
    "fit_rotation",
    "fit_translation",
    "pose_uncertainty",
]
