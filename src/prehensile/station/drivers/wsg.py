"""The Schunk WSG 50 hand: opening width with a force limit, at 20 Hz."""

import numpy as np
from drake import lcmt_schunk_wsg_command, lcmt_schunk_wsg_status
from pydrake.manipulation import (
    MakeMultibodyStateToWsgStateSystem,
    SchunkWsgCommandSender,
    SchunkWsgDriver,
    SchunkWsgPositionController,
    SchunkWsgStatusReceiver,
)
from pydrake.systems.framework import OutputPort
from pydrake.systems.lcm import LcmPublisherSystem, LcmSubscriberSystem

from prehensile.station.drivers.site import Driver, GuardPorts, Site
from prehensile.station.guard import GuardLimits

_PERIOD = 0.05  # s; the real driver takes no faster commands
_SPEED = 0.42  # m/s of the opening width (data sheet of the WSG 50)
_ACCELERATION = 5.0  # m/s^2 of the opening width (the same)
_MAX_FORCE = 80.0  # N (the same)
_DEFAULT_FORCE = 40.0  # N
# Stiffness and damping of the grip. With Drake's defaults (200 N/m) the force is 2 N on an object
# 1 cm wide; with these it is at the limit from 2 cm on, as the real hand grips.
_GRIP_STIFFNESS = 2000.0  # N/m
_GRIP_DAMPING = 10.0  # N s/m
# Inertia of motor and spindle as each finger feels it: what 80 N accelerate at a few m/s^2. Without
# it fingers of 50 g fly back and forth under sampled control.
_SPINDLE_MASS = 1.0  # kg, at most what the data sheet's force and acceleration give
_FINGERS = ("left_finger_sliding_joint", "right_finger_sliding_joint")
_STATUS_TIMEOUT = 10.0  # s to wait for the first status message


def _limits(site: Site) -> GuardLimits:
    """Limits of the opening width; the first finger's joint moves to negative positions."""
    site.check_joints(2)
    plant, instance = site.plant, site.instance
    for joint in _FINGERS:
        if not plant.HasJointNamed(joint, instance):
            site.fail(f"the model has no joint '{joint}'", "drive a model of the WSG 50")
    left, right = (plant.GetJointByName(joint, instance) for joint in _FINGERS)
    width = float(right.position_upper_limits()[0] - left.position_lower_limits()[0])
    return GuardLimits(
        position_lower=(0.0,),
        position_upper=(width,),
        velocity=(_SPEED,),
        acceleration=(_ACCELERATION,),
        effort_lower=(0.0,),
        effort_upper=(_MAX_FORCE,),
        effort_default=(_DEFAULT_FORCE,),
        jump=np.inf,  # fingers may be sent anywhere from anywhere
    )


def _add_guard(site: Site, state: OutputPort) -> GuardPorts:
    left, right = site.plant.GetDefaultPositions(site.instance)
    return site.add_guard(
        _limits(site),
        state,
        effort="force_limit",
        period=_PERIOD,
        default_position=np.array([right - left]),
    )


def _simulate(site: Site) -> None:
    _limits(site)
    builder, plant, instance = site.builder, site.plant, site.instance
    for index in plant.GetJointActuatorIndices(instance):
        actuator = plant.get_joint_actuator(index)
        actuator.set_default_gear_ratio(1.0)
        actuator.set_default_rotor_inertia(_SPINDLE_MASS)
    controller = builder.AddNamedSystem(
        f"{site.name}.controller",
        SchunkWsgPositionController(
            time_step=_PERIOD,
            kp_command=_GRIP_STIFFNESS,
            kd_command=_GRIP_DAMPING,
            default_force_limit=_DEFAULT_FORCE,
        ),
    )
    state = builder.AddNamedSystem(f"{site.name}.state", MakeMultibodyStateToWsgStateSystem())
    builder.Connect(plant.get_state_output_port(instance), controller.get_state_input_port())
    builder.Connect(plant.get_state_output_port(instance), state.get_input_port())
    builder.Connect(
        controller.get_generalized_force_output_port(), plant.get_actuation_input_port(instance)
    )
    guard = _add_guard(site, state.get_output_port())
    builder.Connect(guard.position, controller.get_desired_position_input_port())
    builder.Connect(guard.effort, controller.get_force_limit_input_port())
    site.export_output(state.get_output_port(), "state_measured")
    site.export_output(controller.get_grip_force_output_port(), "force_measured")


def _connect(site: Site) -> tuple[OutputPort, np.ndarray]:
    _limits(site)
    builder, name = site.builder, site.name
    receiver = builder.AddNamedSystem(f"{name}.status_receiver", SchunkWsgStatusReceiver())
    subscriber = builder.AddNamedSystem(
        f"{name}.status_subscriber",
        LcmSubscriberSystem.Make(
            channel="SCHUNK_WSG_STATUS",
            lcm_type=lcmt_schunk_wsg_status,
            lcm=site.lcm,
            use_cpp_serializer=True,
            wait_for_message_on_initialization_timeout=_STATUS_TIMEOUT,
        ),
    )
    builder.Connect(subscriber.get_output_port(), receiver.get_status_input_port())
    state = receiver.get_state_output_port()
    guard = _add_guard(site, state)
    sender = builder.AddNamedSystem(
        f"{name}.command_sender", SchunkWsgCommandSender(default_force_limit=_DEFAULT_FORCE)
    )
    publisher = builder.AddNamedSystem(
        f"{name}.command_publisher",
        LcmPublisherSystem.Make(
            channel="SCHUNK_WSG_COMMAND",
            lcm_type=lcmt_schunk_wsg_command,
            lcm=site.lcm,
            publish_period=_PERIOD,
            use_cpp_serializer=True,
        ),
    )
    builder.Connect(guard.position, sender.get_position_input_port())
    builder.Connect(guard.effort, sender.get_force_limit_input_port())
    builder.Connect(sender.get_command_output_port(), publisher.get_input_port())
    site.export_output(state, "state_measured")
    site.export_output(receiver.get_force_output_port(), "force_measured")
    # Width and rate to the positions of the two fingers.
    return state, np.array([[-0.5, 0.0], [0.5, 0.0]])


DRIVER = Driver(SchunkWsgDriver, _simulate, _connect)
