"""From images to clouds: unprojection, normals, cropping, fusion, segmentation."""

from prehensile.perception.camera_model import CameraModel, Distortion, PosedCamera
from prehensile.perception.cloud import Box, PointCloud, crop, inside_box, inside_half_space, merge
from prehensile.perception.depth import DepthConfig, normals_from_depth, unproject
from prehensile.perception.depth_noise import DepthNoiseConfig, add_depth_noise
from prehensile.perception.fusion import downsample, fuse
from prehensile.perception.normals import estimate_normals, orient_normals, surface_variation
from prehensile.perception.segmentation import convex_segments, resting_pairs

__all__ = [
    "Box",
    "CameraModel",
    "DepthConfig",
    "DepthNoiseConfig",
    "Distortion",
    "PointCloud",
    "PosedCamera",
    "add_depth_noise",
    "convex_segments",
    "crop",
    "downsample",
    "estimate_normals",
    "fuse",
    "inside_box",
    "inside_half_space",
    "merge",
    "normals_from_depth",
    "orient_normals",
    "resting_pairs",
    "surface_variation",
    "unproject",
]
