"""Splitting a cloud into objects without knowing them."""

import numpy as np
from numpy.typing import NDArray

from prehensile.perception.cloud import PointCloud


def convex_segments(
    cloud: PointCloud,
    voxel_size: float,
    *,
    max_concavity: float = np.deg2rad(10.0),
    max_step: float = 0.6,
    min_points: int = 12,
) -> NDArray[np.int64]:
    """Labels pieces of the cloud that are connected without a concave edge or a step.

    Household objects are mostly convex and meet their neighbours in concave edges, so points in
    adjacent voxels belong together if the surface between them is flat or convex (Stein,
    Schoeler, Papon and Woergoetter, "Object Partitioning using Local Convexity", CVPR 2014).
    Voxels on the edge itself average both sides and would bridge it; so pieces are first grown
    without any point that has a concave edge or a step beside it, and such points then join the
    piece next to them.

    Args:
        cloud: one point per voxel, as :func:`prehensile.perception.fuse_depth_images` gives.
        voxel_size: edge of those voxels [m].
        max_concavity: two adjacent points are apart if their normals turn toward each other by
            more than this within a voxel's length [rad].
        max_step: two adjacent points with like normals are apart if they lie further from each
            other along the normal than this [voxels].
        min_points: smaller pieces are labelled -1.

    Returns:
        (N,) labels 0, 1, ... by decreasing number of points; -1 for points of no piece.
    """
    n = len(cloud)
    if n == 0:
        return np.zeros(0, dtype=np.int64)
    i, j = _adjacent_pairs(cloud.points, voxel_size)
    d = cloud.points[j] - cloud.points[i]
    n_i, n_j = cloud.require_normals()[i], cloud.require_normals()[j]
    turn = n_j - n_i
    angle = 2 * np.arcsin(np.minimum(0.5 * np.linalg.norm(turn, axis=1), 1.0))
    # Convex: going from i to j the normal leans forward, so turn . d >= 0. Points of adjacent
    # voxels can be very near each other; then direction means little.
    length = np.maximum(np.linalg.norm(d, axis=1), 0.5 * voxel_size)
    concave = np.sum(turn * d, axis=1) < -2 * np.sin(0.5 * max_concavity) * length
    height = np.abs(np.sum((n_i + n_j) * d, axis=1)) / 2
    step = (height > max_step * voxel_size) & (angle < np.deg2rad(70))
    opposite = angle > np.deg2rad(145)  # the two faces of a sheet

    edge = np.zeros(n, dtype=bool)
    edge[i[concave | step]] = True
    edge[j[concave | step]] = True
    joined = ~(concave | step | opposite)
    smooth = joined & ~edge[i] & ~edge[j]
    root = _components(n, i[smooth], j[smooth])
    _, inverse, count = np.unique(root, return_inverse=True, return_counts=True)
    order = np.argsort(-count, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    rank[count < min_points] = -1
    labels = rank[inverse]
    i, j = np.concatenate([i[joined], j[joined]]), np.concatenate([j[joined], i[joined]])
    for _ in range(2):  # an edge is two voxels wide
        take = (labels[i] < 0) & (labels[j] >= 0)
        labels[i[take]] = labels[j[take]]
    return labels


def resting_pairs(
    cloud: PointCloud, labels: NDArray[np.int64], voxel_size: float
) -> NDArray[np.int64]:
    """How much of each segment is seen to lie under each other one.

    Where something stands or leans on a surface, a patch that faces upward meets one that does
    not, in a concave edge.

    Args:
        cloud: one point per voxel.
        labels: (N,) segments 0..L-1 of its points, -1 for none.
        voxel_size: edge of the voxels [m].

    Returns:
        (L, L) matrix; entry [a, b] counts the adjacent points that show b resting on a.
    """
    count = labels.max(initial=-1) + 1
    result = np.zeros((count, count), dtype=np.int64)
    if count == 0:
        return result
    i, j = _adjacent_pairs(cloud.points, voxel_size)
    i, j = np.concatenate([i, j]), np.concatenate([j, i])
    up = cloud.require_normals()[:, 2]
    on = (
        (labels[i] != labels[j])
        & (labels[i] >= 0)
        & (labels[j] >= 0)
        & (up[i] > 0.5)
        & (up[j] < 0.5)
        & (cloud.points[j, 2] >= cloud.points[i, 2])
    )
    np.add.at(result, (labels[i[on]], labels[j[on]]), 1)
    return result


def _adjacent_pairs(
    points: NDArray[np.float64], voxel_size: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of points in voxels that share a face, an edge or a corner, each pair once."""
    cell = np.floor(points / voxel_size).astype(np.int64)
    cell -= cell.min(axis=0) - 1
    extent = cell.max(axis=0) + 2
    key = (cell[:, 0] * extent[1] + cell[:, 1]) * extent[2] + cell[:, 2]
    order = np.argsort(key, kind="stable")
    sorted_key = key[order]
    first, second = [], []
    for dx, dy, dz in np.ndindex(3, 3, 3):
        shift = ((dx - 1) * extent[1] + (dy - 1)) * extent[2] + (dz - 1)
        if shift <= 0:
            continue
        at = np.minimum(np.searchsorted(sorted_key, key + shift), len(points) - 1)
        hit = np.nonzero(sorted_key[at] == key + shift)[0]
        first.append(hit)
        second.append(order[at[hit]])
    return np.concatenate(first), np.concatenate(second)


def _components(n: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.int64]:
    """Connected components of the graph of n nodes with edges (i, j): the least node of each.

    Every node hangs on a smaller one; each round hooks the roots of an edge's ends together and
    then shortens all chains (Shiloach and Vishkin, 1982).
    """
    parent = np.arange(n)
    while True:
        root_i, root_j = parent[i], parent[j]
        differ = root_i != root_j
        if not differ.any():
            return parent
        i, j = i[differ], j[differ]
        low = np.minimum(root_i[differ], root_j[differ])
        high = np.maximum(root_i[differ], root_j[differ])
        np.minimum.at(parent, high, low)
        while True:
            grand = parent[parent]
            if np.array_equal(grand, parent):
                break
            parent = grand
