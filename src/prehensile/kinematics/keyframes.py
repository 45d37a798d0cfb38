"""Keyframes of a hand: the poses that it goes through, what it does there, and their sequence.

    keyframes = [
        Keyframe("initial", X_WGinitial, width=0.1),
        Keyframe("prepick", X_WGprepick),
        Keyframe("pick", X_WGpick, width=0.0, dwell=0.5),
        Keyframe("lift", X_WGprepick, blend=0.05),
        ...
    ]

The whole of that sequence is :func:`pick_and_place_keyframes`;
:mod:`prehensile.kinematics.keyframe_timing` makes a motion of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform

from prehensile.kinematics.trajectories import PoseTrajectory, law_progress


@dataclass(frozen=True)
class Keyframe:
    """A pose to go through.

    Attributes:
        name: what for; also in messages.
        X_WG: pose of the hand.
        width: opening of the hand (m) when it goes on from here. During the dwell it changes to
            this, or without one on the way here. None keeps what was before.
        dwell: how long the hand rests here (s, >= 0).
        blend: how far (m, >= 0) from here the hand may pass without stopping; 0 stops.
    """

    name: str
    X_WG: RigidTransform
    width: float | None = None
    dwell: float = 0.0
    blend: float = 0.0


def pick_and_place_keyframes(
    X_WGinitial: RigidTransform,
    X_WGpick: RigidTransform,
    X_WGplace: RigidTransform,
    *,
    p_GPre: ArrayLike = (0.0, -0.1, 0.0),
    clearance: float = 0.4,
    open_width: float = 0.1,
    closed_width: float = 0.0,
    dwell: float = 0.5,
    blend: float = 0.05,
) -> list[Keyframe]:
    """The keyframes of picking something up here and setting it down there.

    They are initial, prepick, pick, lift, clearance, preplace, place, retreat: down from the
    prepick pose in a straight line and up again, over the table, and the same at the goal (Tedrake,
    *Robotic Manipulation*, section 3.8).

    Args:
        X_WGinitial: where the hand is.
        X_WGpick: the hand at the object.
        X_WGplace: the hand at the object when it is to let go.
        p_GPre: (3,) where the hand waits before the grasp and the release, seen from there, in m;
            the default suits a hand whose y points to its finger tips.
        clearance: least height of the hand's origin in W, in m, half-way from lift to preplace,
            where the orientation is half-way as well.
        open_width, closed_width: openings of the hand, in m.
        dwell: time for the fingers to close or open, in s.
        blend: how far from lift, clearance and preplace the hand may pass, in m; 0 stops there.

    Raises:
        ValueError: p_GPre or clearance is not finite.
    """
    p_GPre = np.asarray(p_GPre, float)
    if p_GPre.shape != (3,) or not np.isfinite(p_GPre).all():
        raise ValueError(f"p_GPre must be three finite numbers, got {p_GPre}")
    if not np.isfinite(clearance):
        raise ValueError(f"clearance must be finite, got {clearance}")
    X_GPre = RigidTransform(p_GPre)
    X_WGprepick, X_WGpreplace = X_WGpick @ X_GPre, X_WGplace @ X_GPre
    poses = [X_WGprepick, X_WGpreplace]
    middle = PoseTrajectory(poses, [law_progress(0.0, 1.0, "linear")]).value(0.5)
    p = middle.translation()
    X_WGclearance = RigidTransform(middle.rotation(), [p[0], p[1], max(p[2], clearance)])
    return [
        Keyframe("initial", X_WGinitial, width=open_width),
        Keyframe("prepick", X_WGprepick),
        Keyframe("pick", X_WGpick, width=closed_width, dwell=dwell),
        Keyframe("lift", X_WGprepick, blend=blend),
        Keyframe("clearance", X_WGclearance, blend=blend),
        Keyframe("preplace", X_WGpreplace, blend=blend),
        Keyframe("place", X_WGplace, width=open_width, dwell=dwell),
        Keyframe("retreat", X_WGpreplace),
    ]


def check_keyframes(keyframes: Sequence[Keyframe]) -> None:
    """Raises ValueError for fewer than two keyframes, or one that is out of range."""
    if len(keyframes) < 2:
        raise ValueError("keyframes: at least two are needed")
    for i, k in enumerate(keyframes):
        if not (0.0 <= k.dwell < np.inf and k.blend >= 0.0):
            raise ValueError(f"keyframes: {k.name}: dwell and blend must not be negative")
        if k.width is not None and not np.isfinite(k.width):
            raise ValueError(f"keyframes: {k.name}: width must be finite")
        if k.blend > 0.0 and (k.dwell > 0.0 or i in (0, len(keyframes) - 1)):
            raise ValueError(f"keyframes: {k.name}: blends where the hand has to rest")
