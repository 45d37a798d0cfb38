"""From depth images to clouds, and from clouds to what is in them."""

from prehensile.perception.articulated_tracking import (
    ArmState,
    ArmTrackerConfig,
    start_arm_tracking,
    track_arm,
)
from prehensile.perception.body_evidence import Body, EvidenceConfig
from prehensile.perception.camera_model import CameraModel, Distortion, PosedCamera
from prehensile.perception.cloud import Box, PointCloud, crop, inside_box, inside_half_space, merge
from prehensile.perception.cloud_file import read_cloud, write_cloud
from prehensile.perception.constrained_refinement import refine_constrained
from prehensile.perception.conversions import (
    cloud_from_rows,
    from_drake,
    from_open3d,
    to_drake,
    to_open3d,
)
from prehensile.perception.depth import DepthConfig, normals_from_depth, unproject
from prehensile.perception.depth_noise import DepthNoiseConfig, add_depth_noise
from prehensile.perception.free_space import DepthView, free_space_violation
from prehensile.perception.fusion import downsample, fuse
from prehensile.perception.mesh import TriangleMesh, merge_meshes
from prehensile.perception.mesh_file import read_mesh
from prehensile.perception.model_mesh import mesh_of_model
from prehensile.perception.normals import estimate_normals, orient_normals, surface_variation
from prehensile.perception.outliers import radius_outliers, statistical_outliers
from prehensile.perception.planes import Plane, PlaneSearch, plane_regions, ransac_plane
from prehensile.perception.sampling import (
    farthest_point_sampling,
    sample_mesh_poisson_disc,
    sample_mesh_uniform,
)
from prehensile.perception.segmentation import (
    convex_segments,
    euclidean_clusters,
    nearest_segment,
    resting_pairs,
    subtract,
)
from prehensile.perception.tracking import (
    ObjectState,
    TrackerConfig,
    TrackingStatus,
    start_tracking,
    track_object,
)
from prehensile.perception.visibility import visible_points
from prehensile.perception.volume import DepthVolume, Occupancy, fuse_volume

__all__ = [
    "ArmState",
    "ArmTrackerConfig",
    "Body",
    "Box",
    "CameraModel",
    "DepthConfig",
    "DepthNoiseConfig",
    "DepthView",
    "DepthVolume",
    "Distortion",
    "EvidenceConfig",
    "ObjectState",
    "Occupancy",
    "Plane",
    "PlaneSearch",
    "PointCloud",
    "PosedCamera",
    "TrackerConfig",
    "TrackingStatus",
    "TriangleMesh",
    "add_depth_noise",
    "cloud_from_rows",
    "convex_segments",
    "crop",
    "downsample",
    "estimate_normals",
    "euclidean_clusters",
    "farthest_point_sampling",
    "free_space_violation",
    "from_drake",
    "from_open3d",
    "fuse",
    "fuse_volume",
    "inside_box",
    "inside_half_space",
    "merge",
    "merge_meshes",
    "mesh_of_model",
    "nearest_segment",
    "normals_from_depth",
    "orient_normals",
    "plane_regions",
    "radius_outliers",
    "ransac_plane",
    "read_cloud",
    "read_mesh",
    "refine_constrained",
    "resting_pairs",
    "sample_mesh_poisson_disc",
    "sample_mesh_uniform",
    "start_arm_tracking",
    "start_tracking",
    "statistical_outliers",
    "subtract",
    "surface_variation",
    "to_drake",
    "to_open3d",
    "track_arm",
    "track_object",
    "unproject",
    "visible_points",
    "write_cloud",
]
