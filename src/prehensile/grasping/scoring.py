"""How good a grasp candidate is, judged from the cloud alone.

Everything is computed in the frame P midway between the pads, parallel to the hand's frame G: x
is the closing direction, y the approach, z lies across the fingers. The hand comes in along y, so
a finger sweeps the *column* of points that are no further than its tip and within its width.
"""

import dataclasses as dc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prehensile.grasping.candidates import Candidates
from prehensile.grasping.collision import hand_hits_boxes, hand_hits_points
from prehensile.grasping.columns import columns, largest, room_beside
from prehensile.grasping.grasp import GraspConfig, GraspStatus
from prehensile.grasping.gripper import ParallelGripper
from prehensile.perception.cloud import Box, PointCloud
from prehensile.perception.segmentation import resting_pairs

# An object narrower than this [m] must be seen from both sides: what looks like free space behind
# its one side may be its own inside.
_MIN_UNSEEN_SPAN = 0.03
# A normal with this component toward the palm belongs to a surface that no pad can press on.
_FACES_PALM = 0.85
# So many pairs of adjacent points that show something resting on the object are plenty.
_FULL_BURDEN = 15


TERMS = ("contact", "tilt", "offset", "opening", "mixed", "tight", "burden")
"""Names of the terms that add up to a score."""


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

    def select(self, index: NDArray[np.int64]) -> "Evaluation":
        """The rows chosen by indices."""
        return self._map(lambda name, value: value[index])

    def replaced(self, where: NDArray[np.bool_], other: "Evaluation") -> "Evaluation":
        """This evaluation with the rows ``where`` (M,) taken from another of the same length."""

        def choose(name: str, value: NDArray[Any]) -> NDArray[Any]:
            new = other.terms[name] if name in other.terms else getattr(other, name)
            return np.where(where[:, None] if value.ndim == 2 else where, new, value)

        return self._map(choose)

    def _map(self, f: Callable[[str, NDArray[Any]], NDArray[Any]]) -> "Evaluation":
        """f(name, array) of every array."""
        arrays = {x.name: getattr(self, x.name) for x in dc.fields(self) if x.name != "terms"}
        return Evaluation(
            **{name: f(name, value) for name, value in arrays.items()},
            terms={name: f(name, value) for name, value in self.terms.items()},
        )


def evaluate(
    candidates: Candidates,
    cloud: PointCloud,
    segments: NDArray[np.int64],
    gripper: ParallelGripper,
    obstacles: Sequence[Box],
    config: GraspConfig,
) -> Evaluation:
    """Centres, opens and scores each candidate, or says why it is none.

    A candidate is feasible if on both sides of its point there is room in the column for a
    finger, within the largest opening; if the contacts are antipodal; and if neither hand nor
    wrist, swept along the approach, touch the cloud or an obstacle. Its score is

        contact quality - tilt - offset - opening - mixed - tight - burden

    with the weights of the config. The contact quality is the mean of both sides' own: of the
    points that a pad touches first, the sum of the squared x components of the normals (those
    that face the pad), relative to half of what a fully covered pad would have (at most 1), times
    their mean square. Following Tedrake, Robotic Manipulation, section 5.4.3, with both sides
    judged apart.

    Args:
        candidates: poses between the pads, in W.
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
        status=np.full(M, GraspStatus.FOUND, dtype=object),
        p_WP=candidates.p_WP.copy(),
        width=np.zeros(M),
        span=np.zeros(M),
        score=np.full(M, -np.inf),
        terms={name: np.zeros(M) for name in TERMS},
        contact_axis=np.zeros((M, 3)),
    )
    centres = _segment_centres(cloud, segments)
    resting = resting_pairs(cloud, segments, config.voxel_size).sum(axis=1)
    burdens = np.minimum(resting / _FULL_BURDEN, 1.0)
    for rows in _places(candidates.seed):
        _evaluate_columns(candidates, rows, cloud, segments, centres, burdens, gripper, config, out)
    alive = np.nonzero(out.status == GraspStatus.FOUND)[0]
    if len(obstacles) > 0 and len(alive) > 0:
        hits = hand_hits_boxes(
            candidates.R_WP[alive],
            out.p_WP[alive],
            out.width[alive],
            gripper,
            obstacles,
            margin=config.obstacle_margin,
            approach=config.approach,
        )
        out.status[alive[hits]] = GraspStatus.HITS_OBSTACLES
        alive = alive[~hits]
    for rows in _places(candidates.seed, alive):
        hits = hand_hits_points(
            candidates.R_WP[rows],
            out.p_WP[rows],
            out.width[rows],
            gripper,
            cloud.points,
            margin=config.margin,
        )
        out.status[rows[hits]] = GraspStatus.HITS_CLOUD
    out.score[out.status != GraspStatus.FOUND] = -np.inf
    return out


def _places(
    seed: NDArray[np.int64], rows: NDArray[np.int64] | None = None
) -> list[NDArray[np.int64]]:
    """The rows (by default all), divided into those of one seed, which lie near each other."""
    rows = np.arange(len(seed)) if rows is None else rows
    return np.split(rows, np.nonzero(np.diff(seed[rows]))[0] + 1) if len(rows) else []


def _segment_centres(cloud: PointCloud, segments: NDArray[np.int64]) -> NDArray[np.float64]:
    """(L, 3) the mean point of each label 0..L-1."""
    labelled = segments >= 0
    if not labelled.any():
        return np.zeros((0, 3))
    count = np.bincount(segments[labelled])
    sums = [np.bincount(segments[labelled], cloud.points[labelled, k]) for k in range(3)]
    return np.stack(sums, axis=-1) / count[:, None]


def _evaluate_columns(
    candidates: Candidates,
    rows: NDArray[np.int64],
    cloud: PointCloud,
    segments: NDArray[np.int64],
    centres: NDArray[np.float64],
    burdens: NDArray[np.float64],
    gripper: ParallelGripper,
    config: GraspConfig,
    out: Evaluation,
) -> None:
    """Everything that the columns of the fingers tell about the candidates ``rows``."""
    R, p = candidates.R_WP[rows], candidates.p_WP[rows]
    m = len(rows)
    tip = gripper.pad_y[1] - gripper.p_GPad[1]
    base = gripper.finger[0].y[0] - gripper.p_GPad[1]
    room = gripper.finger_thickness + 2 * config.min_clearance
    reach = gripper.max_gap + room
    half_z = 0.5 * gripper.finger[0].width + config.margin
    i, n, x, y, z = columns(cloud.points, R, p, (reach, half_z), (base, tip + config.margin))

    x_left, x_right = room_beside(i, x, m, room, reach)
    between = (x > x_left[i]) & (x < x_right[i])
    low = -largest(i[between], -x[between], m)
    high = largest(i[between], x[between], m)
    wide = ~np.isfinite(x_left) | ~np.isfinite(x_right) | ~np.isfinite(low)

    # What a pad can touch: neither surfaces that face the palm, nor, on its side of the object,
    # ones that face away from it, such as the inside of a mug's wall.
    pad_half = 0.5 * (gripper.pad_y[1] - gripper.pad_y[0])
    at_pads = between & (np.abs(y) <= pad_half) & (np.abs(z) <= 0.5 * gripper.pad_width)
    k, n_pad, x_pad = i[at_pads], n[at_pads], x[at_pads]
    normals = cloud.require_normals()[n_pad]
    normal_x = np.sum(R[k, :, 0] * normals, axis=1)
    beside = np.sum(R[k, :, 1] * normals, axis=1) > -_FACES_PALM
    with np.errstate(invalid="ignore"):
        middle = 0.5 * (low + high)
    # The pads close evenly, so the hand is centred on what they will touch. A side that no camera
    # saw is taken to be where the column ends, if it ends above the middle of the pads, and does
    # not merely sink below their reach.
    touch, seen, side, ends = {}, {}, {}, np.ones(m, dtype=bool)
    for sign, end in ((-1, -low), (1, high)):
        side[sign] = beside & (sign * normal_x > -0.5) & (sign * (x_pad - middle[k]) > 0)
        reached = largest(k[side[sign]], sign * x_pad[side[sign]], m)
        seen[sign] = np.isfinite(reached)
        touch[sign] = np.where(seen[sign], reached, end)
        at_end = between & (sign * x >= end[i] - config.contact_depth)
        ends &= seen[sign] | (largest(i[at_end], -y[at_end], m) >= 0.0)
    with np.errstate(invalid="ignore"):
        centre = 0.5 * (touch[1] - touch[-1])
        span = touch[1] + touch[-1]
        extent = np.maximum(high - centre, centre - low)

    # Open as far as wished, or else as far as must be.
    outward = np.abs(x - centre[i])

    def blocked(half_gap: NDArray[np.float64]) -> NDArray[np.bool_]:
        into = outward - half_gap[i]
        inside = (into >= 0) & (into <= gripper.finger_thickness + config.min_clearance)
        return (np.bincount(i[inside], minlength=m) > 0) | ~(half_gap <= 0.5 * gripper.max_gap)

    half_gap = extent + config.clearance
    tight = blocked(half_gap)
    half_gap = np.where(tight, extent + config.min_clearance, half_gap)
    wide |= ~(half_gap <= 0.5 * gripper.max_gap)
    hits = blocked(half_gap)

    full = 0.5 * gripper.pad_width * 2 * pad_half / config.voxel_size**2
    quality, square, contact_axis = np.zeros(m), np.ones(m, dtype=bool), np.zeros((m, 3))
    for sign in (-1, 1):
        first = side[sign] & (sign * x_pad >= touch[sign][k] - config.contact_depth)
        facing = np.maximum(sign * normal_x[first], 0.0) ** 2
        total = np.bincount(k[first], facing, m)
        mean = total / np.maximum(np.bincount(k[first], minlength=m), 1)
        seen_quality = np.minimum(total / full, 1.0) * mean
        quality += 0.5 * np.where(seen[sign], seen_quality, config.unseen_side)
        square &= ~seen[sign] | (mean >= np.cos(config.max_contact_angle) ** 2)
        for axis in range(3):
            contact_axis[:, axis] += np.bincount(k[first], facing * sign * normals[first, axis], m)
    length = np.linalg.norm(contact_axis, axis=1, keepdims=True)
    out.contact_axis[rows] = contact_axis / np.maximum(length, 1e-12)
    both, one = seen[-1] & seen[1], seen[-1] | seen[1]
    antipodal = square & ends & (both | (one & (span > _MIN_UNSEEN_SPAN)))

    # Later lines take precedence.
    status = np.full(m, GraspStatus.FOUND, dtype=object)
    status[hits] = GraspStatus.HITS_CLOUD
    status[~antipodal] = GraspStatus.NOT_ANTIPODAL
    status[wide] = GraspStatus.TOO_WIDE
    out.status[rows] = status
    out.p_WP[rows] = p + np.where(wide, 0.0, centre)[:, None] * R[:, :, 0]
    out.span[rows] = np.where(wide, 0.0, span)
    out.width[rows] = np.where(wide, 0.0, 2 * (half_gap - gripper.pad_offset))

    label = candidates.segment[rows]
    other = np.bincount(k, segments[n_pad] != label[k], m)
    arm, burden = np.zeros(m), np.zeros(m)
    known = label >= 0
    arm[known] = np.linalg.norm((out.p_WP[rows[known]] - centres[label[known]])[:, :2], axis=1)
    burden[known] = burdens[label[known]]
    terms = {
        "contact": quality,
        "tilt": -config.weight_tilt * (1.0 + R[:, 2, 1]),
        "offset": -config.weight_offset * arm / 0.1,
        "opening": -config.weight_opening * out.width[rows] / gripper.max_width,
        "mixed": -config.weight_mixed * other / np.maximum(np.bincount(k, minlength=m), 1),
        "tight": -config.weight_tight * tight,
        "burden": -config.weight_burden * burden,
    }
    for name, term in terms.items():
        out.terms[name][rows] = term
    out.score[rows] = sum(terms.values())
