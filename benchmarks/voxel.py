"""Voxel down-sampling of a bin scene as three depth cameras see it."""

from pathlib import Path

import numpy as np

from benchmarks.framework import Contender, Results, Samples, time_calls

TITLE = "Voxel down-sampling, 300 000 points, 5 mm voxels, one thread"
VOXEL_SIZE = 0.005
POINTS = "points"
NORMALS = "points and normals"


def prepare(folder: Path) -> None:
    """Writes points (N, 3) in pixel order of three cameras, and unit normals, as float32."""
    rng = np.random.default_rng(0)
    clouds, normals = [], []
    side = 316
    for angle in (0.3, 2.4, 4.5):
        u, v = np.meshgrid(np.linspace(-0.35, 0.35, side), np.linspace(-0.35, 0.35, side))
        x = np.cos(angle) * u - np.sin(angle) * v
        y = np.sin(angle) * u + np.cos(angle) * v
        # Heaps of the size of household objects, with steps between them; 1 mm of noise.
        z = 0.08 * np.sin(14 * x) * np.cos(11 * y) + 0.06 * (np.floor(9 * x + 5 * y) % 2)
        points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        clouds.append(points + rng.normal(0, 0.001, points.shape))
        normal = rng.normal(0, 0.3, points.shape) + [0, 0, 1]
        normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    np.save(folder / "points.npy", np.concatenate(clouds).astype(np.float32))
    np.save(folder / "normals.npy", np.concatenate(normals).astype(np.float32))


def _load(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    return np.load(folder / "points.npy"), np.load(folder / "normals.npy")


def ours(folder: Path) -> Results:
    """The kernel, in a process that has imported Drake as a user's would."""
    import pydrake.math  # noqa: F401

    from prehensile.native import voxel_downsample

    points, normals = _load(folder)
    plain = time_calls(lambda: voxel_downsample(points, VOXEL_SIZE))
    carried = time_calls(lambda: voxel_downsample(points, VOXEL_SIZE, normals=normals))
    return {POINTS: Samples(plain, "s"), NORMALS: Samples(carried, "s")}


def open3d(folder: Path) -> Results:
    """``open3d.geometry.PointCloud.voxel_down_sample``."""
    import open3d  # pyright: ignore[reportMissingImports]

    points, normals = _load(folder)
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(float)))
    plain = time_calls(lambda: cloud.voxel_down_sample(VOXEL_SIZE))
    cloud.normals = open3d.utility.Vector3dVector(normals.astype(float))
    carried = time_calls(lambda: cloud.voxel_down_sample(VOXEL_SIZE))
    return {POINTS: Samples(plain, "s"), NORMALS: Samples(carried, "s")}


def small_gicp(folder: Path) -> Results:
    """``small_gicp.voxelgrid_sampling``, which carries no normals."""
    import small_gicp  # pyright: ignore[reportMissingImports]

    cloud = small_gicp.PointCloud(_load(folder)[0].astype(float))
    plain = time_calls(lambda: small_gicp.voxelgrid_sampling(cloud, VOXEL_SIZE, 1))
    return {POINTS: Samples(plain, "s")}


def drake(folder: Path) -> Results:
    """``PointCloud.VoxelizedDownSample``."""
    from pydrake.perception import BaseField, Fields, PointCloud

    points, normals = _load(folder)
    plain_cloud = PointCloud(len(points))
    plain_cloud.mutable_xyzs()[:] = points.T
    cloud = PointCloud(len(points), Fields(int(BaseField.kXYZs) | int(BaseField.kNormals)))
    cloud.mutable_xyzs()[:] = points.T
    cloud.mutable_normals()[:] = normals.T
    plain = time_calls(lambda: plain_cloud.VoxelizedDownSample(VOXEL_SIZE), repeats=5)
    carried = time_calls(lambda: cloud.VoxelizedDownSample(VOXEL_SIZE), repeats=5)
    return {POINTS: Samples(plain, "s"), NORMALS: Samples(carried, "s")}


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("Open3D", open3d, requirements=("open3d==0.20.0",)),
    Contender("small_gicp", small_gicp, requirements=("small-gicp==1.0.1", "numpy")),
    Contender("Drake", drake),
)
