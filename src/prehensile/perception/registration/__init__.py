"""Poses of known objects in clouds: every method answers with a :class:`RegistrationResult`."""

from prehensile.perception.registration.branch_and_bound import (
    BranchAndBoundResult,
    branch_and_bound,
)
from prehensile.perception.registration.certificate import (
    RotationCertificate,
    certify_rotation,
)
from prehensile.perception.registration.consistency import (
    Clique,
    ConsistencyGraph,
    consistency_graph,
    match_by_distances,
    maximum_clique,
)
from prehensile.perception.registration.constraints import HalfSpaces, fit_rigid_constrained
from prehensile.perception.registration.convex_constraints import ConvexFit, fit_rigid_convex
from prehensile.perception.registration.filter_reg import FilterRegConfig, filter_registration
from prehensile.perception.registration.fpfh import fpfh, match_features
from prehensile.perception.registration.gnc_rotation import (
    RotationEstimate,
    gnc_rotation,
)
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
from prehensile.perception.registration.known_object import KnownObject
from prehensile.perception.registration.locate import LocateConfig, LocateResult, locate
from prehensile.perception.registration.losses import RobustLoss
from prehensile.perception.registration.nonlinear import estimate_pose_nonlinear
from prehensile.perception.registration.planar import (
    PlanarResult,
    PlanarStep,
    icp_2d,
    planar_pose,
    point_drift_2d,
)
from prehensile.perception.registration.point_drift import PointDriftConfig, coherent_point_drift
from prehensile.perception.registration.point_pairs import PointPairModel, PoseVotes
from prehensile.perception.registration.ransac import (
    ransac_pose,
)
from prehensile.perception.registration.refine import (
    RefineConfig,
    RefinedPoses,
    refine_pose,
    refine_poses,
)
from prehensile.perception.registration.result import (
    RegistrationResult,
    RegistrationStatus,
    pose_uncertainty,
)
from prehensile.perception.registration.robust import (
    CorrespondenceResult,
    RobustConfig,
    register_correspondences,
)
from prehensile.perception.registration.voting import (
    Vote,
    vote,
    vote_for_scale,
)

__all__ = [
    "BranchAndBoundResult",
    "Clique",
    "ConsistencyGraph",
    "ConvexFit",
    "CorrespondenceResult",
    "FilterRegConfig",
    "HalfSpaces",
    "IcpConfig",
    "IcpDirection",
    "IcpKind",
    "IcpModel",
    "KnownObject",
    "LocateConfig",
    "LocateResult",
    "PlanarResult",
    "PlanarStep",
    "PointDriftConfig",
    "PointPairModel",
    "PoseVotes",
    "RefineConfig",
    "RefinedPoses",
    "RegistrationResult",
    "RegistrationStatus",
    "RigidFit",
    "RobustConfig",
    "RobustLoss",
    "RotationCertificate",
    "RotationEstimate",
    "Vote",
    "branch_and_bound",
    "certify_rotation",
    "coherent_point_drift",
    "consistency_graph",
    "estimate_pose_nonlinear",
    "filter_registration",
    "fit_rigid",
    "fit_rigid_constrained",
    "fit_rigid_convex",
    "fit_rotation",
    "fit_translation",
    "fpfh",
    "gnc_rotation",
    "icp",
    "icp_2d",
    "icp_many_starts",
    "locate",
    "match_by_distances",
    "match_features",
    "maximum_clique",
    "planar_pose",
    "point_drift_2d",
    "pose_uncertainty",
    "ransac_pose",
    "refine_pose",
    "refine_poses",
    "register_correspondences",
    "vote",
    "vote_for_scale",
]
