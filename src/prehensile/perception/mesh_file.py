"""Surfaces of triangles in files: OBJ, STL, PLY, glTF. Nothing in a file is trusted."""

from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import Finding, InputError
from prehensile.models.packages import inside
from prehensile.perception.gltf import MAX_TRIANGLES, parse_gltf
from prehensile.perception.mesh import TriangleMesh
from prehensile.perception.ply import parse_ply

MAX_BYTES = 256 << 20
"""Size of the largest file that is read, and of a buffer beside it."""

_Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]
# What parsers raise for broken content (UnicodeDecodeError is a ValueError).
_BROKEN = (
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    RecursionError,
    TypeError,
    ValueError,
)


def read_mesh(path: Path | str, *, root: Path | None = None) -> TriangleMesh:
    """Reads a surface from an OBJ, STL, PLY, glTF or GLB file, by its suffix.

    Lengths are taken as metres. glTF is turned from y-up to z-up, as Drake does when it loads it;
    the other formats are taken as they are. Polygons are cut into fans of triangles. Colours,
    normals and texture coordinates are passed over. STL, which lists corners, gets its vertices
    joined where they are equal.

    Args:
        path: the file, at most 256 MiB and 5 million triangles.
        root: the folder that buffers beside a glTF file may not leave; that of the file if None.

    Raises:
        InputError: the format is not known, or the file is broken, too large, holds no triangles,
            a position that is not finite, or a triangle whose vertex is missing.
        OSError: it cannot be read.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".stl", ".ply", ".gltf", ".glb"):
        raise InputError(
            Finding(
                f"{suffix!r} is no format of meshes known here",
                "use .obj, .stl, .ply, .gltf or .glb",
                str(path),
            )
        )
    folder = path.parent if root is None else root

    def side_file(name: str) -> bytes:
        return _bounded(inside(folder, path.parent / name, name))

    data = _bounded(path)
    try:
        if suffix in (".gltf", ".glb"):
            vertices, triangles = parse_gltf(data, side_file)
            vertices = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
        else:
            vertices, triangles = {".obj": _obj, ".stl": _stl, ".ply": _ply}[suffix](data)
        if len(triangles) > MAX_TRIANGLES:
            raise InputError(Finding(f"more than {MAX_TRIANGLES} triangles", "simplify it"))
        return TriangleMesh(vertices, triangles)
    except InputError as error:
        raise InputError(
            *(Finding(f.message, f.mend, f.file or str(path), f.line) for f in error.findings)
        ) from None
    except _BROKEN as error:
        said = " ".join(str(error).split())[:200]
        message = f"the mesh cannot be read: {type(error).__name__}: {said}"
        raise InputError(Finding(message, "export it anew", str(path))) from None


def _bounded(path: Path) -> bytes:
    """The content of a file that is not too large."""
    if path.stat().st_size > MAX_BYTES:
        message = f"the file is larger than {MAX_BYTES >> 20} MiB"
        raise InputError(Finding(message, "simplify the mesh", str(path)))
    return path.read_bytes()


def _obj(data: bytes) -> _Triangles:
    """Vertices and faces of a Wavefront OBJ file."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.splitlines(), start=1):
        kind, *words = line.split(b"#", 1)[0].split() or [b""]
        try:
            if kind == b"v":
                x, y, z = words[:3]
                vertices.append([float(x), float(y), float(z)])
            elif kind == b"f":
                # Counted from one, or from the end of what there is so far if negative.
                corners = [int(word.split(b"/", 1)[0]) for word in words]
                indices = [i - 1 if i > 0 else len(vertices) + i for i in corners]
                if len(indices) < 3 or 0 in corners or min(indices) < 0:
                    raise ValueError
                triangles += [(indices[0], b, c) for b, c in pairwise(indices[1:])]
                if len(triangles) > MAX_TRIANGLES:
                    break
        except ValueError:
            said = line[:60].decode(errors="replace")
            raise InputError(Finding(f"not understood: {said!r}", line=number)) from None
    return np.array(vertices).reshape(-1, 3), _indices(triangles)


def _stl(data: bytes) -> _Triangles:
    """Corners of a binary or ASCII STL file, equal ones joined."""
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 and len(data) == 84 + 50 * count:
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
        corners = np.frombuffer(data, record, count, 84)["corners"].reshape(-1, 3)
    elif data.lstrip().startswith(b"solid") and b"facet" in data:
        words = data.split()
        places = [i for i, word in enumerate(words) if word == b"vertex"]
        rows = [[float(word) for word in words[i + 1 : i + 4]] for i in places]
        if len(rows) % 3 or any(len(row) != 3 for row in rows):
            raise InputError("the file ends within a facet")
        corners = np.array(rows).reshape(-1, 3)
    else:
        raise InputError("the file is no STL: neither ASCII nor as long as its count of triangles")
    vertices, inverse = np.unique(corners.astype(np.float64), axis=0, return_inverse=True)
    return vertices, inverse.reshape(-1, 3)


def _ply(data: bytes) -> _Triangles:
    """Vertices and faces of a PLY file."""
    elements = parse_ply(data)
    vertex, face = elements.get("vertex", {}), elements.get("face", {})
    if missing := {"x", "y", "z"} - vertex.keys():
        raise InputError(f"its vertices have no {', '.join(sorted(missing))}")
    polygons = face.get("vertex_indices", face.get("vertex_index"))
    if polygons is None:
        raise InputError("it has no faces with 'vertex_indices'")
    vertices = np.stack([vertex[axis] for axis in "xyz"], axis=1).astype(np.float64)
    polygons = np.asarray(polygons)
    if polygons.ndim != 2 or polygons.shape[1] < 3 or not np.issubdtype(polygons.dtype, np.integer):
        raise InputError("its 'vertex_indices' are no lists of three or more whole numbers")
    k = np.arange(1, polygons.shape[1] - 1)
    first = np.broadcast_to(polygons[:, :1], (len(polygons), len(k)))
    fans = np.stack([first, polygons[:, k], polygons[:, k + 1]], axis=-1)
    return vertices, fans.reshape(-1, 3).astype(np.int64)


def _indices(triangles: list[tuple[int, int, int]]) -> NDArray[np.int64]:
    return np.array(triangles, dtype=np.int64).reshape(-1, 3)
