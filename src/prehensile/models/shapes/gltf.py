"""Self-contained glTF 2.0 files: geometry, materials and PNG textures in one JSON text.

glTF has y up; our meshes, like Drake's frames, have z up. Drake turns every glTF file by 90
degrees about x when it loads it (to x, -z, y), so the writer turns by -90 degrees and what is
seen in Drake is what the mesh says.
"""

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.models.shapes import checks
from prehensile.models.shapes.mesh import Mesh

_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_TO_Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # R_GM: mesh frame M to glTF frame G
_PNG = "data:image/png;base64,"
_BIN = "data:application/octet-stream;base64,"


@dataclass(frozen=True)
class Material:
    """How a surface looks (glTF metallic-roughness model).

    Attributes:
        name: for people who read the file.
        color: red, green, blue, alpha in 0..1 (linear light); multiplies the texture.
        metallic: 0 (paint, plastic) to 1 (bare metal).
        roughness: 0 (mirror) to 1 (chalk).
        texture: a PNG file's bytes, or None.
        double_sided: whether the back of the faces is drawn too.
    """

    name: str = "paint"
    color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    metallic: float = 0.0
    roughness: float = 0.6
    texture: bytes | None = None
    double_sided: bool = False

    def __post_init__(self) -> None:
        for name, value in (
            *((f"color[{k}]", c) for k, c in enumerate(self.color)),
            ("metallic", self.metallic),
            ("roughness", self.roughness),
        ):
            checks.in_range(name, value, 0.0, 1.0)


@dataclass(frozen=True)
class Part:
    """A mesh and the material it is made of."""

    mesh: Mesh
    material: Material


def write_gltf(path: str | Path, parts: Sequence[Part]) -> None:
    """Writes the parts as one self-contained glTF file, under a temporary name first.

    The same parts give the same bytes. Parts with equal materials share one.
    """
    if not parts:
        raise InputError(Finding("no parts to write", file=str(path)))
    writer = _Writer()
    primitives = [writer.primitive(part) for part in parts]
    write_atomic(Path(path), writer.document(primitives))


class _Writer:
    """Collects accessors, materials and images while primitives are added."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._materials: list[Material] = []
        self._images: list[bytes] = []

    def primitive(self, part: Part) -> dict[str, Any]:
        mesh = part.mesh
        positions = (mesh.vertices @ _TO_Y_UP.T).astype("<f4")
        attributes = {
            "POSITION": self._accessor(positions, "VEC3", _FLOAT, _ARRAY_BUFFER, bounds=True),
            "NORMAL": self._accessor(
                (mesh.normals @ _TO_Y_UP.T).astype("<f4"), "VEC3", _FLOAT, _ARRAY_BUFFER
            ),
        }
        if part.material.texture is not None:
            flipped = (mesh.uvs * [1.0, -1.0] + [0.0, 1.0]).astype("<f4")  # glTF: v downwards
            attributes["TEXCOORD_0"] = self._accessor(flipped, "VEC2", _FLOAT, _ARRAY_BUFFER)
        short = len(mesh.vertices) < 65536
        indices = mesh.faces.reshape(-1).astype("<u2" if short else "<u4")
        return {
            "attributes": attributes,
            "indices": self._accessor(
                indices, "SCALAR", _USHORT if short else _UINT, _ELEMENT_BUFFER
            ),
            "material": self._material(part.material),
        }

    def _accessor(
        self, data: np.ndarray, kind: str, component: int, target: int, bounds: bool = False
    ) -> int:
        self._buffer.extend(b"\0" * (-len(self._buffer) % 4))
        content = np.ascontiguousarray(data).tobytes()
        self._views.append(
            {
                "buffer": 0,
                "byteOffset": len(self._buffer),
                "byteLength": len(content),
                "target": target,
            }
        )
        self._buffer.extend(content)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": component,
            "count": len(data),
            "type": kind,
        }
        if bounds:
            accessor["min"] = data.min(axis=0).tolist()
            accessor["max"] = data.max(axis=0).tolist()
        self._accessors.append(accessor)
        return len(self._accessors) - 1

    def _material(self, material: Material) -> int:
        if material not in self._materials:
            self._materials.append(material)
            if material.texture is not None and material.texture not in self._images:
                self._images.append(material.texture)
        return self._materials.index(material)

    def document(self, primitives: list[dict[str, Any]]) -> str:
        content: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "prehensile.models.shapes"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": primitives}],
            "materials": [self._material_json(m) for m in self._materials],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [
                {
                    "byteLength": len(self._buffer),
                    "uri": _BIN + base64.b64encode(self._buffer).decode(),
                }
            ],
        }
        if self._images:
            # Linear with mipmaps, clamped: small prints stay calm at a distance.
            content["samplers"] = [
                {"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}
            ]
            content["images"] = [
                {"uri": _PNG + base64.b64encode(png).decode(), "mimeType": "image/png"}
                for png in self._images
            ]
            content["textures"] = [{"sampler": 0, "source": k} for k in range(len(self._images))]
        return json.dumps(content, indent=1) + "\n"

    def _material_json(self, material: Material) -> dict[str, Any]:
        surface: dict[str, Any] = {
            "baseColorFactor": list(material.color),
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        }
        if material.texture is not None:
            surface["baseColorTexture"] = {"index": self._images.index(material.texture)}
        result: dict[str, Any] = {"name": material.name, "pbrMetallicRoughness": surface}
        if material.double_sided:
            result["doubleSided"] = True
        if material.color[3] < 1.0:
            result["alphaMode"] = "BLEND"
        return result


def read_gltf(path: str | Path) -> list[Part]:
    """Reads back a file that ``write_gltf`` wrote (to the precision of 32-bit floats)."""
    path = Path(path)
    try:
        content = json.loads(path.read_text())
        blob = base64.b64decode(content["buffers"][0]["uri"].removeprefix(_BIN))
        images = [
            base64.b64decode(image["uri"].removeprefix(_PNG)) for image in content.get("images", [])
        ]
        return [
            _read_part(content, blob, images, primitive)
            for primitive in content["meshes"][0]["primitives"]
        ]
    except (OSError, ValueError, KeyError, IndexError) as error:
        raise InputError(
            Finding(f"not a glTF file of ours: {error!r}", "generate the model anew", str(path))
        ) from None


def _read_part(
    content: dict[str, Any], blob: bytes, images: list[bytes], primitive: dict[str, Any]
) -> Part:
    def read(index: int) -> np.ndarray:
        accessor = content["accessors"][index]
        view = content["bufferViews"][accessor["bufferView"]]
        dtype = {_FLOAT: "<f4", _USHORT: "<u2", _UINT: "<u4"}[accessor["componentType"]]
        columns = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
        data = np.frombuffer(blob, dtype, accessor["count"] * columns, view["byteOffset"])
        return data.reshape(-1, columns)

    attributes = primitive["attributes"]
    vertices = read(attributes["POSITION"]).astype(float) @ _TO_Y_UP
    uvs = np.zeros((len(vertices), 2))
    if "TEXCOORD_0" in attributes:
        uvs = read(attributes["TEXCOORD_0"]).astype(float) * [1.0, -1.0] + [0.0, 1.0]
    mesh = Mesh(
        vertices,
        read(primitive["indices"]).reshape(-1, 3).astype(np.int64),
        read(attributes["NORMAL"]).astype(float) @ _TO_Y_UP,
        uvs,
    )
    described = content["materials"][primitive["material"]]
    surface = described["pbrMetallicRoughness"]
    texture = surface.get("baseColorTexture")
    return Part(
        mesh,
        Material(
            described["name"],
            tuple(surface["baseColorFactor"]),
            surface["metallicFactor"],
            surface["roughnessFactor"],
            None if texture is None else images[content["textures"][texture["index"]]["source"]],
            described.get("doubleSided", False),
        ),
    )
