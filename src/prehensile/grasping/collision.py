"""Collision between boxes."""

import numpy as np
from numpy.typing import NDArray


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
