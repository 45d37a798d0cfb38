"""The number that most of several measurements agree with, found exactly by sorting."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.native import _core


@dataclass(frozen=True, eq=False)
class Vote:
    """The outcome of a vote.

    Attributes:
        estimate: weighted mean of the values that agree.
        inliers: (N,) bool, which do.
        cost: sum of ((estimate - value) / bound)^2 over those, plus the number of the others.
    """

    estimate: float
    inliers: NDArray[np.bool_]
    cost: float


def vote(values: ArrayLike, bounds: ArrayLike, *, most_inliers: bool = False) -> Vote:
    """Truncated least squares of one unknown: the global minimum, in O(N log N).

    Minimizes the sum of min(((x - value_i) / bound_i)^2, 1). The set of intervals
    value_i +- bound_i that hold x changes at their ends only, and within one set the best x is the
    weighted mean (adaptive voting: Yang, Shi and Carlone, "TEASER", IEEE T-RO 37(2), 2021,
    section V).

    Args:
        values: (N,) measurements, N >= 1, in any one unit.
        bounds: (N,) or one number for all: greatest error of a right measurement, > 0.
        most_inliers: instead, find the largest set whose intervals share a point, and of the
            equally large ones the one of least squares (consensus maximization).

    Returns:
        Estimate and inliers.

    Raises:
        ValueError: if there is no value, or a number is not finite or out of range.
    """
    array, errors = np.asarray(values, float), np.asarray(bounds, float)
    if errors.shape not in ((), array.shape):
        raise ValueError(f"bounds: expected one or {array.shape}, not {errors.shape}")
    errors = np.broadcast_to(errors, array.shape)
    return _vote(_core.vote(array, errors, most_inliers), "bounds")


def vote_for_scale(model_points: ArrayLike, scene_points: ArrayLike, noise_bound: float) -> Vote:
    """The scale s of scene = s R model + p from correspondences, before the rest is known.

    A vote among the ratios |b_i - b_j| / |a_i - a_j|, each right to within
    2 noise_bound / |a_i - a_j|; of more than half a million pairs an even part of that size.

    Args:
        model_points: (N, 3) in O [m], N >= 2.
        scene_points: (N, 3), the partner of each in W [m].
        noise_bound: greatest error of a right scene point [m], > 0.

    Returns:
        The scale; the inliers are pairs of correspondences, in the order of the search.

    Raises:
        ValueError: if shapes disagree, a number is not finite or out of range, or all model points
            lie within the noise of each other.
    """
    return _vote(_core.vote_for_scale(model_points, scene_points, noise_bound), "noise_bound")


def _vote(native: tuple[float, NDArray[np.uint8], float], bounds: str) -> Vote:
    estimate, inliers, cost = native
    if not np.isfinite(estimate):
        raise ValueError(f"{bounds}: so small or large that weights are not finite")
    return Vote(estimate, inliers.view(bool), cost)
