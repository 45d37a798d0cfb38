"""From images to clouds: unprojection, normals, cropping, fusion, segmentation."""

from prehensile.perception.cloud import Box, Cloud, crop, inside_box
from prehensile.perception.depth import normals_from_depth, unproject
from prehensile.perception.fusion import fuse_depth_images, voxel_downsample
from prehensile.perception.segmentation import convex_segments

__all__ = [
    "Box",
    "Cloud",
    "convex_segments",
    "crop",
    "fuse_depth_images",
    "inside_box",
    "normals_from_depth",
    "unproject",
    "voxel_downsample",
]
