"""Three depth images of a full bin to one cloud with normals: how long, and how right.

The scene is the clear-bin station with ten objects at rest, as its three D415 see it (640 x 480,
rendered, without noise; once more with noise). True normals are those of the triangles that the
pixels' rays hit; an error is the angle between a point's normal and that at the nearest point that
was hit.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework import Contender, Results, Samples, time_calls

TITLE = "Three depth images of a bin to one cloud with normals, 5 mm voxels"
VOXEL_SIZE = 0.005
TIME = "one thread"
TIME_TWO = "two threads"
MEDIAN = "median error of the normals"
WITHIN = "normals within 15 degrees"
NOISY_MEDIAN = "with noise: median error"
NOISY_WITHIN = "with noise: within 15 degrees"
NOISE = (0.001, 0.002)  # standard deviation of the depth z: 1 mm + 2 mm/m^2 z^2
NOISY_WINDOW = 7  # pixels; what suits that noise


def prepare(folder: Path) -> None:
    """Writes the images, the cameras, the region, and the points and normals that rays hit."""
    from prehensile.station.robot_plant import make_robot_diagram
    from prehensile.station.scenario_file import load_scenario
    from prehensile.tasks.clear_bin_run import ClearBinRun, bin_geometry, choose_models

    run = ClearBinRun(choose_models(10, 0), seed=0)
    context = run.station_context()
    triangles = _triangles(run)
    rng = np.random.default_rng(0)
    data: dict[str, Any] = {"depths": [], "noisy": [], "K": [], "X_WC": []}
    points, normals = [], []
    for camera in run.cameras:
        depth = run.station.GetOutputPort(f"{camera.name}.depth_image").Eval(context).data[:, :, 0]
        X_WC = run.station.GetOutputPort(f"{camera.name}.X_WC").Eval(context).GetAsMatrix4()
        sigma = NOISE[0] + NOISE[1] * np.minimum(depth, 5.0) ** 2
        data["depths"].append(depth.copy())
        data["noisy"].append((depth + sigma * rng.normal(size=depth.shape)).astype(np.float32))
        data["K"].append(camera.model.K)
        data["X_WC"].append(X_WC)
        p, n = _cast(triangles, camera.model.K, X_WC, depth.shape)
        points.append(p)
        normals.append(n)
    # The bin with its floor and walls.
    geometry = bin_geometry(make_robot_diagram(load_scenario("two_bins")), "bin0")
    region = geometry.region(inset=-0.02, above_floor=-0.03, above_rim=0.1)
    reach = 0.5 * np.abs(region.X_WB.rotation().matrix()) @ region.size
    low, high = region.X_WB.translation() - reach, region.X_WB.translation() + reach
    np.savez(
        folder / "scene.npz",
        **data,
        low=low,
        high=high,
        points=np.concatenate(points),
        normals=np.concatenate(normals),
    )


def ours(folder: Path) -> Results:
    """``prehensile.perception.fuse``."""
    from pydrake.math import RigidTransform

    from prehensile.perception import Box, CameraModel, DepthConfig, PosedCamera, fuse

    scene = np.load(folder / "scene.npz")
    low, high = scene["low"], scene["high"]
    box = Box(RigidTransform(0.5 * (low + high)), high - low)
    cameras = [
        PosedCamera(CameraModel.from_K(K, 640, 480), RigidTransform(X))
        for K, X in zip(scene["K"], scene["X_WC"], strict=True)
    ]
    depths, noisy = list(scene["depths"]), list(scene["noisy"])
    config = DepthConfig(window=NOISY_WINDOW, noise_constant=NOISE[0], noise_quadratic=NOISE[1])
    one = time_calls(lambda: fuse(depths, cameras, box, VOXEL_SIZE))
    two = time_calls(lambda: fuse(depths, cameras, box, VOXEL_SIZE, num_threads=2))
    clean = fuse(depths, cameras, box, VOXEL_SIZE)
    rough = fuse(noisy, cameras, box, VOXEL_SIZE, config=config)
    return {
        TIME: Samples(one, "s"),
        TIME_TWO: Samples(two, "s"),
        **_quality(scene, clean.points, clean.require_normals(), MEDIAN, WITHIN),
        **_quality(scene, rough.points, rough.require_normals(), NOISY_MEDIAN, NOISY_WITHIN),
    }


def manipulation(folder: Path) -> Results:
    """As the clutter clearing of ``manipulation`` does it: normals first, of all points."""
    return _drake(folder, normals_first=True)


def drake(folder: Path) -> Results:
    """Drake's functions in the quicker order: normals after down-sampling."""
    return _drake(folder, normals_first=False)


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("Drake, normals first (manipulation)", manipulation),
    Contender("Drake, voxels first", drake),
)


def _drake(folder: Path, *, normals_first: bool) -> Results:
    from pydrake.perception import Concatenate

    scene = np.load(folder / "scene.npz")
    low, high = scene["low"], scene["high"]

    def chain(sources: list[Callable[[], Any]]) -> Any:
        clouds = []
        for source, X_WC in zip(sources, scene["X_WC"], strict=True):
            cloud = source().Crop(low, high)
            if not normals_first:
                cloud = cloud.VoxelizedDownSample(VOXEL_SIZE)
            cloud.EstimateNormals(radius=0.1, num_closest=30)
            cloud.FlipNormalsTowardPoint(X_WC[:3, 3])
            clouds.append(cloud)
        return Concatenate(clouds).VoxelizedDownSample(VOXEL_SIZE)

    images = {name: _drake_sources(scene, name) for name in ("depths", "noisy")}
    seconds = time_calls(lambda: chain(images["depths"]), repeats=3)
    clean, rough = chain(images["depths"]), chain(images["noisy"])
    return {
        TIME: Samples(seconds, "s"),
        **_quality(scene, clean.xyzs().T, clean.normals().T, MEDIAN, WITHIN),
        **_quality(scene, rough.xyzs().T, rough.normals().T, NOISY_MEDIAN, NOISY_WITHIN),
    }


def _drake_sources(scene: Any, name: str) -> list[Callable[[], Any]]:
    """For each camera a function that makes its point cloud in W from its image."""
    from pydrake.common.value import AbstractValue
    from pydrake.math import RigidTransform
    from pydrake.perception import DepthImageToPointCloud
    from pydrake.systems.sensors import CameraInfo, ImageDepth32F, PixelType

    sources = []
    for depth, K, X_WC in zip(scene[name], scene["K"], scene["X_WC"], strict=True):
        info = CameraInfo(640, 480, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
        system = DepthImageToPointCloud(info, PixelType.kDepth32F, 1.0)
        context = system.CreateDefaultContext()
        image = ImageDepth32F(640, 480)
        image.mutable_data[:, :, 0] = depth
        pose = AbstractValue.Make(RigidTransform(X_WC))
        system.GetInputPort("camera_pose").FixValue(context, pose)

        def source(system: Any = system, context: Any = context, image: Any = image) -> Any:
            system.depth_image_input_port().FixValue(context, image)  # Not kept from last time.
            return system.point_cloud_output_port().Eval(context)

        sources.append(source)
    return sources


def _quality(
    scene: Any, points: np.ndarray, normals: np.ndarray, median: str, within: str
) -> Results:
    """Angles between normals and the true ones."""
    from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

    _, nearest = cKDTree(scene["points"]).query(points)
    cosine = np.sum(normals * scene["normals"][nearest], axis=1)
    # A point without a normal counts as wrong.
    error = np.degrees(np.arccos(np.clip(np.nan_to_num(cosine, nan=-1.0), -1, 1)))
    return {
        median: Samples([float(np.median(error))], "deg"),
        within: Samples([100 * float(np.mean(error <= 15))], "%", more_is_better=True),
    }


def _triangles(run: Any) -> np.ndarray:
    """(T, 3, 3) corners in W of the triangles of all that cameras see."""
    from pydrake.geometry import Role

    from prehensile.models.shapes.gltf import read_gltf

    scene_graph = run.station.GetSubsystemByName("scene_graph")
    context = scene_graph.GetMyContextFromRoot(run.simulator.get_context())
    query = scene_graph.get_query_output_port().Eval(context)
    triangles = []
    for geometry in query.inspector().GetAllGeometryIds(Role.kPerception):
        path = query.inspector().GetShape(geometry).source().path()
        X_WG = query.GetPoseInWorld(geometry)
        for part in read_gltf(path):
            vertices = X_WG.multiply(np.asarray(part.mesh.vertices, dtype=float).T).T
            triangles.append(vertices[np.asarray(part.mesh.faces)])
    return np.concatenate(triangles)


def _cast(
    triangles_W: np.ndarray, K: np.ndarray, X_WC: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals in W where the pixels' rays first meet a triangle."""
    R_WC, p_WC = X_WC[:3, :3], X_WC[:3, 3]
    corners = (triangles_W - p_WC) @ R_WC
    corners = corners[(corners[..., 2] > 0.05).all(axis=1)]
    uv = (corners @ K.T)[..., :2] / corners[..., 2:]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    low = np.maximum(np.ceil(uv.min(axis=1)), 0).astype(int)
    high = np.minimum(np.floor(uv.max(axis=1)), [shape[1] - 1, shape[0] - 1]).astype(int)
    # n . p = d, so the inverse depth along K^-1 [u, v, 1] is (n / d) . K^-1 [u, v, 1].
    d = np.sum(normal * corners[:, 0], axis=1)
    inverse_depth = np.zeros(shape)
    hit = np.full(shape, -1)
    K_inverse = np.linalg.inv(K)
    for i in np.nonzero((low <= high).all(axis=1) & (np.abs(d) > 1e-9 * length))[0]:
        rows, columns = slice(low[i, 1], high[i, 1] + 1), slice(low[i, 0], high[i, 0] + 1)
        v, u = np.ogrid[rows, columns]
        sides = [
            (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
            for a, b in zip(uv[i], np.roll(uv[i], -1, axis=0), strict=True)
        ]
        inside = np.all([s >= 0 for s in sides], axis=0) | np.all([s <= 0 for s in sides], axis=0)
        a, b, c = (normal[i] / d[i]) @ K_inverse
        w = a * u + b * v + c
        nearer = inside & (w > inverse_depth[rows, columns])
        inverse_depth[rows, columns][nearer] = w[nearer]
        hit[rows, columns][nearer] = i
    v, u = np.nonzero(hit >= 0)
    rays = np.stack([u, v, np.ones(len(u))], axis=-1) @ K_inverse.T
    points = (rays / inverse_depth[v, u][:, None]) @ R_WC.T + p_WC
    unit = normal / length[:, None] * -np.sign(d)[:, None]
    return points, unit[hit[v, u]] @ R_WC.T
