"""Several depth images of one scene to one cloud, and clouds to fewer points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import InputError
from prehensile.native import _core, voxel_downsample
from prehensile.perception.camera_model import PosedCamera
from prehensile.perception.cloud import Box, PointCloud
from prehensile.perception.depth import DepthConfig, native_view


def fuse(
    depth_images: Sequence[NDArray[np.generic]],
    cameras: Sequence[PosedCamera],
    region: Box,
    voxel_size: float,
    *,
    color_images: Sequence[NDArray[np.uint8]] | None = None,
    config: DepthConfig | None = None,
    num_threads: int = 1,
) -> PointCloud:
    """One cloud of what several depth cameras see inside a box.

    Normals are made in each image, from its own pixel grid and toward its own camera, as
    :func:`prehensile.perception.normals_from_depth` says, before points are averaged (Tedrake,
    Robotic Manipulation, section 5.4.1: the order matters). What lies outside the region does not
    count. Pixels without a normal give no point, so flying pixels between two surfaces and slivers
    of what is outside do not either. A voxel in which the normals disagree (the
    two faces of a sheet) is left out.

    Where ``config`` states a noise, windows may deviate from their planes by what it explains, and
    each point is put where its line of sight meets its window's plane, which averages the noise
    over the window.

    Args:
        depth_images: (H, W) each: depth along the optical axis, floats in metres or whole numbers
            in ``config.depth_unit``. What is zero, not finite or out of range is no measurement.
        cameras: the camera of each, calibrated.
        region: the box of interest, in W; everything outside is dropped.
        voxel_size: edge of a voxel [m], > 0.
        color_images: (H, W, 3 or 4) uint8 each, pixel by pixel those of the depth images; None if
            not known.
        config: what counts as a measurement, and how normals are made; ``DepthConfig()`` if None.
        num_threads: threads to share the work, at least 1; the result is the same.

    Returns:
        The cloud in W with normals, sensor_origins (of each point the position of the camera that
        saw most of its voxel) and, if given, colors: the means over each voxel of the grid through
        W's origin, in the order in which the cameras' pixels, row by row, first meet the voxels.
        Empty where nothing is seen.

    Raises:
        InputError: naming the argument, if the sequences are empty or differ in length, an image
            has another shape than its camera, a pose is not finite, the region is empty, or
            voxel_size is not positive or too small for the region.
    """
    config = config or DepthConfig()
    if not depth_images:
        raise InputError("depth_images is empty; expected one per camera")
    if len(depth_images) != len(cameras):
        raise InputError(f"{len(depth_images)} depth_images for {len(cameras)} cameras")
    if color_images is not None and len(color_images) != len(cameras):
        raise InputError(f"{len(color_images)} color_images for {len(cameras)} cameras")
    views = [
        native_view(
            image,
            camera.model,
            config,
            camera.X_WC.GetAsMatrix4(),
            None if color_images is None else color_images[i],
            name=f"depth_images[{i}]",
        )
        for i, (image, camera) in enumerate(zip(depth_images, cameras, strict=True))
    ]
    try:
        points, normals, sensor_origins, colors = _core.fuse_depth(
            views,
            region.X_WB.GetAsMatrix4(),
            region.size,
            voxel_size,
            config.limits(),
            num_threads,
        )
    except ValueError as error:
        raise InputError(str(error)) from None
    return PointCloud(points, normals, colors, sensor_origins=sensor_origins)


def downsample(cloud: PointCloud, voxel_size: float, *, num_threads: int = 1) -> PointCloud:
    """One point per occupied voxel: the mean of its points, normals and colours.

    Voxels are the cells of the grid through the origin, in the order in which the cloud's points
    first meet them. A voxel whose normals cancel (both sides of a thin sheet) is left out. Labels
    and sensor origins are those of the first point in each voxel.

    Args:
        cloud: the cloud.
        voxel_size: edge of a voxel [m], > 0.
        num_threads: threads to share the work, at least 1; the result is the same.

    Raises:
        InputError: if voxel_size is not positive, or too small for the cloud's extent.
    """
    voxel_size = float(voxel_size)  # Both grids below must round alike.
    try:
        voxels = voxel_downsample(
            cloud.points, voxel_size, normals=cloud.normals, num_threads=num_threads
        )
    except ValueError as error:
        raise InputError(str(error)) from None
    points = np.asarray(voxels.points, dtype=np.float64)
    normals = None if voxels.normals is None else np.asarray(voxels.normals, dtype=np.float64)
    known = {}
    if cloud.colors is not None or cloud.labels is not None or cloud.sensor_origins is not None:
        voxel_of, first = _voxels_of(cloud.points, voxel_size)
        if cloud.colors is not None:
            sums = [np.bincount(voxel_of, cloud.colors[:, k], len(first)) for k in range(3)]
            mean = np.stack(sums, axis=-1) / voxels.counts[:, None]
            known["colors"] = np.rint(mean).astype(np.uint8)
        if cloud.labels is not None:
            known["labels"] = cloud.labels[first]
        if cloud.sensor_origins is not None:
            known["sensor_origins"] = cloud.sensor_origins[first]
    result = PointCloud(points, normals, **known)
    return result if normals is None else result.select(np.linalg.norm(normals, axis=1) > 0)


def _voxels_of(
    points: NDArray[np.float64], voxel_size: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The voxel of each point, numbered as they first occur, and the first point of each voxel."""
    cell = np.floor(points * (1.0 / voxel_size)).astype(np.int64)
    key = (cell[:, 0] << 42) + (cell[:, 1] << 21) + cell[:, 2]
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank[inverse], first[order]
