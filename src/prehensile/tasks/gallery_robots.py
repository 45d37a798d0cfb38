"""Robots of the gallery: models of the registry, loaded, placed side by side, in a ready posture.

Nothing here knows any robot by name: what stands in the registry as an arm or a hand takes part.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Body, Frame, Joint, ModelInstanceIndex
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from pydrake.solvers import Solve
from pydrake.systems.framework import Context

from prehensile.control.joint_controller import actuators_of, controlled_joints
from prehensile.errors import Finding, InputError
from prehensile.models.registry import DATA, ModelInfo, list_models, package_map

_STARTS = 24  # guesses for a ready posture
_TWIST = 0.004  # m/rad^2 by which a high elbow is worth less in a twisted posture


@dataclass(frozen=True)
class Robot:
    """A model in the gallery.

    Attributes:
        info: the registry's.
        diagram: the model alone, its base fixed to the world.
        instance: the model in the diagram's plant.
        base: its first link.
        X_WB: where that stands in the gallery.
        q: the posture that it starts in, (n,) of all its joints.
    """

    info: ModelInfo
    diagram: RobotDiagram
    instance: ModelInstanceIndex
    base: Body
    X_WB: RigidTransform
    q: NDArray[np.float64]

    @property
    def plant(self) -> MultibodyPlant:
        """The plant of the model alone."""
        return self.diagram.plant()

    @property
    def joints(self) -> list[Joint]:
        """Its joints with actuators, in the order of its state; empty if it has none."""
        if not actuators_of(self.plant, [self.instance]):
            return []
        return controlled_joints(self.plant, [self.instance])

    @property
    def index(self) -> NDArray[np.intp]:
        """(n,) where the positions of ``joints`` stand among those of the plant."""
        return np.array([joint.position_start() for joint in self.joints], dtype=np.intp)


def gallery_robots(category: str, names: Sequence[str] | None = None) -> list[Robot]:
    """Loads the robots of a category, places them in rows, and finds a posture for each.

    Args:
        category: ``arm`` or ``hand``.
        names: of the models wanted; default: all there are.

    Raises:
        InputError: a name is that of no such model.
    """
    infos = {info.name: info for info in list_models() if info.category == category}
    for name in names or ():
        if name not in infos:
            known = ", ".join(infos)
            raise InputError(Finding(f"there is no {category} '{name}'", f"there are {known}"))
    chosen = [infos[name] for name in dict.fromkeys(names or infos)]
    place = _place_arm if category == "arm" else _place_hand
    return [place(_load(info), k, len(chosen)) for k, info in enumerate(chosen)]


def is_free(robot: Robot, path: NDArray[np.float64]) -> bool:
    """Whether a path (K, n) of the driven joints leads through no collision.

    Where other joints follow them by constraints, nobody knows before the simulation.
    """
    plant = robot.plant
    if plant.num_positions() != path.shape[1]:
        return True
    context = robot.diagram.CreateDefaultContext()
    plant_context = robot.diagram.plant_context(context)
    q = robot.q.copy()
    steps = [np.linspace(a, b, 12) for a, b in pairwise(path)] or [path]
    for row in np.vstack(steps):
        q[robot.index] = row
        plant.SetPositions(plant_context, q)
        query = plant.get_geometry_query_input_port().Eval(plant_context)
        if query.HasCollisions():
            return False
    return True


def _load(info: ModelInfo) -> Robot:
    """The model alone on a floor, its base at the origin, in its default posture."""
    builder = RobotDiagramBuilder(time_step=0.002)
    plant = builder.plant()
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (instance,) = parser.AddModels(str(info.path))
    base = _base(plant, instance)
    if info.category == "arm":
        (floor,) = parser.AddModels(str(DATA / "floor" / "floor.sdf"))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", floor))
    if plant.world_body().index() not in {b.index() for b in plant.GetBodiesWeldedTo(base)}:
        plant.WeldFrames(plant.world_frame(), base.body_frame())
    diagram = builder.Build()
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    q = np.clip(plant.GetPositions(plant.CreateDefaultContext()), lower, upper)
    return Robot(info, diagram, instance, plant.get_body(base.index()), RigidTransform(), q)


def _base(plant: MultibodyPlant, instance: ModelInstanceIndex) -> Body:
    """The first link of a model: the one that no joint carries."""
    carried = {plant.get_joint(i).child_body().index() for i in plant.GetJointIndices(instance)}
    return next(plant.get_body(i) for i in plant.GetBodyIndices(instance) if i not in carried)


def _spot(k: int, count: int, in_row: int, apart: tuple[float, float]) -> NDArray[np.float64]:
    """(2,) place of the k-th of some robots in rows along y, each row between those before it."""
    rows = -(-count // in_row)
    columns = -(-count // rows)
    row, column = divmod(k, columns)
    return np.array(apart) * [-row, 0.5 * (columns - 1 + row % 2) - column]


def _place_arm(robot: Robot, k: int, count: int) -> Robot:
    """Arms stand in rows and face x, each in its ready posture."""
    p_WB = [*_spot(k, count, 4, (1.5, 1.1)), 0.0]
    return replace(robot, X_WB=RigidTransform(p_WB), q=_ready(robot))


def _place_hand(robot: Robot, k: int, count: int) -> Robot:
    """Hands stand in rows, fingers up."""
    plant = robot.plant
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, robot.q)
    carriers = {plant.get_joint(i).parent_body().index() for i in plant.GetJointIndices()}
    tips = [i for i in plant.GetBodyIndices(robot.instance) if i not in carriers]
    p_BTips = np.array([_center(plant, context, plant.get_body(i)) for i in tips])
    p_BTip = p_BTips.mean(axis=0) - _center(plant, context, robot.base)
    p_BTip[2] += 1e-9  # z is up where nothing says otherwise
    axis = int(np.argmax(np.abs(p_BTip)))
    up = np.sign(p_BTip[axis]) * np.eye(3)[axis]
    # The viewer sees the fingers side by side.
    spread = np.where(np.arange(3) == axis, np.inf, np.ptp(p_BTips, axis=0))
    front = np.eye(3)[int(np.argmin(spread))]
    R_BW = np.column_stack([front, np.cross(up, front), up])
    x, y = _spot(k, count, 3, (0.3, 0.38))
    p_WB = [x, y, 0.1 - x]  # as if on steps: nobody hides who stands behind
    return replace(robot, X_WB=RigidTransform(RotationMatrix(R_BW).inverse(), p_WB))


def _center(plant: MultibodyPlant, context: Context, body: Body) -> NDArray[np.float64]:
    """Centre of mass of a body in the world."""
    return plant.EvalBodyPoseInWorld(context, body).multiply(body.default_com())


def _ready(robot: Robot) -> NDArray[np.float64]:
    """A posture with the flange in front of the arm, pointing down, and the elbow high."""
    plant = robot.plant
    chain = robot.joints
    if not chain:
        return robot.q
    context = plant.CreateDefaultContext()
    origins = [joint.frame_on_child().CalcPoseInWorld(context).translation() for joint in chain]
    reach = float(np.linalg.norm(np.diff(origins, axis=0), axis=1).sum())
    flange = _flange(robot)
    rng = np.random.default_rng(0)
    best, best_score = robot.q, -np.inf
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    lower, upper = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
    p_WF = origins[0] * [0.0, 0.0, 1.0] + reach * np.array([0.6, 0.0, 0.25])
    for _ in range(_STARTS):
        ik = InverseKinematics(plant)
        ik.AddPositionConstraint(flange, np.zeros(3), plant.world_frame(), p_WF - 0.02, p_WF + 0.02)
        ik.AddAngleBetweenVectorsConstraint(
            flange, [0.0, 0.0, 1.0], plant.world_frame(), [0.0, 0.0, -1.0], 0.0, 0.1
        )
        guess = rng.uniform(lower, upper)
        prog, q = ik.prog(), ik.q()
        prog.AddBoundingBoxConstraint(lower, upper, q)
        prog.AddQuadraticErrorCost(0.1 * np.eye(len(q)), robot.q, q)
        result = Solve(prog, guess)
        if not result.is_success():
            continue
        found = result.GetSolution(q)
        plant.SetPositions(context, found)
        bodies = [plant.get_body(i) for i in plant.GetBodyIndices(robot.instance)]
        height = np.mean([_center(plant, context, body)[2] for body in bodies])
        score = float(height - _TWIST * np.sum((found - robot.q) ** 2))
        if score > best_score and is_free(robot, found[None, robot.index]):
            best, best_score = found, score
    return best


def _flange(robot: Robot) -> Frame:
    """The frame that a model names on its last link, z out of it; else that link's own."""
    plant, last = robot.plant, robot.joints[-1].child_body()
    welded = {body.index() for body in plant.GetBodiesWeldedTo(last)}
    frames = [plant.get_frame(i) for i in plant.GetFrameIndices(robot.instance)]
    named = [f for f in frames if f.body().index() in welded and f.name() != last.name()]
    return named[-1] if named else last.body_frame()
