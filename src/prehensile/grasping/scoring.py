"""How good a grasp candidate is, judged from the cloud alone.

Everything is computed in the frame P midway between the pads, parallel to the hand's frame G: x
is the closing direction, y the approach, z lies across the fingers. The hand comes in along y, so
a finger sweeps the *column* of points that are no further than its tip and within its width.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prehensile.grasping.candidates import Candidates
from prehensile.grasping.collision import boxes_overlap
from prehensile.grasping.grasp import GraspConfig, GraspStatus
from prehensile.grasping.gripper import ParallelGripper
from prehensile.perception.cloud import Box, Cloud

# Width of the cells into which a column is divided along x [m].
_CELL = 0.0025
# An object narrower than this [m] must be seen from both sides: what looks like free space behind
# its one side may be its own inside.
_MIN_UNSEEN_SPAN = 0.03


@dataclass(frozen=True)
class Evaluation:
    """What became of M candidates; rows of rejected ones hold no meaning but for ``status``.

    Attributes:
        status: (M,) GraspStatus: FOUND where the candidate is feasible.
        p_WP: (M, 3) the point midway between the pads, after centring [m].
        width: (M,) opening commands [m].
        span: (M,) extent between the pads of what is there [m].
        score: (M,) the scores.
        terms: the terms that add up to the scores, by name, each (M,).
        contact_axis: (M, 3) in W, the mean of the normals touched by the right pad and of the
            reversed ones touched by the left pad (the closing axis, if the grasp is perfect).
    """

    status: NDArray[np.object_]
    p_WP: NDArray[np.float64]
    width: NDArray[np.float64]
    span: NDArray[np.float64]
    score: NDArray[np.float64]
    terms: dict[str, NDArray[np.float64]]
    contact_axis: NDArray[np.float64]


def evaluate(
    candidates: Candidates,
    cloud: Cloud,
    segments: NDArray[np.int64],
    gripper: ParallelGripper,
    obstacles: Sequence[Box],
    config: GraspConfig,
) -> Evaluation:
    """Centres, opens and scores each candidate, or says why it is none.

    A candidate is feasible if on both sides of its point there is room in the column for a
    finger, within the largest opening; if the contacts are antipodal; and if neither hand nor
    wrist, swept along the approach, touch the cloud or an obstacle. Its score is

        contact quality - tilt - offset - width - mixed

    with the weights of the config. The contact quality is the mean of both sides' own: of the
    points that a pad touches first, the sum of the squared x components of the normals (those
    that face the pad), relative to half of what a fully covered pad would have (at most 1), times
    their mean square. Following Tedrake, Robotic Manipulation, section 5.4.3, with both sides
    judged apart.

    Args:
        candidates: poses between the pads, in W; neighbours in the list should be neighbours in
            space, for speed.
        cloud: the scene in W.
        segments: (N,) labels of its points.
        gripper: the hand.
        obstacles: boxes in W that the hand must not touch (and that need not be in the cloud).
        config: settings.

    Returns:
        The evaluation, row by row.
    """
    M = len(candidates)
    out = Evaluation(
        status=np.full(M, GraspStatus.NO_POINTS, dtype=object),
        p_WP=candidates.p_WP.copy(),
        width=np.zeros(M),
        span=np.zeros(M),
        score=np.full(M, -np.inf),
        terms={name: np.zeros(M) for name in ("contact", "tilt", "offset", "width", "mixed")},
        contact_axis=np.zeros((M, 3)),
    )
    centres = _segment_centres(cloud, segments)
    chunk = 32
    for start in range(0, M, chunk):
        rows = slice(start, min(start + chunk, M))
        _evaluate_columns(candidates, rows, cloud, segments, centres, gripper, config, out)
    alive = np.nonzero(out.status == GraspStatus.FOUND)[0]
    if len(obstacles) > 0 and len(alive) > 0:
        hits = _hits_obstacles(candidates.R_WP, out, alive, gripper, obstacles, config)
        out.status[alive[hits]] = GraspStatus.HITS_OBSTACLES
        alive = alive[~hits]
    for start in range(0, len(alive), chunk):
        rows = alive[start : start + chunk]
        hits = _hand_hits_cloud(candidates.R_WP, out, rows, cloud, gripper, config)
        out.status[rows[hits]] = GraspStatus.HITS_CLOUD
    out.score[out.status != GraspStatus.FOUND] = -np.inf
    return out


def _segment_centres(
    cloud: Cloud, segments: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(L, 3) the mean point of each label 0..L-1."""
    labelled = segments >= 0
    if not labelled.any():
        return np.zeros((0, 3))
    count = np.bincount(segments[labelled])
    sums = [np.bincount(segments[labelled], cloud.points[labelled, k]) for k in range(3)]
    return np.stack(sums, axis=-1) / count[:, None]


def _evaluate_columns(
    candidates: Candidates,
    rows: slice,
    cloud: Cloud,
    segments: NDArray[np.int64],
    centres: NDArray[np.float64],
    gripper: ParallelGripper,
    config: GraspConfig,
    out: Evaluation,
) -> None:
    """Everything that the columns of the fingers tell, for the candidates in ``rows``."""
    R, p = candidates.R_WP[rows], candidates.p_WP[rows]
    m = len(p)
    p_Pad = gripper.p_GPad[1]
    tip, palm = gripper.pad_y[1] - p_Pad, gripper.palm_y[1] - p_Pad
    room = gripper.finger_thickness + 2 * config.clearance
    reach = gripper.max_gap + room
    half_z = 0.5 * gripper.finger_width + config.margin

    middle = p.mean(axis=0)
    radius = np.sqrt(reach**2 + max(-palm, tip) ** 2) + np.linalg.norm(p - middle, axis=1).max()
    near = np.nonzero(np.sum((cloud.points - middle) ** 2, axis=1) < radius**2)[0]
    if len(near) == 0:
        return
    # Coordinates of every near point in every candidate's frame: three (m, n) arrays.
    q = cloud.points[near] - middle
    shift = np.einsum("mik,mi->mk", R, p - middle)
    z = _dot(R[:, :, 2], q) - shift[:, 2:]
    i, n = np.nonzero(np.abs(z) <= half_z)
    y = np.einsum("ki,ki->k", R[i, :, 1], q[n]) - shift[i, 1]
    x = np.einsum("ki,ki->k", R[i, :, 0], q[n]) - shift[i, 0]
    z = z[i, n]
    column = (y <= tip + config.margin) & (y >= palm) & (np.abs(x) <= reach)
    i, n, x, y, z = i[column], n[column], x[column], y[column], z[column]

    # Room for a finger: the first stretch of free cells to the right and to the left of x = 0.
    half_cells = int(np.ceil(reach / _CELL))
    cells = 2 * half_cells + 1
    cell = np.floor(x / _CELL + 0.5).astype(np.int64) + half_cells
    taken = np.zeros((m, cells + 1), dtype=np.int64)
    np.add.at(taken, (i, cell + 1), 1)
    before = np.cumsum(taken, axis=1)  # before[:, b]: points in cells 0..b-1
    need = int(np.ceil(room / _CELL))
    stretch_free = before[:, need:] == before[:, :-need]  # cells b..b+need-1
    right = stretch_free[:, half_cells:]
    left = stretch_free[:, : half_cells - need + 1][:, ::-1]
    has_room = right.any(axis=1) & left.any(axis=1)
    # What is between lies strictly within these edges of cells.
    x_right = (np.argmax(right, axis=1) - 0.5) * _CELL
    x_left = -(np.argmax(left, axis=1) + 0.5) * _CELL

    between = has_room[i] & (x < x_right[i]) & (x > x_left[i])
    i, n, x, y, z = i[between], n[between], x[between], y[between], z[between]
    high = _extreme(np.maximum, i, x, m)
    low = -_extreme(np.maximum, i, -x, m)
    # What the pads will touch: they close evenly, so the hand is centred on that.
    pad_half = 0.5 * (gripper.pad_y[1] - gripper.pad_y[0])
    at_pads = (np.abs(y) <= pad_half) & (np.abs(z) <= 0.5 * gripper.pad_width)
    ip, np_, xp = i[at_pads], n[at_pads], x[at_pads]
    pad_high = _extreme(np.maximum, ip, xp, m)
    pad_low = -_extreme(np.maximum, ip, -xp, m)
    normal_x = np.einsum("ki,ki->k", R[ip, :, 0], cloud.normals[near[np_]])
    toward_right = _extreme(np.maximum, ip, np.where(normal_x > 0, xp, -np.inf), m)
    toward_left = -_extreme(np.maximum, ip, np.where(normal_x < 0, -xp, -np.inf), m)
    # A side that no camera saw is taken to be where the column ends.
    seen_right, seen_left = np.isfinite(toward_right), np.isfinite(toward_left)
    high_touch = np.where(seen_right, pad_high, high)
    low_touch = np.where(seen_left, pad_low, low)
    with np.errstate(invalid="ignore"):
        centre = 0.5 * (high_touch + low_touch)
        half_gap = np.maximum(high - centre, centre - low) + config.clearance
        # The column's neighbours may still be too near for a finger on the wider side.
        slack = np.minimum(x_right - high, low - x_left) + room - config.clearance
        fits = half_gap + gripper.finger_thickness <= np.minimum(
            high - centre, centre - low
        ) + np.maximum(slack, room - config.clearance)
        wide = ~has_room | (2 * half_gap > gripper.max_gap)
        span = high_touch - low_touch

    # Quality of the contact of each side.
    full = 0.5 * gripper.pad_width * 2 * pad_half / config.voxel_size**2
    quality, contact_axis = np.zeros(m), np.zeros((m, 3))
    square_ok = np.ones(m, dtype=bool)
    for sign, edge, seen in ((1.0, pad_high, seen_right), (-1.0, -pad_low, seen_left)):
        touched = sign * xp >= edge[ip] - config.contact_depth
        k = ip[touched]
        facing = np.maximum(sign * normal_x[touched], 0.0) ** 2
        total = np.bincount(k, facing, m)
        mean = total / np.maximum(np.bincount(k, minlength=m), 1)
        quality += 0.5 * np.where(
            seen, np.minimum(total / full, 1.0) * mean, config.unseen_side
        )
        square_ok &= ~seen | (mean >= np.cos(config.max_contact_angle) ** 2)
        for axis in range(3):
            contact_axis[:, axis] += np.bincount(
                k, facing * sign * cloud.normals[near[np_[touched]], axis], m
            )
    both = seen_right & seen_left
    antipodal = square_ok & (both | ((seen_right | seen_left) & (span > _MIN_UNSEEN_SPAN)))

    label = candidates.segment[rows]
    other = segments[near[np_]] != label[ip]
    mixed = np.bincount(ip, other, m) / np.maximum(np.bincount(ip, minlength=m), 1)

    status = np.full(m, GraspStatus.FOUND, dtype=object)
    status[~antipodal] = GraspStatus.NOT_ANTIPODAL
    status[~fits & antipodal] = GraspStatus.HITS_CLOUD
    status[wide] = GraspStatus.TOO_WIDE
    status[~np.isfinite(high)] = np.where(
        has_room[~np.isfinite(high)], GraspStatus.NO_POINTS, GraspStatus.TOO_WIDE
    )
    found = status == GraspStatus.FOUND
    out.status[rows] = status
    with np.errstate(invalid="ignore"):
        out.p_WP[rows] = np.where(found[:, None], p + centre[:, None] * R[:, :, 0], p)
        out.width[rows] = np.where(found, 2 * half_gap - 2 * gripper.pad_offset, 0.0)
        out.width[rows] = np.clip(out.width[rows], 0.0, gripper.max_width)
        out.span[rows] = np.where(found, span, 0.0)
    length = np.linalg.norm(contact_axis, axis=1, keepdims=True)
    out.contact_axis[rows] = np.where(length > 0, contact_axis / np.maximum(length, 1e-12), 0.0)
    offset = np.zeros(m)
    known = label >= 0
    offset[known] = np.linalg.norm(
        (out.p_WP[rows][known] - centres[label[known]])[:, :2], axis=1
    )
    terms = {
        "contact": quality,
        "tilt": -config.weight_tilt * (1.0 + R[:, 2, 1]),
        "offset": -config.weight_offset * offset / 0.1,
        "width": -config.weight_width * out.width[rows] / gripper.max_width,
        "mixed": -config.weight_mixed * mixed,
    }
    for name, term in terms.items():
        out.terms[name][rows] = term
    out.score[rows] = sum(terms.values())


def _dot(axes: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, n) products of every axis (m, 3) with every point (n, 3)."""
    return sum(axes[:, k, None] * q[None, :, k] for k in range(3))


def _extreme(
    ufunc: np.ufunc, index: NDArray[np.int64], values: NDArray[np.float64], m: int
) -> NDArray[np.float64]:
    """(m,) largest of the values of each index; -inf where there is none."""
    result = np.full(m, -np.inf)
    ufunc.at(result, index, values)
    return result


def _hits_obstacles(
    R_WP: NDArray[np.float64],
    out: Evaluation,
    alive: NDArray[np.int64],
    gripper: ParallelGripper,
    obstacles: Sequence[Box],
    config: GraspConfig,
) -> NDArray[np.bool_]:
    """Which of the candidates ``alive`` touch an obstacle on the way in or at the end."""
    R = R_WP[alive]
    p_WG = out.p_WP[alive] - np.einsum("mij,j->mi", R, gripper.p_GPad)
    centres_G, sizes = gripper.boxes(out.width[alive], config.approach)
    centres = p_WG[:, None] + np.einsum("mij,mbj->mbi", R, centres_G)
    hits = np.zeros(len(alive), dtype=bool)
    for X_WB, size in obstacles:
        overlap = boxes_overlap(
            R[:, None],
            centres,
            sizes + 2 * config.obstacle_margin,
            X_WB.rotation().matrix(),
            X_WB.translation(),
            np.asarray(size, dtype=float),
        )
        hits |= overlap.any(axis=1)
    return hits


def _hand_hits_cloud(
    R_WP: NDArray[np.float64],
    out: Evaluation,
    rows: NDArray[np.int64],
    cloud: Cloud,
    gripper: ParallelGripper,
    config: GraspConfig,
) -> NDArray[np.bool_]:
    """Which of the candidates ``rows`` have points in the hand, or above it on its way in."""
    R, p = R_WP[rows], out.p_WP[rows]
    q = cloud.points - p.mean(axis=0)
    shift = np.einsum("mik,mi->mk", R, p - p.mean(axis=0))
    x, y, z = (np.abs(_dot(R[:, :, k], q) - shift[:, k : k + 1]) if k != 1
               else _dot(R[:, :, 1], q) - shift[:, 1:2] for k in range(3))
    y = y + gripper.p_GPad[1]  # now from G's origin
    hits = np.zeros(len(rows), dtype=bool)
    for (size_x, size_z), end in (
        (gripper.palm_size, gripper.palm_y[1]),
        (gripper.wrist_size, gripper.wrist_y[1]),
    ):
        inside = (
            (y <= end + config.margin)
            & (x <= 0.5 * size_x + config.margin)
            & (z <= 0.5 * size_z + config.margin)
        )
        hits |= inside.any(axis=1)
    # The fingers, for points that the columns did not reach.
    inner = 0.5 * out.width[rows] + gripper.pad_offset
    fingers = (
        (y <= gripper.pad_y[1] + config.margin)
        & (z <= 0.5 * gripper.finger_width + config.margin)
        & (x >= inner[:, None])
        & (x <= inner[:, None] + gripper.finger_thickness + config.margin)
    )
    return hits | fingers.any(axis=1)
