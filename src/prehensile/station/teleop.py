"""Teleoperation: sliders, keys and a gamepad of the Meshcat page drive an arm and its hand.

The station is driven through its command ports alone, so that a real one is driven the same way::

    SliderSource ──pose──► DifferentialInverseKinematics ──► smoothing ──► iiwa.position
    SliderSource ──values (joints)───────────────────────────────────► smoothing ──► iiwa.position
    SliderSource ──values (width)──────────────────────────────────────────────────► wsg.position

Sliders are read at 32 Hz. Of what runs at the command rate, only the inverse kinematics is a
System written in Python, some 30 µs a time. Where the sliders lead out of reach or against a
joint's limit, the arm slides along and comes to rest.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, RigidBody
from pydrake.systems.framework import Diagram, DiagramBuilder, System
from pydrake.systems.primitives import LinearSystem

from prehensile.errors import Finding, InputError
from prehensile.kinematics.differential_ik import DifferentialIkConfig, FrameTask, JointLimits
from prehensile.kinematics.systems import DifferentialInverseKinematics
from prehensile.kinematics.tree import tree_from_plant
from prehensile.station.guard import COMMAND_PERIOD, GuardLimits
from prehensile.station.robot_plant import add_part
from prehensile.station.scenario import Scenario
from prehensile.station.slider_source import Gamepad, Knob, SliderSource
from prehensile.viz.sliders import Slider, joint_sliders

Mode = Literal["pose", "planar", "joints"]

# Greatest speeds of what the sliders command, m/s and rad/s.
_LINEAR_SPEED, _ANGULAR_SPEED = 0.3, 1.2
# Least steps of sliders and keys, m and rad.
_LINEAR_STEP, _ANGULAR_STEP = 0.005, 0.02
# Share of a joint's speed limit that is used.
_SPEED_SHARE = 0.6
# Of the hand's way to the sliders: 1/s from distance to speed, and the damping that keeps an arm
# stretched to its reach from trembling.
_GAIN, _DAMPING = 20.0, 0.05
# Time constant tau in s of the smoothing of joint commands.
_SMOOTHING = 0.1
_MAX_WIDTH, _WIDTH_STEP, _WIDTH_SPEED = 0.107, 0.002, 0.15
_JOINT_KEYS = tuple(zip("QWERTYU", "1234567", strict=True))


@dataclass(frozen=True)
class Arm:
    """The arm that is driven, as its controller sees it.

    Attributes:
        name: of its model in the scenario.
        hand: name of the model of its hand, "" if it has none.
        plant: the arm alone with its hand made rigid.
        q0: (n,) where its joints are at the start.
        end: the body that the pose sliders move: the hand's first, else the arm's last.
    """

    name: str
    hand: str
    plant: MultibodyPlant
    q0: NDArray[np.float64]
    end: RigidBody

    def start_pose(self) -> RigidTransform:
        """X_WE at the start."""
        context = self.plant.CreateDefaultContext()
        self.plant.SetPositions(context, self.q0)
        return self.plant.EvalBodyPoseInWorld(context, self.end)


def teleoperate(
    station: Diagram,
    scenario: Scenario,
    meshcat: Meshcat,
    *,
    mode: Mode = "pose",
    arm: str = "",
    gamepad: Callable[[], Gamepad] | None = None,
) -> Diagram:
    """Puts a station under the control of the page.

    Args:
        station: from :func:`prehensile.station.build.build`; it becomes part of the result.
        scenario: that it was built from.
        meshcat: the page that the sliders are put on.
        mode: "pose": roll, pitch, yaw, x, y, z of the hand in the world; "planar": x, z and tilt
            about y of the hand, by the joints that turn about y alone; "joints": each joint.
        arm: name of the arm's model; default: the first with a driver.
        gamepad: what reads the gamepad; default: that of the page.

    Returns:
        A diagram with the station and its commands; arms that are not driven hold still.

    Raises:
        InputError: the scenario has no such arm, or the arm cannot move in the plane.
    """
    read_gamepad = meshcat.GetGamepad if gamepad is None else gamepad
    driven = find_arm(station, scenario, arm)
    builder = DiagramBuilder()
    builder.AddSystem(station)
    if mode == "joints":
        source = builder.AddNamedSystem("joints", _joint_source(driven, meshcat, read_gamepad))
        commands = source.GetOutputPort("values")
    else:
        planar = mode == "planar"
        make = _planar_source if planar else _pose_source
        source = builder.AddNamedSystem("pose", make(driven, meshcat, read_gamepad))
        ik = builder.AddNamedSystem("differential_ik", pose_follower(driven, scenario, planar))
        builder.Connect(source.GetOutputPort("pose"), ik.GetInputPort("X_AE_desired"))
        # The integrator starts where the arm is, then runs open loop.
        state = station.GetOutputPort(f"{driven.name}.state_estimated")
        builder.Connect(state, ik.GetInputPort("robot_state"))
        commands = ik.GetOutputPort("joint_positions")
    smoothing = builder.AddNamedSystem("smoothing", _smoothing(driven.q0))
    builder.Connect(commands, smoothing.get_input_port())
    builder.Connect(smoothing.get_output_port(), station.GetInputPort(f"{driven.name}.position"))
    if driven.hand and station.HasInputPort(f"{driven.hand}.position"):
        width = float(_measured(station, f"{driven.hand}.state_measured")[0])
        hand = builder.AddNamedSystem("hand", _hand_source(width, meshcat, read_gamepad))
        builder.Connect(
            hand.GetOutputPort("values"), station.GetInputPort(f"{driven.hand}.position")
        )
    diagram = builder.Build()
    diagram.set_name("teleoperation")
    return diagram


def find_arm(station: Diagram, scenario: Scenario, name: str = "") -> Arm:
    """The arm to drive, from the station's ports and the scenario's drivers.

    Args:
        station: the station.
        scenario: that it was built from.
        name: of the arm's model; "" for the first arm.

    Returns:
        The arm.

    Raises:
        InputError: there is no such arm.
    """
    arms = [
        model
        for model in scenario.model_drivers
        if station.HasInputPort(f"{model}.position")
        and station.HasOutputPort(f"{model}.position_measured")
    ]
    if not arms:
        raise InputError(
            Finding("the scenario has no arm", "give one a driver under model_drivers")
        )
    if name and name not in arms:
        raise InputError(Finding(f"the scenario has no arm '{name}'", f"it has {', '.join(arms)}"))
    name = name or arms[0]
    hand = getattr(scenario.model_drivers[name], "hand_model_name", "")
    plant = MultibodyPlant(scenario.plant_config.time_step)
    add_part(scenario, plant, [name], frozen_children=True)
    plant.Finalize()
    part = plant.GetModelInstanceByName(hand or name)
    bodies = plant.GetBodyIndices(part)
    end = plant.get_body(bodies[0] if hand else bodies[-1])
    return Arm(name, hand, plant, _measured(station, f"{name}.position_measured"), end)


def pose_follower(arm: Arm, scenario: Scenario, planar: bool) -> System:
    """The system that turns poses of the hand into joint positions.

    Args:
        arm: the arm.
        scenario: it comes from.
        planar: move only the joints that turn about y of the world, and follow only x, z and the
            angle about y.

    Returns:
        A system with the input ports ``X_AE_desired`` (the pose of E in the world; E is the
        frame of ``arm.end``, in the plane its origin with the axes that the world had at the
        start) and ``robot_state`` (where it starts), and the output port ``joint_positions``.

    Raises:
        InputError: fewer than three joints turn about y.
    """
    plant = MultibodyPlant(scenario.plant_config.time_step)
    add_part(scenario, plant, [arm.name], frozen_children=True)
    end = plant.GetBodyByName(arm.end.name(), plant.GetModelInstanceByName(arm.hand or arm.name))
    R_WE0 = arm.start_pose().rotation()
    # With axes parallel to the world's at the start, E turns about its own y alone, so that the
    # parts of its velocity that leave the plane can be told by index.
    R_EP = R_WE0.inverse() if planar else RotationMatrix()
    frame = plant.AddFrame(
        FixedOffsetFrame("teleop", end.body_frame(), RigidTransform(R_EP), end.model_instance())
    )
    plant.Finalize()
    limits = GuardLimits.of_plant(plant, plant.GetModelInstanceByName(arm.name))
    speed = _SPEED_SHARE * _finite(np.array(limits.velocity), 1.0)
    weights = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
    if planar:
        turning = _joints_about_y(plant, arm.q0)
        if turning.sum() < 3:
            raise InputError(
                Finding(
                    f"of the joints of '{arm.name}' {turning.sum()} turn about y at its start",
                    "planar teleoperation needs three; the scenario 'planar' shows how",
                )
            )
        speed = np.where(turning, speed, 0.0)
        weights = (0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
    task = FrameTask(
        weights=weights,
        axes="frame",
        gain=_GAIN,
        max_angular=2 * _ANGULAR_SPEED,
        max_linear=2 * _LINEAR_SPEED,
    )
    config = DifferentialIkConfig(
        period=COMMAND_PERIOD,
        centering="posture",
        centering_weight=_DAMPING**2,
        centering_gain=0.5,
        nominal_position=tuple(arm.q0),
    )
    ik = DifferentialInverseKinematics(
        tree_from_plant(plant, [frame]),
        [task],
        config,
        limits=JointLimits(
            lower=np.array(limits.position_lower),
            upper=np.array(limits.position_upper),
            velocity=speed,
            acceleration=np.array(limits.acceleration),
        ),
        default_position=arm.q0,
        names=["hand"],
    )
    builder = DiagramBuilder()
    builder.AddNamedSystem("differential_ik", ik)
    builder.ExportInput(ik.GetInputPort("hand.pose"), "X_AE_desired")
    builder.ExportInput(ik.GetInputPort("estimated_state"), "robot_state")
    builder.ExportOutput(ik.GetOutputPort("position"), "joint_positions")
    return builder.Build()


def _joints_about_y(plant: MultibodyPlant, q: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which joints turn about an axis parallel to y of the world at q."""
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    turning = np.zeros(plant.num_velocities(), bool)
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if isinstance(joint, RevoluteJoint):
            R_WF = joint.frame_on_parent().CalcPoseInWorld(context).rotation()
            axis_W = R_WF.multiply(joint.revolute_axis())
            turning[joint.velocity_start()] = abs(axis_W[1]) > 1 - 1e-4
    return turning


def _pose_source(arm: Arm, meshcat: Meshcat, gamepad: Callable[[], Gamepad]) -> SliderSource:
    X_WE = arm.start_pose()
    roll, pitch, yaw = RollPitchYaw(X_WE.rotation()).vector()
    x, y, z = X_WE.translation()
    knobs = [
        _angle("roll", roll, "KeyJ", "KeyL", buttons=(14, 15)),
        _angle("pitch", pitch, "KeyK", "KeyI", buttons=(13, 12)),
        _angle("yaw", yaw, "KeyU", "KeyO", axis=(2, -1.0)),
        _length("x", x, "KeyS", "KeyW", axis=(1, -1.0)),
        _length("y", y, "KeyD", "KeyA", axis=(0, -1.0)),
        _length("z", z, "KeyQ", "KeyE", axis=(3, -1.0)),
    ]
    return SliderSource(
        meshcat,
        knobs,
        pose_of=lambda v: RigidTransform(RollPitchYaw(v[:3]), v[3:]),
        gamepad=gamepad,
    )


def _planar_source(arm: Arm, meshcat: Meshcat, gamepad: Callable[[], Gamepad]) -> SliderSource:
    x, y, z = arm.start_pose().translation()
    knobs = [
        _angle("tilt", 0.0, "KeyD", "KeyA", axis=(2, 1.0)),
        _length("x", x, "KeyS", "KeyW", axis=(1, -1.0)),
        _length("z", z, "KeyQ", "KeyE", axis=(3, -1.0)),
    ]
    return SliderSource(
        meshcat,
        knobs,
        pose_of=lambda v: RigidTransform(
            RotationMatrix.MakeYRotation(v[0]), np.array([v[1], y, v[2]])
        ),
        gamepad=gamepad,
    )


def _joint_source(arm: Arm, meshcat: Meshcat, gamepad: Callable[[], Gamepad]) -> SliderSource:
    joints = joint_sliders(arm.plant, arm.q0)
    speeds = _SPEED_SHARE * _finite(arm.plant.GetVelocityUpperLimits(), 1.0)
    knobs = []
    for i, (joint, slider) in enumerate(joints):
        less, more = _JOINT_KEYS[i] if i < len(_JOINT_KEYS) else ("", "")
        slider = replace(
            slider,
            name=joint.name(),
            step=_ANGULAR_STEP,
            decrease=f"Key{less}" if less else "",
            increase=f"Digit{more}" if more else "",
        )
        knobs.append(Knob(slider, float(speeds[joint.velocity_start()])))
    return SliderSource(meshcat, knobs, gamepad=gamepad)


def _hand_source(width: float, meshcat: Meshcat, gamepad: Callable[[], Gamepad]) -> SliderSource:
    slider = Slider("opening", 0.0, _MAX_WIDTH, _WIDTH_STEP, width, "KeyN", "KeyM")
    return SliderSource(meshcat, [Knob(slider, _WIDTH_SPEED, buttons=(0, 1))], gamepad=gamepad)


def _angle(name: str, value: float, decrease: str, increase: str, **pad: Any) -> Knob:
    slider = Slider(name, -np.pi, np.pi, _ANGULAR_STEP, value, decrease, increase)
    return Knob(slider, _ANGULAR_SPEED, **pad)


def _length(name: str, value: float, decrease: str, increase: str, **pad: Any) -> Knob:
    # An arm reaches about a metre: no place that it can reach is more than two from here.
    slider = Slider(name, value - 1.0, value + 1.0, _LINEAR_STEP, value, decrease, increase)
    return Knob(slider, _LINEAR_SPEED, **pad)


def _smoothing(q0: NDArray[np.float64]) -> LinearSystem:
    """A critically damped second-order low-pass filter at the command rate that starts at q0.

    A step of speed v comes out with an acceleration of at most v / (e tau), so that the guard
    in the station seldom has to step in.
    """
    n, keep = len(q0), np.exp(-COMMAND_PERIOD / _SMOOTHING)
    new = 1 - keep
    eye = np.eye(n)
    system = LinearSystem(
        A=np.kron([[keep, 0.0], [new * keep, keep]], eye),
        B=np.kron([[new], [new**2]], eye),
        C=np.kron([[0.0, 1.0]], eye),
        D=np.zeros((n, n)),
        time_period=COMMAND_PERIOD,
    )
    system.configure_default_state(np.concatenate([q0, q0]))
    return system


def _measured(station: Diagram, port: str) -> NDArray[np.float64]:
    return station.GetOutputPort(port).Eval(station.CreateDefaultContext())


def _finite(values: NDArray[np.float64], otherwise: float) -> NDArray[np.float64]:
    return np.where(np.isfinite(values), values, otherwise)
