"""Collision of the hand with boxes and with points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from prehensile.grasping.gripper import ParallelGripper
from prehensile.perception.cloud import Box


def boxes_overlap(
    R_WA: NDArray[np.float64],
    p_WA: NDArray[np.float64],
    size_A: NDArray[np.float64],
    R_WB: NDArray[np.float64],
    p_WB: NDArray[np.float64],
    size_B: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether two oriented boxes share a point, for arrays of pairs.

    Looks for a separating axis among the fifteen that suffice (Gottschalk, Lin and Manocha,
    "OBBTree", SIGGRAPH 1996). Boxes that merely touch count as overlapping.

    Args:
        R_WA: (..., 3, 3) orientations of the boxes A; columns are their axes in W.
        p_WA: (..., 3) their centres [m].
        size_A: (..., 3) their full sizes [m].
        R_WB: the same of the boxes B; all leading shapes broadcast.
        p_WB: see R_WB.
        size_B: see R_WB.

    Returns:
        (...) a mask.
    """
    a, b = 0.5 * size_A, 0.5 * size_B
    R_AB = np.swapaxes(R_WA, -1, -2) @ R_WB
    t = (np.swapaxes(R_WA, -1, -2) @ (p_WB - p_WA)[..., None])[..., 0]
    # Edges that are parallel but for rounding have no cross product to separate along.
    C = np.abs(R_AB) + 1e-12
    apart = np.any(np.abs(t) > a + (C @ b[..., None])[..., 0], axis=-1)
    t_B = (t[..., None, :] @ R_AB)[..., 0, :]
    apart |= np.any(np.abs(t_B) > (a[..., None, :] @ C)[..., 0, :] + b, axis=-1)
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            reach_A = a[..., i1] * C[..., i2, j] + a[..., i2] * C[..., i1, j]
            reach_B = b[..., j1] * C[..., i, j2] + b[..., j2] * C[..., i, j1]
            distance = t[..., i2] * R_AB[..., i1, j] - t[..., i1] * R_AB[..., i2, j]
            apart |= np.abs(distance) > reach_A + reach_B
    return ~apart


def hand_hits_boxes(
    R_WP: NDArray[np.float64],
    p_WP: NDArray[np.float64],
    width: NDArray[np.float64],
    gripper: ParallelGripper,
    obstacles: Sequence[Box],
    *,
    margin: float,
    approach: float,
) -> NDArray[np.bool_]:
    """Whether the hand touches any of the boxes at the end of its approach or on the way.

    Args:
        R_WP: (M, 3, 3) orientations of the hand.
        p_WP: (M, 3) the points midway between the pads, in W [m].
        width: (M,) opening commands [m].
        gripper: the hand.
        obstacles: boxes in W.
        margin: distance that the hand keeps from them [m].
        approach: length of the straight approach along y of the hand [m].

    Returns:
        (M,) a mask.
    """
    p_WG = p_WP - R_WP @ gripper.p_GPad
    centres_G, sizes = gripper.boxes(width, approach)
    centres = p_WG[:, None] + np.einsum("mij,mbj->mbi", R_WP, centres_G)
    hits = np.zeros(len(p_WP), dtype=bool)
    for X_WB, size in obstacles:
        overlap = boxes_overlap(
            R_WP[:, None],
            centres,
            sizes + 2 * margin,
            np.asarray(X_WB.rotation().matrix(), dtype=float),
            np.asarray(X_WB.translation(), dtype=float),
            np.asarray(size, dtype=float),
        )
        hits |= overlap.any(axis=1)
    return hits


def hand_hits_points(
    R_WP: NDArray[np.float64],
    p_WP: NDArray[np.float64],
    width: NDArray[np.float64],
    gripper: ParallelGripper,
    points: NDArray[np.float64],
    *,
    margin: float,
) -> NDArray[np.bool_]:
    """Whether there are points in the hand, or behind it, where it comes from.

    Args:
        R_WP: (M, 3, 3) orientations of the hand.
        p_WP: (M, 3) the points midway between the pads, in W [m]; near one another.
        width: (M,) opening commands [m].
        gripper: the hand; only what lies behind its pads is looked at, not the first box of each
            finger, which scoring does.
        points: (N, 3) in W [m].
        margin: distance that the hand keeps from them [m].

    Returns:
        (M,) a mask.
    """
    # Most points are below all those parts, if the hand points down.
    parts = gripper.finger[1:] + gripper.body
    behind = gripper.p_GPad[1] - max(part.y[1] for part in parts) - margin
    reach = max(part.x[1] for part in parts) + 0.5 * gripper.max_width + margin
    across = 0.5 * max(part.width for part in parts) + margin
    lowest = (
        p_WP[:, 2]
        - behind * R_WP[:, 2, 1]
        - reach * np.abs(R_WP[:, 2, 0])
        - across * np.abs(R_WP[:, 2, 2])
    )
    middle = p_WP.mean(axis=0)
    q = (points[points[:, 2] >= lowest.min()] - middle).astype(np.float32)
    shift = np.einsum("mik,mi->km", R_WP, p_WP - middle).astype(np.float32)
    x, y, z = (R_WP[:, :, k].astype(np.float32) @ q.T - shift[k, :, None] for k in range(3))
    y += np.float32(gripper.p_GPad[1])  # from G's origin
    x, z = np.abs(x), np.abs(z)
    hits = np.zeros(len(p_WP), dtype=bool)
    opening = 0.5 * width[:, None].astype(np.float32)
    for some, shift_x in ((gripper.finger[1:], opening), (gripper.body, 0 * opening)):
        for part in some:
            inside = (
                (y <= part.y[1] + margin)
                & (z <= 0.5 * part.width + margin)
                & (x - shift_x >= part.x[0] - margin)
                & (x - shift_x <= part.x[1] + margin)
            )
            hits |= inside.any(axis=1)
    return hits
