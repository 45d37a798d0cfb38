"""A known object found in one noisy depth view, without a guess, and its pose refined.

Timed is what a user pays for every new scene, from a crop of points (N, 3) to a refined pose:
down-sampling, normals and features of the scene, matching, solving, refinement and, for us, the
verdict whether to believe it. What depends on the model alone is prepared before and not timed,
but for KISS-Matcher, whose interface takes both clouds at each call. All are held on one core, and
times are those that the processor worked.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework import ROOT, Contender, Results, Samples
from benchmarks.refinement import BOTTLE, BUNNY, _outward, _rotation, _sample

TITLE = "Crop to refined pose, some 4000 points of one view, 30 random poses, one core"
TRIALS = 30
NOISE = 0.0015  # Standard deviation of the depth (m).
PIXEL = 0.002  # What a pixel sees at the object's distance (m).
DISTANCE = 0.6
CLUTTER = 0.2  # Part of the scene that is of other things, in the cluttered trials.
SUCCESS = 0.02  # Of the diameter: mean distance of nearest points (ADD-S).
VOXEL = 0.005  # Of the peers (m).
NAMES = ("bunny", "bottle")


def prepare(folder: Path) -> None:
    """Writes for each model points and normals, and the bottle's mesh; scenes and poses."""
    from prehensile.perception import PointCloud, estimate_normals
    from prehensile.perception.distance_field import DistanceField
    from prehensile.perception.mesh_file import read_mesh

    rng = np.random.default_rng(0)
    mesh = read_mesh(ROOT / BOTTLE)
    np.savez(folder / "bottle_mesh.npz", vertices=mesh.vertices, triangles=mesh.triangles)
    models = {"bottle": _sample(mesh.vertices, mesh.triangles, 100_000, rng)}
    for path in sorted(ROOT.glob(BUNNY))[:1]:
        points = np.load(path).T
        cloud = estimate_normals(PointCloud(points), radius=0.006)
        cloud = cloud.replace(normals=_outward(points, cloud.require_normals()))
        # Points of the surface between those of the cloud, so that scenes and model share none.
        field = DistanceField.from_cloud(cloud, 0.002)
        near = np.repeat(points, 12, axis=0) + rng.normal(0, 0.0015, (12 * len(points), 3))
        surface = field.closest(near)
        models["bunny"] = (surface.points, surface.normals)
    for name, (points, normals) in models.items():
        few = rng.permutation(len(points))[:8000]
        np.savez(folder / f"{name}.npz", points=points[few], normals=normals[few])
        for trial in range(TRIALS):
            scene, X_CO = _view(points, normals, rng)
            cluttered = np.concatenate([scene, _clutter(scene, rng)])
            np.savez(
                folder / f"{name}-{trial}.npz",
                clean=scene,
                cluttered=cluttered[rng.permutation(len(cluttered))],
                X_CO=X_CO,
            )


def _view(points: Any, normals: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """One point per pixel of a camera at the origin that looks along z, and the object's pose."""
    X_CO = np.eye(4)
    X_CO[:3, :3] = _rotation(rng.normal(size=3), rng.uniform(0, np.pi))
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    X_CO[:3, 3] = [*rng.uniform(-0.05, 0.05, 2), DISTANCE] - X_CO[:3, :3] @ middle
    p = points @ X_CO[:3, :3].T + X_CO[:3, 3]
    p = p[(p * (normals @ X_CO[:3, :3].T)).sum(axis=1) < -0.05]
    pixel = np.floor(p[:, :2] / p[:, 2:] * DISTANCE / PIXEL).astype(int)
    pixel -= pixel.min(axis=0)
    key = pixel[:, 0] * (pixel[:, 1].max() + 1) + pixel[:, 1]
    # The nearest point of a pixel hides the others, and in its neighbours what lies well behind.
    width = pixel.max(axis=0) + 3
    front = np.full(width, np.inf)
    np.minimum.at(front, (pixel[:, 0] + 1, pixel[:, 1] + 1), p[:, 2])
    around = np.min(
        [np.roll(front, (i, j), axis=(0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0
    )
    order = np.lexsort((p[:, 2], key))
    first = order[np.concatenate([[True], np.diff(key[order]) > 0])]
    first = first[p[first, 2] < around[pixel[first, 0] + 1, pixel[first, 1] + 1] + 0.008]
    scene = p[rng.permutation(first)]
    return scene * (1 + rng.normal(0, NOISE, (len(scene), 1)) / scene[:, 2:]), X_CO


def _clutter(scene: Any, rng: np.random.Generator) -> Any:
    """A piece of a table behind the object and half a ball beside it."""
    count = int(CLUTTER / (1 - CLUTTER) * len(scene))
    plane = rng.uniform(-0.08, 0.08, (count // 2, 3)) * [1, 0.8, 0]
    plane[:, 2] = 0.75 * plane[:, 1] + 0.06
    ball = rng.normal(size=(count - count // 2, 3))
    ball *= 0.03 / np.linalg.norm(ball, axis=1, keepdims=True)
    ball[:, 2] = -np.abs(ball[:, 2])
    turn = rng.uniform(0, 2 * np.pi)
    ball += 0.09 * np.array([np.cos(turn), np.sin(turn), 0])
    return scene.mean(axis=0) + np.concatenate([plane, ball]) + rng.normal(0, 0.001, (count, 3))


def _measure(
    folder: Path, load: Callable[[str, Any, Any], Any], solve: Callable[[Any, Any], Any]
) -> Results:
    """Times solve(model, scene) -> X_CO on all trials, and counts what came right.

    Args:
        load: makes of a model's name, points and normals what a user keeps of it; not timed.
    """
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    results = {}
    for name in NAMES:
        if not (folder / f"{name}.npz").exists():
            continue
        with np.load(folder / f"{name}.npz") as file:
            points = file["points"]
            model = load(name, points, file["normals"])
        for kind in ("clean", "cluttered"):
            seconds, right = [], 0
            for trial in range(TRIALS):
                with np.load(folder / f"{name}-{trial}.npz") as file:
                    scene, X_CO = file[kind], file["X_CO"]
                if not trial:
                    solve(model, scene)
                start = time.process_time()
                found = solve(model, scene)
                seconds.append(time.process_time() - start)
                right += _is_right(points[::4], X_CO, found)
            case = name if kind == "clean" else f"{name}, {CLUTTER:.0%} clutter"
            results[case] = Samples(seconds, "s")
            results[f"{case}, right"] = Samples([float(right)], f"of {TRIALS}", more_is_better=True)
    return results


def _is_right(points: Any, X_CO: Any, found: Any) -> bool:
    a, b = (points @ X[:3, :3].T + X[:3, 3] for X in (X_CO, found))
    nearest = np.array([np.linalg.norm(b - p, axis=1).min() for p in a])
    return bool(nearest.mean() < SUCCESS * np.linalg.norm(np.ptp(points, axis=0)))


def ours(folder: Path) -> Results:
    """``locate``: point-pair votes, refinement on the distance field, verification."""
    from prehensile.perception import PointCloud
    from prehensile.perception.mesh import TriangleMesh
    from prehensile.perception.registration import KnownObject, locate

    def load(name: str, points: Any, normals: Any) -> Any:
        if name == "bottle":
            with np.load(folder / "bottle_mesh.npz") as file:
                mesh = TriangleMesh(file["vertices"], file["triangles"])
            return KnownObject.from_mesh(mesh, cache_dir=folder / "fields")
        return KnownObject.from_cloud(PointCloud(points, normals))

    def solve(model: Any, scene: Any) -> Any:
        result = locate(PointCloud(scene, sensor_origins=np.zeros(3)), model)
        # A pose that is not believed counts as none.
        if result.X_WO is None or result.status.value in ("no_consensus", "low_overlap"):
            return np.eye(4)
        return result.X_WO.GetAsMatrix4()

    return _measure(folder, load, solve)


def open3d(folder: Path) -> Results:
    """FPFH, ``registration_ransac_based_on_feature_matching``, then ICP point to plane."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import open3d  # pyright: ignore[reportMissingImports]

    registration = open3d.pipelines.registration
    near = open3d.geometry.KDTreeSearchParamHybrid

    def features(cloud: Any) -> tuple[Any, Any]:
        few = cloud.voxel_down_sample(VOXEL)
        if not few.has_normals():
            few.estimate_normals(near(2 * VOXEL, 30))
            few.orient_normals_towards_camera_location(np.zeros(3))
        return few, registration.compute_fpfh_feature(few, near(5 * VOXEL, 100))

    def load(_: str, points: Any, normals: Any) -> Any:
        model = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        model.normals = open3d.utility.Vector3dVector(normals)
        return model, *features(model)

    def solve(model: Any, scene: Any) -> Any:
        cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(scene))
        few, feature = features(cloud)
        reach = 1.5 * VOXEL
        found = registration.registration_ransac_based_on_feature_matching(
            *(few, model[1], feature, model[2], True, reach),
            registration.TransformationEstimationPointToPoint(False),
            3,
            [
                registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                registration.CorrespondenceCheckerBasedOnDistance(reach),
            ],
            registration.RANSACConvergenceCriteria(100_000, 0.999),
        )
        refined = registration.registration_icp(
            *(cloud, model[0], 2 * VOXEL, found.transformation),
            registration.TransformationEstimationPointToPlane(),
        )
        return np.linalg.inv(refined.transformation)

    return _measure(folder, load, solve)


def kiss_matcher(folder: Path) -> Results:
    """``KISSMatcher.estimate``, then small_gicp's ICP point to plane."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import kiss_matcher  # pyright: ignore[reportMissingImports]
    import small_gicp  # pyright: ignore[reportMissingImports]

    scale = 100.0  # It refuses voxels of millimetres.
    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(scale * VOXEL))

    # It turns normals toward the origin. They are alike in both clouds only where both origins lie
    # inside the object, so it gets them shifted that way.
    def load(_: str, points: Any, normals: Any) -> Any:
        target = small_gicp.PointCloud(points)
        tree = small_gicp.KdTree(target)
        small_gicp.estimate_normals_covariances(target, tree, 20, 1)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        return (scale * (points - middle)).astype(np.float32), middle, target, tree

    def solve(model: Any, scene: Any) -> Any:
        inside = scene.mean(axis=0)
        inside *= 1 + 0.04 / np.linalg.norm(inside)
        found = matcher.estimate((scale * (scene - inside)).astype(np.float32), model[0])
        start = np.eye(4)
        start[:3, :3] = found.rotation
        start[:3, 3] = np.ravel(found.translation) / scale + model[1] - start[:3, :3] @ inside
        answer = small_gicp.align(
            *(model[2], small_gicp.PointCloud(scene), model[3]),
            init_T_target_source=start,
            registration_type="PLANE_ICP",
            max_correspondence_distance=2 * VOXEL,
            num_threads=1,
        )
        return np.linalg.inv(answer.T_target_source)

    return _measure(folder, load, solve)


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("Open3D RANSAC", open3d, requirements=("open3d==0.20.0",)),
    Contender(
        "KISS-Matcher",
        kiss_matcher,
        requirements=("kiss-matcher==1.0.2", "small-gicp==1.0.1", "numpy"),
    ),
)
