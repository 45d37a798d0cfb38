"""Signed distance of bodies that move against each other, from one field for each.

A field of the whole would have to be built again for every configuration. The least of the bodies'
own distances needs nothing but their poses. Outside all bodies it is the distance to their union.
Inside, it has the right sign, but may be smaller in size than the distance to the union's surface
(the nearest surface of a body may lie within another): good for constraints that forbid
penetration, and for points on surfaces. This is how DART tracks (Schmidt, Newcombe and Fox, "DART:
Dense Articulated Real-Time Tracking", RSS 2014).

Of the intersection of bodies, the largest of the distances is likewise exact inside and right in
sign outside, where it bounds the true distance from below.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform

from prehensile.native import _core
from prehensile.perception.distance_field import DistanceField


class ArticulatedSample(NamedTuple):
    """What is known at N points.

    Attributes:
        distances: (N,) to the nearest body [m], negative inside one.
        gradients: (N, 3) of the distances by the point's position, expressed in W.
        bodies: (N,) int32 which body that is; the first of several alike.
    """

    distances: NDArray[np.float64]
    gradients: NDArray[np.float64]
    bodies: NDArray[np.int32]


def articulated_distance(
    fields: Sequence[DistanceField],
    X_WL: Sequence[RigidTransform],
    p_WQ: ArrayLike,
    *,
    num_threads: int = 1,
) -> ArticulatedSample:
    """Distances of points from bodies with given poses.

    The distance's derivative by a body's motion is that by the point's, reversed: a body that moves
    with spatial velocity V_WL = [w; v] at its origin changes the distance of a point Q that is
    nearest to it by -gradient . (v + w x p_LQ_W).

    Args:
        fields: of each body, in its frame L, all signed; at least one.
        X_WL: their poses, as many.
        p_WQ: (N, 3) points Q in W, finite [m].
        num_threads: to share the points; the result is the same.

    Returns:
        Distances, gradients, and which body is nearest.

    Raises:
        ValueError: naming the argument.
    """
    for i, field in enumerate(fields):
        if not field.is_signed:
            raise ValueError(f"fields: number {i} has no signs")
    if len(fields) != len(X_WL):
        raise ValueError(f"X_WL: {len(X_WL)} poses for {len(fields)} fields")
    poses = np.array([X.GetAsMatrix4() for X in X_WL]).reshape(-1, 4, 4)
    cores = [field.core for field in fields]
    return ArticulatedSample(*_core.nearest_body(cores, poses, p_WQ, num_threads))
