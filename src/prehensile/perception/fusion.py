"""Several depth images of one scene to one cloud with normals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.errors import InputError
from prehensile.native import voxel_downsample
from prehensile.perception.cloud import Box, PointCloud, inside_box, rotate
from prehensile.perception.depth import normals_from_depth, unproject


def fuse_depth_images(
    depths: Sequence[NDArray[np.floating]],
    Ks: Sequence[NDArray[np.floating]],
    X_WCs: Sequence[RigidTransform],
    box: Box,
    voxel_size: float,
    *,
    num_threads: int = 1,
) -> PointCloud:
    """One cloud of what several depth cameras see inside a box.

    Normals are made in each image, from its own pixel grid and toward its own camera, before the
    clouds are merged and down-sampled (Tedrake, Robotic Manipulation, section 5.4.1: the order
    matters).

    Args:
        depths: depth images (H, W) [m].
        Ks: their intrinsics (3, 3).
        X_WCs: poses of their optical frames in W.
        box: the region of interest, in W; everything outside is dropped.
        voxel_size: edge of a voxel [m], > 0.
        num_threads: threads to share the down-sampling, at least 1; the result is the same.

    Returns:
        The cloud in W: the mean of the points of each voxel of the grid through W's origin, in
        the order in which the cameras' pixels, row by row, first meet the voxels.

    Raises:
        InputError: if the sequences differ in length, or an image or K has a wrong shape.
    """
    if not len(depths) == len(Ks) == len(X_WCs):
        raise InputError("depths, Ks and X_WCs must have one entry per camera")
    points, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for depth, K, X_WC in zip(depths, Ks, X_WCs, strict=True):
        rows, columns = _region_of_interest(depth.shape, K, X_WC, box)
        K_roi = K - np.array([[0, 0, columns.start], [0, 0, rows.start], [0, 0, 0]])
        p_C = unproject(depth[rows, columns], K_roi)
        inside = inside_box(p_C, Box(X_WC.inverse() @ box.X_WB, box.size))
        normals_C = normals_from_depth(np.where(inside, depth[rows, columns], np.nan), K_roi)
        keep = np.isfinite(normals_C[:, :, 0])
        R_WC = np.asarray(X_WC.rotation().matrix(), dtype=float)
        points.append(rotate(p_C[keep], R_WC) + X_WC.translation())
        normals.append(rotate(normals_C[keep], R_WC))
    cloud = PointCloud(np.concatenate(points), np.concatenate(normals))
    return downsample(cloud, voxel_size, num_threads=num_threads)


def downsample(cloud: PointCloud, voxel_size: float, *, num_threads: int = 1) -> PointCloud:
    """One point per occupied voxel: the mean of its points and of its normals.

    Voxels are the cells of the grid through the origin, in the order in which the cloud's points
    first meet them. A voxel whose normals cancel (both sides of a thin sheet) is left out.

    Args:
        cloud: the cloud.
        voxel_size: edge of a voxel [m], > 0.
        num_threads: threads to share the work, at least 1; the result is the same.

    Raises:
        InputError: if voxel_size is not positive, or too small for the cloud's extent.
    """
    try:
        voxels = voxel_downsample(
            cloud.points, voxel_size, normals=cloud.normals, num_threads=num_threads
        )
    except ValueError as error:
        raise InputError(str(error)) from None
    normals = np.asarray(voxels.normals, dtype=float)
    seen = normals.any(axis=1)
    return PointCloud(np.asarray(voxels.points, dtype=float)[seen], normals[seen])


def _region_of_interest(
    shape: tuple[int, ...], K: NDArray[np.floating], X_WC: RigidTransform, box: Box
) -> tuple[slice, slice]:
    """Rows and columns that can see the box, with a rim for the normals' windows."""
    corners_B = 0.5 * np.array(box.size) * (np.indices((2, 2, 2)).reshape(3, 8).T * 2 - 1)
    p_C = (X_WC.inverse() @ box.X_WB).multiply(corners_B.T)
    if np.any(p_C[2] < 0.01):  # the box reaches behind the camera: look everywhere
        return slice(0, shape[0]), slice(0, shape[1])
    u, v, _ = K @ (p_C / p_C[2])
    rim = 5
    low = np.clip([v.min() - rim, u.min() - rim], 0, shape)
    high = np.clip([v.max() + rim + 1, u.max() + rim + 1], 0, shape)
    return slice(int(low[0]), int(high[0])), slice(int(low[1]), int(high[1]))
