"""The meshes of one conversion: each read once, and written in the form that Drake loads."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.models.convert.locate import Locator
from prehensile.models.convert.mass import Solid
from prehensile.models.convert.mesh_file import MAX_FACES, Piece, extra, read_mesh
from prehensile.models.convert.report import Report
from prehensile.models.shapes.gltf import Material, Part, write_gltf
from prehensile.models.shapes.mesh import WELD, Mesh, shade

_MIN_THICKNESS = 1e-3  # m, of a box that stands for a flat mesh
_MAX_TOTAL_FACES = 5 * MAX_FACES
_LEAST, _GREATEST = 1e-6, 1e5  # m
_LARGE = 20.0  # m; a mesh of this size has most likely another unit


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """What stands for a collision mesh.

    Attributes:
        file: a mesh file beside the model, relative to it; "" for a box.
        convex: whether the mesh is convex.
        size: (3,) edge lengths of the box in m.
        p_MS: (3,) middle of the box in the mesh's frame, m.
    """

    file: str
    convex: bool = True
    size: tuple[float, ...] = ()
    p_MS: tuple[float, ...] = (0.0, 0.0, 0.0)


class MeshStore:
    """Reads meshes and writes them into a folder.

    Args:
        folder: of the model being written; meshes go into ``meshes`` in it.
        locator: finds the files.
        scale: factor on all their coordinates.
        collision: see ``options.COLLISIONS``.
        report: what was done is noted here.
    """

    def __init__(
        self, folder: Path, locator: Locator, scale: float, collision: str, report: Report
    ) -> None:
        self._folder = folder / "meshes"
        self._locator = locator
        self._scale = scale
        self._collision = collision
        self._report = report
        self._pieces: dict[str, list[Piece]] = {}
        self._names: set[str] = set()
        self._visuals: dict[object, str] = {}
        self._collisions: dict[object, list[CollisionShape]] = {}
        self._solids: dict[object, Solid] = {}
        self._faces = 0

    def add_points(self, name: str, vertices: np.ndarray, faces: np.ndarray) -> str:
        """Adds a mesh that is in no file, and gives the URI it is known by here."""
        uri = f"inline:{name}"
        self._pieces[uri] = [Piece(vertices, faces, None, None)]
        return uri

    def visual(self, uri: str, scale: np.ndarray, color: tuple[float, ...] | None) -> str:
        """Writes a mesh to be seen.

        Args:
            uri: of the mesh.
            scale: (3,) along x, y, z; negative ones mirror.
            color: linear red, green, blue, alpha for what has no colour of its own, None: grey.

        Returns:
            The file, relative to the model.
        """
        key = (uri, *scale, color)
        if key not in self._visuals:
            plain = Material() if color is None else Material(color=(*color,))  # type: ignore[arg-type]
            parts = []
            for piece in self.pieces(uri, scale):
                uvs = piece.uvs if piece.uvs is not None else np.zeros((len(piece.vertices), 2))
                material = piece.material or plain
                mesh = _shaded(piece.vertices, piece.faces, uvs)
                parts.append(Part(mesh, replace(material, double_sided=True)))
            file = self._name(uri, ".gltf")
            write_gltf(self._folder / file, parts)
            self._visuals[key] = f"meshes/{file}"
            self._report.add("mesh", _stem(uri), f"written as meshes/{file} to be seen")
        return self._visuals[key]

    def collision(self, uri: str, scale: np.ndarray) -> list[CollisionShape]:
        """Makes the shapes that touch in place of a mesh."""
        key = (uri, *scale)
        if key not in self._collisions:
            self._collisions[key] = self._shapes(uri, scale)
        return self._collisions[key]

    def solid(self, uri: str, scale: np.ndarray) -> Solid:
        """The mesh filled with matter; its convex hull if it is not closed."""
        key = (uri, *scale)
        if key not in self._solids:
            vertices, faces = self._merged(uri, scale)
            mesh = _plain(vertices, faces)
            if not mesh.is_closed() or not mesh.volume():
                hull = _hull(vertices)
                if hull is None:
                    raise InputError(Finding(f"the mesh '{uri}' is flat: it has no volume"))
                mesh = _plain(*hull)
                text = "not closed: its mass properties are those of its convex hull"
                self._report.add("inertia", _stem(uri), text)
            elif mesh.volume() < 0:
                mesh = _plain(vertices, faces[:, ::-1])
                text = "its faces look inwards: turned for the mass properties"
                self._report.add("inertia", _stem(uri), text)
            properties = mesh.solid_mass_properties(1.0)
            self._solids[key] = Solid(mesh.volume(), properties.p_BoBcm_B, properties.I_BBcm_B)
        return self._solids[key]

    def pieces(self, uri: str, scale: np.ndarray) -> list[Piece]:
        """The pieces of a mesh, scaled.

        Raises:
            InputError: the file cannot be found or read, or all meshes together are too large.
        """
        if not np.isfinite(scale).all() or (scale == 0).any():
            raise InputError(Finding(f"the scale of the mesh '{uri}' is {scale}", "write 1 1 1"))
        if uri not in self._pieces:
            path, root = self._locator.find(uri)
            self._pieces[uri] = read_mesh(path, root)
            self._faces += sum(len(p.faces) for p in self._pieces[uri])
            if self._faces > _MAX_TOTAL_FACES:
                message = f"the meshes have more than {_MAX_TOTAL_FACES} triangles together"
                raise InputError(Finding(message, "simplify them"))
        factor = scale * self._scale
        flipped = np.prod(factor) < 0
        pieces = [
            replace(p, vertices=p.vertices * factor, faces=p.faces[:, ::-1] if flipped else p.faces)
            for p in self._pieces[uri]
        ]
        extent = max(float(np.ptp(p.vertices, axis=0).max()) for p in pieces)
        if not _LEAST < extent < _GREATEST:
            message = f"the mesh '{uri}' is {extent:g} m large"
            raise InputError(Finding(message, "correct its scale"))
        if extent > _LARGE:
            text = f"{extent:.3g} m large: if it is in millimetres, convert with --units mm"
            self._report.add("note", _stem(uri), text)
        return pieces

    def _merged(self, uri: str, scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pieces = self.pieces(uri, scale)
        starts = np.cumsum([0, *(len(p.vertices) for p in pieces)])
        faces = [p.faces + start for p, start in zip(pieces, starts[:-1], strict=True)]
        return np.concatenate([p.vertices for p in pieces]), np.concatenate(faces)

    def _shapes(self, uri: str, scale: np.ndarray) -> list[CollisionShape]:
        vertices, faces = self._merged(uri, scale)
        name, how = _stem(uri), self._collision
        hull = _hull(vertices)
        if hull is None or how == "box":
            low, high = vertices.min(axis=0), vertices.max(axis=0)
            size = np.maximum(high - low, _MIN_THICKNESS)
            middle = (low + high) / 2
            why = "a flat mesh: " if hull is None else ""
            self._report.add("collision", name, f"{why}its box of {_said(size)} m touches")
            return [CollisionShape("", size=(*size.tolist(),), p_MS=(*middle.tolist(),))]
        if how == "keep":
            self._report.add("collision", name, "kept as it is; point contact uses its hull")
            return [CollisionShape(self._write_obj(uri, vertices, faces), convex=False)]
        if how == "decompose":
            parts = self._decompose(vertices, faces)
            if parts:
                text = f"{len(faces)} triangles became {len(parts)} convex pieces"
                self._report.add("collision", name, text)
                return [CollisionShape(self._write_obj(uri, *part)) for part in parts]
            text = "the package 'coacd' is not installed: a convex hull in place of convex pieces"
            self._report.add("note", "collision", text)
        text = f"{len(faces)} triangles became their convex hull of {len(hull[1])}"
        self._report.add("collision", name, text)
        return [CollisionShape(self._write_obj(uri, *hull))]

    def _decompose(
        self, vertices: np.ndarray, faces: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Convex pieces by CoACD (Wei et al. 2022); none if it is not installed."""
        try:
            coacd = extra("coacd", "convex decomposition")
        except InputError:
            return []
        coacd.set_log_level("error")
        parts = coacd.run_coacd(
            coacd.Mesh(vertices, faces), threshold=0.05, max_convex_hull=16, seed=0
        )
        hulls = (_hull(np.asarray(points, float)) for points, _ in parts)
        return [hull for hull in hulls if hull is not None]

    def _write_obj(self, uri: str, vertices: np.ndarray, faces: np.ndarray) -> str:
        file = self._name(uri, ".obj")
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices.tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
        write_atomic(self._folder / file, "\n".join(lines) + "\n")
        return f"meshes/{file}"

    def _name(self, uri: str, suffix: str) -> str:
        """A file name not used yet."""
        stem = plain_name(_stem(uri), "mesh")
        stem = stem + ("_collision" if suffix == ".obj" else "")
        name, k = stem + suffix, 1
        while name.lower() in self._names:
            k += 1
            name = f"{stem}_{k}{suffix}"
        self._names.add(name.lower())
        return name


def plain_name(name: str, otherwise: str) -> str:
    """A name of letters, digits, _ and - that is safe in a path."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_-")[:80] or otherwise


def _stem(uri: str) -> str:
    return Path(uri.removeprefix("inline:")).stem


def _said(size: np.ndarray) -> str:
    return " x ".join(f"{s:.3g}" for s in size)


def _shaded(vertices: np.ndarray, faces: np.ndarray, uvs: np.ndarray) -> Mesh:
    """With normals; a piece that is nothing but triangles without area is kept as it is."""
    mesh = shade(vertices, faces, uvs)
    return mesh if len(mesh.faces) else _plain(vertices, faces)


def _plain(vertices: np.ndarray, faces: np.ndarray) -> Mesh:
    up = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    return Mesh(vertices, faces, up, np.zeros((len(vertices), 2)))


def _hull(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices and outward faces of the convex hull; None for points in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        return None
    size = np.ptp(vertices, axis=0)
    if hull.volume <= 1e-6 * size.max() ** 3 * 1e-3 or hull.volume < WELD**3:
        return None
    used = np.unique(hull.simplices)
    faces = np.searchsorted(used, hull.simplices)
    points = vertices[used]
    a, b, c = np.moveaxis(points[faces], 1, 0)
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return points, faces
