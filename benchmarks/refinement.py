"""A pose refined from a wrong guess: one noisy depth view against a known model."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework import ROOT, Contender, Results, Samples

TITLE = "Pose refinement, some 4000 points of one view, 12 starts an angle, one thread"
TRIALS = 12
ANGLES = (30, 45, 60)
REPEATS = 3  # Of each solution; the shortest counts.
NOISE = 0.001  # Standard deviation of the scene's points (m).
OFFSET = 0.02  # Of the guess's position (m).
SUCCESS = 0.02  # Of the diameter: mean distance of nearest points (ADD-S).
FAR = 0.05  # Greatest distance of corresponding points for the peers (m).
BUNNY = "build/peers/manipulation/lib/python3*/site-packages/manipulation/models/bunny/bunny.npy"
BOTTLE = "src/prehensile/models/data/mustard_bottle/mustard_bottle.gltf"


def prepare(folder: Path) -> None:
    """Writes models (points, normals; the bottle's mesh, too), scenes, poses and guesses."""
    from prehensile.perception import PointCloud, estimate_normals
    from prehensile.perception.mesh_file import read_mesh

    rng = np.random.default_rng(0)
    mesh = read_mesh(ROOT / BOTTLE)
    dense, dense_normals = _sample(mesh.vertices, mesh.triangles, 60_000, rng)
    models = {"bottle": (dense, dense_normals)}
    np.savez(folder / "bottle_mesh.npz", vertices=mesh.vertices, triangles=mesh.triangles)
    for path in sorted(ROOT.glob(BUNNY)):
        points = np.load(path).T
        cloud = estimate_normals(PointCloud(points), radius=0.006)
        models["bunny"] = (points, _outward(points, cloud.require_normals()))
    for name, (points, normals) in models.items():
        few = rng.permutation(len(points))[:8000]
        np.savez(folder / f"{name}.npz", points=points[few], normals=normals[few])
        for angle in ANGLES:
            for trial in range(TRIALS):
                scene, X_WO, guess = _trial(points, normals, angle, rng)
                path = folder / f"{name}-{angle}-{trial}.npz"
                np.savez(path, scene=scene, X_WO=X_WO, guess=guess)


def _sample(vertices: Any, triangles: Any, count: int, rng: np.random.Generator) -> tuple[Any, Any]:
    """Points spread evenly over triangles, and their normals."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    t = rng.choice(len(triangles), count, p=area / area.sum())
    u, v = rng.uniform(size=(2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return a[t] + u * (b - a)[t] + v * (c - a)[t], normal[t] / area[t, None]


def _outward(points: Any, normals: Any) -> Any:
    """Normals turned alike across neighbours, out of the whole."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
    from scipy.spatial import KDTree

    _, near = KDTree(points).query(points, 12)
    rows, columns = np.repeat(np.arange(len(points)), 12), near.ravel()
    cost = 1.0001 - np.abs((normals[rows] * normals[columns]).sum(axis=1))
    tree = minimum_spanning_tree(csr_matrix((cost, (rows, columns)), shape=(len(points),) * 2))
    top = int(points[:, 2].argmax())
    normals = normals.copy()
    normals[top] *= np.sign(normals[top, 2])
    order, parent = breadth_first_order(tree, top, directed=False)
    for i in order[1:]:
        normals[i] *= np.sign(normals[i] @ normals[parent[i]])
    return normals


def _rotation(axis: Any, angle: float) -> Any:
    x, y, z = axis / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def _trial(points: Any, normals: Any, angle: float, rng: np.random.Generator) -> tuple[Any, ...]:
    """What a camera 0.6 m away sees of a model at a random pose, and a guess that far off."""
    X_WO = np.eye(4)
    X_WO[:3, :3] = _rotation(rng.normal(size=3), rng.uniform(0, np.pi))
    X_WO[:3, 3] = rng.uniform(-0.3, 0.3, 3)
    centre = points.mean(axis=0)
    away = rng.normal(size=3)
    z = -away / np.linalg.norm(away)
    eye = centre - 0.6 * z
    x = np.cross(z, [0.3, 0.5, 0.81])
    y = np.cross(z, x / np.linalg.norm(x))
    p = (points - eye) @ np.stack([np.cross(y, z), y, z], axis=1)
    pixel = np.floor(p[:, :2] / p[:, 2:] * 0.6 / 0.002).astype(int)
    pixel -= pixel.min(axis=0)
    key = pixel[:, 0] * (pixel[:, 1].max() + 1) + pixel[:, 1]
    front = np.full(key.max() + 1, np.inf)
    np.minimum.at(front, key, p[:, 2])
    facing = ((eye - points) * normals).sum(axis=1) > 0.06
    seen = np.flatnonzero(facing & (p[:, 2] < front[key] + 0.004))
    scene = points[rng.permutation(seen)[:4000]]
    scene = scene + rng.normal(0, NOISE, scene.shape)
    guess = np.eye(4)
    guess[:3, :3] = _rotation(rng.normal(size=3), np.deg2rad(angle)) @ X_WO[:3, :3]
    step = rng.normal(size=3)
    step *= OFFSET / np.linalg.norm(step)
    guess[:3, 3] = X_WO[:3, :3] @ centre + X_WO[:3, 3] + step - guess[:3, :3] @ centre
    return scene @ X_WO[:3, :3].T + X_WO[:3, 3], X_WO, guess


Model = tuple[Any, Any]  # Points and normals.


def _measure(
    folder: Path,
    repeats: int,
    load: Callable[[str, Model], Any],
    solve: Callable[[Any, Any, Any], Any],
) -> Results:
    """Times solve(model, scene, guess) -> X_WO on all trials, and counts what came right.

    Args:
        load: makes of a model's name and cloud what a user keeps of it; not timed.
    """
    results = {}
    for name in ("bunny", "bottle"):
        if not (folder / f"{name}.npz").exists():
            continue
        with np.load(folder / f"{name}.npz") as file:
            cloud = file["points"], file["normals"]
        model = load(name, cloud)
        for angle in ANGLES:
            seconds, right = [], 0
            for trial in range(TRIALS):
                with np.load(folder / f"{name}-{angle}-{trial}.npz") as file:
                    scene, X_WO, guess = file["scene"], file["X_WO"], file["guess"]
                times, found = [], guess
                for _ in range(repeats):
                    start = time.perf_counter()
                    found = solve(model, scene, guess)
                    times.append(time.perf_counter() - start)
                seconds.append(min(times))
                right += _is_right(cloud[0][::8], X_WO, found)
            results[f"{name}, {angle} degrees off"] = Samples(seconds, "s")
            results[f"{name}, {angle} degrees off, right"] = Samples(
                [float(right)], f"of {TRIALS}", more_is_better=True
            )
    return results


def _is_right(points: Any, X_WO: Any, found: Any) -> bool:
    a, b = (points @ X[:3, :3].T + X[:3, 3] for X in (X_WO, found))
    nearest = np.linalg.norm(a[:, None] - b[None], axis=2).min(axis=1)
    return bool(nearest.mean() < SUCCESS * np.linalg.norm(np.ptp(points, axis=0)))


def ours(folder: Path) -> Results:
    """``refine_pose`` on a field that is built once; starts 40 degrees around the guess, too."""
    return _ours(folder, spread=0.7)


def ours_one_start(folder: Path) -> Results:
    """``refine_pose`` as it is by default, from the guess alone."""
    return _ours(folder, spread=0.0)


def _ours(folder: Path, spread: float) -> Results:
    from pydrake.math import RigidTransform

    from prehensile.perception import PointCloud
    from prehensile.perception.distance_field import DistanceField
    from prehensile.perception.mesh import TriangleMesh
    from prehensile.perception.registration import RefineConfig, refine_pose

    config = RefineConfig(spread=spread, num_coarse_points=200)

    def load(name: str, model: Model) -> Any:
        if name == "bottle":
            with np.load(folder / "bottle_mesh.npz") as file:
                return DistanceField.from_mesh(TriangleMesh(file["vertices"], file["triangles"]))
        return DistanceField.from_cloud(PointCloud(*model))

    def solve(field: Any, scene: Any, guess: Any) -> Any:
        result = refine_pose(PointCloud(scene), field, RigidTransform(guess), config)
        return np.eye(4) if result.X_WO is None else result.X_WO.GetAsMatrix4()

    return _measure(folder, REPEATS, load, solve)


def _open3d(folder: Path, kind: str) -> Results:
    import open3d  # pyright: ignore[reportMissingImports]

    registration = open3d.pipelines.registration
    criteria = registration.ICPConvergenceCriteria(1e-7, 1e-7, 60)

    def cloud(points: Any, normals: Any = None) -> Any:
        result = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        if normals is not None:
            result.normals = open3d.utility.Vector3dVector(normals)
        return result

    def solve(model: Any, scene: Any, guess: Any) -> Any:
        source, start = cloud(scene), np.linalg.inv(guess)
        if kind == "gicp":
            method = registration.TransformationEstimationForGeneralizedICP()
            call = registration.registration_generalized_icp
        else:
            method = {
                "point": registration.TransformationEstimationPointToPoint,
                "plane": registration.TransformationEstimationPointToPlane,
            }[kind]()
            call = registration.registration_icp
        answer = call(source, model, FAR, start, method, criteria)
        return np.linalg.inv(answer.transformation)

    return _measure(folder, REPEATS, lambda _, model: cloud(*model), solve)


def open3d_point(folder: Path) -> Results:
    """``registration_icp``, point to point."""
    return _open3d(folder, "point")


def open3d_plane(folder: Path) -> Results:
    """``registration_icp``, point to plane."""
    return _open3d(folder, "plane")


def open3d_gicp(folder: Path) -> Results:
    """``registration_generalized_icp``."""
    return _open3d(folder, "gicp")


def _small_gicp(folder: Path, kind: str) -> Results:
    import small_gicp  # pyright: ignore[reportMissingImports]

    def load(_: str, model: Model) -> Any:
        target = small_gicp.PointCloud(model[0])
        tree = small_gicp.KdTree(target)
        small_gicp.estimate_normals_covariances(target, tree, 20, 1)
        return target, tree

    def solve(model: Any, scene: Any, guess: Any) -> Any:
        source = small_gicp.PointCloud(scene)
        if kind == "GICP":
            tree = small_gicp.KdTree(source)
            small_gicp.estimate_covariances(source, tree, 20, 1)
        answer = small_gicp.align(
            *(model[0], source, model[1]),
            init_T_target_source=np.linalg.inv(guess),
            registration_type=kind,
            max_correspondence_distance=FAR,
            num_threads=1,
            max_iterations=60,
        )
        return np.linalg.inv(answer.T_target_source)

    return _measure(folder, REPEATS, load, solve)


def small_gicp_plane(folder: Path) -> Results:
    """``small_gicp.align``, point to plane."""
    return _small_gicp(folder, "PLANE_ICP")


def small_gicp_gicp(folder: Path) -> Results:
    """``small_gicp.align``, generalized ICP: needs the scene's covariances."""
    return _small_gicp(folder, "GICP")


_OPEN3D = ("open3d==0.20.0",)
_SMALL_GICP = ("small-gicp==1.0.1", "numpy")

CONTENDERS = (
    Contender("prehensile", ours),
    Contender("prehensile one start", ours_one_start),
    Contender("Open3D point to point", open3d_point, requirements=_OPEN3D),
    Contender("Open3D point to plane", open3d_plane, requirements=_OPEN3D),
    Contender("Open3D GICP", open3d_gicp, requirements=_OPEN3D),
    Contender("small_gicp point to plane", small_gicp_plane, requirements=_SMALL_GICP),
    Contender("small_gicp", small_gicp_gicp, requirements=_SMALL_GICP),
)
