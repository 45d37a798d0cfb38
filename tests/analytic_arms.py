"""Arms given as lines, and their forward kinematics, for tests of analytic inverse kinematics."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
x, y, z = np.eye(3)


@dataclass(frozen=True)
class Lines:
    """An arm by its axes and a point on each at q = 0, in W, and the tool's pose at q = 0."""

    axes: Array
    points: Array
    X_WG0: Array

    def make(self, kind: Any, lower: ArrayLike = -np.pi, upper: ArrayLike = np.pi) -> Any:
        limits = [np.full(len(self.axes), limit, dtype=float) for limit in (lower, upper)]
        return kind(self.axes, self.points, self.X_WG0, *limits)

    def poses(self, Q: ArrayLike) -> Array:
        """(N, 4, 4) forward kinematics of (N, n), by Rodrigues' formula."""
        Q = np.atleast_2d(Q)
        X = np.broadcast_to(self.X_WG0, (len(Q), 4, 4)).copy()
        for i in reversed(range(len(self.axes))):
            R = rotation(self.axes[i], Q[:, i])
            X[:, :3, :3] = R @ X[:, :3, :3]
            shifted = (X[:, :3, 3] - self.points[i])[:, :, None]
            X[:, :3, 3] = self.points[i] + (R @ shifted)[:, :, 0]
        return X

    def moved(self, q: ArrayLike, point: ArrayLike, count: int) -> Array:
        """A point that joints 1 to `count` carry."""
        p = np.array(point, dtype=float)
        for i in reversed(range(count)):
            R = rotation(self.axes[i], np.asarray(q, dtype=float)[i : i + 1])[0]
            p = self.points[i] + R @ (p - self.points[i])
        return p

    def turned(self, q: ArrayLike, direction: ArrayLike, count: int) -> Array:
        """A direction that joints 1 to `count` carry."""
        v = np.array(direction, dtype=float)
        for i in reversed(range(count)):
            v = rotation(self.axes[i], np.asarray(q, dtype=float)[i : i + 1])[0] @ v
        return v

    def disguised(self, seed: int) -> "Lines":
        """The same arm with a random base, tool, zero positions, signs, and points on the lines."""
        rng = np.random.default_rng(seed)
        n = len(self.axes)
        zeros = rng.uniform(-3.0, 3.0, n)
        axes = np.array([self.turned(zeros, self.axes[i], i) for i in range(n)])
        points = np.array([self.moved(zeros, self.points[i], i) for i in range(n)])
        axes *= rng.choice([-1.0, 1.0], (n, 1))
        X_WB = random_pose(rng)
        axes = axes @ X_WB[:3, :3].T
        points = points @ X_WB[:3, :3].T + X_WB[:3, 3] + axes * rng.normal(size=(n, 1))
        return Lines(axes, points, random_pose(rng))


def rotation(axis: Array, angles: Array) -> Array:
    """(N, 3, 3) rotations about a unit axis."""
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + s * K + (1 - c) * (K @ K)


def random_pose(rng: np.random.Generator) -> Array:
    Q, R = np.linalg.qr(rng.normal(size=(3, 3)))
    Q *= np.sign(np.diag(R))
    X = np.eye(4)
    X[:3, :3] = Q * np.linalg.det(Q)
    X[:3, 3] = rng.normal(size=3)
    return X


def _lines(axes: list, points: list, p_WG: tuple[float, float, float]) -> Lines:
    X_WG0 = np.eye(4)
    X_WG0[:3, 3] = p_WG
    unit = [np.array(axis) / np.linalg.norm(axis) for axis in axes]
    return Lines(np.array(unit), np.array(points, dtype=float), X_WG0)


_S, _W = (0, 0, 0.34), (0, 0, 1.14)
# The iiwa's proportions, and the same with an elbow beside the line.
SRS = _lines([z, y, z, -y, z, y, z], [_S, _S, _S, (0, 0, 0.75), _W, _W, _W], (0, 0, 1.27))
SRS_BENT = _lines(
    [z, y, (0.2, 0, 1), -y, (0.3, 0, 1), y, (-0.1, 0, 1)],
    [_S, _S, _S, (0.08, 0.1, 0.74), (0, 0, 1.14), _W, _W],
    (0.05, 0, 1.27),
)
UR = _lines(
    [z, y, y, y, -z, y],
    [(0, 0, 0), (0, 0.1, 0.16), (0.425, 0, 0.16), (0.8, 0, 0.16), (0.8, 0.1, 0), (0.8, 0, 0.06)],
    (0.8, 0.2, 0.06),
)
_P = (0.5, 0.15, 0.9)
PUMA = _lines(
    [z, y, -y, x, y, x],
    [(0, 0, 0), (0.1, 0.2, 0.4), (0.1, 0, 0.85), _P, _P, _P],
    (0.6, 0.15, 0.9),
)
# Shoulder, elbow and wrist in one plane: the wrist can be over the shoulder, all ways.
PLANAR = _lines(
    [z, y, y, x, y, x],
    [(0, 0, 0), (0, 0, 0.4), (0.5, 0, 0.4), (1.0, 0, 0.4), (1.0, 0, 0.4), (1.0, 0, 0.4)],
    (1.1, 0, 0.4),
)
MEETING = _lines(
    [z, (0.3, 0.5, 0.2), (0.3, 0.5, 0.8), x, y, x],
    [(0, 0, 0.4), (0, 0, 0.4), (0.1, 0.2, 0.85), _P, _P, _P],
    (0.6, 0.15, 0.9),
)
