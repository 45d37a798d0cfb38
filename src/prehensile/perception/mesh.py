"""Triangle meshes as perception uses them: surfaces to sample, to look up, to compare with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import InputError


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface of triangles, in the frame O of the object that it is.

    Attributes:
        vertices: (V, 3) positions [m], finite.
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
        elif not np.isfinite(vertices).all():
            faults.append("vertices holds values that are not finite")
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
