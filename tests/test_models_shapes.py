"""The mesh generators against closed forms, Drake's own reading of the files, and invariants."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import Mesh as DrakeMesh
from pydrake.math import RollPitchYaw

from prehensile.errors import InputError
from prehensile.models import shapes
from prehensile.models.shapes import Material, Part

lengths = st.floats(0.01, 2.0)


def _box_inertia(size, mass):
    x, y, z = np.square(size)
    return mass / 12.0 * np.diag([y + z, x + z, x + y])


CLOSED = {
    "box": shapes.box([0.1, 0.2, 0.3]),
    "rounded box": shapes.rounded_box([0.1, 0.2, 0.3], 0.02, 8),
    "cylinder": shapes.cylinder(0.05, 0.2),
    "rounded cylinder": shapes.cylinder(0.05, 0.2, rounding=0.01),
    "sphere": shapes.sphere(0.1),
    "capsule": shapes.capsule(0.05, 0.2),
    "lathe": shapes.lathe([(0, 0), (0.1, 0), (0.05, 0.1), (0, 0.1)]),
    "loft": shapes.loft([shapes.circle(0.1, 24), shapes.superellipse(0.05, 0.08, 4, 24)], [0, 0.3]),
    "sweep": shapes.sweep([(0, 0, 0), (0.1, 0, 0), (0.2, 0.1, 0.1)], shapes.circle(0.02, 12)),
    "extrude": shapes.extrude([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 0.1, bevel=0.02),
}


@pytest.mark.parametrize("name", CLOSED)
def test_solids_are_closed_with_normals_that_look_out(name):
    mesh = CLOSED[name]
    assert mesh.is_closed()
    assert mesh.volume() > 0.0
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-9)
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    across = np.cross(b - a, c - a)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    for k in range(3):
        cosine = np.einsum("ij,ij->i", across, mesh.normals[mesh.faces[:, k]])
        assert cosine.min() > np.cos(np.radians(60.0))
    assert mesh.uvs.min() >= -1e-9
    assert mesh.uvs.max() <= 1.0 + 1e-9


@given(lengths, lengths, lengths, st.floats(0.1, 50.0))
@settings(max_examples=20, deadline=None)
def test_box_has_the_textbook_volume_and_inertia(x, y, z, mass):
    mesh = shapes.box([x, y, z])
    assert mesh.volume() == pytest.approx(x * y * z, rel=1e-9)
    properties = mesh.solid_mass_properties(mass)
    np.testing.assert_allclose(
        properties.I_BBcm_B, _box_inertia([x, y, z], mass), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(properties.p_BoBcm_B, 0.0, atol=1e-12)


def test_round_bodies_approach_their_formulas():
    r, h, m = 0.1, 0.3, 2.0
    ball = shapes.sphere(r, 256)
    assert ball.volume() == pytest.approx(4.0 / 3.0 * np.pi * r**3, rel=1e-3)
    np.testing.assert_allclose(
        np.diag(ball.solid_mass_properties(m).I_BBcm_B), 0.4 * m * r**2, rtol=1e-3
    )
    np.testing.assert_allclose(
        np.diag(ball.shell_mass_properties(m).I_BBcm_B), 2.0 / 3.0 * m * r**2, rtol=1e-3
    )
    can = shapes.cylinder(r, h, 256).solid_mass_properties(m)
    side = m * (3.0 * r**2 + h**2) / 12.0
    np.testing.assert_allclose(np.diag(can.I_BBcm_B), [side, side, m * r**2 / 2.0], rtol=1e-3)
    cone = shapes.lathe([(0, 0), (r, 0), (0, h)], 256)
    assert cone.volume() == pytest.approx(np.pi * r**2 * h / 3.0, rel=1e-3)
    assert cone.solid_mass_properties(m).p_BoBcm_B[2] == pytest.approx(h / 4.0, rel=1e-3)


def test_sweep_obeys_pappus():
    angle = np.linspace(0.0, 1.5 * np.pi, 200)
    path = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(200)])
    section = shapes.rounded_rectangle(0.2, 0.1, 0.02)
    x, y = section.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert shapes.sweep(path, section).volume() == pytest.approx(area * 1.5 * np.pi, rel=2e-3)


@given(st.tuples(*[st.floats(-3, 3)] * 3), st.tuples(*[st.floats(-5, 5)] * 3))
@settings(max_examples=20, deadline=None)
def test_mass_properties_move_with_the_mesh(rpy, position):
    mesh = CLOSED["lathe"]
    rotation = RollPitchYaw(*rpy).ToRotationMatrix().matrix()
    before, moved = mesh.solid_mass_properties(1.5), mesh.transformed(rotation, position)
    after = moved.solid_mass_properties(1.5)
    np.testing.assert_allclose(
        after.I_BBcm_B, rotation @ before.I_BBcm_B @ rotation.T, rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(after.p_BoBcm_B, rotation @ before.p_BoBcm_B + position, atol=1e-9)
    assert mesh.mirrored(0).volume() == pytest.approx(mesh.volume())


def test_creases_stay_sharp_and_curves_smooth():
    can = shapes.cylinder(0.05, 0.1, 64)
    on_rim = np.isclose(can.vertices[:, 2], 0.05) & (np.hypot(*can.vertices[:, :2].T) > 0.04)
    up = np.abs(can.normals[on_rim, 2])
    assert np.all((up < 1e-9) | (up > 1.0 - 1e-9))  # no normal leans over the edge
    ball = shapes.sphere(0.1, 64)
    radial = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    assert np.einsum("ij,ij->i", radial, ball.normals).min() > np.cos(np.radians(3.0))


@given(st.integers(3, 40), st.integers(0, 1000))
@settings(max_examples=40, deadline=None)
def test_triangulation_keeps_the_area_of_star_shaped_outlines(count, seed):
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    radius = rng.uniform(0.3, 1.0, count)
    outline = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    triangles = outline[shapes.triangulate(outline)]
    u, v = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    areas = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    x, y = outline.T
    assert areas.min() > -1e-12
    assert areas.sum() == pytest.approx(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def test_box_atlas_puts_each_face_upright_where_it_says():
    size = np.array([0.1, 0.2, 0.3])
    mesh = shapes.box(size)
    rects = shapes.box_atlas(size)[1]
    for name, (u0, v0, u1, v1) in rects.items():
        axis, sign = "xyz".index(name[1]), 1.0 if name[0] == "+" else -1.0
        mine = np.isclose(mesh.normals[:, axis], sign)
        uvs, points = mesh.uvs[mine], mesh.vertices[mine]
        np.testing.assert_allclose([uvs.min(axis=0), uvs.max(axis=0)], [[u0, v0], [u1, v1]])
        if axis != 2:  # side faces: v grows with height, u to the right seen from outside
            up = points[:, 2] > 0
            assert np.all(np.isclose(uvs[up, 1], v1))
            assert np.all(np.isclose(uvs[~up, 1], v0))
            right = np.cross([0, 0, 1], sign * np.eye(3)[axis])
            assert np.all(np.isclose(uvs[points @ right > 0, 0], u1))


def test_drake_reads_the_file_as_the_mesh_says(tmp_path):
    mesh = shapes.rounded_box([0.1, 0.2, 0.3], 0.01).transformed(p_AB=[0.5, -0.3, 0.2])
    path = tmp_path / "box.gltf"
    shapes.write_gltf(path, [Part(mesh, Material())])
    hull = DrakeMesh(str(path)).GetConvexHull()
    vertices = np.array([hull.vertex(k) for k in range(hull.num_vertices())])
    np.testing.assert_allclose(vertices.min(axis=0), mesh.bounds()[0], atol=1e-6)
    np.testing.assert_allclose(vertices.max(axis=0), mesh.bounds()[1], atol=1e-6)


def test_gltf_comes_back_and_repeats_byte_for_byte(tmp_path):
    paint = Material("red", (0.8, 0.1, 0.1, 1.0), metallic=0.1, roughness=0.3)
    printed = Material("print", (1.0, 1.0, 1.0, 1.0), texture=b"\x89PNG not looked into")
    parts = [
        Part(CLOSED["lathe"], paint),
        Part(CLOSED["box"], printed),
        Part(CLOSED["sphere"], paint),
    ]
    first, second = tmp_path / "a.gltf", tmp_path / "b.gltf"
    shapes.write_gltf(first, parts)
    shapes.write_gltf(second, parts)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.gltf", "b.gltf"]  # no leftovers
    for part, back in zip(parts, shapes.read_gltf(first), strict=True):
        assert back.material == part.material
        np.testing.assert_array_equal(back.mesh.faces, part.mesh.faces)
        np.testing.assert_allclose(back.mesh.vertices, part.mesh.vertices, atol=1e-7)
        np.testing.assert_allclose(back.mesh.normals, part.mesh.normals, atol=1e-6)
        if part.material.texture:
            np.testing.assert_allclose(back.mesh.uvs, part.mesh.uvs, atol=1e-6)


@pytest.mark.parametrize(
    "make",
    [
        lambda: shapes.sphere(0.1, 2),
        lambda: shapes.sphere(0.1, 100_000),
        lambda: shapes.cylinder(0.1, 0.2, 12.5),  # type: ignore[arg-type]
        lambda: shapes.sphere(0.0),
        lambda: shapes.sphere(float("nan")),
        lambda: shapes.cylinder(0.1, -1.0),
        lambda: shapes.box([0.1, 0.0, 0.1]),
        lambda: shapes.box([0.1, float("nan"), 0.1]),
        lambda: shapes.rounded_box([0.1, 0.1, 0.1], 0.06),
        lambda: shapes.rounded_box([0.1, 0.1, 0.1], 0.01, 3),
        lambda: shapes.lathe([(0.0, 0.0), (-0.1, 0.1)]),
        lambda: shapes.lathe([(0.0, 0.0), (float("inf"), 0.1)]),
        lambda: shapes.lathe([(0.0, 0.0)]),
        lambda: shapes.loft([[(0, 0), (1, 0), (0, 1)]], [0.0]),
        lambda: shapes.sweep([(0, 0, 0), (0, 0, 0)], shapes.circle(0.1)),
        lambda: shapes.sweep([(0, 0, 0), (0, 0, 1)], shapes.circle(0.1)),  # along up
        lambda: shapes.extrude([(0, 0), (1, 1), (1, 0)], 0.1),  # clockwise
        lambda: shapes.extrude([(0, 0), (1, 0), (1, 1)], 0.1, bevel=0.2),
        lambda: shapes.circle(float("nan")),
        lambda: shapes.superellipse(0.1, 0.1, 100.0),
        lambda: shapes.rounded_rectangle(0.1, 0.1, 0.2),
        lambda: shapes.merge([]),
        lambda: CLOSED["box"].scaled([1, 1, 0]),
        lambda: CLOSED["box"].transformed(2.0 * np.eye(3)),
        lambda: CLOSED["box"].solid_mass_properties(0.0),
        lambda: shapes.lathe([(0.1, 0), (0.1, 1)]).volume(),  # open
        lambda: Material(color=(1.2, 0, 0, 1)),
        lambda: Material(roughness=float("nan")),
    ],
)
def test_bad_arguments_are_input_errors(make):
    with pytest.raises(InputError):
        make()


def test_resolution_error_says_the_range():
    with pytest.raises(InputError, match="from 3 to 512"):
        shapes.sphere(0.1, 1_000_000)
