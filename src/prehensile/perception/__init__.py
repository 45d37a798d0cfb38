"""From images to clouds: unprojection, normals, cropping, fusion, segmentation."""

from prehensile.perception.cloud import Box, PointCloud, crop, inside_box, inside_half_space, merge
from prehensile.perception.depth import normals_from_depth, unproject
from prehensile.perception.depth_noise import DepthNoiseConfig, add_depth_noise
from prehensile.perception.fusion import downsample, fuse_depth_images
from prehensile.perception.segmentation import convex_segments, resting_pairs

__all__ = [
    "Box",
    "DepthNoiseConfig",
    "PointCloud",
    "add_depth_noise",
    "convex_segments",
    "crop",
    "downsample",
    "fuse_depth_images",
    "inside_box",
    "inside_half_space",
    "merge",
    "normals_from_depth",
    "resting_pairs",
    "unproject",
]
