"""Coherent point drift of full views beside pycpd, to the same answer."""

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import refinement
from benchmarks.framework import ROOT, Contender, Results, Samples, time_calls

TITLE = "Coherent point drift, full views, one thread, to the same number of iterations"
SIZES = (1000, 2000)
ITERATIONS = 50
OUTLIERS = 0.1
NOISE = 0.001  # Standard deviation of the scene's points (m).


def prepare(folder: Path) -> None:
    """Writes models and noisy scenes that are other samples of the same surface, turned by 35°."""
    from prehensile.perception.mesh_file import read_mesh

    rng = np.random.default_rng(0)
    mesh = read_mesh(ROOT / refinement.BOTTLE)
    R = refinement._rotation(np.array([1.0, 2.0, -1.0]), np.deg2rad(35))
    for size in SIZES:
        points, _ = refinement._sample(mesh.vertices, mesh.triangles, 2 * size, rng)
        points -= points.mean(axis=0)
        scene = points[size:] @ R.T + [0.03, 0.01, -0.02] + rng.normal(0, NOISE, (size, 3))
        np.savez(folder / f"{size}.npz", model=points[:size], scene=scene)


def _results(poses: dict[int, Any], seconds: dict[int, float], folder: Path, name: str) -> Results:
    """Times, and how far our pose lies from theirs at the corners of a cube of 0.2 m."""
    results = {f"{size} points": Samples([seconds[size]], "s") for size in SIZES}
    corners = 0.1 * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    for size in SIZES:
        np.save(folder / f"{name}-{size}.npy", poses[size])
        ours = folder / f"ours-{size}.npy"
        if name != "ours" and ours.exists():
            a, b = (corners @ X[:3, :3].T + X[:3, 3] for X in (np.load(ours), poses[size]))
            apart = float(np.abs(a - b).max())
            results[f"{size} points, apart from ours"] = Samples([1e9 * apart], "nm")
    return results


def ours(folder: Path) -> Results:
    """``coherent_point_drift`` with the outliers' density that pycpd supposes."""
    from prehensile.perception import PointCloud
    from prehensile.perception.registration import PointDriftConfig, coherent_point_drift

    poses, seconds = {}, {}
    for size in SIZES:
        with np.load(folder / f"{size}.npz") as file:
            model, scene = PointCloud(file["model"]), PointCloud(file["scene"])
        config = PointDriftConfig(
            outlier_weight=OUTLIERS,
            outlier_volume=size,
            max_iterations=ITERATIONS,
            tolerance=0.0,
        )
        result = coherent_point_drift(scene, model, config=config)
        assert result.X_WO is not None
        poses[size] = result.X_WO.GetAsMatrix4()
        times = time_calls(partial(coherent_point_drift, scene, model, config=config), 5)
        seconds[size] = float(np.median(times))
    return _results(poses, seconds, folder, "ours")


def pycpd(folder: Path) -> Results:
    """``pycpd.RigidRegistration`` kept from changing the scale, as rigid bodies do not."""
    from pycpd import RigidRegistration  # pyright: ignore[reportMissingImports]

    class Rigid(RigidRegistration):
        def update_transform(self) -> None:
            super().update_transform()
            mean_x = self.Pt1 @ self.X / self.Np
            mean_y = self.P1 @ self.Y / self.Np
            self.s, self.t = 1.0, mean_x - self.R.T @ mean_y

        def update_variance(self) -> None:
            super().update_variance()
            squares = self.Pt1 @ (self.X_hat**2).sum(axis=1)
            self.sigma2 = squares + self.YPY - 2 * np.trace(self.A @ self.R)
            self.sigma2 /= self.Np * self.D

    poses, seconds = {}, {}
    for size in SIZES:
        with np.load(folder / f"{size}.npz") as file:
            model, scene = file["model"], file["scene"]
        start = time.perf_counter()
        drift = Rigid(X=scene, Y=model, w=OUTLIERS, max_iterations=ITERATIONS, tolerance=0.0)
        drift.register()
        seconds[size] = time.perf_counter() - start
        poses[size] = np.eye(4)
        poses[size][:3, :3], poses[size][:3, 3] = drift.R.T, drift.t
    return _results(poses, seconds, folder, "pycpd")


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("pycpd", pycpd, requirements=("pycpd==2.0.0", "numpy")),
)
