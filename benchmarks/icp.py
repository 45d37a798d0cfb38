"""Iterative closest points beside the same algorithms of others, on the trials of refinement."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import refinement
from benchmarks.framework import Contender, Results

TITLE = "Iterative closest points, some 4000 points of one view, 12 starts an angle, one thread"
PLANE = "plane"
GENERALIZED = "generalized"
POINT = "point"
RADIUS = 0.006  # Of the neighbourhoods for the scene's normals (m).

prepare = refinement.prepare


def _all(run: Callable[[str], Results], kinds: tuple[str, ...]) -> Results:
    """The results of several kinds, each case named by its kind."""
    return {f"{kind}: {case}": samples for kind in kinds for case, samples in run(kind).items()}


def ours(folder: Path) -> Results:
    """``icp`` with the model prepared once; the scene's normals, where needed, are timed."""
    from pydrake.math import RigidTransform

    from prehensile.perception import PointCloud, estimate_normals
    from prehensile.perception.registration import IcpConfig, IcpKind, IcpModel, icp

    kinds = {
        PLANE: IcpKind.POINT_TO_PLANE,
        GENERALIZED: IcpKind.GENERALIZED,
        POINT: IcpKind.POINT_TO_POINT,
    }

    def run(kind: str) -> Results:
        config = IcpConfig(kinds[kind], max_distance=refinement.FAR)

        def solve(model: Any, scene: Any, guess: Any) -> Any:
            cloud = PointCloud(scene)
            if kind == GENERALIZED:
                cloud = estimate_normals(cloud, radius=RADIUS)
            result = icp(cloud, model, RigidTransform(guess), config)
            return np.eye(4) if result.X_WO is None else result.X_WO.GetAsMatrix4()

        def load(_: str, model: refinement.Model) -> Any:
            return IcpModel(PointCloud(model[0], normals=model[1]))

        return refinement._measure(folder, 2, load, solve)

    return _all(run, (PLANE, GENERALIZED, POINT))


def small_gicp(folder: Path) -> Results:
    """``small_gicp.align``; it has no index of the scene to build for the plane."""
    names = {PLANE: "PLANE_ICP", GENERALIZED: "GICP", POINT: "ICP"}
    return _all(
        lambda kind: refinement._small_gicp(folder, names[kind]), (PLANE, GENERALIZED, POINT)
    )


def open3d(folder: Path) -> Results:
    """``open3d.pipelines.registration``."""
    names = {PLANE: "plane", GENERALIZED: "gicp", POINT: "point"}
    return _all(lambda kind: refinement._open3d(folder, names[kind]), (PLANE, GENERALIZED, POINT))


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("small_gicp", small_gicp, requirements=refinement._SMALL_GICP),
    Contender("Open3D", open3d, requirements=refinement._OPEN3D),
)
