"""Normals from neighbours, on the cloud of the voxel benchmark."""

import os
from pathlib import Path

import numpy as np

from benchmarks import voxel
from benchmarks.framework import Contender, Results, Samples, time_calls

TITLE = "Normals of 300 000 points from their neighbours, and how far from exact they are"
RADIUS = 0.01
NEIGHBORS = 30
WITHIN = "within 1 cm"
WITHIN_TWO = "within 1 cm, two threads"
NEAREST = "30 neighbours"
ERROR = "within 1 cm: median angle to NumPy's eigenvectors"
REPEATS = 5


def prepare(folder: Path) -> None:
    """Writes the points (N, 3) and, for every 300th, the exact normal within the radius."""
    from scipy.spatial import KDTree

    voxel.prepare(folder)
    points = _load(folder)
    rows = np.arange(0, len(points), 300)
    near = KDTree(points).query_ball_point(points[rows], RADIUS)
    normals = [np.linalg.eigh(np.cov(points[row].T))[1][:, 0] for row in near]
    np.savez(folder / "exact.npz", rows=rows, normals=normals)


def _load(folder: Path) -> np.ndarray:
    return np.load(folder / "points.npy").astype(float)


def _median_angle(folder: Path, normals: np.ndarray) -> list[float]:
    """Degrees between the lines of some normals and the exact ones."""
    exact = np.load(folder / "exact.npz")
    u, v = normals[exact["rows"]], exact["normals"]
    cross = np.linalg.norm(np.cross(u, v), axis=1)
    return [float(np.median(np.degrees(np.arctan2(cross, np.abs((u * v).sum(axis=1))))))]


def ours(folder: Path) -> Results:
    """In a process that has imported Drake as a user's would."""
    from prehensile.perception.cloud import PointCloud
    from prehensile.perception.normals import estimate_normals

    cloud = PointCloud(_load(folder))
    within = time_calls(lambda: estimate_normals(cloud, radius=RADIUS), REPEATS)
    two = time_calls(lambda: estimate_normals(cloud, radius=RADIUS, num_threads=2), REPEATS)
    nearest = time_calls(lambda: estimate_normals(cloud, neighbors=NEIGHBORS), REPEATS)
    normals = estimate_normals(cloud, radius=RADIUS).require_normals()
    return {
        WITHIN: Samples(within, "s"),
        WITHIN_TWO: Samples(two, "s"),
        NEAREST: Samples(nearest, "s"),
        ERROR: Samples(_median_angle(folder, normals), "deg"),
    }


def open3d(folder: Path) -> Results:
    """``open3d.geometry.PointCloud.estimate_normals``, on one thread."""
    os.environ["OMP_NUM_THREADS"] = "1"  # Read when the library is loaded.
    import open3d  # pyright: ignore[reportMissingImports]

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(_load(folder)))
    radius = open3d.geometry.KDTreeSearchParamRadius(RADIUS)
    nearest = open3d.geometry.KDTreeSearchParamKNN(NEIGHBORS)
    # Normals that are already there would be kept in direction, at some cost.
    plain = open3d.geometry.PointCloud(cloud)

    def estimate(parameter: object) -> object:
        plain.normals = open3d.utility.Vector3dVector()
        plain.estimate_normals(parameter)
        return plain

    within_times = time_calls(lambda: estimate(radius), REPEATS)
    nearest_times = time_calls(lambda: estimate(nearest), REPEATS)
    return {WITHIN: Samples(within_times, "s"), NEAREST: Samples(nearest_times, "s")}


def small_gicp(folder: Path) -> Results:
    """``small_gicp.estimate_normals``, its tree included."""
    import small_gicp  # pyright: ignore[reportMissingImports]

    points = _load(folder)

    def estimate() -> object:
        cloud = small_gicp.PointCloud(points)
        small_gicp.estimate_normals(cloud, num_neighbors=NEIGHBORS, num_threads=1)
        return cloud

    return {NEAREST: Samples(time_calls(estimate, REPEATS), "s")}


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("Open3D", open3d, requirements=("open3d==0.20.0",)),
    Contender("small_gicp", small_gicp, requirements=("small-gicp==1.0.1", "numpy")),
)
