"""Clouds of simple solids with exact normals, as three cameras above would see them."""

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform

from prehensile.perception import PointCloud, downsample, merge

VOXEL = 0.004


def box_cloud(size: Sequence[float], X_WB: RigidTransform, faces: str = "xXyYZ") -> PointCloud:
    """A box's faces in voxels: x is the one at -x, X the one at +x, and so on."""
    points, normals = [], []
    for face in faces:
        axis, sign = "xyz".index(face.lower()), 1.0 if face.isupper() else -1.0
        others = [k for k in range(3) if k != axis]
        steps = [np.linspace(-size[k] / 2, size[k] / 2, int(size[k] / 0.001)) for k in others]
        p = np.zeros((len(steps[0]) * len(steps[1]), 3))
        p[:, others] = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
        p[:, axis] = sign * size[axis] / 2
        n = np.zeros_like(p)
        n[:, axis] = sign
        points.append(p)
        normals.append(n)
    cloud = PointCloud(np.concatenate(points), np.concatenate(normals))
    return downsample(cloud.transformed(X_WB), VOXEL)


def cylinder_cloud(radius: float, height: float, X_WB: RigidTransform) -> PointCloud:
    """A cylinder along its z axis, with both ends."""
    angle, z = np.meshgrid(
        np.arange(0, 2 * np.pi, 0.001 / radius), np.arange(-height / 2, height / 2, 0.001)
    )
    n = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1).reshape(-1, 3)
    wall = PointCloud(radius * n + [0, 0, 1] * z.reshape(-1, 1), n)
    grid = np.stack(np.meshgrid(*[np.arange(-radius, radius, 0.001)] * 2), -1).reshape(-1, 2)
    grid = grid[np.linalg.norm(grid, axis=1) < radius]
    ends = [
        PointCloud(
            np.column_stack([grid, np.full(len(grid), sign * height / 2)]),
            np.tile([0.0, 0.0, sign], (len(grid), 1)),
        )
        for sign in (-1.0, 1.0)
    ]
    return downsample(merge([wall, *ends]).transformed(X_WB), VOXEL)


def sphere_cloud(radius: float, centre: Sequence[float]) -> PointCloud:
    """A sphere, evenly covered (Fibonacci's spiral)."""
    count = int(4 * np.pi * radius**2 / 1e-6)
    k = np.arange(count)
    z = 1 - (2 * k + 1) / count
    turn = k * np.pi * (3 - np.sqrt(5))
    s = np.sqrt(1 - z * z)
    n = np.stack([s * np.cos(turn), s * np.sin(turn), z], axis=-1)
    return downsample(PointCloud(np.array(centre) + radius * n, n), VOXEL)
