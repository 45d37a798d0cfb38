"""Points on meshes, and few points that stand for many."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud
from prehensile.perception.mesh import TriangleMesh

_MOST_SAMPLES = 20_000_000


def sample_mesh_uniform(mesh: TriangleMesh, count: int, *, seed: int) -> PointCloud:
    """Points drawn independently and evenly over a surface, with the triangles' normals.

    Args:
        mesh: of positive area.
        count: how many, at least 0.
        seed: the same seed gives the same points.

    Raises:
        ValueError: naming the argument.
    """
    areas = mesh.areas()
    total = np.cumsum(areas)
    if not 0 < total[-1] < np.inf:
        raise ValueError(f"mesh: its area must be positive and finite, not {total[-1]}")
    if not 0 <= count <= _MOST_SAMPLES:
        raise ValueError(f"count: must be 0 to {_MOST_SAMPLES}, not {count}")
    u = np.random.default_rng(seed).random((3, count))
    # side="right" passes over triangles without area; rounding may pass the last one.
    last = np.flatnonzero(areas)[-1]
    which = np.minimum(np.searchsorted(total, u[0] * total[-1], side="right"), last)
    # Even over a triangle: Turk, "Generating random points in triangles" (1990).
    root = np.sqrt(u[1])
    weights = np.stack([1 - root, root * (1 - u[2]), root * u[2]])
    corners = mesh.vertices[mesh.triangles[which]]
    points = np.einsum("kn,nkj->nj", weights, corners)
    return PointCloud(points, normals=mesh.triangle_normals()[which])


def sample_mesh_poisson_disc(
    mesh: TriangleMesh, *, count: int | None = None, radius: float | None = None, seed: int
) -> PointCloud:
    """Points spread over a surface so that none are close to each other, with normals.

    Given a count, five times as many uniform samples are thinned out by elimination (Yuksel,
    "Sample elimination for generating Poisson disk sample sets", 2015), which keeps neighbours
    some 0.7 of the distance of a perfect hexagonal pattern apart. Given a radius, uniform samples
    are thrown and kept if they are at least that far from all kept before (dart throwing; Cook,
    1986), until hardly a gap is left that could hold another. Distances are straight through space,
    so both sides of a thin sheet share their points' room.

    Args:
        mesh: of positive area.
        count: how many points, at least 1. Give this or `radius`.
        radius: least distance between two points [m].
        seed: the same seed gives the same points.

    Raises:
        ValueError: not exactly one of count and radius, a value out of range, or a radius so small
            that the surface would hold millions of points.
    """
    if (count is None) == (radius is None):
        raise ValueError("count, radius: give one of the two")
    if count is not None:
        if not 1 <= count <= _MOST_SAMPLES // 5:
            raise ValueError(f"count: must be 1 to {_MOST_SAMPLES // 5}, not {count}")
        samples = sample_mesh_uniform(mesh, 5 * count, seed=seed)
        # Discs in a hexagonal pattern, count of them, cover the plane at this distance.
        spacing = np.sqrt(2 * mesh.area() / (np.sqrt(3) * count))
        return samples.select(_core.eliminate_samples(samples.points, count, spacing))
    assert radius is not None
    if not 0 < radius < np.inf:
        raise ValueError(f"radius: must be positive and finite, not {radius}")
    throws = 25 * (mesh.area() / radius / radius) + 25
    if not throws <= _MOST_SAMPLES:
        raise ValueError(f"radius: {radius} is too small for a surface of {mesh.area():.3g} m²")
    samples = sample_mesh_uniform(mesh, int(throws), seed=seed)
    return samples.select(_core.keep_apart(samples.points, radius))


def farthest_point_sampling(points: ArrayLike, count: int, start: int = 0) -> NDArray[np.int32]:
    """Indices of points far from each other: (count,), in the order of choice.

    Each next one is the farthest from all chosen so far, of several the one with the smallest
    index (Eldar et al., "The farthest point strategy for progressive image sampling", 1997). The
    first m of the answer are the answer for m. Takes a time proportional to N · count.

    Args:
        points: (N, 3) in any one frame, finite.
        count: 0 to N.
        start: index of the first one.

    Raises:
        ValueError: naming the argument.
    """
    if count < 0:
        raise ValueError(f"count: must be zero or more, not {count}")
    if start < 0:
        raise ValueError(f"start: must be zero or more, not {start}")
    return _core.farthest_points(points, count, start)[0]
