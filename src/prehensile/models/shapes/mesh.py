"""A triangle mesh with normals and texture coordinates, and what can be computed from it."""

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from prehensile.errors import Finding, InputError
from prehensile.models.shapes import checks

WELD = 1e-7  # m; vertices nearer than this are one point of the surface


@dataclass(frozen=True)
class MassProperties:
    """Mass, centre of mass and rotational inertia of a body B.

    Attributes:
        mass: kg.
        p_BoBcm_B: (3,) centre of mass in the mesh's frame, m.
        I_BBcm_B: (3, 3) rotational inertia about the centre of mass, kg m^2.
    """

    mass: float
    p_BoBcm_B: np.ndarray
    I_BBcm_B: np.ndarray


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise seen from outside.

    Attributes:
        vertices: (V, 3) positions, m. Points on a crease or a texture seam are repeated.
        faces: (F, 3) indices into the vertices.
        normals: (V, 3) outward unit normals for shading.
        uvs: (V, 2) texture coordinates; (0, 0) is the lower left corner of the picture.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray

    def __post_init__(self) -> None:
        count = len(self.vertices)
        shapes = (self.vertices.shape, self.normals.shape, self.uvs.shape)
        if shapes != ((count, 3), (count, 3), (count, 2)) or self.faces.shape[1:] != (3,):
            raise InputError(f"mesh arrays have shapes {shapes} and faces {self.faces.shape}")
        if not all(np.isfinite(a).all() for a in (self.vertices, self.normals, self.uvs)):
            raise InputError("mesh contains NaN or infinity")
        if len(self.faces) and not 0 <= self.faces.min() <= self.faces.max() < count:
            raise InputError("mesh has a face that points at no vertex")

    def transformed(
        self,
        R_AB: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        p_AB: ArrayLike = (0, 0, 0),
    ) -> "Mesh":
        """The mesh given in frame B, expressed in frame A."""
        rotation = np.asarray(R_AB, dtype=float)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-6 or np.linalg.det(rotation) < 0:
            raise InputError(Finding("R_AB is not a rotation matrix", key="R_AB"))
        return dataclasses.replace(
            self,
            vertices=self.vertices @ rotation.T + checks.vector("p_AB", p_AB, 3),
            normals=self.normals @ rotation.T,
        )

    def scaled(self, factors: ArrayLike) -> "Mesh":
        """The mesh stretched along x, y, z by positive factors (3,)."""
        scale = checks.vector("factors", factors, 3)
        for value in scale:
            checks.positive("factors", value)
        normals = self.normals / scale
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return dataclasses.replace(self, vertices=self.vertices * scale, normals=normals)

    def mirrored(self, axis: int) -> "Mesh":
        """The mirror image in the plane through the origin across axis 0, 1 or 2."""
        sign = np.ones(3)
        sign[axis] = -1.0
        return dataclasses.replace(
            self,
            vertices=self.vertices * sign,
            normals=self.normals * sign,
            faces=self.faces[:, ::-1].copy(),
        )

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper corner (3,), (3,) of the axis-aligned bounding box."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def is_closed(self) -> bool:
        """Whether the surface encloses a volume: each edge is met once in each direction."""
        faces = weld(self.vertices)[self.faces]
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        there, n_there = np.unique(edges, axis=0, return_counts=True)
        back, n_back = np.unique(edges[:, ::-1], axis=0, return_counts=True)
        return np.array_equal(there, back) and np.array_equal(n_there, n_back)

    def area(self) -> float:
        """Area of the surface, m^2."""
        return float(self._areas().sum())

    def volume(self) -> float:
        """Enclosed volume, m^3, by the divergence theorem; the mesh must be closed."""
        self._require_closed()
        return float(np.linalg.det(self.vertices[self.faces]).sum() / 6.0)

    def solid_mass_properties(self, mass: float) -> MassProperties:
        """Mass properties of a homogeneous solid that fills the closed mesh.

        Sums signed tetrahedra spanned by the origin and each triangle; the second moments of a
        tetrahedron follow Blow and Binstock, "How to find the inertia tensor (or other mass
        properties) of a 3D solid body represented by a triangle mesh" (2004).
        """
        checks.positive("mass", mass)
        self._require_closed()
        # About the centre of the box, so that far-away meshes lose no digits.
        middle = np.mean(self.bounds(), axis=0)
        tets = self.vertices[self.faces] - middle  # (F, 3, 3)
        volumes = np.linalg.det(tets) / 6.0
        volume = volumes.sum()
        if volume <= 0.0:
            raise InputError("mesh encloses no positive volume: its faces look inwards")
        corner_sum = tets.sum(axis=1)
        center = (volumes[:, None] * corner_sum).sum(axis=0) / (4.0 * volume)
        outer = np.einsum("fki,fkj->fij", tets, tets)
        outer += np.einsum("fi,fj->fij", corner_sum, corner_sum)
        second = np.einsum("f,fij->ij", volumes, outer) / 20.0
        return _mass_properties(mass, center, second / volume, middle)

    def shell_mass_properties(self, mass: float) -> MassProperties:
        """Mass properties of a thin shell of even thickness on the surface."""
        checks.positive("mass", mass)
        middle = np.mean(self.bounds(), axis=0)
        triangles = self.vertices[self.faces] - middle
        areas = self._areas()
        corner_sum = triangles.sum(axis=1)
        center = (areas[:, None] * corner_sum).sum(axis=0) / (3.0 * areas.sum())
        outer = np.einsum("fki,fkj->fij", triangles, triangles)
        outer += np.einsum("fi,fj->fij", corner_sum, corner_sum)
        second = np.einsum("f,fij->ij", areas, outer) / 12.0
        return _mass_properties(mass, center, second / areas.sum(), middle)

    def _areas(self) -> np.ndarray:
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    def _require_closed(self) -> None:
        if not self.is_closed():
            raise InputError("mesh is not closed, so it encloses no volume")


def _mass_properties(
    mass: float, center: np.ndarray, second: np.ndarray, middle: np.ndarray
) -> MassProperties:
    """From the mean of p p^T (about ``middle``) to the inertia about the centre of mass."""
    second = second - np.outer(center, center)
    inertia = mass * (np.trace(second) * np.eye(3) - second)
    return MassProperties(mass, center + middle, 0.5 * (inertia + inertia.T))


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh with the triangles of all; overlapping parts stay as they are."""
    parts = list(meshes)
    if not parts:
        raise InputError("no meshes to merge")
    starts = np.cumsum([0, *(len(m.vertices) for m in parts[:-1])])
    return Mesh(
        np.concatenate([m.vertices for m in parts]),
        np.concatenate([m.faces + start for m, start in zip(parts, starts, strict=True)]),
        np.concatenate([m.normals for m in parts]),
        np.concatenate([m.uvs for m in parts]),
    )


def weld(vertices: np.ndarray) -> np.ndarray:
    """(V,) for each vertex the number of the point it lies on (within WELD)."""
    keys = np.round(vertices / WELD).astype(np.int64)
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)


def shade(
    vertices: ArrayLike, faces: ArrayLike, uvs: ArrayLike, crease: float = np.radians(35.0)
) -> Mesh:
    """A mesh with smooth normals that break where faces meet at more than ``crease``.

    The normal at a corner of a face is the mean, weighted by corner angle, of the normals of
    those faces around the point that lie within ``crease`` of the face. Vertices are repeated
    where normals differ. Faces without area are dropped.

    Args:
        vertices: (V, 3) positions, m.
        faces: (F, 3) indices.
        uvs: (V, 2) texture coordinates.
        crease: rad, 0 for flat faces, pi for smooth everywhere.
    """
    points = checks.array("vertices", vertices, 3, 3)
    triangles = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
    texture = checks.array("uvs", uvs, 2, 3)
    checks.in_range("crease", crease, 0.0, np.pi)

    welded = weld(points)
    ring = welded[triangles]
    proper = (ring[:, 0] != ring[:, 1]) & (ring[:, 1] != ring[:, 2]) & (ring[:, 2] != ring[:, 0])
    triangles = triangles[proper]
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    triangles = triangles[length > 0.0]
    face_normals = cross[length > 0.0] / length[length > 0.0, None]

    corners = triangles.reshape(-1)  # corner k belongs to face k // 3
    weights = _corner_angles(points[triangles]).reshape(-1)
    order = np.argsort(welded[corners], kind="stable")
    group = welded[corners][order]
    starts = np.flatnonzero(np.r_[True, group[1:] != group[:-1]])
    sizes = np.diff(np.r_[starts, len(group)])
    # All ordered pairs (i, j) of corners that share a point.
    size_of = np.repeat(sizes, sizes)
    first = np.repeat(np.arange(len(group)), size_of)
    block = np.repeat(np.repeat(starts, sizes), size_of)
    inside = np.arange(len(first)) - np.repeat(np.cumsum(size_of) - size_of, size_of)
    i, j = order[first], order[block + inside]
    cosine = np.einsum("ij,ij->i", face_normals[i // 3], face_normals[j // 3])
    near = (cosine >= np.cos(crease) - 1e-9) | (i == j)
    normals = np.zeros((len(corners), 3))
    np.add.at(normals, i[near], weights[j[near], None] * face_normals[j[near] // 3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)

    keys = np.column_stack([corners, np.round(normals * 1e5).astype(np.int64)])
    _, chosen, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    source = corners[chosen]
    return Mesh(points[source], inverse.reshape(-1, 3), normals[chosen], texture[source])


def _corner_angles(triangles: np.ndarray) -> np.ndarray:
    """(F, 3) interior angles of triangles (F, 3, 3)."""
    to_next = np.roll(triangles, -1, axis=1) - triangles
    to_last = np.roll(triangles, 1, axis=1) - triangles
    cosine = np.einsum("fki,fki->fk", to_next, to_last)
    sine = np.linalg.norm(np.cross(to_next, to_last), axis=2)
    return np.arctan2(sine, cosine)
