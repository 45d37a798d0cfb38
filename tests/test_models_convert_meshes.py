"""Conversion of meshes: size, mass, shape that touches, and files that mean harm."""

import json
import struct
from itertools import pairwise

import numpy as np
import pytest
from convert_files import BOX_FACES, Loaded, ball, box_points, prism, write_dae, write_stl
from pydrake.geometry import Convex, Role

from prehensile.errors import InputError
from prehensile.models.convert.conversion import convert
from prehensile.models.convert.options import ConvertOptions
from prehensile.models.shapes.gltf import Material, Part, read_gltf, write_gltf
from prehensile.models.shapes.primitives import box

pytest.importorskip("trimesh", reason="the optional extra 'convert' is not installed")


def central(model):
    inertia = model.inertia("base_link")
    return inertia.Shift(inertia.get_com()).CalcRotationalInertia().CopyToFullMatrix3()


def load(path, out, **options):
    return Loaded(convert(path, out, ConvertOptions(**options)).path, weld=False)


def test_a_box_has_the_mass_properties_of_a_box(tmp_path):
    size, middle = np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.2, 0.1])
    mesh = write_stl(tmp_path / "box.stl", box_points(size, middle), BOX_FACES)
    model = load(mesh, tmp_path / "out", density=800)
    inertia = model.inertia("base_link")
    mass = 800 * size.prod()
    assert inertia.get_mass() == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(inertia.get_com(), middle, atol=1e-7)
    x, y, z = size**2
    expected = mass / 12 * np.diag([y + z, x + z, x + y])
    np.testing.assert_allclose(central(model), expected, rtol=1e-5, atol=1e-9)


def test_a_cylinder_and_a_ball_come_close_to_the_closed_forms(tmp_path):
    points, faces = prism(0.05, 0.4, 200)
    model = load(write_stl(tmp_path / "rod.stl", points, faces), tmp_path / "rod", mass=2.0)
    across = 2 * (3 * 0.05**2 + 0.4**2) / 12
    expected = np.diag([across, across, 2 * 0.05**2 / 2])
    np.testing.assert_allclose(central(model), expected, rtol=1e-3, atol=1e-9)
    points, faces = ball(0.1, 30)
    model = load(write_stl(tmp_path / "ball.stl", points, faces), tmp_path / "ball")
    volume = 4 / 3 * np.pi * 0.1**3
    assert model.inertia("base_link").get_mass() == pytest.approx(1000 * volume, rel=2e-2)
    mass = model.inertia("base_link").get_mass()
    np.testing.assert_allclose(
        central(model), 0.4 * mass * 0.1**2 * np.eye(3), rtol=5e-3, atol=1e-8
    )


def test_scale_and_units(tmp_path):
    mesh = write_stl(tmp_path / "box.stl", box_points((100, 200, 300)), BOX_FACES)
    done = convert(mesh, tmp_path / "large")
    assert any("--units mm" in c.text for c in done.report.changes)
    for name, scale in (("mm", 0.001), ("tenth", 0.1)):
        model = load(mesh, tmp_path / name, scale=scale)
        for role in (Role.kProximity, Role.kIllustration):
            low, high = model.extents("base_link", role)
            np.testing.assert_allclose(high - low, np.array([100, 200, 300]) * scale, rtol=1e-5)


def test_a_mesh_that_is_open_or_inside_out_is_weighed_all_the_same(tmp_path):
    size = (0.1, 0.2, 0.3)
    for name, faces, said in (
        ("open", BOX_FACES[:-1], "not closed"),
        ("inside_out", BOX_FACES[:, ::-1], "inwards"),
    ):
        mesh = write_stl(tmp_path / f"{name}.stl", box_points(size), faces)
        done = convert(mesh, tmp_path / name)
        model = Loaded(done.path, weld=False)
        assert model.inertia("base_link").get_mass() == pytest.approx(6.0, rel=1e-5)
        assert any(said in c.text for c in done.report.changes)


def test_a_flat_mesh_is_refused_alone_and_a_thin_box_in_a_robot(tmp_path):
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]) * 0.1
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    mesh = write_stl(tmp_path / "flat.stl", points, faces)
    with pytest.raises(InputError, match="flat"):
        convert(mesh, tmp_path / "a")
    shape = '<geometry><mesh filename="flat.stl"/></geometry>'
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r"><link name="base_link"><collision>{shape}</collision></link></robot>'
    )
    model = load(tmp_path / "r.urdf", tmp_path / "b")
    low, high = model.extents("base_link")
    np.testing.assert_allclose(high - low, [0.1, 0.1, 0.001], atol=1e-9)


def two_blocks():
    a, b = box_points((0.1, 0.1, 0.1), (-0.2, 0, 0)), box_points((0.1, 0.1, 0.1), (0.2, 0, 0))
    bridge = box_points((0.32, 0.02, 0.02))
    faces = np.vstack([BOX_FACES + 8 * k for k in range(3)])
    return np.vstack([a, b, bridge]), faces


@pytest.mark.parametrize(
    "choice", ["hull", "box", "keep", pytest.param("decompose", marks=pytest.mark.slow)]
)
def test_what_stands_for_a_collision_mesh(tmp_path, choice):
    if choice == "decompose":
        pytest.importorskip("coacd")
    mesh = write_stl(tmp_path / "dumbbell.stl", *two_blocks())
    model = load(mesh, tmp_path / "out", collision=choice)
    shapes = [model.inspector.GetShape(g) for g in model.shapes("base_link")]
    kinds = {type(s).__name__ for s in shapes}
    _, high = model.extents("base_link")
    np.testing.assert_allclose(high, [0.25, 0.05, 0.05], atol=0.01)
    # Above the bridge there is nothing, but inside of the hull.
    query = model.plant.get_geometry_query_input_port().Eval(model.context)
    body = model.plant.GetBodyByName("base_link")
    p_W = body.EvalPoseInWorld(model.context) @ np.array([0, 0, 0.035])
    if choice == "box":
        assert kinds == {"Box"}
    elif choice == "hull":
        (hull,) = shapes
        assert isinstance(hull, Convex)
    elif choice == "keep":
        assert kinds == {"Mesh"}
    else:
        assert len(shapes) >= 3
        assert kinds == {"Convex"}
    if choice in ("hull", "box", "decompose"):
        hits = query.ComputeSignedDistanceToPoint(p_W)
        assert (min(h.distance for h in hits) < 0) == (choice != "decompose")


def test_without_coacd_decomposition_falls_back_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "coacd", None)
    mesh = write_stl(tmp_path / "dumbbell.stl", *two_blocks())
    done = convert(mesh, tmp_path / "out", ConvertOptions(collision="decompose"))
    assert any("coacd" in c.text for c in done.report.changes)
    assert len(Loaded(done.path).shapes("base_link")) == 1


def test_without_trimesh_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    mesh = write_stl(tmp_path / "box.stl", box_points((1, 1, 1)), BOX_FACES)
    with pytest.raises(InputError, match="prehensile\\[convert\\]"):
        convert(mesh, tmp_path / "out")


def test_collada_has_its_unit_and_its_color(tmp_path):
    pytest.importorskip("collada")
    mesh = write_dae(tmp_path / "box.dae", box_points((100, 200, 300)), BOX_FACES, 0.001)
    done = convert(mesh, tmp_path / "out")
    low, high = Loaded(done.path).extents("base_link", Role.kIllustration)
    np.testing.assert_allclose(high - low, [0.1, 0.2, 0.3], rtol=1e-5)
    (part,) = read_gltf(tmp_path / "out" / "meshes" / "box.gltf")
    # 0.8 and 0.1 on a screen, in linear light.
    np.testing.assert_allclose(part.material.color, [0.8**2.2, 0.1**2.2, 0.1**2.2, 1], atol=0.01)


def test_gltf_stands_as_drake_has_it(tmp_path):
    part = Part(box((0.1, 0.2, 0.4)).transformed(p_AB=(0, 0.3, 0)), Material(color=(0, 1, 0, 1)))
    write_gltf(tmp_path / "post.gltf", [part])
    model = load(tmp_path / "post.gltf", tmp_path / "out")
    low, high = model.extents("base_link", Role.kIllustration)
    np.testing.assert_allclose([low, high], [(-0.05, 0.2, -0.2), (0.05, 0.4, 0.2)], atol=1e-6)
    (seen,) = read_gltf(tmp_path / "out" / "meshes" / "post.gltf")
    np.testing.assert_allclose(seen.material.color, [0, 1, 0, 1], atol=0.01)


def test_a_mirrored_mesh_of_a_robot_is_mirrored_with_its_faces(tmp_path):
    points, _ = prism(0.05, 0.2, 12)
    points = points * [1, 1, 1] + [0.3, 0, 0]
    write_stl(tmp_path / "rod.stl", points, prism(0.05, 0.2, 12)[1])
    shape = '<geometry><mesh filename="rod.stl" scale="-1 1 2"/></geometry>'
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><material name="blue"><color rgba="0 0 1 1"/></material>'
        f'<link name="base_link"><visual>{shape}<material name="blue"/></visual>'
        f"<collision>{shape}</collision></link></robot>"
    )
    done = convert(tmp_path / "r.urdf", tmp_path / "out")
    model = Loaded(done.path)
    for role in (Role.kProximity, Role.kIllustration):
        low, high = model.extents("base_link", role)
        np.testing.assert_allclose(
            [low, high], [(-0.35, -0.05, -0.2), (-0.25, 0.05, 0.2)], atol=1e-6
        )
    (part,) = read_gltf(tmp_path / "out" / "meshes" / "rod.gltf")
    assert part.material.color == (0, 0, 1, 1)
    assert part.mesh.volume() > 0


# Harm


def gltf_with(**changes):
    data = "data:application/octet-stream;base64," + "AAAA" * 12
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3", "bufferView": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": data}],
    }
    return json.dumps(document | changes).encode()


BOMB = (
    b'<?xml version="1.0"?><!DOCTYPE c [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(f'<!ENTITY {b} "&{a};&{a};&{a};&{a};">'.encode() for a, b in pairwise("abcdefghi"))
    + b"]><COLLADA>&i;</COLLADA>"
)
UTF16 = BOMB.replace(b'version="1.0"', b'version="1.0" encoding="utf-16"').decode().encode("utf-16")


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("bomb.dae", BOMB),
        ("bomb16.dae", UTF16),
        ("empty.stl", b""),
        ("short.stl", bytes(80) + struct.pack("<I", 2**31) + bytes(50)),
        ("nan.stl", bytes(80) + struct.pack("<I", 1) + struct.pack("<12fH", *[np.nan] * 12, 0)),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        ("index.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 99999999\n"),
        ("huge.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999\n"
         b"property float x\nproperty float y\nproperty float z\nend_header\n"),
        ("huge.off", b"OFF\n99999999999 1 0\n0 0 0\n"),
        ("huge.gltf",
         gltf_with(accessors=[{"count": 10**12, "type": "VEC3", "componentType": 5126}])),
        ("out.gltf", gltf_with(buffers=[{"byteLength": 36, "uri": "../secret.bin"}])),
        ("not.gltf", b"{"),
        ("not.glb", b"glTF"),
        ("text.dae", b"hello"),
    ],
)  # fmt: skip
def test_broken_and_hostile_meshes_are_input_errors(tmp_path, name, data):
    (tmp_path / "secret.bin").write_bytes(bytes(36))
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / name).write_bytes(data)
    with pytest.raises(InputError) as error:
        convert(tmp_path / "m" / name, tmp_path / "out")
    assert name in str(error.value)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m", "secret.bin"]


def test_materials_outside_of_the_folder_are_not_read(tmp_path):
    (tmp_path / "secret.mtl").write_text("newmtl m\nKd 0 1 0\n")
    (tmp_path / "m").mkdir()
    obj = "mtllib ../secret.mtl\nusemtl m\n"
    obj += "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in box_points((0.1, 0.1, 0.1)))
    obj += "".join(f"f {a} {b} {c}\n" for a, b, c in BOX_FACES + 1)
    (tmp_path / "m" / "box.obj").write_text(obj)
    convert(tmp_path / "m" / "box.obj", tmp_path / "out")
    (part,) = read_gltf(tmp_path / "out" / "meshes" / "box.gltf")
    assert part.material.color[1] < 0.9
    (tmp_path / "m" / "box.obj").write_text(obj.replace("../secret", "own"))
    (tmp_path / "m" / "own.mtl").write_text("newmtl m\nKd 0 1 0\n")
    convert(tmp_path / "m" / "box.obj", tmp_path / "again")
    (part,) = read_gltf(tmp_path / "again" / "meshes" / "box.gltf")
    np.testing.assert_allclose(part.material.color, [0, 1, 0, 1], atol=0.01)


def test_an_obj_without_a_color_takes_the_description_s(tmp_path):
    obj = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in box_points((0.1, 0.1, 0.1)))
    obj += "vt 0 0\nvt 1 0\nvt 1 1\n"
    obj += "".join(f"f {a}/1 {b}/2 {c}/3\n" for a, b, c in BOX_FACES + 1)
    (tmp_path / "box.obj").write_text(obj)
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="a"><visual><geometry><mesh filename="box.obj"/></geometry>'
        '<material name="m"><color rgba="0 1 0 1"/></material></visual></link></robot>'
    )
    convert(tmp_path / "r.urdf", tmp_path / "out")
    (part,) = read_gltf(tmp_path / "out" / "meshes" / "box.gltf")
    assert part.material.color == (0, 1, 0, 1)
    assert part.material.texture is None


@pytest.mark.parametrize("scale", [1e-300, 1e-9, 1e7, 1e200])
def test_an_absurd_scale_is_refused(tmp_path, scale):
    mesh = write_stl(tmp_path / "box.stl", box_points((0.1, 0.2, 0.3)), BOX_FACES)
    with pytest.raises(InputError, match="m large"):
        convert(mesh, tmp_path / "out", ConvertOptions(scale=scale))
