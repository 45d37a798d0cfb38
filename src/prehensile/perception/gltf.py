"""Triangles of glTF 2.0 files, which need not be trusted.

Source: Khronos Group, "glTF 2.0 Specification" (2021).
"""

import base64
import binascii
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import InputError

MAX_TRIANGLES = 5_000_000
"""Most triangles that are read from one file, those of repeated meshes counted each time."""

_MAX_DEPTH = 64  # Of nodes in nodes.
_MAX_NODES = 20_000  # Visited, repeated ones counted each time.
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
_Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


def parse_gltf(data: bytes, read_side_file: Callable[[str], bytes]) -> _Triangles:
    """Reads all triangles of the scene of a .gltf or .glb file, the nodes' poses applied.

    Skins, morph targets and sparse or compressed arrays are not read.

    Args:
        data: the file's bytes.
        read_side_file: gives the bytes of a buffer beside the file by the name that the file has
            for it; raises InputError if it may not be read.

    Returns:
        (V, 3) vertices in glTF's own frame, y up; (T, 3) indices.

    Raises:
        InputError: what it holds cannot be used as it is.
        ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError: it is
            broken.
    """
    binary = b""
    if data.startswith(b"glTF"):
        data, binary = _chunks(data)
    reader = _Reader(json.loads(data), binary, read_side_file)
    reader.read_scene()
    if not reader.triangles:
        raise InputError("the file holds no triangles")
    return np.concatenate(reader.vertices), np.concatenate(reader.triangles)


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """The JSON text and the binary part of a .glb file."""
    at, parts = 12, {}
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        if at + 8 + length > len(data):
            raise InputError("the file ends early")
        parts.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return parts.get(0x4E4F534A, b""), parts.get(0x004E4942, b"")


class _Reader:
    """Walks over the nodes of a scene and collects their triangles."""

    def __init__(self, gltf: Any, binary: bytes, read_side_file: Callable[[str], bytes]) -> None:
        self.vertices: list[NDArray[np.float64]] = []
        self.triangles: list[NDArray[np.int64]] = []
        self._gltf = gltf
        self._binary = binary
        self._read_side_file = read_side_file
        self._buffers: dict[int, bytes] = {}
        self._meshes: dict[int, list[_Triangles]] = {}
        self._num_vertices = 0
        self._num_triangles = 0
        self._num_nodes = 0

    def read_scene(self) -> None:
        scenes = self._gltf.get("scenes")
        if scenes:
            roots = _item(scenes, self._gltf.get("scene", 0)).get("nodes", [])
        else:
            nodes = self._gltf.get("nodes", [])
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [i for i in range(len(nodes)) if i not in children]
        for root in roots:
            self._read_node(root, np.eye(4), 0)

    def _read_node(self, index: int, X_parent: NDArray[np.float64], depth: int) -> None:
        self._num_nodes += 1
        if depth > _MAX_DEPTH or self._num_nodes > _MAX_NODES:
            raise InputError("its nodes are nested in each other too deeply or too often")
        node = _item(self._gltf["nodes"], index)
        X = X_parent @ _transform(node)
        if "mesh" in node:
            self._add_mesh(node["mesh"], X)
        for child in node.get("children", []):
            self._read_node(child, X, depth + 1)

    def _add_mesh(self, index: int, X: NDArray[np.float64]) -> None:
        if index not in self._meshes:
            primitives = _item(self._gltf["meshes"], index)["primitives"]
            self._meshes[index] = [p for q in primitives if (p := self._primitive(q)) is not None]
        for vertices, triangles in self._meshes[index]:
            self._num_triangles += len(triangles)
            if self._num_triangles > MAX_TRIANGLES:
                raise InputError(f"it holds more than {MAX_TRIANGLES} triangles")
            mirrored = np.linalg.det(X[:3, :3]) < 0
            self.vertices.append(vertices @ X[:3, :3].T + X[:3, 3])
            self.triangles.append(triangles[:, :: -1 if mirrored else 1] + self._num_vertices)
            self._num_vertices += len(vertices)

    def _primitive(self, primitive: dict) -> _Triangles | None:
        """Vertices and triangles, or None for points and lines."""
        mode = primitive.get("mode", 4)
        if mode not in (4, 5, 6):
            return None
        vertices = self._accessor(primitive["attributes"]["POSITION"], "VEC3").astype(np.float64)
        if "indices" in primitive:
            indices = self._accessor(primitive["indices"], "SCALAR")[:, 0].astype(np.int64)
        else:
            indices = np.arange(len(vertices))
        if mode == 4:
            triangles = indices[: len(indices) // 3 * 3].reshape(-1, 3)
        elif mode == 5:  # A strip: every other triangle is the other way round.
            triangles = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
            triangles[1::2] = triangles[1::2, [1, 0, 2]]
        else:  # A fan.
            first = np.broadcast_to(indices[:1], (max(len(indices) - 2, 0),))
            triangles = np.stack([first, indices[1:-1], indices[2:]], axis=1)
        if len(triangles) and triangles.max() >= len(vertices):
            raise InputError("a triangle names a vertex that does not exist")
        return (vertices, triangles) if len(triangles) else None

    def _accessor(self, index: int, kind: str) -> NDArray[Any]:
        """The rows of an array, (count, 1) or (count, 3)."""
        accessor = _item(self._gltf["accessors"], index)
        if accessor["type"] != kind:
            raise InputError(f"an array of {kind} is expected, not of {accessor['type']!r}")
        if "sparse" in accessor or "bufferView" not in accessor:
            raise InputError("sparse and compressed arrays are not read")
        view = _item(self._gltf["bufferViews"], accessor["bufferView"])
        dtype = np.dtype("<" + _COMPONENTS[accessor["componentType"]])
        if kind == "SCALAR" and dtype.kind != "u":
            raise InputError("indices are not whole numbers")
        columns = 3 if kind == "VEC3" else 1
        width = columns * dtype.itemsize
        count, stride = _whole(accessor["count"]), _whole(view.get("byteStride", width))
        offset = _whole(accessor.get("byteOffset", 0))
        start, length = _whole(view.get("byteOffset", 0)), _whole(view["byteLength"])
        buffer = self._buffer(view["buffer"])
        if (
            start + length > len(buffer)
            or stride < width
            or (count and offset + (count - 1) * stride + width > length)
        ):
            raise InputError("an array goes beyond its buffer")
        if not count:
            return np.zeros((0, columns), dtype)
        rows = np.ndarray((count, columns), dtype, buffer, start + offset, (stride, dtype.itemsize))
        if accessor.get("normalized") and dtype.kind != "f":
            return np.maximum(rows / np.iinfo(dtype).max, -1)
        return rows

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            buffer = _item(self._gltf["buffers"], index)
            uri = buffer.get("uri")
            if uri is None:
                self._buffers[index] = self._binary
            elif uri.startswith("data:"):
                head, _, text = uri.partition(",")
                if not head.endswith(";base64"):
                    raise InputError("a buffer is neither a file nor in base64")
                try:
                    self._buffers[index] = base64.b64decode(text, validate=True)
                except binascii.Error as error:
                    raise InputError(f"a buffer is not in base64: {error}") from None
            else:
                self._buffers[index] = self._read_side_file(uri)
        return self._buffers[index]


def _item(items: list, index: Any) -> Any:
    """An item by an index that is not trusted."""
    if not isinstance(index, int) or not 0 <= index < len(items):
        raise InputError(f"index {index!r} names nothing")
    return items[index]


def _whole(value: Any) -> int:
    if not isinstance(value, int) or not 0 <= value < 2**40:
        raise InputError(f"{value!r} is no size")
    return value


def _transform(node: dict) -> NDArray[np.float64]:
    """The pose of a node in its parent, with scale, (4, 4)."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = (float(value) for value in node.get("rotation", (0, 0, 0, 1)))
    X = np.eye(4)
    X[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    X[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), dtype=float).reshape(3)
    X[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=float).reshape(3)
    return X
