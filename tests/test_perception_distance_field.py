"""Distance fields against closed forms and Drake's own signed distances."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pydrake.geometry import Box as DrakeBox
from pydrake.geometry import GeometryInstance, Mesh, ProximityProperties, Role, SceneGraph, Shape
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from prehensile.errors import InputError
from prehensile.models.registry import find_model
from prehensile.perception import PointCloud
from prehensile.perception.articulated_field import articulated_distance
from prehensile.perception.distance_field import DistanceField, cached_distance_field
from prehensile.perception.mesh import TriangleMesh

SIZE = np.array([0.06, 0.1, 0.16])


def box_mesh(size: NDArray[np.float64] = SIZE) -> TriangleMesh:
    """A box about the origin."""
    x, y, z = size / 2
    corners = [[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return TriangleMesh(np.array(corners), np.array(triangles))


def sphere_mesh(radius: float, rings: int = 60) -> TriangleMesh:
    """A sphere about the origin, of flat triangles."""
    polar, turn = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.arange(2 * rings) * np.pi / rings
    )
    p = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1)
    p = p.round(12)  # All of a pole's vertices at one place.
    index = np.arange(p[..., 0].size).reshape(p.shape[:2])
    a, b = index[:, :-1].ravel(), index[:, 1:].ravel()
    c, d = np.roll(index, -1, axis=0)[:, 1:].ravel(), np.roll(index, -1, axis=0)[:, :-1].ravel()
    return TriangleMesh(
        radius * p.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    )


def box_distance(p: NDArray[np.float64], size: NDArray[np.float64] = SIZE) -> NDArray[np.float64]:
    """Signed distance from a box about the origin."""
    q = np.abs(p) - size / 2
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def drake_distances(shape: Shape, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """The distances of points from a shape at the origin, by Drake."""
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("test")
    instance = GeometryInstance(RigidTransform(), shape, "shape")
    instance.set_proximity_properties(ProximityProperties())
    scene_graph.RegisterAnchoredGeometry(source, instance)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    return np.array([query.ComputeSignedDistanceToPoint(x)[0].distance for x in p])


def points_around(size: NDArray[np.float64], count: int, seed: int = 0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).uniform(-0.7, 0.7, (count, 3)) * size


def test_sphere() -> None:
    # Where the surface is smooth, errors are far below the spacing; the mesh is flat by 25 um.
    field = DistanceField.from_mesh(sphere_mesh(0.05), 0.003, 0.03)
    rng = np.random.default_rng(1)
    p = rng.normal(size=(2000, 3))
    p *= rng.uniform(0.03, 0.07, (2000, 1)) / np.linalg.norm(p, axis=1, keepdims=True)
    radii = np.linalg.norm(p, axis=1)
    d, g = field.at(p)
    np.testing.assert_allclose(d, radii - 0.05, atol=6e-5)
    # Facets turn by three degrees from one to the next.
    assert ((g * p).sum(axis=1) / radii).min() > 0.995
    nearest, normals = field.closest(p)
    np.testing.assert_allclose(np.linalg.norm(nearest, axis=1), 0.05, atol=8e-5)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-12)


def test_box_against_closed_form_and_drake() -> None:
    field = DistanceField.from_mesh(box_mesh(), 0.002)
    p = points_around(SIZE, 4000)
    d, g = field.at(p)
    exact = box_distance(p)
    np.testing.assert_allclose(exact[:100], drake_distances(DrakeBox(*SIZE), p[:100]), atol=1e-12)
    # Edges and the medial axis cost part of a spacing, near them alone.
    error = np.abs(d - exact)
    assert error.max() < 0.002
    assert np.quantile(error, 0.6) < 1e-6
    assert (np.sign(d) == np.sign(exact))[np.abs(exact) > 1e-3].all()
    assert np.linalg.norm(g, axis=1).max() < 1 + 1e-5


def test_gradient_is_that_of_the_distance() -> None:
    field = DistanceField.from_mesh(sphere_mesh(0.05, 40), 0.004, 0.03)
    p = points_around(np.full(3, 0.12), 300)
    p = p[np.linalg.norm(p, axis=1) > 0.02]
    h = 1e-5
    numeric = [
        (field.at(p + h * e).distances - field.at(p - h * e).distances) / (2 * h) for e in np.eye(3)
    ]
    error = np.abs(np.stack(numeric, 1) - field.at(p).gradients)
    # The facets turn by 0.08 from one to the next, within a cell.
    assert error.max() < 0.1
    assert error.mean() < 0.01


def test_cavity_and_mesh_against_drake(tmp_path: Path) -> None:
    # A box with a cavity; and without it, as Drake reads it from a file.
    outer, inner = box_mesh(), box_mesh(SIZE * [0.7, 0.7, 0.7])
    hole = TriangleMesh(inner.vertices, inner.triangles[:, ::-1])  # A cavity: closed, inside out.
    mesh = TriangleMesh(
        np.concatenate([outer.vertices, hole.vertices]),
        np.concatenate([outer.triangles, hole.triangles + 8]),
    )
    field = DistanceField.from_mesh(mesh, 0.002, 0.03)
    p = points_around(SIZE, 400)
    exact = np.maximum(box_distance(p), -box_distance(p, 0.7 * SIZE))
    d = field.at(p).distances
    assert np.abs(d - exact)[exact < 0].max() < 0.002  # Exact inside the shell.
    assert (np.sign(d) == np.sign(exact))[np.abs(exact) > 1e-3].all()
    path = tmp_path / "box.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in outer.vertices]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in outer.triangles]
    path.write_text("\n".join(lines))
    solid = DistanceField.from_mesh(outer, 0.002, 0.03)
    drake = drake_distances(Mesh(str(path)), p)
    assert np.abs(solid.at(p).distances - drake).max() < 0.002


def test_outside_the_grid_distances_bound_from_above_and_gradients_point_away() -> None:
    field = DistanceField.from_mesh(box_mesh(), 0.003, margin=0.02)
    p = points_around(SIZE, 500) * 8
    p = p[box_distance(p) > 0.1]
    d, g = field.at(p)
    exact = box_distance(p)
    assert (d >= exact - 1e-4).all()
    assert (d <= 1.25 * exact).all()
    np.testing.assert_allclose(np.linalg.norm(g, axis=1), 1, atol=1e-6)
    assert (box_distance(p - d[:, None] * g) < 0.003).all()


def test_an_open_mesh_has_no_signs() -> None:
    mesh = box_mesh()
    opened = TriangleMesh(mesh.vertices, mesh.triangles[:-2])  # Without its top.
    with pytest.raises(ValueError, match="triangles: the surface is not closed"):
        DistanceField.from_mesh(opened, 0.004)
    with pytest.raises(ValueError, match="triangles: turned inside out"):
        DistanceField.from_mesh(TriangleMesh(mesh.vertices, mesh.triangles[:, ::-1]), 0.004)
    field = DistanceField.from_mesh(opened, 0.002, signed=False)
    assert not field.is_signed
    p = points_around(SIZE, 3000)
    d = field.at(p).distances
    assert (d >= 0).all()
    # The distance from five rectangles. Beyond the rim sides end, and no false surface is there.
    x, y, z = SIZE / 2
    walls = []
    for low, high in (
        ([-x, -y, -z], [-x, y, z]), ([x, -y, -z], [x, y, z]), ([-x, -y, -z], [x, -y, z]),
        ([-x, y, -z], [x, y, z]), ([-x, -y, -z], [x, y, -z]),
    ):  # fmt: skip
        walls.append(np.linalg.norm(p - np.clip(p, low, high), axis=1))
    assert np.abs(d - np.min(walls, axis=0)).max() < 0.0025


def test_cloud() -> None:
    k = np.arange(4000)
    z = 1 - (2 * k + 1) / 4000
    s, turn = np.sqrt(1 - z * z), k * np.pi * (3 - np.sqrt(5))
    n = np.stack([s * np.cos(turn), s * np.sin(turn), z], axis=1)
    field = DistanceField.from_cloud(PointCloud(0.05 * n, n), 0.003)
    p = points_around(np.full(3, 0.14), 1000)
    radii = np.linalg.norm(p, axis=1)
    far = radii > 0.02
    np.testing.assert_allclose(field.at(p).distances[far], np.abs(radii - 0.05)[far], atol=3e-4)
    _, normals = field.closest(p)
    assert ((normals * p).sum(axis=1) / radii)[far].min() > 0.97
    with pytest.raises(InputError, match="normals"):
        DistanceField.from_cloud(PointCloud(n))
    with pytest.raises(InputError, match="empty"):
        DistanceField.from_cloud(PointCloud(np.zeros((0, 3)), np.zeros((0, 3))))


def test_threads_do_not_change_it() -> None:
    one, two = (DistanceField.from_mesh(box_mesh(), 0.006, num_threads=n) for n in (1, 3))
    assert one.to_bytes() == two.to_bytes()
    p = points_around(SIZE, 20_000)
    np.testing.assert_array_equal(one.at(p).distances, two.at(p, num_threads=3).distances)


@pytest.mark.parametrize(
    ("spacing", "margin", "name"),
    [
        (0, None, "spacing"),
        (np.nan, None, "spacing"),
        (1e-6, None, "spacing"),
        (0.01, -1, "margin"),
    ],
)
def test_bad_grids(spacing: float, margin: float | None, name: str) -> None:
    with pytest.raises(ValueError, match=f"^{name}:"):
        DistanceField.from_mesh(box_mesh(), spacing, margin)


def test_bad_points() -> None:
    field = DistanceField.from_mesh(box_mesh(), 0.01)
    for bad in (np.zeros((3, 2)), np.full((1, 3), np.nan)):
        with pytest.raises(ValueError, match="^points:"):
            field.at(bad)
    assert len(field.at(np.zeros((0, 3))).distances) == 0


def test_files(tmp_path: Path) -> None:
    field = DistanceField.from_mesh(box_mesh(), 0.01)
    path = tmp_path / "box.field"
    field.save(path)
    again = DistanceField.load(path)
    assert again.to_bytes() == field.to_bytes()
    good = path.read_bytes()
    nan = np.array([np.nan], "<f4").tobytes()
    for bad, message in (
        (good[:-1], "cut short"),
        (good + b"x", "cut short"),
        (good[:20], "not a distance field"),
        (b"", "not a distance field"),
        (b"PREHDF99" + good[8:], "another version"),
        (good[:-4] + nan, "nodes"),
        (good[:32] + b"\xff" * 8 + good[40:], "spacing"),
        (good[:32] + nan + nan + good[40:], "spacing"),  # As one number, 2e307.
        (good[:8] + nan + nan + good[16:], "origin"),
        (good[:40] + (2**31 - 1).to_bytes(4, "little") + good[44:], "cut short"),
        (good[:40] + (-3).to_bytes(4, "little", signed=True) + good[44:], "cut short"),
    ):
        path.write_bytes(bad)
        with pytest.raises(InputError, match=message):
            DistanceField.load(path)
    with pytest.raises(InputError, match="cannot be read"):
        DistanceField.load(tmp_path / "none")


def test_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = cached_distance_field(box_mesh(), 0.01)
    (path,) = (tmp_path / "prehensile" / "distance_fields").iterdir()
    written = path.stat().st_mtime_ns
    assert cached_distance_field(box_mesh(), 0.01).to_bytes() == first.to_bytes()
    assert path.stat().st_mtime_ns == written
    # Another mesh or argument has another file; a damaged one is made again.
    cached_distance_field(box_mesh(SIZE * 1.01), 0.01, cache_dir=tmp_path / "other")
    cached_distance_field(box_mesh(), 0.012, cache_dir=tmp_path / "other")
    assert len(list((tmp_path / "other").iterdir())) == 2
    path.write_bytes(path.read_bytes()[:100])
    assert cached_distance_field(box_mesh(), 0.01).to_bytes() == first.to_bytes()
    assert DistanceField.load(path).to_bytes() == first.to_bytes()
    # A folder that cannot be made is no obstacle.
    (tmp_path / "file").write_text("")
    cached_distance_field(box_mesh(), 0.02, cache_dir=tmp_path / "file" / "below")


def test_planar_arm() -> None:
    # Two boxes as links; the distance to their union outside, and the right sign inside.
    link = np.array([0.2, 0.04, 0.04])
    field = DistanceField.from_mesh(box_mesh(link), 0.004, margin=0.1)
    elbow = RigidTransform(RollPitchYaw(0, 0, 0.7), [0, 0, 0]) @ RigidTransform([0.1, 0, 0])
    bend = RigidTransform(RollPitchYaw(0, 0, -1.2), [0.1, 0, 0])
    X_WL = [elbow, elbow @ bend @ RigidTransform([0.1, 0, 0])]
    p = np.random.default_rng(0).uniform(-0.3, 0.5, (3000, 3)) * [1, 1, 0.1]
    each = np.array([box_distance((X.inverse() @ p.T).T, link) for X in X_WL])
    d, g, bodies = articulated_distance([field, field], X_WL, p)
    near = each.min(axis=0) < 0.1  # Where the grids are.
    np.testing.assert_allclose(d[near], each.min(axis=0)[near], atol=0.003)
    clear = near & (np.abs(each[0] - each[1]) > 0.005)
    np.testing.assert_array_equal(bodies[clear], each.argmin(axis=0)[clear])
    h = 1e-5
    step = articulated_distance([field, field], X_WL, p + [h, 0, 0]).distances - d
    assert np.mean(np.abs(step / h - g[:, 0])[clear] < 0.05) > 0.95  # But at a medial axis.
    with pytest.raises(ValueError, match="X_WL: 1 poses for 2 fields"):
        articulated_distance([field, field], X_WL[:1], p)
    with pytest.raises(ValueError, match="fields: none"):
        articulated_distance([], [], p)


def shape_field(shape: Shape) -> DistanceField:
    """The field of a shape, from Drake's distances at the nodes."""
    scene_graph = SceneGraph()
    source = scene_graph.RegisterSource("test")
    instance = GeometryInstance(RigidTransform(), shape, "shape")
    instance.set_proximity_properties(ProximityProperties())
    scene_graph.RegisterAnchoredGeometry(source, instance)
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    steps = np.linspace(-0.25, 0.25, 21)
    nodes = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1)
    found = [query.ComputeSignedDistanceToPoint(p)[0] for p in nodes.reshape(-1, 3)]
    d = np.array([f.distance for f in found]).reshape(nodes.shape[:3])
    g = np.nan_to_num(np.array([f.grad_W for f in found])).reshape(nodes.shape)
    return DistanceField.from_values(nodes[0, 0, 0], steps[1] - steps[0], d, g)


def test_iiwa_against_drake() -> None:
    # Every collision shape of the arm as a body of its own, against the query object of the whole.
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    Parser(plant).AddModels(str(find_model("iiwa7").path))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyContextFromRoot(context), [0.3, 0.6, -0.4, -1.2, 0.5, 0.9, 0.1])
    query = scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))
    inspector = scene_graph.model_inspector()
    ids = inspector.GetAllGeometryIds(Role.kProximity)
    shapes = [inspector.GetShape(i) for i in ids]
    kept = [k for k, shape in enumerate(shapes) if not isinstance(shape, Mesh)]
    fields = [shape_field(shapes[k]) for k in kept]
    X_WL = [query.GetPoseInWorld(ids[k]) for k in kept]
    assert len(fields) >= 4
    p = np.random.default_rng(0).uniform([-0.4, -0.4, 0], [0.7, 0.4, 1.2], (600, 3))
    wanted = {ids[k] for k in kept}
    exact = np.array(
        [
            min(f.distance for f in query.ComputeSignedDistanceToPoint(x) if f.id_G in wanted)
            for x in p
        ]
    )
    d, g, bodies = articulated_distance(fields, X_WL, p)
    # Far from a body the grid's bound is used, never below the truth by more than the cells' error.
    near = exact < 0.15
    assert near.sum() > 50
    assert np.abs(d - exact)[near].max() < 0.012
    assert (np.sign(d) == np.sign(exact))[np.abs(exact) > 0.012].all()
    assert set(bodies) <= set(range(len(fields)))
    np.testing.assert_allclose(np.linalg.norm(g[near & (exact > 0.05)], axis=1), 1, atol=0.3)
