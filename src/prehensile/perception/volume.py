"""Truncated signed distances and occupancy from depth images, on a grid of voxels."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.errors import InputError
from prehensile.native import _core
from prehensile.perception.cloud import Box, PointCloud, rotate
from prehensile.perception.free_space import DepthView

_MAX_VOXELS = 1 << 28


class Occupancy(IntEnum):
    """What is known of a place."""

    UNKNOWN = -1
    """No ray came here, or only behind a surface."""
    FREE = 0
    """Rays went through."""
    OCCUPIED = 1
    """A surface, or just behind one."""


@dataclass(frozen=True, eq=False)
class DepthVolume:
    """Signed distances from what depth cameras saw, with the free space along their rays.

    Voxel (i, j, k) has its centre, in the box's frame B, at ((i, j, k) + 1/2) voxel_size minus
    half the box's size.

    Attributes:
        region: the box that the grid fills, in W.
        voxel_size: edge of a voxel [m].
        truncation: distances are kept up to this far in front of a surface and behind it [m].
        distances: (nx, ny, nz) float32 mean signed distance of each voxel's centre, positive on
            the cameras' side [m].
        weights: (nx, ny, nz) float32 how much the images said, at most 1 each; 0 where none did.
    """

    region: Box
    voxel_size: float
    truncation: float
    distances: NDArray[np.float32]
    weights: NDArray[np.float32]

    def occupancy(self) -> NDArray[np.int8]:
        """(nx, ny, nz) what is known of each voxel, as values of :class:`Occupancy`.

        Occupied is where the surface passes through or before the voxel: where its centre lies
        less than half a voxel in front.
        """
        state = np.where(self.distances < 0.5 * self.voxel_size, 1, 0).astype(np.int8)
        state[self.weights == 0] = Occupancy.UNKNOWN
        return state

    def occupancy_at(self, points: ArrayLike) -> NDArray[np.int8]:
        """(N,) what is known of the voxels that points (N, 3) in W lie in.

        Points outside the region, and points that are not finite, are unknown.
        """
        index = np.floor(self._index_coordinates(points) + 0.5)
        shape = np.array(self.distances.shape)
        with np.errstate(invalid="ignore"):
            inside = ((index >= 0) & (index < shape)).all(axis=1)
        state = np.full(len(index), Occupancy.UNKNOWN, dtype=np.int8)
        i, j, k = index[inside].astype(np.int64).T
        distance = self.distances[i, j, k]
        known = np.where(distance < 0.5 * self.voxel_size, 1, 0).astype(np.int8)
        known[self.weights[i, j, k] == 0] = Occupancy.UNKNOWN
        state[inside] = known
        return state

    def distance_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """(N,) signed distance at points (N, 3) in W, interpolated between voxel centres [m].

        NaN where one of the eight voxels around has not been seen, or lies outside.
        """
        at = self._index_coordinates(points)
        low = np.floor(at)
        shape = np.array(self.distances.shape)
        with np.errstate(invalid="ignore"):
            inside = ((low >= 0) & (low < shape - 1)).all(axis=1)
        result = np.full(len(at), np.nan)
        base = low[inside].astype(np.int64)
        t = at[inside] - low[inside]
        total = np.zeros(len(base))
        for corner in np.ndindex(2, 2, 2):
            i, j, k = (base + corner).T
            share = np.prod(np.where(corner, t, 1 - t), axis=1)
            value = np.where(self.weights[i, j, k] > 0, self.distances[i, j, k], np.nan)
            total += share * value
        result[inside] = total
        return result

    def surface(self) -> PointCloud:
        """Points where the distance changes its sign between neighbouring voxels, with normals.

        The points lie on the grid's edges, placed by linear interpolation; normals are the
        distance's gradient, so they point to the side that the cameras were on.
        """
        known = self.weights > 0
        d = np.where(known, self.distances, np.nan).astype(np.float64)
        gradient = np.zeros((*d.shape, 3))
        for axis in range(3):
            if d.shape[axis] > 1:
                gradient[..., axis] = np.gradient(d, axis=axis)
        points, normals = [], []
        for axis in range(3):
            here = tuple(slice(None, -1) if a == axis else slice(None) for a in range(3))
            there = tuple(slice(1, None) if a == axis else slice(None) for a in range(3))
            a, b = d[here], d[there]
            near = np.maximum(np.abs(a), np.abs(b)) < 0.999 * self.truncation
            cross = np.nonzero(((a < 0) != (b < 0)) & near)
            t = a[cross] / (a[cross] - b[cross])
            p = np.stack(cross, axis=1).astype(np.float64)
            p[:, axis] += t
            points.append(p)
            blend = (1 - t)[:, None] * gradient[here][cross] + t[:, None] * gradient[there][cross]
            normals.append(blend)
        n = np.concatenate(normals)
        length = np.linalg.norm(n, axis=1)
        usable = np.isfinite(length) & (length > 0)
        n = n[usable] / length[usable, None]
        p_B = (np.concatenate(points)[usable] + 0.5) * self.voxel_size - 0.5 * self._extent()
        R_WB = np.asarray(self.region.X_WB.rotation().matrix(), dtype=float)
        return PointCloud(rotate(p_B, R_WB) + self.region.X_WB.translation(), rotate(n, R_WB))

    def integrated(
        self,
        views: DepthView | Sequence[DepthView],
        *,
        min_depth: float = 0.05,
        max_depth: float = 10.0,
        num_threads: int = 1,
    ) -> "DepthVolume":
        """This volume with the depth images of one moment more; see :func:`fuse_volume`."""
        result = DepthVolume(
            self.region,
            self.voxel_size,
            self.truncation,
            self.distances.copy(),
            self.weights.copy(),
        )
        for view in [views] if isinstance(views, DepthView) else views:
            depth, K, X_WC, ignored = view.native()
            if ignored is not None:
                depth = np.where(ignored.view(np.bool_), np.float32(0), depth)
            _core.integrate_depth(
                result.distances,
                result.weights,
                self.voxel_size,
                self.region.X_WB.GetAsMatrix4(),
                depth,
                [K[0, 0], K[1, 1], K[0, 2], K[1, 2]],
                X_WC,
                self.truncation,
                min_depth,
                max_depth,
                num_threads,
            )
        return result

    def _extent(self) -> NDArray[np.float64]:
        """Edge lengths of the grid [m]."""
        return self.voxel_size * np.array(self.distances.shape, dtype=np.float64)

    def _index_coordinates(self, points: ArrayLike) -> NDArray[np.float64]:
        """Points (N, 3) in W as places in the grid: whole numbers at voxel centres."""
        p = np.asarray(points, dtype=np.float64)
        if p.ndim != 2 or p.shape[1] != 3:
            raise ValueError(f"points: expected shape (N, 3), not {p.shape}")
        X_BW = self.region.X_WB.inverse()
        p_B = rotate(p, np.asarray(X_BW.rotation().matrix(), dtype=float)) + X_BW.translation()
        return (p_B + 0.5 * self._extent()) / self.voxel_size - 0.5


def fuse_volume(
    views: DepthView | Sequence[DepthView],
    region: Box,
    voxel_size: float,
    *,
    truncation: float | None = None,
    min_depth: float = 0.05,
    max_depth: float = 10.0,
    num_threads: int = 1,
) -> DepthVolume:
    """Truncated signed distances of what depth cameras see in a region, and its free space.

    Each image compares each voxel with the return of the pixel that it projects onto: the way
    along the ray, times the cosine of incidence, is the distance from the plane seen there. The
    images' answers are averaged, weighed by that cosine and by how near the surface is (Curless
    and Levoy, "A volumetric method for building complex models from range images", 1996; Newcombe
    et al., "KinectFusion", 2011). Where a ray passes well in front of its return the space is
    free: there the distance is the truncation.

    Args:
        views: depth images of pinhole cameras and their poses.
        region: the box to fill, in W; its size is rounded up to whole voxels.
        voxel_size: edge of a voxel [m], > 0.
        truncation: distance from a surface up to which distances are kept [m]; four voxels by
            default. No less than the depth's noise.
        min_depth: depths below it are no measurement [m], > 0.
        max_depth: depths above it are no measurement [m].
        num_threads: at least 1; it does not change the result.

    Raises:
        InputError: if the region is not a box of finite, positive size, voxel_size or truncation
            is not positive, or there would be more than 2^28 voxels.
        ValueError: naming the argument: a view's shapes, intrinsics or pose.
    """
    size = np.asarray(region.size, dtype=np.float64)
    if size.shape != (3,) or not (np.isfinite(size) & (size > 0)).all():
        raise InputError("region: its size must be three positive, finite numbers")
    if not 0 < voxel_size < np.inf:
        raise InputError(f"voxel_size is {voxel_size}; it must be positive and finite")
    truncation = 4 * voxel_size if truncation is None else truncation
    if not 0 < truncation < np.inf:
        raise InputError(f"truncation is {truncation}; it must be positive and finite")
    counts = np.ceil(size / voxel_size - 1e-9)
    if counts.max() > 32768 or np.prod(counts) > _MAX_VOXELS:
        raise InputError(f"voxel_size {voxel_size} is too small for the region: over 2^28 voxels")
    shape = tuple(int(c) for c in np.maximum(counts, 1))
    empty = DepthVolume(
        Box(region.X_WB, voxel_size * np.array(shape, dtype=np.float64)),
        voxel_size,
        truncation,
        np.zeros(shape, dtype=np.float32),
        np.zeros(shape, dtype=np.float32),
    )
    return empty.integrated(
        views, min_depth=min_depth, max_depth=max_depth, num_threads=num_threads
    )
