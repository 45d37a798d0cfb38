"""What the cameras saw, as heights that a planner keeps the hand above."""

from collections.abc import Iterable

import numpy as np
from pydrake.geometry import CalcObb, Obb, Role, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import RobotDiagram
from scipy.ndimage import maximum_filter

_SPACING = 0.025  # m between neighbouring points on the surface of a shape
_REACH = 0.4  # m from the frame of a hand to anything of it, or in it, or to the wrist


class HeightMap:
    """Heights over a horizontal grid; everything below the surface counts as solid.

    What lies under a point that was seen may be anything, so nothing goes there.
    """

    def __init__(self, points: np.ndarray, *, cell: float = 0.01, clearance: float = 0.015) -> None:
        """Makes the map of a cloud.

        Args:
            points: p_WP (N, 3).
            cell: size of the square cells (m, > 0).
            clearance: how far around and above the points nothing may come (m, >= 0).
        """
        points = np.asarray(points, dtype=float).reshape(-1, 3)
        self._cell = cell
        rim = int(np.ceil(clearance / cell - 1e-9))
        self._heights = np.full((1, 1), -np.inf)
        self._low = np.zeros(2)
        self._top = -np.inf
        if len(points) == 0:
            return
        cells = np.floor(points[:, :2] / cell).astype(int)
        first = cells.min(axis=0) - rim
        heights = np.full(cells.max(axis=0) - first + rim + 1, -np.inf)
        np.maximum.at(heights, tuple((cells - first).T), points[:, 2])
        self._low = first * cell
        self._heights = maximum_filter(heights, 2 * rim + 1) + clearance
        self._top = float(self._heights.max())

    def comes_near(self, p_WG: np.ndarray) -> bool:
        """Whether a hand at a point (3,) may have anything below the surface; quick to tell."""
        size = np.array(self._heights.shape) * self._cell
        beside = np.maximum(self._low - p_WG[:2], p_WG[:2] - self._low - size)
        return bool(p_WG[2] - _REACH < self._top and beside.max() < _REACH)

    def lowers(self, p_WP: np.ndarray) -> bool:
        """Whether any of the points (N, 3) is below the surface."""
        index = np.floor((p_WP[:, :2] - self._low) / self._cell).astype(int)
        inside = np.all((index >= 0) & (index < self._heights.shape), axis=1)
        x, y = index[inside].T
        return bool(np.any(p_WP[inside, 2] < self._heights[x, y]))

    def cut(self, p_WC: np.ndarray, radius: float) -> "HeightMap":
        """The same map without what is within a radius (m) of a point, seen from above."""
        cut = HeightMap(np.empty((0, 3)), cell=self._cell)
        x, y = (np.arange(n) for n in self._heights.shape)
        centers = [self._low[k] + (i + 0.5) * self._cell for k, i in enumerate((x, y))]
        square = (centers[0][:, None] - p_WC[0]) ** 2 + (centers[1] - p_WC[1]) ** 2
        cut._low, cut._top = self._low, self._top
        cut._heights = np.where(square < radius**2, -np.inf, self._heights)
        return cut


def box_points(obb: Obb, X_FS: RigidTransform) -> np.ndarray:
    """Points (K, 3) in F, at most 2.5 cm apart, on the surface of a box of the shape frame S."""
    half = obb.half_width()
    axes = [np.linspace(-h, h, int(np.ceil(2.0 * h / _SPACING)) + 1) for h in half]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    surface = np.any(np.isclose(np.abs(grid), half), axis=1)
    return (X_FS @ obb.pose()).multiply(grid[surface].T).T


def shape_points(shape: Shape, X_FS: RigidTransform) -> np.ndarray:
    """Points (K, 3) in F on the box around a shape."""
    obb = CalcObb(shape)
    return np.empty((0, 3)) if obb is None else box_points(obb, X_FS)


def body_points(
    diagram: RobotDiagram, bodies: Iterable[BodyIndex]
) -> list[tuple[BodyIndex, np.ndarray]]:
    """For each body with collision geometry, points (K, 3) in its frame on boxes around it."""
    inspector = diagram.scene_graph().model_inspector()
    result = []
    for body in bodies:
        frame = diagram.plant().GetBodyFrameIdOrThrow(body)
        clouds = [
            box_points(obb, inspector.GetPoseInFrame(geometry))
            for geometry in inspector.GetGeometries(frame, Role.kProximity)
            if (obb := inspector.GetObbInGeometryFrame(geometry)) is not None
        ]
        if clouds:
            result.append((body, np.vstack(clouds)))
    return result
