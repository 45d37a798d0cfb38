"""Scenes of the gallery: robots of the registry side by side, with postures and motions for each.

Nothing here knows any robot by name: what stands in the registry as an arm or a hand takes part.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydrake.math import BsplineBasis, RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Body, Frame, Joint, ModelInstanceIndex
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from pydrake.solvers import Solve
from pydrake.systems.framework import Context
from pydrake.trajectories import BsplineTrajectory

from prehensile.control.joint_controller import ControllerKind, actuators_of, controlled_joints
from prehensile.errors import Finding, InputError
from prehensile.models.registry import DATA, ModelInfo, list_models
from prehensile.planning.arm import JointLimits
from prehensile.planning.trajectory import time_parameterize
from prehensile.station.guard import GuardLimits

HOLD = 1.0
"""Seconds that every robot holds still before it moves."""

_BANDWIDTH = 20.0  # rad/s of arms; the mechanics of real ones allow about that much
_HAND_BANDWIDTH = 40.0  # rad/s of fingers
_SPEED = 1.0  # rad/s, the fastest that an arm's joint is moved in the gallery
_FINGER_SPEED = 2.0  # rad/s or m/s, the same of fingers
_FRACTION = 0.6  # of what velocity and acceleration limits allow
_SWING = 0.5  # rad, to either side of the ready posture
_CLOSED = 0.9  # of the way to the end of a finger's range
_SPREAD = 0.3  # of the same, for joints that go both ways
_STARTS = 24  # guesses for a ready posture
_TWIST = 0.004  # m/rad^2 by which a high elbow is worth less in a twisted posture
_TILE = 4.0  # m, side of the model of the floor


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
    chosen = [infos[name] for name in names or infos]
    place = _place_arm if category == "arm" else _place_hand
    return [place(_load(info), k, len(chosen)) for k, info in enumerate(chosen)]


def scenario_text(robots: Sequence[Robot], controller: ControllerKind, title: str) -> str:
    """The YAML text of a scenario with robots on a floor, each under a controller.

    Args:
        robots: the robots.
        controller: kind of controller of all of them; fingers are always driven by stiffness,
            as a sampled controller is no match for parts of a few grams.
        title: first line of the text, a comment.
    """
    places = np.array([robot.X_WB.translation() for robot in robots])
    lines = [
        f"# {title}",
        "",
        "plant_config:",
        "  time_step: 0.002",
        "  contact_model: hydroelastic_with_fallback",
        "  discrete_contact_approximation: sap",
        "",
        "simulator_config:",
        "  integration_scheme: explicit_euler  # the plant is discrete; only controllers integrate",
        "",
        "visualization:",
        "  publish_contacts: false",
        "",
        "directives:",
    ]
    for k, (x, y) in enumerate(_tiles(places)):
        lines += [
            "- add_model:",
            f"    name: floor{k}",
            "    file: package://prehensile/floor/floor.sdf",
            f"- add_weld: {{parent: world, child: 'floor{k}::base_link', "
            f"X_PC: {{translation: [{x:g}, {y:g}, 0.0]}}}}",
        ]
    for robot in robots:
        lines += _directives(robot)
    drivers = [(robot.info.name, _driver(robot, controller)) for robot in robots if robot.joints]
    lines += ["", "model_drivers:", *(f"  {name}: {driver}" for name, driver in drivers)]
    return "\n".join(lines) + "\n"


def swing(robot: Robot) -> BsplineTrajectory:
    """Every joint of an arm swings to one side and to the other, and all come back.

    The way is cut until it leads through no collision of the arm with itself or the floor.
    """
    limits = _joint_limits(robot)
    q = robot.q[robot.index]
    sides = np.where(np.arange(len(q)) % 2 == 0, 1.0, -1.0)  # neighbours go opposite ways
    room = 0.8 * np.minimum(limits.upper - q, q - limits.lower)

    def path(scale: float) -> NDArray[np.float64]:
        reach = sides * np.minimum(scale * _SWING, room)
        return np.array([q, q + reach, q - reach, q + 0.5 * np.roll(reach, 1), q])

    return _follow(robot, path, limits)


def wave(robot: Robot) -> BsplineTrajectory:
    """The fingers of a hand close and open, all at once and one after the other.

    The way is cut until the fingers do not meet.
    """
    limits = _joint_limits(robot)
    q = robot.q[robot.index]
    above, below = limits.upper - q, q - limits.lower
    far = np.where(above > below, limits.upper, limits.lower)
    # What can go both ways from here spreads the fingers: a little of that is enough.
    spreads = np.minimum(above, below) > 0.5 * np.maximum(above, below)
    far = np.where(spreads, q + _SPREAD * (far - q), far)
    fingers = _fingers(robot)
    if len(fingers) == len(q):  # a gripper's jaws move together
        fingers = []

    def path(scale: float) -> NDArray[np.float64]:
        there = q + scale * _CLOSED * (far - q)
        ways = [there, *(np.where(finger, there, q) for finger in fingers)]
        return np.array([q, *(row for way in ways for row in (way, q))])

    return _follow(robot, path, limits)


def _follow(
    robot: Robot, path: Callable[[float], NDArray[np.float64]], limits: JointLimits
) -> BsplineTrajectory:
    """The motion along the greatest of the scaled paths that is free of collisions."""
    scale = next((s for s in 0.85 ** np.arange(16) if _free(robot, path(s))), 0.0)
    made = path(scale)
    trajectory = time_parameterize(np.clip(made, limits.lower, limits.upper), limits).trajectory
    # The same motion after the time of holding still, during which its start is held.
    basis = trajectory.basis()
    knots = np.array(basis.knots()) + HOLD
    return BsplineTrajectory(BsplineBasis(basis.order(), knots), trajectory.control_points())


def _load(info: ModelInfo) -> Robot:
    """The model alone on a floor, its base at the origin, in its default posture."""
    builder = RobotDiagramBuilder(time_step=0.002)
    plant = builder.plant()
    (instance,) = Parser(plant).AddModels(str(info.path))
    base = _base(plant, instance)
    if info.category == "arm":
        (floor,) = Parser(plant).AddModels(str(DATA / "floor" / "floor.sdf"))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link", floor))
    if plant.GetBodiesWeldedTo(base)[0].index() != plant.world_body().index():
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
        if score > best_score and _free(robot, found[None, robot.index]):
            best, best_score = found, score
    return best


def _flange(robot: Robot) -> Frame:
    """The frame that a model names on its last link, z out of it; else that link's own."""
    plant, last = robot.plant, robot.joints[-1].child_body()
    welded = {body.index() for body in plant.GetBodiesWeldedTo(last)}
    frames = [plant.get_frame(i) for i in plant.GetFrameIndices(robot.instance)]
    named = [f for f in frames if f.body().index() in welded and f.name() != last.name()]
    return named[-1] if named else last.body_frame()


def _joint_limits(robot: Robot) -> JointLimits:
    """Limits of the joints of a robot, as far as the gallery uses them."""
    limits = GuardLimits.of_plant(robot.plant, robot.instance)
    every = robot.plant.GetPositionsFromArray(
        robot.instance, np.arange(robot.plant.num_positions())
    ).astype(int)
    own = [every.tolist().index(i) for i in robot.index]
    lower, upper, velocity, acceleration = (
        np.array(values)[own]
        for values in (
            limits.position_lower,
            limits.position_upper,
            limits.velocity,
            limits.acceleration,
        )
    )
    speed = _SPEED if robot.info.category == "arm" else _FINGER_SPEED
    velocity = np.minimum(_FRACTION * velocity, speed)
    return JointLimits(lower, upper, velocity, np.minimum(_FRACTION * acceleration, 4.0 * speed))


def _free(robot: Robot, path: NDArray[np.float64]) -> bool:
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


def _fingers(robot: Robot) -> list[NDArray[np.bool_]]:
    """For each finger which driven joints are its own: those behind one joint of the palm."""
    plant = robot.plant
    by_child = {
        plant.get_joint(i).child_body().index(): plant.get_joint(i)
        for i in plant.GetJointIndices(robot.instance)
    }
    palm = {body.index() for body in plant.GetBodiesWeldedTo(robot.base)}

    def root(joint: Joint) -> int:
        while joint.parent_body().index() not in palm:
            joint = by_child[joint.parent_body().index()]
        return int(joint.index())

    roots = [root(joint) for joint in robot.joints]
    return [np.array([r == own for r in roots]) for own in dict.fromkeys(roots)]


def _tiles(places: NDArray[np.float64]) -> list[tuple[float, float]]:
    """Centres of tiles of floor that reach 1 m beyond all places."""
    low, high = places[:, :2].min(axis=0) - 1.0, places[:, :2].max(axis=0) + 1.0
    counts = np.ceil((high - low) / _TILE).astype(int)
    first = 0.5 * (low + high) - 0.5 * _TILE * (counts - 1)
    return [tuple(first + _TILE * np.array(k)) for k in np.ndindex(*counts)]


def _directives(robot: Robot) -> list[str]:
    """A model and where it stands."""
    name = robot.info.name
    x, y, z = robot.X_WB.translation() + 0.0
    roll, pitch, yaw = np.rad2deg(RollPitchYaw(robot.X_WB.rotation()).vector()) + 0.0
    plant = robot.plant
    joints = [plant.get_joint(i) for i in plant.GetJointIndices(robot.instance)]
    joints = [joint for joint in joints if joint.num_positions() == 1]
    lines = ["- add_model:", f"    name: {name}", f"    file: {robot.info.url}"]
    if joints:
        lines.append("    default_joint_positions:")
    for joint in joints:
        lines.append(f"      {joint.name()}: [{robot.q[joint.position_start()]:.4f}]")
    return [
        *lines,
        "- add_weld:",
        "    parent: world",
        f"    child: {name}::{robot.base.name()}",
        "    X_PC:",
        f"      translation: [{x:g}, {y:g}, {z:g}]",
        f"      rotation: !Rpy {{ deg: [{roll:g}, {pitch:g}, {yaw:g}] }}",
    ]


def _driver(robot: Robot, controller: ControllerKind) -> str:
    """A driver's YAML."""
    if robot.info.category == "hand":
        return f"!JointStiffnessDriver {{ bandwidth: {_HAND_BANDWIDTH:g} }}"
    bandwidth = f"bandwidth: {_BANDWIDTH:g}"
    if controller == "stiffness":
        return f"!JointStiffnessDriver {{ {bandwidth} }}"
    if controller == "gravity-compensation":
        return f"!JointPidDriver {{ {bandwidth} }}"
    if controller == "pid":
        more = f"gravity_compensation: false, integral_rate: {0.25 * _BANDWIDTH:g}"
        return f"!JointPidDriver {{ {bandwidth}, {more} }}"
    gains = f"{{ kp: {_BANDWIDTH**2:g}, ki: 0, kd: {2 * _BANDWIDTH:g} }}"
    actuators = actuators_of(robot.plant, [robot.instance])
    each = ", ".join(f"{actuator.name()}: {gains}" for actuator in actuators)
    return f"!InverseDynamicsDriver {{ gains: {{ {each} }} }}"
