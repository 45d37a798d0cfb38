"""Nearest points, inside and outside of surfaces of triangles."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core


class SurfacePoints(NamedTuple):
    """The points of a surface nearest to M queries.

    Attributes:
        points: (M, 3) nearest points [m]; zero where none is near enough.
        normals: (M, 3) unit pseudo-normals there: a face's own, the mean over the faces (weighted
            by their angles) at edges and vertices. Zero where all of these are degenerate or no
            point is near enough.
        triangles: (M,) int32 which triangle each point lies on, -1 where none is near enough.
        barycentric: (M, 3) its weights of the triangle's vertices.
        distances: (M,) from query to point [m], infinite where none is near enough.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[np.int32]
    barycentric: NDArray[np.float64]
    distances: NDArray[np.float64]


class MeshSurface:
    """A surface of triangles in a hierarchy of boxes, copied.

    Vertices at the same position are taken as one, so that a mesh whose vertices are doubled at the
    seams of its texture can still be closed. Queries may run on several threads at once; the GIL is
    released.

    Args:
        vertices: (V, 3) in any one frame, finite.
        triangles: (T, 3) indices of the vertices, counter-clockwise seen from outside, T ≥ 1.

    Raises:
        ValueError: naming the argument.
    """

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        self._surface = _core.MeshSurface(vertices, triangles)

    @property
    def is_closed(self) -> bool:
        """Whether every edge is shared by as many triangles one way round as the other.

        Triangles with two vertices at one position are not counted.
        """
        return self._surface.is_closed

    @property
    def num_pieces(self) -> int:
        """The number of pieces that share no vertex."""
        return self._surface.num_pieces

    def nearest(
        self, queries: ArrayLike, max_distance: float = float("inf"), num_threads: int = 1
    ) -> SurfacePoints:
        """The nearest point of the surface to each query.

        Args:
            queries: (M, 3) in the frame of the vertices, finite.
            max_distance: points further away do not count [m].
            num_threads: does not change the result.

        Raises:
            ValueError: naming the argument.
        """
        return SurfacePoints(*self._surface.nearest(queries, max_distance, num_threads))

    def signed_distance(self, queries: ArrayLike, num_threads: int = 1) -> NDArray[np.float64]:
        """Distance of each query from the surface [m], negative inside: (M,).

        The side is that of the pseudo-normal at the nearest point (Bærentzen and Aanæs, 2005) where
        the surface is closed and of one piece. Where it has several pieces, which may overlap, or
        holes, a query is inside if the surface winds around it more than half
        (:meth:`winding_number`).

        Args:
            queries: (M, 3) in the frame of the vertices, finite.
            num_threads: does not change the result.

        Raises:
            ValueError: naming the argument.
        """
        return self._surface.signed_distance(queries, num_threads)

    def winding_number(self, queries: ArrayLike) -> NDArray[np.float64]:
        """How often the surface winds around each query: (M,), within some 0.02.

        1 inside and 0 outside of a closed surface, and between for one with holes: its solid angle
        seen from there over 4 π (Jacobson et al., "Robust inside-outside segmentation using
        generalized winding numbers", 2013).

        Args:
            queries: (M, 3) in the frame of the vertices, finite.

        Raises:
            ValueError: naming the argument.
        """
        return self._surface.winding_number(queries)
