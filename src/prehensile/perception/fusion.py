"""Several depth images of one scene to one cloud with normals."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.errors import InputError
from prehensile.perception.cloud import Box, Cloud, inside_box, rotate
from prehensile.perception.depth import normals_from_depth, unproject


def fuse_depth_images(
    depths: Sequence[NDArray[np.floating]],
    Ks: Sequence[NDArray[np.floating]],
    X_WCs: Sequence[RigidTransform],
    box: Box,
    voxel_size: float,
    *,
    rgbs: Sequence[NDArray[np.uint8]] | None = None,
) -> Cloud:
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
        rgbs: colour images (H, W, 3 or 4), registered to the depth images.

    Returns:
        The cloud in W: the mean of the points of each voxel, ordered by voxel.

    Raises:
        InputError: if the sequences differ in length, or an image or K has a wrong shape.
    """
    if not len(depths) == len(Ks) == len(X_WCs) or (
        rgbs is not None and len(rgbs) != len(depths)
    ):
        raise InputError("depths, Ks, X_WCs and rgbs must have one entry per camera")
    points, normals, colors = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3))]
    for i, (depth, K, X_WC) in enumerate(zip(depths, Ks, X_WCs, strict=True)):
        if rgbs is not None and rgbs[i].shape[:2] != depth.shape:
            raise InputError(f"rgbs[{i}] has shape {rgbs[i].shape}; depth has {depth.shape}")
        rows, columns = _region_of_interest(depth.shape, K, X_WC, box)
        K_roi = K - np.array([[0, 0, columns.start], [0, 0, rows.start], [0, 0, 0]])
        p_C = unproject(depth[rows, columns], K_roi)
        inside = inside_box(p_C, Box(X_WC.inverse() @ box.X_WB, box.size))
        normals_C = normals_from_depth(np.where(inside, depth[rows, columns], np.nan), K_roi)
        keep = np.isfinite(normals_C[:, :, 0])
        R_WC = X_WC.rotation().matrix()
        points.append(rotate(p_C[keep], R_WC) + X_WC.translation())
        normals.append(rotate(normals_C[keep], R_WC))
        if rgbs is not None:
            colors.append(rgbs[i][rows, columns, :3][keep] / 255.0)
    return voxel_downsample(
        Cloud(
            np.concatenate(points),
            np.concatenate(normals),
            None if rgbs is None else np.concatenate(colors),
        ),
        voxel_size,
    )


def voxel_downsample(cloud: Cloud, voxel_size: float) -> Cloud:
    """One point per occupied voxel: the mean of its points, normals and colours.

    Voxels are the cells of the grid through the origin. A voxel whose normals cancel (both sides
    of a sheet thinner than the voxel) has no normal and is dropped. Points come out ordered by
    their voxels' integer coordinates (x, then y, then z).

    Raises:
        InputError: if voxel_size is not positive, or so small that the grid does not fit.
    """
    if not voxel_size > 0:
        raise InputError(f"voxel_size is {voxel_size}; it must be positive")
    if len(cloud) == 0:
        return cloud
    cell = np.floor(cloud.points / voxel_size)
    cell -= cell.min(axis=0)
    extent = cell.max(axis=0) + 1
    if np.prod(extent) > 2**62:
        raise InputError(f"voxel_size {voxel_size} is too small for a cloud of this extent")
    key = (cell[:, 0] * extent[1] + cell[:, 1]) * extent[2] + cell[:, 2]
    _, inverse, count = np.unique(key.astype(np.int64), return_inverse=True, return_counts=True)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        sums = [np.bincount(inverse, values[:, k], len(count)) for k in range(3)]
        return np.stack(sums, axis=-1) / count[:, None]

    normals = mean(cloud.normals)
    length = np.linalg.norm(normals, axis=1)
    keep = length > 0.3
    return Cloud(
        mean(cloud.points)[keep],
        normals[keep] / length[keep, None],
        None if cloud.rgb is None else mean(cloud.rgb)[keep],
    )


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
