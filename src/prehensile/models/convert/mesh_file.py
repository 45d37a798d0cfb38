"""Mesh files of any common format, read without trusting them.

Reading and decomposing is done by trimesh (and pycollada, CoACD), the optional extra ``convert``.
"""

import importlib
import json
import struct
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np

from prehensile.errors import Finding, InputError
from prehensile.models.packages import inside
from prehensile.models.shapes.gltf import Material

SUFFIXES = (".obj", ".stl", ".dae", ".ply", ".glb", ".gltf", ".off")
MAX_BYTES = 256 << 20
MAX_FACES = 2_000_000
_MAX_TEXTURE_BYTES = 64 << 20
_MAX_ACCESSOR = 50_000_000  # numbers in one array of a glTF file
_UNSAID = [102, 102, 102, 255]  # trimesh's default
_Z_FROM_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


@dataclass(frozen=True, eq=False)
class Piece:
    """Triangles of one material.

    Attributes:
        vertices: (V, 3) in m.
        faces: (F, 3) indices of vertices.
        uvs: (V, 2), or None where there is no texture.
        material: None if the file says nothing about the colour.
    """

    vertices: np.ndarray
    faces: np.ndarray
    uvs: np.ndarray | None
    material: Material | None


def extra(module: str, need: str) -> Any:
    """Imports a module of the optional extra ``convert``.

    Args:
        module: its name.
        need: what it is needed for, for the error's text.

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        message = f"{need} needs the Python package '{module}', which is not installed"
        raise InputError(Finding(message, "pip install 'prehensile[convert]'")) from None


def read_mesh(path: Path, root: Path) -> list[Piece]:
    """Reads a mesh file; z is up, as everywhere in Drake.

    A COLLADA file's unit is applied, its up-axis is not (as the tools of ROS have it). glTF is
    turned from y-up to z-up, as Drake does when it loads it.

    Args:
        path: the file.
        root: the folder that textures, materials and buffers it names may not leave.

    Returns:
        Its pieces, at least one.

    Raises:
        InputError: it is too large, broken, holds no triangles, or a package is missing.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        mend = "use one of " + " ".join(SUFFIXES)
        raise InputError(Finding(f"'{suffix}' is not a mesh format known here", mend, str(path)))
    if path.stat().st_size > MAX_BYTES:
        message = f"the mesh has more than {MAX_BYTES >> 20} MiB"
        raise InputError(Finding(message, "simplify it", str(path)))
    trimesh = extra("trimesh", f"reading the mesh '{path.name}'")
    if suffix == ".dae":
        extra("collada", f"reading the mesh '{path.name}'")
    data = path.read_bytes()
    try:
        _check_content(suffix, data)
        scene = trimesh.load_scene(
            BytesIO(data), file_type=suffix[1:], resolver=_resolver(trimesh, path, root)
        )
        pieces = _pieces(scene, suffix)
    except InputError as error:
        findings = (Finding(f.message, f.mend, str(path)) for f in error.findings)
        raise InputError(*findings) from None
    except (Exception, MemoryError) as error:  # whatever a parser does with a broken file
        said = " ".join(str(error).split())[:200]
        message = f"the mesh cannot be read: {type(error).__name__}: {said}"
        raise InputError(Finding(message, "export it anew", str(path))) from None
    return pieces


def _check_content(suffix: str, data: bytes) -> None:
    """What would make a parser expand entities or take all memory."""
    if suffix == ".dae":
        parser = expat.ParserCreate()

        def refuse(*_: object) -> None:
            raise InputError(Finding("the file declares XML entities", "remove them"))

        parser.EntityDeclHandler = refuse
        parser.Parse(data, True)
    elif suffix in (".gltf", ".glb"):
        text = data
        if suffix == ".glb":
            length = struct.unpack_from("<I", data, 12)[0]
            text = data[20 : 20 + length]
        for accessor in json.loads(text).get("accessors", []):
            if not 0 <= accessor["count"] * 16 <= _MAX_ACCESSOR:
                raise InputError(Finding(f"an array of {accessor['count']} rows", "simplify it"))


def _resolver(trimesh: Any, path: Path, root: Path) -> Any:
    """Hands a parser the files that a mesh names, if they are inside the folder."""

    class Inside(trimesh.resolvers.Resolver):
        def __init__(self) -> None:
            pass

        def get(self, name: str) -> bytes:
            file = inside(root, path.parent / str(name).strip(), str(name))
            if file.stat().st_size > _MAX_TEXTURE_BYTES:
                raise InputError(Finding(f"'{name}' is larger than {_MAX_TEXTURE_BYTES >> 20} MiB"))
            return file.read_bytes()

        def keys(self) -> list[str]:
            return []

        def namespaced(self, namespace: str) -> "Inside":
            raise InputError(Finding("meshes in archives are not read"))

        def write(self, name: str, data: bytes) -> None:
            raise InputError(Finding("a mesh may not write"))

    return Inside()


def _pieces(scene: Any, suffix: str) -> list[Piece]:
    unit = 1.0
    if suffix == ".dae" and "*" in (scene.units or ""):
        unit = float(scene.units.split("*")[0])  # trimesh says "0.001 * meters"
    X = _Z_FROM_Y_UP if suffix in (".gltf", ".glb") else np.eye(4)
    pieces, faces = [], 0
    for node in scene.graph.nodes_geometry:
        X_MN, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not hasattr(mesh, "faces") or len(mesh.faces) == 0:
            continue  # points or lines
        faces += len(mesh.faces)
        if faces > MAX_FACES:
            raise InputError(Finding(f"more than {MAX_FACES} triangles", "simplify it"))
        X_MN = X @ X_MN
        vertices = unit * (np.asarray(mesh.vertices, float) @ X_MN[:3, :3].T + X_MN[:3, 3])
        triangles = np.asarray(mesh.faces, np.int64)
        if not np.isfinite(vertices).all():
            raise InputError(Finding("NaN or infinity among the vertices", "export it anew"))
        if np.linalg.det(X_MN[:3, :3]) < 0:
            triangles = triangles[:, ::-1]
        uvs, material = _look(mesh.visual, suffix)
        pieces.append(Piece(vertices, triangles, uvs, material))
    if not pieces:
        raise InputError(Finding("the mesh has no triangles", "export it anew"))
    return pieces


def _look(visual: Any, suffix: str) -> tuple[np.ndarray | None, Material | None]:
    """Texture coordinates and material of a trimesh visual."""
    if not visual.defined:
        return None, None
    if visual.kind != "texture":
        # Colours of faces or vertices: one for the piece.
        return None, Material(color=linear(np.asarray(visual.main_color) / 255.0))
    material = visual.material
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    uvs = visual.uv
    # trimesh makes up a grey picture of a few pixels for an .obj that says nothing of its colour.
    if list(material.main_color) == _UNSAID and (image is None or image.width * image.height <= 16):
        return None, None
    if image is not None and uvs is not None:
        png = BytesIO()
        image.convert("RGB").save(png, "PNG")
        return np.asarray(uvs, float), Material(color=(1.0, 1.0, 1.0, 1.0), texture=png.getvalue())
    color = np.asarray(material.main_color) / 255.0
    if suffix in (".gltf", ".glb"):
        r, g, b, alpha = (float(c) for c in color)
        return None, Material(color=(r, g, b, alpha))
    return None, Material(color=linear(color))


def linear(color: Any) -> tuple[float, float, float, float]:
    """Linear light from a colour as screens have it, (4,) in 0..1; alpha is left."""
    rgba = np.clip(np.asarray(color, float), 0.0, 1.0)
    r, g, b = (float(c) for c in rgba[:3] ** 2.2)
    return r, g, b, float(rgba[3])
