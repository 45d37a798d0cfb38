"""A mustard bottle tracked through depth images while it moves, with a hand around it or not."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.framework import Contender, Results, Samples

TITLE = "Tracking a moving bottle, 640x480 depth images at 30 Hz, processor time"
FRAMES = 40
DT = 1 / 30
FOCAL = 610.0
NOISE = 0.001  # Standard deviation of the depth at 1 m; grows with its square (m).
EYE, TARGET = (0.65, -0.35, 0.5), (0.0, 0.0, 0.1)
MARGIN = 0.03  # How far from the last pose's bounding box peers look for points (m).
FAR = 0.02  # Greatest distance of corresponding points for the peers (m).
SCENES = ("alone", "in a hand")
# Centre and size of the fingers, in the bottle's frame: the nearer one hides some 40 % of it.
FINGERS = (((0.042, 0.0, 0.01), (0.024, 0.11, 0.075)), ((-0.042, 0.0, 0.01), (0.024, 0.11, 0.075)))


def prepare(folder: Path) -> None:
    """Renders the images with Drake; writes them, the true poses and the model."""
    from prehensile.perception.model_mesh import mesh_of_model

    mesh = mesh_of_model("mustard_bottle")
    rng = np.random.default_rng(0)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    areas = mesh.areas()
    t = rng.choice(len(areas), 6000, p=areas / areas.sum())
    u, v = rng.uniform(size=(2, len(t), 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = a[t] + u * (b - a)[t] + v * (c - a)[t]
    np.savez(folder / "model.npz", points=points, normals=mesh.triangle_normals()[t])
    np.savez(folder / "mesh.npz", vertices=mesh.vertices, triangles=mesh.triangles)
    X_WC = _camera()
    np.save(folder / "X_WC.npy", X_WC)
    poses = np.array([_pose(k * DT) for k in range(FRAMES + 1)])
    np.save(folder / "poses.npy", poses)
    for scene in SCENES:
        np.save(folder / f"{scene}.npy", _render(poses[1:], X_WC, scene == "in a hand", rng))


def _camera() -> Any:
    z = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    X_WC = np.eye(4)
    X_WC[:3, :3], X_WC[:3, 3] = np.column_stack([x, np.cross(z, x), z]), EYE
    return X_WC


def _pose(t: float) -> Any:
    """Up to 0.5 m/s and 1.5 rad/s."""
    angle, axis = 1.5 / 4 * np.sin(4 * t), np.array([0.6, 0.64, 0.48])
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    X_WO = np.eye(4)
    X_WO[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    X_WO[:3, 3] = 0.1 * np.sin(5 * t), 0.03 * t, 0.06
    return X_WO


def _render(poses: Any, X_WC: Any, with_hand: bool, rng: Any) -> Any:
    """(F, 480, 640) float32 depth over a table."""
    from pydrake.geometry import (
        Box,
        ClippingRange,
        DepthRange,
        DepthRenderCamera,
        MakeRenderEngineVtk,
        RenderCameraCore,
        RenderEngineVtkParams,
    )
    from pydrake.math import RigidTransform
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.sensors import CameraInfo

    from prehensile.models.packages import package_map
    from prehensile.models.registry import find_model

    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map(None))
    (bottle,) = parser.AddModels(str(find_model("mustard_bottle").path))
    body = plant.get_body(plant.GetBodyIndices(bottle)[0])
    color = np.array([0.5, 0.5, 0.5, 1.0])
    table = RigidTransform([0, 0, -0.11])
    plant.RegisterVisualGeometry(plant.world_body(), table, Box(3, 3, 0.02), "table", color)
    for k, (centre, size) in enumerate(FINGERS if with_hand else ()):
        place = RigidTransform(np.array(centre))
        plant.RegisterVisualGeometry(body, place, Box(*size), f"finger{k}", color)
    plant.Finalize()
    scene_graph.AddRenderer("vtk", MakeRenderEngineVtk(RenderEngineVtkParams()))
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    # Drake's renderer counts pixels from the image's corner, not from the first one's centre.
    info = CameraInfo(640, 480, FOCAL, FOCAL, 320.0, 240.0)
    core = RenderCameraCore("vtk", info, ClippingRange(0.05, 10.0), RigidTransform())
    camera = DepthRenderCamera(core, DepthRange(0.1, 5.0))
    images = []
    for X_WO in poses:
        plant.SetFreeBodyPose(plant_context, body, RigidTransform(X_WO))
        query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
        world = query.inspector().world_frame_id()
        depth = query.RenderDepthImage(camera, world, RigidTransform(X_WC)).data[:, :, 0]
        depth = np.where(np.isfinite(depth), depth, 0)
        images.append(depth + NOISE * rng.standard_normal(depth.shape) * depth**2)
    return np.array(images, dtype=np.float32)


def _results(folder: Path, track: Callable[[str, Any], list[tuple[float, Any]]]) -> Results:
    """Runs a tracker on each scene; it returns the seconds and the pose (4, 4) of each image."""
    poses = np.load(folder / "poses.npy")
    results: dict[str, Samples] = {}
    for scene in SCENES:
        found = track(scene, np.load(folder / f"{scene}.npy"))
        seconds = [s for s, _ in found]
        errors = [
            1e3 * float(np.linalg.norm(X[:3, 3] - true[:3, 3]))
            for (_, X), true in zip(found, poses[1:], strict=True)
        ]
        turns = [_degrees(X, true) for (_, X), true in zip(found, poses[1:], strict=True)]
        good = sum(e < 3 and a < 3 for e, a in zip(errors, turns, strict=True)) / len(found)
        results[f"{scene}: time per image"] = Samples(seconds, "s")
        results[f"{scene}: images within 3 mm, 3 deg"] = Samples([100 * good], "%", True)
        results[f"{scene}: position error"] = Samples(errors, "mm")
        results[f"{scene}: rotation error"] = Samples(turns, "deg")
    return results


def _degrees(X: Any, Y: Any) -> float:
    cosine = (np.trace(X[:3, :3].T @ Y[:3, :3]) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def ours(folder: Path) -> Results:
    """The tracker with its field built before; in the hand it is told the fingers' field."""
    from pydrake.geometry import Box
    from pydrake.math import RigidTransform

    from prehensile.perception.body_evidence import Body
    from prehensile.perception.camera_model import CameraModel, PosedCamera
    from prehensile.perception.distance_field import DistanceField
    from prehensile.perception.free_space import DepthView
    from prehensile.perception.mesh import TriangleMesh, merge_meshes
    from prehensile.perception.model_mesh import shape_mesh
    from prehensile.perception.tracking import start_tracking, track_object

    data = np.load(folder / "mesh.npz")
    body = Body.from_mesh(TriangleMesh(data["vertices"], data["triangles"]))
    fingers = merge_meshes(
        [shape_mesh(Box(*size)).transformed(RigidTransform(np.array(c))) for c, size in FINGERS]
    )
    hand = DistanceField.from_mesh(fingers, margin=0.02)
    X_WC = RigidTransform(np.load(folder / "X_WC.npy"))
    camera = PosedCamera(CameraModel(640, 480, FOCAL, FOCAL, 319.5, 239.5), X_WC)
    poses = np.load(folder / "poses.npy")

    def track(scene: str, images: Any) -> list[tuple[float, Any]]:
        state = start_tracking(RigidTransform(poses[0]))
        found = []
        for k, depth in enumerate(images, 1):
            # Where the hand is, its joints tell.
            occluders = [(hand, RigidTransform(poses[k]))] if scene == "in a hand" else []
            start = time.process_time()
            state = track_object(body, state, k * DT, DepthView(depth, camera), occluders=occluders)
            found.append((time.process_time() - start, state.X_WO.GetAsMatrix4()))
        return found

    return _results(folder, track)


def _near(depth: Any, X_WC: Any, X_WO: Any, low: Any, high: Any) -> Any:
    """The image's points in W that lie in the box around the object's last pose."""
    corners = np.stack(np.meshgrid(*np.stack([low - MARGIN, high + MARGIN], 1)), -1).reshape(-1, 3)
    seen = (corners @ X_WO[:3, :3].T + X_WO[:3, 3] - X_WC[:3, 3]) @ X_WC[:3, :3]
    pixels = np.clip(FOCAL * seen[:, :2] / seen[:, 2:] + [319.5, 239.5], 0, 640).astype(int)
    (u0, v0), (u1, v1) = pixels.min(axis=0), pixels.max(axis=0) + 1
    v, u = np.nonzero(depth[v0:v1, u0:u1] > 0)
    v, u = v + v0, u + u0
    z = depth[v, u].astype(float)
    p_C = np.stack([(u - 319.5) / FOCAL * z, (v - 239.5) / FOCAL * z, z], axis=1)
    p_W = p_C @ X_WC[:3, :3].T + X_WC[:3, 3]
    p_O = (p_W - X_WO[:3, 3]) @ X_WO[:3, :3]
    inside = ((p_O > low - MARGIN) & (p_O < high + MARGIN)).all(axis=1)
    return p_W[inside]


def _by_registration(folder: Path, register: Callable[[Any, Any], Any]) -> Results:
    """Crops each image around the last pose and registers the model from there.

    ``register(points_W, X_WO_guess)`` returns X_WO (4, 4).
    """
    model = np.load(folder / "model.npz")["points"]
    low, high = model.min(axis=0), model.max(axis=0)
    X_WC, poses = np.load(folder / "X_WC.npy"), np.load(folder / "poses.npy")

    def track(_: str, images: Any) -> list[tuple[float, Any]]:
        X_WO, found = poses[0], []
        for depth in images:
            start = time.process_time()
            points = _near(depth, X_WC, X_WO, low, high)
            if len(points) > 50:
                X_WO = register(points, X_WO)
            found.append((time.process_time() - start, X_WO))
        return found

    return _results(folder, track)


def open3d(folder: Path) -> Results:
    """Point-to-plane ICP on the model's normals with a Tukey loss."""
    import open3d as o3d  # pyright: ignore[reportMissingImports]

    data = np.load(folder / "model.npz")
    model = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(data["points"]))
    model.normals = o3d.utility.Vector3dVector(data["normals"])
    estimate = o3d.pipelines.registration.TransformationEstimationPointToPlane(
        o3d.pipelines.registration.TukeyLoss(0.01)
    )
    criteria = o3d.pipelines.registration.ICPConvergenceCriteria(1e-6, 1e-6, 30)

    def register(points: Any, X_WO: Any) -> Any:
        scene = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        scene = scene.voxel_down_sample(0.003)
        result = o3d.pipelines.registration.registration_icp(
            scene, model, FAR, np.linalg.inv(X_WO), estimate, criteria
        )
        return np.linalg.inv(result.transformation)

    return _by_registration(folder, register)


def small_gicp(folder: Path) -> Results:
    """GICP against the preprocessed model."""
    import small_gicp  # pyright: ignore[reportMissingImports]

    points = np.load(folder / "model.npz")["points"]
    model, tree = small_gicp.preprocess_points(points, downsampling_resolution=0.003)

    def register(points: Any, X_WO: Any) -> Any:
        scene, _ = small_gicp.preprocess_points(points, downsampling_resolution=0.003)
        result = small_gicp.align(
            model, scene, tree, init_T_target_source=np.linalg.inv(X_WO),
            registration_type="GICP", max_correspondence_distance=FAR, num_threads=1,
        )  # fmt: skip
        return np.linalg.inv(result.T_target_source)

    return _by_registration(folder, register)


CONTENDERS = (
    Contender("prehensile", ours),
    Contender("Open3D", open3d, requirements=("open3d==0.20.0",)),
    Contender("small_gicp", small_gicp, requirements=("small-gicp==1.0.1", "numpy")),
)
