"""What a planner knows of an arm: kinematics, joint limits, and what may collide with what."""

from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise

import numpy as np
from pydrake.common import Parallelism
from pydrake.geometry import Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, JacobianWrtVariable
from pydrake.planning import (
    LinearDistanceAndInterpolationProvider,
    RobotDiagram,
    SceneGraphCollisionChecker,
)

from prehensile.errors import InputError
from prehensile.kinematics.analytic_ik import analytic_ik
from prehensile.kinematics.joint_limits import JointLimits
from prehensile.native.analytic_ik import PieperArm, SrsArm, UrArm
from prehensile.planning.obstacles import HeightMap, body_points, shape_points


class ArmModel:
    """An arm with a hand among the fixed things around it, for planning.

    Free objects are not part of it: what the cameras see is added with :meth:`set_heights`, and
    a grasped object with :meth:`attach`. Configurations q are those of the arm's joints alone,
    (n,); the hand stands at the width of :meth:`set_hand_width`.

    Distances along joint paths are weighted by each joint's lever arm, so that they are in
    metres and bound the motion of any point of the arm from above up to a factor sqrt(n).

    Attributes:
        plant: the finalized plant of arm, hand and surroundings.
        limits: the joint limits of the arm.
        checker: Drake's collision checker over the same diagram.
    """

    def __init__(
        self,
        diagram: RobotDiagram,
        *,
        arm: str = "iiwa",
        hand: str = "wsg",
        gripper_frame: str = "body",
        padding: float = 0.005,
        edge_step: float = 0.015,
        acceleration: Sequence[float] | None = None,
    ) -> None:
        """Builds the model.

        Args:
            diagram: arm, hand, table, bins ... but no free objects; the model owns it from here.
            arm: name of the arm's model instance.
            hand: name of the hand's model instance.
            gripper_frame: the frame G of the hand that plans are made for: y points from the
                palm to the finger tips, x is the closing direction.
            padding: clearance kept between the robot and its surroundings (m).
            edge_step: weighted distance between two checked configurations of an edge (m).
            acceleration: acceleration limits of the arm (n,). Without it the model file's are
                used, and where it has none, five times the velocity limit per second.

        Raises:
            InputError: if arm, hand or frame do not exist or the arm has no joints.
        """
        plant = diagram.plant()
        for name in (arm, hand):
            if not plant.HasModelInstanceNamed(name):
                raise InputError(f"the plant has no model named {name!r}")
        arm_instance = plant.GetModelInstanceByName(arm)
        hand_instance = plant.GetModelInstanceByName(hand)
        if plant.num_positions(arm_instance) == 0:
            raise InputError(f"model {arm!r} has no joints to plan for")
        if not plant.HasFrameNamed(gripper_frame, hand_instance):
            raise InputError(f"model {hand!r} has no frame {gripper_frame!r}")

        joints = [plant.get_joint(j) for j in plant.GetJointIndices(arm_instance)]
        joints = [joint for joint in joints if joint.num_positions() == 1]
        self._index = np.array([joint.position_start() for joint in joints])
        self.joint_names = [joint.name() for joint in joints]
        self.limits = _joint_limits(plant, self._index, acceleration)
        hand_joints = [plant.get_joint(j) for j in plant.GetJointIndices(hand_instance)]
        self._fingers = [joint for joint in hand_joints if joint.num_positions() == 1]
        self._hand_bodies = plant.GetBodyIndices(hand_instance)

        wrist = joints[max(0, len(joints) - 2)]
        self._points = body_points(diagram, plant.GetBodiesKinematicallyAffectedBy([wrist.index()]))
        weights = np.full(plant.num_positions(), 1.0)
        weights[self._index] = _lever_arms(plant, self._index, arm_instance, hand_instance)
        self.checker = SceneGraphCollisionChecker(
            model=diagram,
            robot_model_instances=[arm_instance, hand_instance],
            edge_step_size=edge_step,
            env_collision_padding=padding,
            distance_and_interpolation_provider=LinearDistanceAndInterpolationProvider(
                plant, weights
            ),
            implicit_context_parallelism=Parallelism(1),
        )
        self.plant = self.checker.plant()
        for i, a in enumerate(self._hand_bodies):
            for b in self._hand_bodies[i + 1 :]:
                self.checker.SetCollisionFilteredBetween(a, b, True)
        self.weights = weights[self._index]
        self.frame_G: Frame = self.plant.GetFrameByName(gripper_frame, hand_instance)
        self._closed_form: SrsArm | UrArm | PieperArm | None = None
        with suppress(ValueError):  # An arm of another kind has no inverse in closed form.
            self._closed_form = analytic_ik(self.plant, self.frame_G)
        self._context = self.plant.CreateDefaultContext()
        self._q = self.plant.GetPositions(self._context)
        self._padding = padding
        self._held_points: np.ndarray | None = None
        self._heights: HeightMap | None = None
        self.set_hand_width(np.inf)

    def why_unreachable(self, X_WG: RigidTransform) -> str:
        """Why no configuration brings the gripper frame to a pose, surroundings left aside.

        Returns:
            "too far", "too near" or "joint limits"; "" if there is such a configuration, or if
            inverse kinematics of this arm has no closed form and nobody knows.
        """
        arm = self._closed_form
        if arm is None:
            return ""
        solutions = arm.widest_interval(X_WG) if isinstance(arm, SrsArm) else arm.solve(X_WG)
        return {"solved": "", "limits": "joint limits"}.get(solutions.status, solutions.status)

    @property
    def num_joints(self) -> int:
        """Number n of joints of the arm."""
        return len(self._index)

    @property
    def q_default(self) -> np.ndarray:
        """The default positions of the arm in its model or scenario file, (n,)."""
        return self.plant.GetPositions(self.plant.CreateDefaultContext())[self._index]

    def full(self, q: np.ndarray) -> np.ndarray:
        """Positions of the whole plant with the arm at q."""
        positions = self._q.copy()
        positions[self._index] = q
        return positions

    def pose(self, q: np.ndarray) -> RigidTransform:
        """X_WG of the arm at q."""
        self._q[self._index] = q
        self.plant.SetPositions(self._context, self._q)
        return self.frame_G.CalcPoseInWorld(self._context)

    def pose_and_jacobian(self, q: np.ndarray) -> tuple[RigidTransform, np.ndarray]:
        """X_WG and J, (6, n), with V_WG = J qdot (rotational rows first, expressed in W)."""
        X_WG = self.pose(q)
        W = self.plant.world_frame()
        J = self.plant.CalcJacobianSpatialVelocity(
            self._context, JacobianWrtVariable.kQDot, self.frame_G, np.zeros(3), W, W
        )
        return X_WG, J[:, self._index]

    def set_hand_width(self, width: float) -> None:
        """Opening of the hand (m) in all collision checks from now on, cut to its limits."""
        for joint in self._fingers:
            lower, upper = joint.position_lower_limits()[0], joint.position_upper_limits()[0]
            # A finger opens toward the end of its range that is farther from zero.
            sign = 1.0 if abs(upper) >= abs(lower) else -1.0
            self._q[joint.position_start()] = np.clip(0.5 * sign * width, lower, upper)

    @property
    def padding(self) -> float:
        """Clearance kept between the robot and its surroundings (m)."""
        return self._padding

    def set_padding(self, padding: float) -> None:
        """Clearance to keep between the robot and its surroundings (m) from now on."""
        self._padding = padding
        self.checker.SetPaddingAllRobotEnvironmentPairs(padding)

    def set_obstacles(self, shapes: Sequence[tuple[Shape, RigidTransform]]) -> None:
        """Replaces the added fixed obstacles by the given shapes and their poses X_WS.

        Meant for a few: the time it takes grows with the cube of their number.
        """
        self.checker.RemoveAllAddedCollisionShapes("obstacles")
        world = self.plant.world_body()
        for shape, X_WS in shapes:
            self.checker.AddCollisionShapeToBody("obstacles", world, shape, X_WS)

    @property
    def heights(self) -> HeightMap | None:
        """What the hand, the wrist and what is held have to stay above."""
        return self._heights

    def set_heights(self, heights: HeightMap | None) -> None:
        """Keeps hand, wrist and what is held above the heights from now on (None: free)."""
        self._heights = heights

    def attach(self, shape: Shape, X_GS: RigidTransform) -> None:
        """Holds the shape in the hand, at X_GS, in place of anything held before."""
        self.detach()
        self.checker.AddCollisionShapeToFrame("held", self.frame_G, shape, X_GS)
        self._held_points = shape_points(shape, X_GS)

    def detach(self) -> None:
        """Holds nothing in the hand any more."""
        self.checker.RemoveAllAddedCollisionShapes("held")
        self._held_points = None

    def is_free(self, q: np.ndarray) -> bool:
        """Whether the arm at q, (n,), touches neither itself nor its surroundings."""
        return self.checker.CheckConfigCollisionFree(self.full(q)) and not self._too_low(q)

    def edge_is_free(self, q_A: np.ndarray, q_B: np.ndarray) -> bool:
        """Whether the straight line in joint space is free, checked every ``edge_step``."""
        if not self.checker.CheckEdgeCollisionFree(self.full(q_A), self.full(q_B)):
            return False
        if self._heights is None:
            return True
        length = float(np.linalg.norm((q_B - q_A) * self.weights))
        count = int(np.ceil(length / self.checker.edge_step_size())) + 1
        u = np.linspace(0.0, 1.0, count)[:, None]
        return self.is_above_heights((1.0 - u) * q_A + u * q_B)

    def path_is_free(self, path: np.ndarray) -> bool:
        """Whether all edges of the path, (K, n), are free."""
        return all(self.edge_is_free(a, b) for a, b in pairwise(path))

    def is_above_heights(self, path: np.ndarray) -> bool:
        """Whether hand, wrist and what is held are above the heights at each q of (K, n)."""
        return not any(self._too_low(q) for q in path)

    def first_collision(self, path: np.ndarray) -> str:
        """The first configuration of a path (K, n) that collides, in words ("" if none does)."""
        for q in path:
            if not self.is_free(q):
                return self.collisions(q)
        return ""

    def collisions(self, q: np.ndarray) -> str:
        """The pairs of bodies in collision at q, in words ("" if there are none)."""
        clearance = self.checker.CalcRobotClearance(self.full(q), self._padding + 1e-6)
        rows = zip(
            clearance.robot_indices(),
            clearance.other_indices(),
            clearance.distances(),
            strict=True,
        )
        # Distances are reported net of padding.
        pairs = sorted(
            {f"{self._body(a)} and {self._body(b)}" for a, b, distance in rows if distance < 0.0}
        )
        if self._too_low(q):
            pairs.append("the hand and what was seen")
        return ", ".join(pairs)

    def _too_low(self, q: np.ndarray) -> bool:
        """Whether the hand, the wrist or what is held is below the heights."""
        if self._heights is None:
            return False
        X_WG = self.pose(q)
        if not self._heights.comes_near(X_WG.translation()):
            return False
        clouds = [] if self._held_points is None else [X_WG.multiply(self._held_points.T).T]
        for index, p_BP in self._points:
            X_WB = self.plant.EvalBodyPoseInWorld(self._context, self.plant.get_body(index))
            clouds.append(X_WB.multiply(p_BP.T).T)
        return self._heights.lowers(np.vstack(clouds))

    def _body(self, index) -> str:
        body = self.plant.get_body(index)
        if index == self.plant.world_body().index():
            return "an obstacle"
        return f"{self.plant.GetModelInstanceName(body.model_instance())}::{body.name()}"


def _joint_limits(
    plant: MultibodyPlant, index: np.ndarray, acceleration: Sequence[float] | None
) -> JointLimits:
    velocity = np.minimum(
        np.abs(plant.GetVelocityLowerLimits()), np.abs(plant.GetVelocityUpperLimits())
    )[index]
    if acceleration is not None:
        limit = np.asarray(acceleration, dtype=float)
    else:
        limit = np.minimum(
            np.abs(plant.GetAccelerationLowerLimits()), np.abs(plant.GetAccelerationUpperLimits())
        )[index]
        limit = np.where(np.isfinite(limit), limit, 5.0 * velocity)
    if limit.shape != velocity.shape or not np.all(np.isfinite(velocity)) or np.any(limit <= 0.0):
        raise InputError("every joint of the arm needs finite, positive velocity and acceleration")
    return JointLimits(
        plant.GetPositionLowerLimits()[index],
        plant.GetPositionUpperLimits()[index],
        velocity,
        limit,
    )


def _lever_arms(plant: MultibodyPlant, index: np.ndarray, *instances) -> np.ndarray:
    """For each joint, how far its axis is from the farthest body origin it moves (m), stretched.

    Measured at zero positions, where serial arms are stretched out; at least 0.1 m, for the
    bodies' own extent.
    """
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, np.zeros(plant.num_positions()))
    bodies = [plant.get_body(i) for instance in instances for i in plant.GetBodyIndices(instance)]
    origins = np.array([body.EvalPoseInWorld(context).translation() for body in bodies])
    arms = np.full(len(index), 0.1)
    joints = [plant.get_joint(j) for j in plant.GetJointIndices()]
    starts = {joint.position_start(): joint for joint in joints if joint.num_positions() == 1}
    for k, start in enumerate(index):
        joint = starts[start]
        p_WJ = joint.frame_on_child().CalcPoseInWorld(context).translation()
        moved = set(plant.GetBodiesKinematicallyAffectedBy([joint.index()]))
        reach = [
            float(np.linalg.norm(p - p_WJ))
            for body, p in zip(bodies, origins, strict=True)
            if body.index() in moved
        ]
        arms[k] = max([0.0, *reach]) + 0.1
    return arms
