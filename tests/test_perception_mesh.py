"""Meshes from files and models, beside Drake's readings of the same."""

import base64
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh, ReadObjToTriangleSurfaceMesh
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.errors import InputError
from prehensile.models.packages import DATA
from prehensile.perception.mesh import TriangleMesh, merge_meshes
from prehensile.perception.mesh_file import read_mesh
from prehensile.perception.model_mesh import mesh_of_model, shape_mesh

YCB = Path(__file__).parents[1].parent / "shared" / "drake_models" / "ycb" / "meshes"

VERTICES = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]])
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TETRAHEDRON = TriangleMesh(VERTICES, TRIANGLES)


def corners(mesh):
    """The triangles as sets of positions that can be compared, whatever the vertices' order."""
    rows = np.round(mesh.vertices[mesh.triangles], 6)
    # Each triangle starts at its least corner.
    first = [min(range(3), key=lambda k: tuple(row[k])) for row in rows]
    return sorted(
        tuple(map(tuple, np.roll(r, -k, axis=0))) for r, k in zip(rows, first, strict=True)
    )


def obj_text():
    lines = ["# a tetrahedron", "mtllib no.mtl", "v 0 0 0", "v 2 0 0 1.0", "v 0 3 0", "v 0 0 4"]
    lines += ["vn 0 0 1", "vt 0 0", "o thing", "f 1//1 3//1 2//1", "f 1/1 2/1 4/1  # side"]
    return "\n".join([*lines, "usemtl x", "f -4 -1 -2", "f 2/1/1 3/1/1 4/1/1", ""]).encode()


def stl_bytes(ascii_form):
    triangles = VERTICES[TRIANGLES].astype("<f4")
    if ascii_form:
        facets = "".join(
            "facet normal 0 0 0\n outer loop\n"
            + "".join("  vertex {:e} {:e} {:e}\n".format(*v) for v in triangle)
            + " endloop\nendfacet\n"
            for triangle in triangles
        )
        return f"solid four\n{facets}endsolid four\n".encode()
    body = b"".join(struct.pack("<3f", 0, 0, 0) + t.tobytes() + b"\0\0" for t in triangles)
    return b"solid, though binary".ljust(80) + struct.pack("<I", 4) + body


def ply_bytes(ascii_form):
    form = "ascii" if ascii_form else "binary_big_endian"
    header = (
        f"ply\nformat {form} 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if ascii_form:
        rows = ["{} {} {}".format(*v) for v in VERTICES] + [
            "3 {} {} {}".format(*t) for t in TRIANGLES
        ]
        return header + "\n".join(rows).encode()
    return (
        header
        + VERTICES.astype(">f4").tobytes()
        + b"".join(b"\3" + t.astype(">i4").tobytes() for t in TRIANGLES)
    )


def gltf_parts(uri):
    """The JSON of the tetrahedron, y up, and its buffer."""
    y_up = np.stack([VERTICES[:, 0], VERTICES[:, 2], -VERTICES[:, 1]], axis=1).astype("<f4")
    buffer = y_up.tobytes() + TRIANGLES.astype("<u2").tobytes()
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [{"byteLength": len(buffer), **({"uri": uri} if uri else {})}],
    }
    return gltf, buffer


def gltf_embedded():
    _, buffer = gltf_parts(None)
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    return json.dumps(gltf_parts(uri)[0]).encode()


def glb_bytes():
    gltf, buffer = gltf_parts(None)
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(buffer), 0x004E4942) + buffer
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


FILES = {
    "m.obj": obj_text(),
    "ascii.stl": stl_bytes(True),
    "binary.stl": stl_bytes(False),
    "ascii.ply": ply_bytes(True),
    "binary.ply": ply_bytes(False),
    "m.gltf": gltf_embedded(),
    "m.glb": glb_bytes(),
}


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_tetrahedron(name, tmp_path):
    (tmp_path / name).write_bytes(FILES[name])
    mesh = read_mesh(tmp_path / name)
    assert corners(mesh) == corners(TETRAHEDRON)
    assert mesh.is_watertight()


def test_a_buffer_beside_the_file_but_not_elsewhere(tmp_path):
    folder = tmp_path / "inner"
    folder.mkdir()
    gltf, buffer = gltf_parts("points.bin")
    (folder / "points.bin").write_bytes(buffer)
    (folder / "m.gltf").write_text(json.dumps(gltf))
    assert corners(read_mesh(folder / "m.gltf")) == corners(TETRAHEDRON)
    (tmp_path / "points.bin").write_bytes(buffer)
    for uri in ("../points.bin", str(tmp_path / "points.bin"), "missing.bin", "http://x/y.bin"):
        gltf["buffers"][0]["uri"] = uri
        (folder / "m.gltf").write_text(json.dumps(gltf))
        with pytest.raises(InputError, match=r"m\.gltf"):
            read_mesh(folder / "m.gltf")


def test_nodes_place_their_meshes(tmp_path):
    gltf, buffer = gltf_parts(None)
    gltf["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(buffer).decode()
    half = 0.5**0.5
    gltf["nodes"] = [
        {"children": [1, 2], "translation": [1.0, 2.0, 3.0]},
        {"mesh": 0, "rotation": [0.0, half, 0.0, half], "scale": [2, 2, 2]},
        # Mirrored in x, columns first.
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
    ]
    (tmp_path / "m.gltf").write_text(json.dumps(gltf))
    mesh = read_mesh(tmp_path / "m.gltf")
    # In z-up: translation (1, -3, 2); a turn by 90° about y is one about z; mirrored in x.
    turned = TETRAHEDRON.transformed(RigidTransform(RollPitchYaw(0, 0, np.pi / 2), [0, 0, 0]))
    first = TriangleMesh(2 * turned.vertices + [1, -3, 2], TRIANGLES)
    second = TriangleMesh(VERTICES * [-1, 1, 1] + [1, -8, 2], TRIANGLES[:, ::-1])
    assert corners(mesh) == corners(merge_meshes([first, second]))
    assert mesh.is_watertight()
    sizes = [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)]
    hull = Mesh(tmp_path / "m.gltf").GetConvexHull()
    points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    np.testing.assert_allclose(sizes, [points.min(axis=0), points.max(axis=0)], atol=1e-6)


@pytest.mark.parametrize(
    ("mode", "expected"), [(5, [[0, 1, 2], [2, 1, 3]]), (6, [[0, 1, 2], [0, 2, 3]])]
)
def test_strips_and_fans(mode, expected, tmp_path):
    gltf, buffer = gltf_parts(None)
    gltf["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(buffer).decode()
    gltf["meshes"][0]["primitives"] = [{"attributes": {"POSITION": 0}, "mode": mode}]
    (tmp_path / "m.gltf").write_text(json.dumps(gltf))
    assert corners(read_mesh(tmp_path / "m.gltf")) == corners(TriangleMesh(VERTICES, expected))


@pytest.mark.parametrize("name", ["mustard_bottle", "mug", "bin", "d415", "suction_cup"])
def test_models_have_the_hulls_that_drake_gives_them(name):
    mesh = mesh_of_model(name)
    file = DATA / name / f"{name}.gltf"
    if not file.exists():
        pytest.skip("drawn by other files")
    hull = Mesh(file).GetConvexHull()
    points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose(points.min(axis=0), low, atol=1e-7)
    np.testing.assert_allclose(points.max(axis=0), high, atol=1e-7)
    assert mesh.is_watertight()
    assert (mesh.surface().signed_distance(points) < 1e-6).all()


def test_a_body_of_several_shapes(tmp_path):
    (tmp_path / "m.obj").write_bytes(FILES["m.obj"])
    visuals = [
        ("1 0 0 0 0 1.5707963267948966", "<box><size>0.2 0.4 0.6</size></box>"),
        ("0 0 0 0 0 0", "<sphere><radius>0.1</radius></sphere>"),
        ("0 5 0 0 0 0", "<cylinder><radius>0.1</radius><length>2</length></cylinder>"),
        ("0 0 9 0 0 0", "<ellipsoid><radii>0.1 0.2 0.3</radii></ellipsoid>"),
        ("0 0 0 0 0 0", "<mesh><uri>m.obj</uri><scale>1 1 2</scale></mesh>"),
    ]
    text = "".join(
        f"<visual name='v{i}'><pose>{pose}</pose><geometry>{shape}</geometry></visual>"
        for i, (pose, shape) in enumerate(visuals)
    )
    (tmp_path / "thing.sdf").write_text(
        f"<sdf version='1.9'><model name='thing'><link name='a'>{text}</link>"
        "<link name='bare'/></model></sdf>"
    )
    mesh = mesh_of_model("thing", packages={"mine": tmp_path})
    assert corners(mesh_of_model("thing", body="a", packages={"mine": tmp_path})) == corners(mesh)
    surface = mesh.surface()
    assert surface.is_closed
    assert surface.num_pieces == 5
    expected = 2 * (0.2 * 0.4 + 0.4 * 0.6 + 0.2 * 0.6) + 4 * np.pi * 0.01
    expected += 2 * np.pi * (0.1 * 2 + 0.01) + 0.47835  # Of the ellipsoid, by its integral.
    tall = TriangleMesh(VERTICES * [1, 1, 2], TRIANGLES)
    assert mesh.area() == pytest.approx(expected + tall.area(), rel=2e-3)
    queries = [
        [1, 0, -0.29],
        [1.19, -0.01, 0],
        [1.21, -0.01, 0],
        [0, 5, 0.9],
        [0, 0.19, 9],
        [0, 0, 8.6],
    ]
    inside = surface.signed_distance([*queries, [0.1, 0.1, 6]]) < 0
    assert inside.tolist() == [True, True, False, True, True, False, True]
    with pytest.raises(InputError, match="bare"):
        mesh_of_model("thing", body="bare", packages={"mine": tmp_path})
    with pytest.raises(InputError, match="name one: "):
        mesh_of_model("iiwa7")
    assert mesh_of_model("iiwa7", body="iiwa_link_3").area() > 0.05
    with pytest.raises(InputError, match="mustard_botle"):
        mesh_of_model("mustard_botle")


def test_a_shape_without_a_file():
    memory = InMemoryMesh(mesh_file=MemoryFile(FILES["m.obj"].decode(), ".obj", "m"))
    with pytest.raises(InputError, match="memory"):
        shape_mesh(Mesh(memory))
    with pytest.raises(InputError, match="int"):
        shape_mesh(3)


@pytest.mark.skipif(not YCB.is_dir(), reason="needs Drake's models beside the repository")
def test_drake_reads_the_same_triangles():
    path = YCB / "006_mustard_bottle_textured.obj"
    mesh, theirs = read_mesh(path), ReadObjToTriangleSurfaceMesh(path)
    np.testing.assert_allclose(mesh.vertices, theirs.vertices(), atol=1e-15)
    named = [[t.vertex(k) for k in range(3)] for t in theirs.triangles()]
    np.testing.assert_array_equal(mesh.triangles, named)
    assert mesh.area() == pytest.approx(theirs.total_area())


def test_area_and_normals_in_closed_form():
    slant = 0.5 * np.sqrt((3 * 4) ** 2 + (2 * 4) ** 2 + (2 * 3) ** 2)
    np.testing.assert_allclose(TETRAHEDRON.areas(), [3, 4, 6, slant])
    assert TETRAHEDRON.area() == pytest.approx(13 + slant)
    direction = np.array([1 / 2, 1 / 3, 1 / 4])
    expected = [[0, 0, -1], [0, -1, 0], [-1, 0, 0], direction / np.linalg.norm(direction)]
    np.testing.assert_allclose(TETRAHEDRON.triangle_normals(), expected, atol=1e-15)
    line = TriangleMesh(VERTICES, [[0, 1, 1], [1, 2, 3]])
    assert not line.triangle_normals()[0].any()
    assert not line.is_watertight()
    X_WO = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [1, 2, 3])
    moved = TETRAHEDRON.transformed(X_WO)
    np.testing.assert_allclose(moved.vertices, (X_WO @ VERTICES.T).T)
    assert moved.area() == pytest.approx(TETRAHEDRON.area())


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("m.obj", b"v 0 0\n", "m.obj:1"),
        ("m.obj", b"v 0 0 0\nf 1 1 0\n", "m.obj:2"),
        ("m.obj", b"v 0 0 0\nf 1 2 3\n", "vertices outside"),
        ("m.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "finite"),
        ("m.obj", b"", "triangles"),
        ("m.stl", b"", "STL"),
        ("m.stl", FILES["binary.stl"][:-1], "STL"),
        ("m.stl", b"solid x\nfacet\nvertex 1 2 3\nvertex 1 2", "facet"),
        ("m.ply", b"plx", "ply"),
        ("m.ply", FILES["ascii.ply"].replace(b"property float z\n", b""), "ply"),
        ("m.gltf", b"{", "m.gltf"),
        ("m.gltf", b"[]", "m.gltf"),
        ("m.gltf", b'{"asset": {}}', "no triangles"),
        ("m.gltf", b"[" * 100000, "m.gltf"),
        ("m.gltf", b'{"nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}]}', "nested"),
        ("m.gltf", FILES["m.gltf"].replace(b'"count": 12', b'"count": 13'), "beyond"),
        ("m.gltf", FILES["m.gltf"].replace(b'"count": 12', b'"count": 1e30'), "size"),
        ("m.gltf", FILES["m.gltf"].replace(b'"count": 4', b'"count": 3'), "does not exist"),
        ("m.glb", FILES["m.glb"][:-1], "early"),
        ("m.dae", b"<COLLADA/>", "format"),
    ],
)
def test_broken_files_are_named(name, content, message, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(tmp_path / name)
    assert name in str(caught.value)


def test_nodes_that_multiply_are_stopped(tmp_path):
    gltf, buffer = gltf_parts(None)
    gltf["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(buffer).decode()
    gltf["nodes"] = [{"children": [i + 1] * 10} for i in range(12)] + [{"mesh": 0}]
    (tmp_path / "m.gltf").write_text(json.dumps(gltf))
    with pytest.raises(InputError, match="too often"):
        read_mesh(tmp_path / "m.gltf")


def read_or_refused(path):
    """Reads a file; no other error than InputError, which names it, may come of that."""
    try:
        mesh = read_mesh(path)
    except InputError as error:
        said = str(error)
    else:
        assert np.isfinite(mesh.vertices).all()
        assert 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.vertices)
        said = path.name
    assert path.name in said


@settings(max_examples=250, deadline=None)
@given(st.sampled_from(sorted(FILES)), st.data())
def test_mutated_files_are_read_or_refused(tmp_path_factory, name, data):
    content = bytearray(FILES[name])
    for _ in range(data.draw(st.integers(1, 6))):
        place = data.draw(st.integers(0, len(content) - 1))
        match data.draw(st.sampled_from(["byte", "cut", "repeat"])):
            case "byte":
                content[place] = data.draw(st.integers(0, 255))
            case "cut":
                del content[place : place + data.draw(st.integers(1, 40))]
            case "repeat":
                content[place:place] = content[place : place + data.draw(st.integers(1, 40))]
        if not content:
            break
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(content)
    read_or_refused(path)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_gltf_with_any_value_anywhere_is_read_or_refused(tmp_path_factory, data):
    root = json.loads(FILES["m.gltf"])
    root["nodes"][0] |= {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "children": []}
    place, key = root, data.draw(st.sampled_from(sorted(root)))
    while isinstance(place[key], dict | list) and place[key] and data.draw(st.booleans()):
        place = place[key]
        keys = sorted(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
    place[key] = data.draw(JSON)
    path = tmp_path_factory.getbasetemp() / "any.gltf"
    path.write_text(json.dumps(root))
    read_or_refused(path)
