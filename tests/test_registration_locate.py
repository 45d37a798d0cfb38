"""Known objects found in rendered views, and not found where they are not."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from prehensile.errors import InputError
from prehensile.perception.camera_model import CameraModel, PosedCamera
from prehensile.perception.cloud import PointCloud, merge
from prehensile.perception.free_space import DepthView
from prehensile.perception.mesh import TriangleMesh
from prehensile.perception.normals import estimate_normals
from prehensile.perception.registration.known_object import KnownObject
from prehensile.perception.registration.locate import LocateConfig, LocateResult, locate
from prehensile.perception.registration.result import RegistrationStatus

K = np.array([[160.0, 0.0, 79.5], [0.0, 160.0, 79.5], [0.0, 0.0, 1.0]])
CAMERA = PosedCamera(CameraModel(160, 160, 160.0, 160.0, 79.5, 79.5), RigidTransform())
NOISE = 0.001


def _box(size: tuple[float, float, float], centre: tuple[float, float, float]) -> TriangleMesh:
    corners = np.indices((2, 2, 2)).reshape(3, 8).T - 0.5
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return TriangleMesh(np.asarray(corners * size + centre, dtype=float), np.array(triangles))


def _union(*meshes: TriangleMesh) -> TriangleMesh:
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    return TriangleMesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.triangles + o for m, o in zip(meshes, offsets, strict=False)]),
    )


def _cylinder(radius: float, height: float, sides: int = 72) -> TriangleMesh:
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low, high = (np.column_stack([ring, np.full(sides, z)]) for z in (-height / 2, height / 2))
    i, j = np.arange(sides), np.roll(np.arange(sides), -1)
    bottom, top = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    triangles = [(i, j, j + sides), (i, j + sides, i + sides), (j, i, bottom)]
    triangles.append((i + sides, j + sides, top))
    vertices = np.concatenate([low, high, [[0, 0, -height / 2], [0, 0, height / 2]]])
    return TriangleMesh(vertices, np.concatenate([np.stack(t, axis=1) for t in triangles]))


MESHES = {
    "steps": _union(
        _box((0.12, 0.06, 0.04), (0, 0, 0)),
        _box((0.03, 0.05, 0.10), (0.04, 0, 0.05)),
        _box((0.05, 0.02, 0.06), (-0.03, 0.015, 0.03)),
    ),
    "plank": _box((0.20, 0.05, 0.02), (0, 0, 0)),
    "brick": _box((0.15, 0.08, 0.05), (0, 0, 0)),
    "can": _cylinder(0.04, 0.12),
}


@pytest.fixture(scope="module", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Distance fields are kept with the test's files and not with the user's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@cache
def _known(name: str) -> KnownObject:
    return KnownObject.from_mesh(MESHES[name], field_spacing=0.003)


def _depth(mesh: TriangleMesh, X_CO: RigidTransform) -> np.ndarray:
    """Depth image (160, 160) by casting a ray through every pixel; infinite where it hits nothing.

    Moeller and Trumbore, "Fast, minimum storage ray-triangle intersection", 1997.
    """
    v, u = np.mgrid[0:160, 0:160]
    rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(u.shape)], axis=-1)
    depth = np.full(u.shape, np.inf)
    p = X_CO.multiply(mesh.vertices.T).T
    for a, b, c in p[mesh.triangles]:
        pixels = (K @ (np.stack([a, b, c]) / [[a[2]], [b[2]], [c[2]]]).T)[:2]
        low = np.clip(np.floor(pixels.min(axis=1)).astype(int), 0, 159)
        high = np.clip(np.ceil(pixels.max(axis=1)).astype(int), 0, 159)
        patch = (slice(low[1], high[1] + 1), slice(low[0], high[0] + 1))
        d = rays[patch]
        h = np.cross(d, c - a)
        determinant = h @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = -(h @ a) / determinant
            q = np.cross(-a, b - a)
            t, z = d @ q / determinant, ((c - a) @ q) / determinant
            hit = (s >= 0) & (t >= 0) & (s + t <= 1) & (z > 0)
        depth[patch] = np.where(hit, np.minimum(depth[patch], z), depth[patch])
    return depth


def _cloud(depth: np.ndarray, rng: np.random.Generator) -> PointCloud:
    """The points of a depth image, with noise along the rays, in the camera's frame."""
    v, u = np.nonzero(np.isfinite(depth))
    z = depth[v, u] + rng.normal(0, NOISE, len(v))
    points = np.stack([(u - K[0, 2]) / K[0, 0] * z, (v - K[1, 2]) / K[1, 1] * z, z], axis=1)
    return PointCloud(points, sensor_origins=np.zeros(3))


def _pose(rng: np.random.Generator) -> RigidTransform:
    R = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    return RigidTransform(RotationMatrix(R), [*rng.uniform(-0.03, 0.03, 2), 0.4])


def _adds(name: str, X: RigidTransform | None, Y: RigidTransform) -> float:
    """Mean distance of points of the surface placed by X from the surface placed by Y [m]."""
    assert X is not None
    points = (Y.inverse() @ X).multiply(_known(name).cloud.points.T).T
    return float(np.abs(_known(name).field.at(points).distances).mean())


def _views(name: str, count: int, seed: int) -> list[tuple[RigidTransform, PointCloud]]:
    rng = np.random.default_rng(seed)
    poses = [_pose(rng) for _ in range(count)]
    return [(X, _cloud(_depth(MESHES[name], X), rng)) for X in poses]


def test_pose_of_an_object_from_one_noisy_view() -> None:
    for X_CO, scene in _views("steps", 8, seed=0):
        result = locate(scene, _known("steps"))
        assert result.status is RegistrationStatus.SUCCESS, result.message
        assert _adds("steps", result.X_WO, X_CO) < 0.02 * _known("steps").diameter
        # No symmetry: the pose itself is right, and as well as its covariance says.
        assert result.X_WO is not None
        assert result.covariance is not None
        error = result.X_WO @ X_CO.inverse()
        assert error.rotation().ToAngleAxis().angle() < np.deg2rad(2)
        assert np.abs(result.X_WO.translation() - X_CO.translation()).max() < 0.002
        assert result.inliers.shape == (len(scene),)
        assert result.inliers.mean() > 0.9
        assert result.residual < 0.002


def test_other_things_in_the_crop_do_not_matter() -> None:
    rng = np.random.default_rng(1)
    for X_CO, scene in _views("steps", 4, seed=2):
        count = len(scene) // 8
        table = rng.uniform([-0.1, -0.1, 0.5], [0.1, 0.1, 0.502], (count, 3))
        ball = rng.normal(size=(count, 3))
        ball *= 0.03 / np.linalg.norm(ball, axis=1, keepdims=True)
        ball[:, 2] = -np.abs(ball[:, 2])
        points = np.concatenate([table, ball + [0.12, 0, 0.42]])
        other = PointCloud(points, sensor_origins=np.zeros(3))
        result = locate(merge([scene, other]), _known("steps"))
        assert result.succeeded, result.message
        assert _adds("steps", result.X_WO, X_CO) < 0.02 * _known("steps").diameter


@pytest.mark.parametrize(
    ("shown", "sought"), [("steps", "can"), ("can", "steps"), ("plank", "can")]
)
def test_an_object_that_is_not_there_is_not_found(shown: str, sought: str) -> None:
    for _, scene in _views(shown, 3, seed=3):
        result = locate(scene, _known(sought))
        assert result.status in (RegistrationStatus.NO_CONSENSUS, RegistrationStatus.LOW_OVERLAP)
        assert result.message


def test_symmetric_objects_are_ambiguous_or_degenerate() -> None:
    for X_CO, scene in _views("brick", 3, seed=4):
        result = locate(scene, _known("brick"))
        assert result.status in (RegistrationStatus.AMBIGUOUS, RegistrationStatus.DEGENERATE)
        assert _adds("brick", result.X_WO, X_CO) < 0.02 * _known("brick").diameter
        for other in result.alternatives:
            assert _adds("brick", other, X_CO) < 0.02 * _known("brick").diameter
    X_CO, scene = _views("can", 1, seed=6)[0]
    result = locate(scene, _known("can"))
    assert result.status is RegistrationStatus.DEGENERATE
    assert _adds("can", result.X_WO, X_CO) < 0.02 * _known("can").diameter
    # What is free is a turn about the axis.
    assert result.free_directions is not None
    assert result.free_directions.shape == (1, 6)
    axis = X_CO.rotation().matrix()[:, 2]
    turn = result.free_directions[0, :3] / np.linalg.norm(result.free_directions[0, :3])
    assert abs(turn @ axis) > 0.99


def test_a_pose_in_seen_through_space_is_refused() -> None:
    X_CO, scene = _views("steps", 1, seed=7)[0]
    depth = _depth(MESHES["steps"], X_CO)
    measured = DepthView(np.where(np.isfinite(depth), depth, 0.8), CAMERA)
    assert locate(scene, _known("steps"), views=measured).succeeded
    # The same camera sees a wall behind the place where the points pretend that the object is.
    empty = DepthView(np.full(depth.shape, 0.8), CAMERA)
    result = locate(scene, _known("steps"), views=[empty])
    assert result.status is RegistrationStatus.NO_CONSENSUS
    assert "saw nothing" in result.message


def test_same_answer_for_any_number_of_threads_and_with_given_normals() -> None:
    X_CO, scene = _views("steps", 1, seed=8)[0]
    one, three = locate(scene, _known("steps")), locate(scene, _known("steps"), num_threads=3)
    assert one.X_WO is not None
    assert three.X_WO is not None
    np.testing.assert_array_equal(one.X_WO.GetAsMatrix4(), three.X_WO.GetAsMatrix4())
    estimated = estimate_normals(scene, radius=0.008)
    given = PointCloud(estimated.points, estimated.normals)
    result = locate(given, _known("steps"))
    assert result.succeeded, result.message
    assert _adds("steps", result.X_WO, X_CO) < 0.02 * _known("steps").diameter


def test_a_cloud_can_be_the_model() -> None:
    dense = KnownObject.from_mesh(MESHES["steps"], num_points=600, field_spacing=0.003).cloud
    model = KnownObject.from_cloud(dense, field_spacing=0.003)
    X_CO, scene = _views("steps", 1, seed=9)[0]
    result = locate(scene, model)
    assert result.succeeded, result.message
    assert _adds("steps", result.X_WO, X_CO) < 0.02 * _known("steps").diameter


def _is_nothing(result: LocateResult, count: int) -> bool:
    return (
        result.status is RegistrationStatus.NO_CONSENSUS
        and result.X_WO is None
        and result.inliers.shape == (count,)
    )


def test_scenes_without_enough_points() -> None:
    model = _known("brick")
    assert _is_nothing(locate(PointCloud(np.zeros((0, 3))), model), 0)
    one = PointCloud(np.ones((1, 3)), sensor_origins=np.zeros(3))
    assert _is_nothing(locate(one, model), 1)
    line = np.zeros((500, 3))
    line[:, 0] = np.linspace(0.5, 1, 500)
    assert _is_nothing(locate(PointCloud(line, sensor_origins=np.zeros(3)), model), 500)


def test_bad_input_is_named() -> None:
    model = _known("brick")
    with pytest.raises(InputError, match="normals nor sensor_origins"):
        locate(PointCloud(np.random.default_rng(0).normal(size=(50, 3))), model)
    with pytest.raises(ValueError, match="num_points"):
        KnownObject.from_mesh(MESHES["brick"], num_points=3)
    with pytest.raises(ValueError, match="no area"):
        KnownObject.from_mesh(TriangleMesh(np.eye(3) * 0 + 1.0, np.array([[0, 1, 2]])))
    with pytest.raises(InputError, match="at least 300"):
        KnownObject.from_cloud(PointCloud(np.zeros((5, 3)), np.zeros((5, 3))))
    for name in ("voxel_fraction", "num_references", "tolerance", "min_score", "ambiguity"):
        for value in (-1, np.nan):
            with pytest.raises(ValueError, match=name):
                replace(LocateConfig(), **{name: value})
