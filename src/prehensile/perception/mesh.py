"""Triangle meshes as perception uses them: surfaces to sample, to look up, to compare with."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.errors import InputError
from prehensile.native.surface import MeshSurface
from prehensile.perception.cloud import FARTHEST, rotate, within


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface of triangles, in the frame O of the object that it is.

    Attributes:
        vertices: (V, 3) positions [m], finite (and none beyond 1e30).
        triangles: (T, 3) int64 indices of the vertices, counter-clockwise seen from outside;
            at least one.
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        """Converts the arrays and checks them.

        Raises:
            InputError: if a shape is wrong, a position is not finite, there is no triangle, or one
                names a vertex that does not exist.
        """
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        triangles = np.asarray(self.triangles)
        faults = []
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            faults.append(f"vertices has shape {vertices.shape}; expected (V, 3)")
        elif not within(vertices, FARTHEST):
            faults.append("vertices holds values that are not finite or beyond 1e30")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or not len(triangles):
            faults.append(f"triangles has shape {triangles.shape}; expected (T, 3) with T >= 1")
        elif not np.issubdtype(triangles.dtype, np.integer):
            faults.append(f"triangles holds {triangles.dtype}; expected integers")
        elif triangles.min() < 0 or triangles.max() >= len(vertices):
            faults.append(f"triangles names vertices outside 0 to {len(vertices) - 1}")
        if faults:
            raise InputError(*faults)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", np.ascontiguousarray(triangles, dtype=np.int64))

    def diameter(self) -> float:
        """Diagonal of the axis-aligned bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def area_vectors(self) -> NDArray[np.float64]:
        """For each triangle its normal times its area [m²]: (T, 3)."""
        a, b, c = (self.vertices[self.triangles[:, k]] for k in range(3))
        return 0.5 * np.cross(b - a, c - a)

    def areas(self) -> NDArray[np.float64]:
        """The areas of the triangles [m²]: (T,)."""
        return np.linalg.norm(self.area_vectors(), axis=1)

    def area(self) -> float:
        """The area of the surface [m²], of one side."""
        return float(self.areas().sum())

    def triangle_normals(self) -> NDArray[np.float64]:
        """Unit normals of the triangles, outward: (T, 3); zero where one has no area."""
        vectors = self.area_vectors()
        norms = np.linalg.norm(vectors, axis=1, keepdims=True)
        return np.divide(vectors, norms, out=np.zeros_like(vectors), where=norms > 0)

    def is_watertight(self) -> bool:
        """Whether every edge is shared by as many triangles one way round as the other.

        Then there is an inside. Vertices at the same position count as one.
        """
        return self.surface().is_closed

    def surface(self) -> MeshSurface:
        """Nearest points, signed distances and winding numbers; built anew at each call."""
        return MeshSurface(self.vertices, self.triangles)

    def transformed(self, X_AB: RigidTransform) -> "TriangleMesh":
        """This mesh, given in B, expressed in A."""
        R_AB = np.asarray(X_AB.rotation().matrix(), dtype=float)
        return TriangleMesh(rotate(self.vertices, R_AB) + X_AB.translation(), self.triangles)


def merge_meshes(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """One mesh of the triangles of several, in order; nothing is joined or cut.

    Raises:
        InputError: there are none.
    """
    if not meshes:
        raise InputError("meshes is empty; expected at least one")
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return TriangleMesh(
        np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in meshes)]),
        np.concatenate(
            [
                np.zeros((0, 3), dtype=np.int64),
                *(mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=False)),
            ]
        ),
    )
