"""What a run of pose-pick reports, held against the simulator's truth."""

import dataclasses as dc
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from prehensile.native.kd_tree import KdTree

POSE_TOLERANCE = 0.005  # m of ADD-S, within which a pose counts as right
POSITION_TOLERANCE = 0.02  # m of the bottle's origin from its goal
UPRIGHT_TOLERANCE = math.radians(5.0)


@dc.dataclass(frozen=True)
class SeenPose:
    """One look, held against the truth.

    Attributes:
        time: simulated seconds.
        what: what was done about it: ``to the goal``, ``check``, ...
        reason: why nothing was believed ("" if it was).
        adds: mean distance of the model's points to those of the true object (ADD-S) [m]; NaN if
            there was no pose.
        see_wall: wall seconds of perception, from the images to the pose.
        plan_wall: wall seconds of planning.
    """

    time: float
    what: str
    reason: str
    adds: float
    see_wall: float
    plan_wall: float


@dc.dataclass(frozen=True)
class PosePickReport:
    """Result of a run; what is said of poses and ends is the simulator's truth.

    Attributes:
        seed: of the scene and of every choice.
        start: how the object was let go: ``upright``, ``leaning`` or ``fallen``.
        X_WStart: where it then lay.
        X_WGoal: where it was to stand.
        X_WEnd: where it ended.
        finished: why the run ended, in words.
        accepted: whether the task's own check accepted the end.
        failures: what went wrong on the way.
        looks: every look.
        phases: (time, state) of the state machine.
        attempts: how often the object was to be moved.
        distance: of the origin from the goal at the end [m].
        tilt: angle to upright at the end [rad].
        yaw: angle about the vertical from the goal, up to half a turn, by which the shape does not
            change [rad].
        at_rest: whether the object was at rest at the end.
        released: whether the hand was clear of it at the end.
        sim_time: simulated seconds.
        wall_time: wall seconds of the simulation with perception and planning.
        interrupted: the user stopped it.
    """

    seed: int
    start: str
    X_WStart: RigidTransform
    X_WGoal: RigidTransform
    X_WEnd: RigidTransform
    finished: str
    accepted: bool
    failures: tuple[str, ...]
    looks: tuple[SeenPose, ...]
    phases: tuple[tuple[float, str], ...]
    attempts: int
    distance: float
    tilt: float
    yaw: float
    at_rest: bool
    released: bool
    sim_time: float
    wall_time: float
    interrupted: bool = False

    @property
    def pose_right(self) -> bool:
        """Whether the first pose that the task acted on was right: ADD-S under 5 mm."""
        first = next(
            (look for look in self.looks if not look.reason and look.what != "check"), None
        )
        return first is not None and first.adds < POSE_TOLERANCE

    @property
    def placed(self) -> bool:
        """Whether it stands within 2 cm of its goal, upright within 5 degrees, at rest, let go."""
        stands = self.distance <= POSITION_TOLERANCE and self.tilt <= UPRIGHT_TOLERANCE
        return stands and self.at_rest and self.released

    def to_json(self) -> dict[str, Any]:
        """The report as plain JSON values, NaN as null."""

        def plain(value: Any) -> Any:
            if isinstance(value, RigidTransform):
                return value.GetAsMatrix4().tolist()
            if isinstance(value, (list, tuple)):
                return [plain(item) for item in value]
            if isinstance(value, SeenPose):
                return {key: plain(item) for key, item in vars(value).items()}
            if isinstance(value, float):
                return value if math.isfinite(value) else None
            return value

        own = {key: plain(value) for key, value in vars(self).items()}
        return {"task": "pose-pick", "placed": self.placed, "pose_right": self.pose_right} | own


def adds(
    points_O: NDArray[np.float64], X_WO: RigidTransform, X_WOEstimated: RigidTransform
) -> float:
    """Mean distance of points (N, 3) of a model to the nearest of the model where it truly is [m].

    The measure ADD-S of Hinterstoisser et al. (ACCV 2012), for which symmetric poses are the same.
    """
    tree = KdTree(X_WO.multiply(points_O.T).T)
    _, distances = tree.nearest(X_WOEstimated.multiply(points_O.T).T)
    return float(distances.mean())
