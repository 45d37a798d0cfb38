"""Clouds in files, and from and to other libraries' clouds."""

import io
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.perception import BaseField, Fields
from pydrake.perception import PointCloud as DrakePointCloud

from prehensile.errors import InputError
from prehensile.perception import Box, PointCloud, inside_box, inside_half_space, merge
from prehensile.perception.cloud_file import read_cloud, write_cloud
from prehensile.perception.conversions import cloud_from_rows, from_drake, from_open3d, to_drake
from prehensile.perception.pcd import parse_pcd
from prehensile.perception.ply import format_ply, parse_ply


def random_cloud(seed: int, count: int, *, one_origin: bool) -> PointCloud:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    return PointCloud(
        rng.normal(size=(count, 3)),
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        rng.integers(0, 256, (count, 3), dtype=np.uint8),
        rng.integers(-1, 9, count),
        rng.normal(size=3) if one_origin else rng.normal(size=(count, 3)),
    )


def assert_same(a: PointCloud, b: PointCloud) -> None:
    for name in ("points", "normals", "colors", "labels", "sensor_origins"):
        left, right = getattr(a, name), getattr(b, name)
        if left is None or right is None:
            assert left is right, name
        else:
            np.testing.assert_array_equal(left, right, err_msg=name)


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
@pytest.mark.parametrize("one_origin", [True, False])
@pytest.mark.parametrize("count", [0, 1, 100])
def test_files_give_back_the_cloud(
    tmp_path: Path, suffix: str, one_origin: bool, count: int
) -> None:
    cloud = random_cloud(3, count, one_origin=one_origin)
    write_cloud(tmp_path / f"cloud{suffix}", cloud)
    back = read_cloud(tmp_path / f"cloud{suffix}")
    if count == 0 and suffix == ".pcd" and one_origin:
        assert len(back) == 0
        return
    assert_same(back, cloud)


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_bare_points(tmp_path: Path, suffix: str) -> None:
    cloud = PointCloud(np.arange(12.0).reshape(4, 3))
    write_cloud(tmp_path / f"c{suffix}", cloud)
    assert_same(read_cloud(tmp_path / f"c{suffix}"), cloud)


def test_the_library_trimesh_reads_our_ply_and_we_read_its(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    cloud = random_cloud(1, 50, one_origin=True)
    write_cloud(tmp_path / "ours.ply", cloud)
    seen = trimesh.load(tmp_path / "ours.ply")
    np.testing.assert_allclose(seen.vertices, cloud.points)
    np.testing.assert_array_equal(seen.colors[:, :3], cloud.colors)

    box = trimesh.creation.box((0.1, 0.2, 0.3))
    for encoding in ("ascii", "binary"):
        elements = parse_ply(box.export(file_type="ply", encoding=encoding))
        np.testing.assert_allclose(
            np.stack([elements["vertex"][n] for n in "xyz"], axis=1), box.vertices, atol=1e-7
        )
        (faces,) = elements["face"].values()
        np.testing.assert_array_equal(faces, box.faces)


def test_ascii_ply_with_polygons_of_several_sizes() -> None:
    text = """ply
format ascii 1.0
comment a square and a triangle
element vertex 5
property float x
property float y
property uchar red
element face 2
property list uchar int vertex_indices
end_header
0 0 1
1 0 2
1 1 3
0 1 4
2 2 255
4 0 1 2 3
3 2 3 4
"""
    elements = parse_ply(text.encode())
    np.testing.assert_array_equal(elements["vertex"]["x"], [0, 1, 1, 0, 2])
    assert elements["vertex"]["red"].dtype == np.uint8
    np.testing.assert_array_equal(
        elements["face"]["vertex_indices"], [[0, 1, 2], [0, 2, 3], [2, 3, 4]]
    )


def test_big_endian_ply() -> None:
    header = (
        b"ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty double x\n"
        b"property double y\nproperty double z\nproperty list uchar short k\nend_header\n"
    )
    data = header + struct.pack(">ddd", 1.5, 2.5, -3.5) + struct.pack(">Bhh", 2, 7, -8)
    vertex = parse_ply(data)["vertex"]
    assert vertex["x"][0] == 1.5
    assert vertex["z"][0] == -3.5
    np.testing.assert_array_equal(vertex["k"], [[7, -8]])


def pcd_bytes(data_line: str, body: bytes) -> bytes:
    header = f"""# .PCD v0.7
VERSION 0.7
FIELDS x y z rgb _
SIZE 4 4 4 4 1
TYPE F F F F U
COUNT 1 1 1 1 4
WIDTH 3
HEIGHT 1
VIEWPOINT 0 0 1 1 0 0 0
POINTS 3
DATA {data_line}
"""
    return header.encode() + body


XYZ = np.array([[0, 1, 2], [np.nan, 0, 0], [3, 4, 5]], dtype=np.float32)
PACKED = np.array([0x010203, 0, 0xFFFEFD], dtype=np.uint32).view(np.float32)


def test_pcd_of_the_point_cloud_library(tmp_path: Path) -> None:
    """Padding, colours packed into a float, points without return, all three encodings."""
    rows = np.zeros(3, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("c", "<f4"), ("_", "V4")])
    for i, name in enumerate("xyz"):
        rows[name] = XYZ[:, i]
    rows["c"] = PACKED
    columns = b"".join(rows[n].tobytes() for n in rows.dtype.names or ())
    # LZF allows runs of literals only: up to 32 bytes after a byte that tells how many.
    packed = b"".join(
        bytes([len(columns[i : i + 32]) - 1]) + columns[i : i + 32]
        for i in range(0, len(columns), 32)
    )
    ascii_rows = io.StringIO()
    for p, c in zip(XYZ, PACKED, strict=True):
        ascii_rows.write(" ".join([*(str(v) for v in p), repr(float(c)), "0 0 0 0"]) + "\n")
    bodies = {
        "binary": rows.tobytes(),
        "binary_compressed": struct.pack("<II", len(packed), len(columns)) + packed,
        "ascii": ascii_rows.getvalue().encode(),
    }
    for form, body in bodies.items():
        path = tmp_path / f"{form}.pcd"
        path.write_bytes(pcd_bytes(form, body))
        cloud = read_cloud(path)
        np.testing.assert_array_equal(cloud.points, XYZ[[0, 2]])
        np.testing.assert_array_equal(cloud.colors, [[1, 2, 3], [255, 254, 253]])
        np.testing.assert_array_equal(cloud.sensor_origins, [[0, 0, 1], [0, 0, 1]])


def test_lzf_copies_that_overlap_what_they_write() -> None:
    # Five bytes: one literal 'a' and a copy of length 4 (2 + 2) from one back; then 7 literals.
    unpacked = b"aaaaa" + bytes(7) * 1
    packed = bytes([0]) + b"a" + bytes([2 << 5, 0]) + bytes([6]) + bytes(7)
    header = (
        b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
        b"DATA binary_compressed\n"
    )
    fields, _ = parse_pcd(header + struct.pack("<II", len(packed), 12) + packed)
    assert b"".join(fields[n].tobytes() for n in "xyz") == unpacked


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_broken_files_are_refused_or_read(data: st.DataObject) -> None:
    """Whatever bytes are changed, cut or put in: a cloud, or an InputError."""
    folder = Path(data.draw(st.sampled_from([".ply", ".pcd"])))
    cloud = random_cloud(0, 4, one_origin=True)
    if folder.name == ".ply":
        columns = {n: cloud.points[:, i] for i, n in enumerate("xyz")}
        faces = np.array([[0, 1, 2], [1, 2, 3]], dtype=np.int32)
        content = format_ply({"vertex": columns, "face": {"vertex_indices": faces}})
        parse = parse_ply
    else:
        content = pcd_bytes("binary", XYZ.tobytes() + bytes(64))
        parse = parse_pcd
    broken = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(broken)))
        match data.draw(st.sampled_from(["change", "cut", "insert"])):
            case "change" if at < len(broken):
                broken[at] = data.draw(st.integers(0, 255))
            case "cut":
                del broken[at : at + data.draw(st.integers(0, 20))]
            case _:
                broken[at:at] = data.draw(st.binary(max_size=5))
    with suppress(InputError):  # Any other error fails the test.
        parse(bytes(broken))


def test_errors_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "short.ply"
    write_cloud(path, random_cloud(0, 10, one_origin=True))
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(InputError, match=r"short\.ply: the PLY file ends before its 10 rows"):
        read_cloud(path)
    with pytest.raises(InputError, match=r"\.xyz"):
        write_cloud(tmp_path / "cloud.xyz", PointCloud(np.zeros((0, 3))))


def test_drake_and_back() -> None:
    cloud = random_cloud(5, 40, one_origin=True)
    back = from_drake(to_drake(cloud), sensor_origin=[0, 0, 1])
    np.testing.assert_allclose(back.points, cloud.points, rtol=1e-6)
    np.testing.assert_allclose(back.require_normals(), cloud.require_normals(), atol=1e-6)
    np.testing.assert_array_equal(back.colors, cloud.colors)
    np.testing.assert_array_equal(back.require_sensor_origins()[7], [0, 0, 1])


def test_drakes_points_without_return_are_dropped() -> None:
    drake = DrakePointCloud(3, Fields(int(BaseField.kXYZs)))
    drake.mutable_xyzs()[:] = np.array([[1, np.nan, 2], [1, 0, np.inf], [1, 0, 0]])
    cloud = from_drake(drake)
    np.testing.assert_array_equal(cloud.points, [[1, 1, 1]])
    assert cloud.normals is None


def test_open3d_cloud() -> None:
    """By an object with Open3D's attributes: Open3D itself is no dependency of the tests."""

    class Fake:
        points = np.array([[0.0, 0, 0], [np.nan, 0, 0]])
        normals = np.array([[0.0, 0, 1], [0, 0, 1]])
        colors = np.array([[0.0, 0.5, 1.0], [0, 0, 0]])

        def has_normals(self) -> bool:
            return True

        def has_colors(self) -> bool:
            return True

    cloud = from_open3d(Fake())
    np.testing.assert_array_equal(cloud.points, [[0, 0, 0]])
    np.testing.assert_array_equal(cloud.colors, [[0, 128, 255]])


def test_rows_of_an_image() -> None:
    points = np.full((4, 5, 3), np.nan)
    points[1, 2] = [1, 2, 3]
    colors = np.arange(80, dtype=np.uint8).reshape(4, 5, 4)
    cloud = cloud_from_rows(points, colors=colors, sensor_origin=[0, 0, 0])
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3]])
    np.testing.assert_array_equal(cloud.colors, [[28, 29, 30]])
    with pytest.raises(InputError, match="colors has shape"):
        cloud_from_rows(points, colors=colors[1:])


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"points": np.zeros((2, 2))}, "points has shape"),
        ({"points": np.zeros(3)}, "points has shape"),
        ({"points": [[0, 0, np.nan]]}, "points holds values that are not finite"),
        ({"points": [["a", "b", "c"]]}, "points cannot be an array"),
        ({"points": np.zeros((2, 3)), "normals": np.zeros((1, 3))}, "normals has shape"),
        ({"points": np.zeros((2, 3)), "colors": np.zeros((2, 3))}, "colors cannot be an array"),
        ({"points": np.zeros((1, 3)), "colors": [[0, 0, 256]]}, "outside 0 to 255"),
        ({"points": np.zeros((2, 3)), "labels": [0.5, 1]}, "labels cannot be an array"),
        ({"points": np.zeros((2, 3)), "sensor_origins": [np.inf, 0, 0]}, "not finite"),
        ({"points": np.zeros((2, 3)), "sensor_origins": np.zeros((3, 3))}, "sensor_origins has"),
    ],
)
def test_wrong_fields_are_refused(fields: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        PointCloud(**fields)


def test_merge_keeps_what_all_have() -> None:
    a, b = random_cloud(0, 3, one_origin=True), random_cloud(1, 2, one_origin=False)
    both = merge([a, PointCloud(np.zeros((0, 3))), b])
    assert_same(both.select(np.arange(3)), a)
    assert_same(both.select(np.arange(3, 5)), b)
    assert merge([a, b.replace(colors=None)]).colors is None
    assert len(merge([])) == 0


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([np.float32, np.float64]))
def test_crops_against_their_definition(seed: int, dtype: type) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(10, 7, 3)).astype(dtype)
    points[3, 3] = [np.nan, 0, 0]
    X_WB = RigidTransform(RollPitchYaw(rng.normal(size=3)), rng.normal(size=3))
    size = rng.uniform(0.1, 4, 3)
    p_B = X_WB.inverse().multiply(points.reshape(-1, 3).T.astype(float)).T.reshape(10, 7, 3)
    with np.errstate(invalid="ignore"):
        near = np.abs(np.abs(p_B) - size / 2).min(axis=-1) < 1e-12
        expected = (np.abs(p_B) <= size / 2).all(axis=-1)
    assert (inside_box(points, Box(X_WB, size)) == expected)[~near].all()
    normal, offset = rng.normal(size=3), rng.normal()
    height = points.astype(float) @ normal
    clear = np.abs(height - offset) > 1e-9
    assert (inside_half_space(points, normal, offset) == (height >= offset))[clear].all()
