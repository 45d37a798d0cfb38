"""Motions of a known object: fetch it by a grasp that can also set it down where it is wanted.

Frames: W world, O the object, G the hand.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Convex
from pydrake.math import RigidTransform

from prehensile.grasping import ParallelGripper
from prehensile.grasping.collision import hand_hits_boxes
from prehensile.kinematics.analytic_ik import SrsArm, analytic_ik
from prehensile.perception.cloud import Box
from prehensile.planning.arm import ArmModel
from prehensile.planning.cartesian import plan_cartesian
from prehensile.planning.moves import MoveOptions, free_path, holding, near, plan_move, timed
from prehensile.planning.pick import X_GFlipped, travel_time
from prehensile.planning.trajectory import TimedPath, time_parameterize
from prehensile.tasks.pose_pick_grasps import ModelGrasp

# What is carried turns about its two contacts, the more the harder it is shaken.
_OPTIONS = MoveOptions(carry_speed=0.5, carry_acceleration=0.15, samples=600)
_PREGRASP = 0.09  # m, straight line into the grasp
_LIFT = 0.20  # m, straight up out of the bin
_LOWER = 0.12  # m, straight down to where it is set down
_LOWER_SPEED = 0.12  # share of the joint velocity limits
_RETREAT = 0.10  # m, straight back from what was set down
_SHRINK = 0.003  # m by which what is held is taken smaller near the floor, which it touches
_GROW = 0.012  # m by which it is taken larger on its way: no rim may turn it in the hand
_EXTRA_OPENING = 0.012  # m that the hand opens wider to let go than it was before it closed
_ARM_ANGLES = np.linspace(-np.pi, np.pi, 16, endpoint=False)
_MAX_CONFIGURATIONS = 3  # of one pose that are tried


@dataclass(frozen=True)
class Transfer:
    """All motions from one rest of the object to the next.

    Attributes:
        grasp: by which it is held.
        X_OG: the hand in the object's frame: the grasp's, or that with the fingers exchanged.
        X_WTarget: where the object is set down.
        approach: from the start to the grasp.
        lift: straight up with the object.
        carry: over the place where it is set down.
        lower: straight down to it.
        retreat: straight back, with the hand open.
        home: back to where the arm rests.
        release_width: opening of the hand to let go [m].
    """

    grasp: ModelGrasp
    X_OG: RigidTransform
    X_WTarget: RigidTransform
    approach: TimedPath
    lift: TimedPath
    carry: TimedPath
    lower: TimedPath
    retreat: TimedPath
    home: TimedPath
    release_width: float


@dataclass(frozen=True)
class TransferPlan:
    """A transfer, or the commonest reasons why there is none."""

    transfer: Transfer | None
    reason: str = ""


class TransferPlanner:
    """Plans transfers of one known object by one arm."""

    def __init__(
        self,
        arm: ArmModel,
        grasps: Sequence[ModelGrasp],
        vertices: NDArray[np.float64],
        gripper: ParallelGripper,
        walls: Sequence[Box],
    ) -> None:
        """Makes the planner.

        Args:
            arm: an arm with a closed-form inverse (seven joints), among fixed surroundings.
            grasps: of the object, best first.
            vertices: (V, 3) of the object, in O [m]; their convex hull is kept clear of things.
            gripper: the hand.
            walls: floors and walls of the bins, for a quick check of all grasps at once.

        Raises:
            ValueError: the arm has no inverse in closed form.
        """
        solver = analytic_ik(arm.plant, arm.frame_G)
        if not isinstance(solver, SrsArm):
            raise ValueError("arm: must have seven joints with spherical shoulder and wrist")
        self._arm, self._solver, self._grasps = arm, solver, grasps
        self._gripper, self._walls = gripper, walls
        half = np.abs(vertices).max(axis=0)
        self._whole = Convex(np.ascontiguousarray(vertices.T), "object")
        self._held, self._carried = (
            Convex(np.ascontiguousarray((vertices * ((half + by) / half)).T), "held")
            for by in (-_SHRINK, _GROW)
        )
        # Whether the hand can be at a target, by grasp, flip and target.
        self._at_target: dict[tuple[int, int, bytes], bool] = {}

    def plan(
        self,
        q_start: NDArray[np.float64],
        X_WO: RigidTransform,
        targets: Sequence[RigidTransform],
        rng: np.random.Generator,
        *,
        max_grasps: int = 12,
        min_score: float = -np.inf,
        avoid: Sequence[RigidTransform] = (),
    ) -> TransferPlan:
        """The motions by the best grasp that serves both ends.

        Args:
            q_start: where the arm is (n,).
            X_WO: where the object is.
            targets: where it may be set down, all equally good.
            rng: of all searches.
            max_grasps: grasps for which all motions are planned before giving up.
            min_score: grasps with lower scores are passed over.
            avoid: grasps X_OG that failed before; those like them are passed over.
        """
        rejected: dict[str, int] = {}

        def reject(reason: str) -> None:
            rejected[reason] = rejected.get(reason, 0) + 1

        tried = 0
        outside = self._outside_walls(X_WO)
        served_at = np.array([self._outside_walls(X) for X in targets])
        for index, grasp in enumerate(self._grasps):
            if grasp.score < min_score:
                reject("the grasps left are poor")
                continue
            if any(_alike(grasp.X_OG, X) for X in avoid):
                continue
            if not outside[index]:
                reject("the object is hemmed in")
                continue
            for flip in (0, 1):
                X_OG = grasp.X_OG @ X_GFlipped if flip else grasp.X_OG
                q_grasps = self._free(X_WO @ X_OG, grasp.width, q_start)
                if not q_grasps:
                    reject("the object is out of reach")
                    continue
                served = [
                    X
                    for X, clear in zip(targets, served_at[:, index], strict=True)
                    if clear and self._serves(index, flip, X_OG, X)
                ]
                if not served:
                    reject("the hand cannot be at the target")
                    continue
                transfer, reason = self._connect(grasp, q_start, q_grasps, X_OG, X_WO, served, rng)
                if transfer is not None:
                    return TransferPlan(transfer)
                reject(reason)
                tried += 1
                if tried >= max_grasps:
                    break
            if tried >= max_grasps:
                break
        worst = sorted(rejected.items(), key=lambda item: -item[1])[:3]
        return TransferPlan(None, "; ".join(f"{reason} ({n} grasps)" for reason, n in worst))

    def plan_rest(
        self,
        q_start: NDArray[np.float64],
        transfer: Transfer,
        X_OG: RigidTransform,
        targets: Sequence[RigidTransform],
        rng: np.random.Generator,
    ) -> Transfer | None:
        """The transfer under way, from after the lift on, for another pose in the hand.

        Args:
            q_start: where the arm is (n,).
            transfer: the one under way.
            X_OG: how the hand truly holds the object.
            targets: where it may be set down, all equally good.
            rng: of all searches.

        Returns:
            The same with new motions; None if there are none.
        """
        held = (self._held, X_OG.inverse())
        for X_WTarget in targets:
            placed, _ = self._place(transfer.grasp, q_start, X_OG, X_WTarget, held, rng)
            if placed is not None:
                carry, lower, retreat, home, width = placed
                return replace(
                    transfer,
                    X_WTarget=X_WTarget,
                    carry=carry,
                    lower=lower,
                    retreat=retreat,
                    home=home,
                    release_width=width,
                )
        return None

    def has_grasp(
        self, X_WO: RigidTransform, targets: Sequence[RigidTransform], *, most: int = 40
    ) -> bool:
        """Whether some grasp of the object at a pose can also set it down at a target.

        Args:
            X_WO: where the object would be.
            targets: where it is to go then.
            most: grasps that the arm is asked for before the answer is no.
        """
        outside = self._outside_walls(X_WO)
        served_at = np.array([self._outside_walls(X) for X in targets])
        asked = 0
        for index in map(int, np.nonzero(outside & served_at.any(axis=0))[0]):
            grasp = self._grasps[index]
            for flip in (0, 1):
                X_OG = grasp.X_OG @ X_GFlipped if flip else grasp.X_OG
                if any(
                    clear and self._serves(index, flip, X_OG, X)
                    for X, clear in zip(targets, served_at[:, index], strict=True)
                ):
                    asked += 1
                    if self._free(X_WO @ X_OG, grasp.width, self._arm.q_default):
                        return True
                    if asked >= most:
                        return False
        return False

    def _outside_walls(self, X_WO: RigidTransform) -> NDArray[np.bool_]:
        """For each grasp, whether the hand keeps clear of the bins, with the object at a pose."""
        R_OP = np.array([grasp.X_OG.rotation().matrix() for grasp in self._grasps])
        p_OP = np.array([grasp.X_OG.multiply(self._gripper.p_GPad) for grasp in self._grasps])
        R_WO = np.asarray(X_WO.rotation().matrix(), dtype=float)
        return ~hand_hits_boxes(
            R_WO @ R_OP,
            p_OP @ R_WO.T + X_WO.translation(),
            np.array([grasp.width for grasp in self._grasps]),
            self._gripper,
            self._walls,
            margin=0.0,
            approach=0.5 * _PREGRASP,
        )

    def _configurations(
        self, X_WG: RigidTransform, q_near: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """All configurations (K, n) at a pose, over a grid of arm angles, the nearest first."""
        poses = np.tile(X_WG.GetAsMatrix4(), (len(_ARM_ANGLES), 1, 1))
        q = self._solver.solve_batch(poses, _ARM_ANGLES)[0].reshape(-1, self._solver.num_joints)
        q = q[np.isfinite(q).all(axis=1)]
        return q[np.argsort([travel_time(self._arm, q_near, row) for row in q], kind="stable")]

    def _free(
        self, X_WG: RigidTransform, width: float, q_near: NDArray[np.float64]
    ) -> list[NDArray[np.float64]]:
        """A few free configurations at a pose of the hand, open to a width, far apart."""
        self._arm.set_hand_width(width)
        found: list[NDArray[np.float64]] = []
        with near(self._arm, _OPTIONS):
            for count, q in enumerate(self._configurations(X_WG, q_near)):
                if count >= 24 or len(found) >= _MAX_CONFIGURATIONS:
                    break
                if any(np.max(np.abs(q - other)) < 0.3 for other in found):
                    continue
                if self._arm.is_free(q):
                    found.append(q)
        return found

    def _serves(
        self, index: int, flip: int, X_OG: RigidTransform, X_WTarget: RigidTransform
    ) -> bool:
        """Whether the hand can be at a target with a grasp."""
        key = (index, flip, X_WTarget.GetAsMatrix34().tobytes())
        if key not in self._at_target:
            width = self._release_width(self._grasps[index])
            q = self._free(X_WTarget @ X_OG, width, self._arm.q_default)
            self._at_target[key] = bool(q)
        return self._at_target[key]

    def _release_width(self, grasp: ModelGrasp) -> float:
        return min(grasp.width + _EXTRA_OPENING, self._gripper.max_width)

    def _connect(
        self,
        grasp: ModelGrasp,
        q_start: NDArray[np.float64],
        q_grasps: Sequence[NDArray[np.float64]],
        X_OG: RigidTransform,
        X_WO: RigidTransform,
        targets: Sequence[RigidTransform],
        rng: np.random.Generator,
    ) -> tuple[Transfer | None, str]:
        """All motions by one grasp; or None and the reason."""
        arm, reason = self._arm, ""
        held = (self._held, X_OG.inverse())
        for q_grasp in q_grasps:
            arm.set_hand_width(grasp.width)
            X_WG = arm.pose(q_grasp)
            with near(arm, _OPTIONS):
                back = plan_cartesian(arm, q_grasp, X_WG @ RigidTransform([0, -_PREGRASP, 0]))
            if not back.found:
                reason = "no straight line to the grasp"
                continue
            with holding(arm, held), near(arm, _OPTIONS):
                up = plan_cartesian(arm, q_grasp, RigidTransform([0, 0, _LIFT]) @ X_WG)
            if not up.found:
                reason = "no straight line up"
                continue
            arm.set_obstacles([(self._whole, X_WO)])
            path, _ = free_path(arm, q_start, back.path[-1], rng, _OPTIONS)
            arm.set_obstacles([])
            if path is None:
                reason = "no way to the grasp"
                continue
            approach, _ = timed(
                arm,
                [path, back.path[::-1]],
                [_OPTIONS.speed, _OPTIONS.near_speed],
                None,
                _OPTIONS,
            )
            if approach is None:
                reason = "no way to the grasp"
                continue
            for X_WTarget in targets:
                placed, reason = self._place(grasp, up.path[-1], X_OG, X_WTarget, held, rng)
                if placed is not None:
                    slow = arm.limits.scaled(1.0, _OPTIONS.carry_acceleration)
                    lift = time_parameterize(up.path, slow, speed=0.4)
                    return Transfer(grasp, X_OG, X_WTarget, approach, lift, *placed), ""
        return None, reason

    def _place(
        self,
        grasp: ModelGrasp,
        q_start: NDArray[np.float64],
        X_OG: RigidTransform,
        X_WTarget: RigidTransform,
        held: tuple[Convex, RigidTransform],
        rng: np.random.Generator,
    ) -> tuple[tuple[TimedPath, TimedPath, TimedPath, TimedPath, float] | None, str]:
        """Carry, lower, retreat, home and the opening; or None and the reason."""
        arm, width, reason = (
            self._arm,
            self._release_width(grasp),
            "the hand cannot be at the target",
        )
        slow = arm.limits.scaled(1.0, _OPTIONS.carry_acceleration)
        for q_end in self._free(X_WTarget @ X_OG, width, q_start):
            X_WG = arm.pose(q_end)
            with near(arm, _OPTIONS):
                back = plan_cartesian(arm, q_end, X_WG @ RigidTransform([0, -_RETREAT, 0]))
            if not back.found:
                reason = "no straight line back from the target"
                continue
            with holding(arm, held), near(arm, _OPTIONS):
                down = plan_cartesian(arm, q_end, RigidTransform([0, 0, _LOWER]) @ X_WG)
            if not down.found:
                reason = "no straight line down to the target"
                continue
            carried = (self._carried, held[1])
            carry = plan_move(arm, q_start, down.path[-1], rng=rng, held=carried, options=_OPTIONS)
            if carry.motion is None:
                reason = "no way to the target"
                continue
            arm.set_obstacles([(self._whole, X_WTarget)])
            away, _ = free_path(arm, back.path[-1], arm.q_default, rng, _OPTIONS)
            home = None
            if away is not None:
                home, _ = timed(arm, [away], [_OPTIONS.speed], None, _OPTIONS)
            arm.set_obstacles([])
            if home is None:
                reason = "no way home from the target"
                continue
            lower = time_parameterize(down.path[::-1], slow, speed=_LOWER_SPEED)
            retreat = time_parameterize(back.path, slow, speed=0.3)
            return (carry.motion, lower, retreat, home, width), ""
        return None, reason


def _alike(X_OA: RigidTransform, X_OB: RigidTransform) -> bool:
    """Whether two grasps, fingers exchanged or not, are about the same."""
    if np.linalg.norm(X_OA.translation() - X_OB.translation()) > 0.02:
        return False
    d = np.sum(X_OA.rotation().matrix() * X_OB.rotation().matrix(), axis=0)
    return bool(0.5 * (d[1] + abs(d[0] + d[2]) - 1.0) > np.cos(np.deg2rad(20)))
