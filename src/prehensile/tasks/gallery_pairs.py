"""Two robots at work together: two arms that lift a box, and an arm with a hand of many joints."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
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
    """An arm traces a square with a hand of sixteen joints, which closes and opens on the way.

    Raises:
        InputError: the square leaves the arm's workspace.
    """
    scenario = load_scenario("iiwa_allegro")
    arm = ArmModel(
        make_robot_diagram(scenario, ["table", "iiwa", "allegro"]),
        hand="allegro",
        gripper_frame="hand_root",
    )
    X_WH = arm.pose(arm.q_default)
    corners = [(0.0, 0.2, 0.0), (0.0, 0.2, 0.15), (0.0, -0.2, 0.15), (0.0, -0.2, 0.0), (0, 0, 0)]
    turns = [(0.0, 0.0, 0.3), (0.3, 0.0, 0.3), (-0.3, 0.0, -0.3), (0.0, 0.0, -0.3), (0, 0, 0)]
    way = [
        RigidTransform(
            RollPitchYaw(np.array(turn)).ToRotationMatrix() @ X_WH.rotation(),
            X_WH.translation() + corner,
        )
        for corner, turn in zip(corners, turns, strict=True)
    ]
    lines = [
        time_parameterize(line, arm.limits.scaled(0.4, 0.4))
        for line in _lines(arm, arm.q_default, way)
    ]
    samples = _samples([HOLD, *lines], arm.q_default)
    duration = COMMAND_PERIOD * (len(samples) - 1)
    return Show(
        scenario,
        [Track("iiwa", _held(samples)), Track("allegro", _grasps(duration))],
        (1.05, 0.5, 0.7),
        (0.35, 0.0, 0.33),
        controller="IiwaDriver and JointStiffnessDriver",
    )


OPEN = np.zeros(16) + 0.3 * (np.arange(16) == 12)
"""Joint angles of the Allegro hand with straight fingers, in rad."""

CLOSED = np.array([0.0, 1.2, 1.0, 0.8] * 3 + [1.0, 0.3, 0.3, 0.5])
"""Joint angles of the Allegro hand with bent fingers and the thumb across, in rad."""


def _grasps(duration: float) -> PiecewisePolynomial:
    """The hand closes and opens twice within a time."""
    times = np.concatenate([[0.0], np.linspace(HOLD, duration, 5)])
    shut = np.array([0.0, 0.0, 1.0, 0.0, 1.0, 0.0])
    rows = OPEN + shut[:, None] * (CLOSED - OPEN)
    return PiecewisePolynomial.CubicShapePreserving(times, rows.T, zero_end_point_derivatives=True)


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
    box = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("cracker_box"))
    X_WBox = plant.EvalBodyPoseInWorld(context, box)
    hands = [
        plant.EvalBodyPoseInWorld(
            context, plant.GetBodyByName("body", plant.GetModelInstanceByName(name))
        )
        for name in ("wsg_left", "wsg_right")
    ]
    left, right = (X_WG.translation() for X_WG in hands)
    return {
        "height of the box's middle, m": float(X_WBox.translation()[2]),
        "tip of the box, rad": float(np.arccos(np.clip(X_WBox.rotation().matrix()[2, 2], -1, 1))),
        "asymmetry of the hands, m": float(np.linalg.norm(left - right * [1.0, -1.0, 1.0])),
    }
