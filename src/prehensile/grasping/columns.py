"""Columns: what a finger sweeps on its way in, as points along the closing axis."""

import numpy as np
from numpy.typing import NDArray

# Width of the cells into which a column is divided along x [m].
_CELL = 0.0025


def columns(
    points: NDArray[np.float64],
    R: NDArray[np.float64],
    p: NDArray[np.float64],
    half_xz: tuple[float, float],
    y_range: tuple[float, float],
) -> tuple[
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
]:
    """The points in a box about each of m frames (R, p), which are near one another.

    Returns:
        For every such pair: the frame's index, the point's index, and the point's x, y and z in
        the frame; ordered by frame, then by point.
    """
    middle = p.mean(axis=0)
    half_x, half_z = half_xz
    low, high = y_range
    limit = np.hypot(np.hypot(half_x, half_z), max(-low, high))
    limit += np.linalg.norm(p - middle, axis=1).max()
    q = points - middle
    near = np.nonzero(np.einsum("nk,nk->n", q, q) <= limit**2)[0]
    q = q[near]
    # Frames that differ in their depth alone are one line: its points are looked for once.
    shift = np.einsum("mik,mi->mk", R, p - middle)
    new = np.ones(len(p), dtype=bool)
    new[1:] = np.any(R[1:] != R[:-1], axis=(1, 2))
    new[1:] |= np.any(np.abs(np.diff(shift[:, [0, 2]], axis=0)) > 1e-9, axis=1)
    start = np.nonzero(new)[0]
    count = np.diff(np.append(start, len(p)))
    z = R[start][:, :, 2] @ q.T - shift[start, 2:]
    line, n = np.nonzero(np.abs(z) <= half_z)
    z = z[line, n]
    at, q = start[line], q[n]
    x = np.einsum("ki,ki->k", R[at, :, 0], q) - shift[at, 0]
    y = np.einsum("ki,ki->k", R[at, :, 1], q)  # from the middle
    least, most = (np.array([f(s) for s in np.split(shift[:, 1], start[1:])]) for f in (min, max))
    inside = (np.abs(x) <= half_x) & (y >= low + least[line]) & (y <= high + most[line])
    line, n, x, y, z = line[inside], n[inside], x[inside], y[inside], z[inside]
    # Every point of a line for every frame of it.
    k = np.repeat(np.arange(len(line)), count[line])
    ends = np.cumsum(count[line])
    i = start[line[k]] + np.arange(len(k)) - (ends - count[line])[k]
    y = y[k] - shift[i, 1]
    inside = (y >= low) & (y <= high)
    k, i, y = k[inside], i[inside], y[inside]
    order = np.argsort(i, kind="stable")
    k, i, y = k[order], i[order], y[order]
    return i, near[n[k]], x[k], y, z[k]


def room_beside(
    i: NDArray[np.int64], x: NDArray[np.float64], m: int, room: float, reach: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the first stretches of length ``room`` without points begin, left and right of x = 0.

    Args:
        i: (P,) which column a point is in, 0..m-1.
        x: (P,) its coordinate, at most ``reach`` in absolute value.
        m: number of columns.
        room: length [m].
        reach: how far to look [m].

    Returns:
        (m,) their inner ends left (negative) and right, nan where there is no such stretch.
    """
    half = int(np.ceil(reach / _CELL))
    need = int(np.ceil(room / _CELL))
    taken = np.zeros((m, 2 * half + 2), dtype=np.int64)
    np.add.at(taken, (i, np.floor(x / _CELL + 0.5).astype(np.int64) + half + 1), 1)
    before = np.cumsum(taken, axis=1)  # before[:, b]: points in cells 0 to b-1
    free = before[:, need:] == before[:, :-need]  # whether cells b to b+need-1 are free
    right, left = free[:, half:], free[:, : half - need + 1][:, ::-1]
    x_right = (np.argmax(right, axis=1) - 0.5) * _CELL
    x_left = -(np.argmax(left, axis=1) + 0.5) * _CELL
    return (
        np.where(left.any(axis=1), x_left, np.nan),
        np.where(right.any(axis=1), x_right, np.nan),
    )


def largest(index: NDArray[np.int64], values: NDArray[np.float64], m: int) -> NDArray[np.float64]:
    """(m,) largest of the values of each index; -inf where there is none."""
    result = np.full(m, -np.inf)
    np.maximum.at(result, index, values)
    return result
