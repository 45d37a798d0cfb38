"""Two robots at work together: two arms that lift a box, an arm and a hand that grasp a can."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context
from pydrake.trajectories import PiecewisePolynomial

from prehensile.errors import InputError
from prehensile.kinematics.joint_limits import JointLimits
from prehensile.planning.arm import ArmModel
from prehensile.planning.cartesian import plan_cartesian
from prehensile.planning.inverse_kinematics import solve_ik
from prehensile.planning.trajectory import TimedPath, time_parameterize
from prehensile.station.guard import COMMAND_PERIOD
from prehensile.station.robot_plant import make_robot_diagram
from prehensile.station.scenario_file import load_scenario
from prehensile.tasks.gallery import Show, Track
from prehensile.tasks.gallery_motions import HOLD

# The mirror image of an iiwa's posture in the plane through its base that halves it.
MIRROR = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs that make the right arm's joint angles of the left one's."""

BOX_SIZE = (0.0709, 0.1634, 0.2124)
"""Size of the cracker box along its axes, in m."""

_TIP = 0.118  # m from the frame of a WSG 50's body to the end of its fingers
_WIDTH = 0.05  # m between the fingers that press, so that the box cannot turn between two points
_SQUEEZE = 0.004  # m that each hand's fingers are sent into the box
_APART = 0.06  # m before the box
_LIFT = 0.2  # m
_SHIFT = (0.12, 0.0, 0.05)  # m, the farthest that the box is carried
_PITCH = 0.35  # rad that it is tipped
_SPEED = 0.3  # of the velocity and acceleration limits while the box is held

CAN_SIZE = (0.0366, 0.2494)
"""Radius and height of the chips can, in m."""

OPEN = np.zeros(16) + 0.3 * (np.arange(16) == 12)
"""Joint angles of the Allegro hand with straight fingers, in rad."""

GRASP = np.array([0.0, 1.14, 0.93, 0.90] * 3 + [0.95, 0.3, 0.3, 0.5])
"""Joint angles that the Allegro hand is sent to around the can, in rad: more than it gets to."""

_P_HCAN = np.array([0.053, 0.0, 0.078])  # m, the can's middle in the frame of the open hand
_BESIDE = (-0.05, -0.2, 0.0)  # m, where the hand is before it approaches the can
_ASIDE = (-0.1, 0.25, 0.1)  # m, where the can is carried from where it was lifted to
_YAW = 0.6  # rad that it is turned there
_GRASPING = 0.8  # s that the hand is given to close or open


def bimanual() -> Show:
    """Two arms press a box between their hands, lift it, tip it, and put it back.

    The left arm's motion is planned, the right one's is its mirror image. There is no grasp: what
    holds the box is friction, from each hand being sent a few millimetres into it.

    Raises:
        InputError: the motion leaves the left arm's workspace.
    """
    scenario = load_scenario("bimanual")
    arm = ArmModel(
        make_robot_diagram(scenario, ["table", "iiwa_left", "wsg_left"]),
        arm="iiwa_left",
        hand="wsg_left",
    )
    arm.set_hand_width(_WIDTH)
    # Fingers to the right, closing along x; the box stands upright where the scenario puts it.
    p_WBox = np.array([0.2, 0.0, 0.5 * BOX_SIZE[2]])
    R_WG = RotationMatrix(np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]))
    y_G = 0.5 * BOX_SIZE[1] + _TIP

    def hand(p_BoxMoved_W: ArrayLike, gap: float, pitch: float = 0.0) -> RigidTransform:
        """The left hand beside the box when that is moved and tipped about its own middle."""
        R_tip = RotationMatrix.MakeYRotation(pitch)
        p_WG = p_WBox + np.asarray(p_BoxMoved_W) + [0.0, y_G + gap, 0.0]
        return RigidTransform(R_tip @ R_WG, p_WG)

    before, home = hand([0.0, 0.0, 0.0], _APART), arm.q_default
    arm.set_obstacles([(Box(*BOX_SIZE), RigidTransform(p_WBox))])
    found = solve_ik(arm, before, home)
    if not found.solved:
        raise InputError(f"the left hand cannot reach the box: {found.reason}")
    arm.set_obstacles([])
    way = [
        hand([0.0, 0.0, 0.0], -_SQUEEZE),
        hand([0.0, 0.0, _LIFT], -_SQUEEZE),
        hand([_SHIFT[0], _SHIFT[1], _LIFT + _SHIFT[2]], -_SQUEEZE, _PITCH),
        hand([0.0, 0.0, _LIFT], -_SQUEEZE),
        hand([0.0, 0.0, 0.0], -_SQUEEZE),
        before,
    ]
    lines = [
        time_parameterize(line, arm.limits.scaled(_SPEED, _SPEED))
        for line in _lines(arm, found.q, way)
    ]
    reach = time_parameterize(np.array([home, found.q]), arm.limits.scaled(0.5, 0.5))
    back = time_parameterize(np.array([lines[-1].q_end, home]), arm.limits.scaled(0.5, 0.5))
    samples = _samples([HOLD, reach, 0.3, *lines, 0.3, back], home)
    width = time_parameterize(np.array([[0.1], [_WIDTH]]), _jaw_limits())
    jaws = _samples([HOLD, width], np.array([0.1]))
    tracks = [
        Track("iiwa_left", _held(samples)),
        Track("iiwa_right", _held(samples * MIRROR)),
        *(
            Track(f"wsg_{side}", _held(jaws), measured="state_measured")
            for side in ("left", "right")
        ),
    ]
    return Show(
        scenario, tracks, (1.0, -0.6, 0.75), (0.05, 0.0, 0.25), controller="IiwaDriver",
        measure=_lifted,
    )  # fmt: skip


def iiwa_allegro() -> Show:
    """An arm reaches for a can, its hand of sixteen joints grasps it, carries it and puts it back.

    The fingers wrap the can and press it into the palm: they are sent a little further than the
    can lets them, and what holds it is friction.

    Raises:
        InputError: the motion leaves the arm's workspace or meets the can.
    """
    scenario = load_scenario("iiwa_allegro")
    arm = ArmModel(
        make_robot_diagram(scenario, ["table", "iiwa", "allegro"]),
        hand="allegro",
        gripper_frame="hand_root",
    )
    p_WCan = np.array([0.65, 0.0, 0.5 * CAN_SIZE[1]])
    # Fingers to the front, the thumb on top, the palm to the left.
    R_WH = RotationMatrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))

    def hand(p_CanMoved_W: ArrayLike, yaw: float = 0.0) -> RigidTransform:
        """The hand at the can when that is moved and turned."""
        R_WHMoved = RotationMatrix.MakeZRotation(yaw) @ R_WH
        return RigidTransform(R_WHMoved, p_WCan + np.asarray(p_CanMoved_W) - R_WHMoved @ _P_HCAN)

    before, home = hand(_BESIDE), arm.q_default
    arm.set_obstacles([(Cylinder(*CAN_SIZE), RigidTransform(p_WCan))])
    found = solve_ik(arm, before, home)
    if not found.solved:
        raise InputError(f"the hand cannot reach the can: {found.reason}")
    if not arm.edge_is_free(home, found.q):
        raise InputError("the arm meets the can on its way")
    arm.set_obstacles([])
    up = np.array([0.0, 0.0, _LIFT])
    way = [
        hand(np.zeros(3)),
        hand(up),
        hand(up + _ASIDE, _YAW),
        hand(up),
        hand(np.zeros(3)),
        before,
    ]
    approach, *carried, retreat = (
        time_parameterize(line, arm.limits.scaled(0.4, 0.4)) for line in _lines(arm, found.q, way)
    )
    reach = time_parameterize(np.array([home, found.q]), arm.limits.scaled(0.6, 0.6))
    back = time_parameterize(np.array([retreat.q_end, home]), arm.limits.scaled(0.6, 0.6))
    parts = [HOLD, reach, approach]
    closes = COMMAND_PERIOD * (len(_samples(parts, home)) - 1)
    parts += [_GRASPING, *carried]
    opens = COMMAND_PERIOD * (len(_samples(parts, home)) - 1)
    fingers = PiecewisePolynomial.CubicShapePreserving(
        [0.0, closes, closes + 0.9 * _GRASPING, opens, opens + 0.9 * _GRASPING],
        np.array([OPEN, OPEN, GRASP, GRASP, OPEN]).T,
        zero_end_point_derivatives=True,
    )
    samples = _samples([*parts, _GRASPING, retreat, back], home)
    return Show(
        scenario,
        [Track("iiwa", _held(samples)), Track("allegro", fingers, start=closes)],
        (1.7, 0.9, 0.8),
        (0.4, 0.0, 0.3),
        controller="IiwaDriver and JointStiffnessDriver",
        measure=lambda plant, context: _raised(plant, context, "chips_can", "can"),
    )


def _lines(
    arm: ArmModel, q: NDArray[np.float64], way: Sequence[RigidTransform]
) -> list[NDArray[np.float64]]:
    """Joint paths (K, n) along straight lines of the hand from pose to pose."""
    paths = []
    for X_WG in way:
        result = plan_cartesian(arm, q, X_WG, check_collisions=False)
        if not result.found:
            raise InputError(f"the hand cannot follow its way: {result.reason}")
        paths.append(result.path)
        q = result.path[-1]
    return paths


def _samples(
    parts: Sequence[TimedPath | float], q_start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Positions (T, n) at the command rate of motions and of waits in seconds, one by one."""
    rows = [q_start]
    for part in parts:
        if isinstance(part, TimedPath):
            count = int(np.ceil(part.duration / COMMAND_PERIOD))
            rows += [part.value(COMMAND_PERIOD * (k + 1)) for k in range(count)]
        else:
            rows += [rows[-1]] * round(part / COMMAND_PERIOD)
    return np.array(rows)


def _held(samples: NDArray[np.float64]) -> PiecewisePolynomial:
    """The function of time through samples at the command rate."""
    times = COMMAND_PERIOD * np.arange(len(samples))
    return PiecewisePolynomial.FirstOrderHold(times, samples.T)


def _jaw_limits() -> JointLimits:
    """How the width of a WSG 50 is moved, in m: gently."""
    return JointLimits(np.array([0.0]), np.array([0.11]), np.array([0.1]), np.array([1.0]))


def _lifted(plant: MultibodyPlant, context: Context) -> Mapping[str, float]:
    """How high the box is above the table and how far from being between the hands."""
    hands = [
        plant.EvalBodyPoseInWorld(
            context, plant.GetBodyByName("body", plant.GetModelInstanceByName(name))
        )
        for name in ("wsg_left", "wsg_right")
    ]
    left, right = (X_WG.translation() for X_WG in hands)
    asymmetry = float(np.linalg.norm(left - right * [1.0, -1.0, 1.0]))
    return {
        **_raised(plant, context, "cracker_box", "box"),
        "asymmetry of the hands, m": asymmetry,
    }


def _raised(plant: MultibodyPlant, context: Context, model: str, name: str) -> dict[str, float]:
    """How high an object that stood upright is above the table, and how far it is tipped."""
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName(model))
    X_WO = plant.EvalBodyPoseInWorld(context, body)
    upright = np.clip(X_WO.rotation().matrix()[2, 2], -1.0, 1.0)
    return {
        f"height of the {name}'s middle, m": float(X_WO.translation()[2]),
        f"tip of the {name}, rad": float(np.arccos(upright)),
    }
