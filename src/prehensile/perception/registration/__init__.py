"""Poses of known objects in clouds: every method answers with a :class:`RegistrationResult`."""

from prehensile.perception.registration.constraints import HalfSpaces, fit_rigid_constrained
from prehensile.perception.registration.convex_constraints import ConvexFit, fit_rigid_convex
from prehensile.perception.registration.icp import (
    IcpConfig,
    IcpDirection,
    IcpKind,
    IcpModel,
    icp,
    icp_many_starts,
)
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
    "ConvexFit",
    "HalfSpaces",
    "IcpConfig",
    "IcpDirection",
    "IcpKind",
    "IcpModel",
    "RegistrationResult",
    "RegistrationStatus",
    "RigidFit",
    "RobustLoss",
    "fit_rigid",
    "fit_rigid_constrained",
    "fit_rigid_convex",
    "fit_rotation",
    "fit_translation",
    "icp",
    "icp_many_starts",
    "pose_uncertainty",
]
