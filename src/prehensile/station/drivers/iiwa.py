"""The KUKA LBR iiwa: joint positions with feed-forward torque, at 200 Hz.

The arm may have fewer joints than the real one has, as that of an exercise in a plane.
"""

from copy import copy

import numpy as np
from drake import lcmt_iiwa_command, lcmt_iiwa_status
from pydrake.manipulation import (
    IiwaCommandSender,
    IiwaControlMode,
    IiwaDriver,
    IiwaStatusReceiver,
    ParseIiwaControlMode,
    SimIiwaDriver,
    kIiwaArmNumJoints,
    position_enabled,
    torque_enabled,
)
from pydrake.systems.framework import OutputPort
from pydrake.systems.lcm import LcmPublisherSystem, LcmSubscriberSystem
from pydrake.systems.primitives import Gain, Multiplexer, SharedPointerSystem

from prehensile.station.drivers.site import Driver, GuardPorts, Site
from prehensile.station.guard import COMMAND_PERIOD, GuardLimits
from prehensile.station.robot_plant import make_robot_plant

_TORQUE_PERIOD = 0.001  # s; the driver takes commands at 1 kHz if they are torques alone
_POSITION_GAIN = 1500.0  # 1/s^2, where the arm has not seven joints and Drake no gains for it
_STATUS_TIMEOUT = 10.0  # s to wait for the first status message

_MEASUREMENTS = (
    "position_commanded",
    "position_measured",
    "velocity_estimated",
    "torque_commanded",
    "torque_measured",
    "torque_external",
)


def _check(site: Site) -> IiwaControlMode:
    """Checks the configuration against the model; returns its control mode."""
    site.check_joints()
    config: IiwaDriver = site.config
    hand = config.hand_model_name
    if hand and not site.plant.HasModelInstanceNamed(hand):
        site.fail(f"no model '{hand}'", "name the hand's model, or leave it out", "hand_model_name")
    try:
        mode = ParseIiwaControlMode(config.control_mode)
    except RuntimeError:
        site.fail(
            f"unknown control mode '{config.control_mode}'",
            "use position_and_torque, position_only or torque_only",
            "control_mode",
        )
    if config.desired_kp_gains is not None and not position_enabled(mode):
        site.fail("torque_only has no position gains", "leave them out", "desired_kp_gains")
    n = site.plant.num_positions(site.instance)
    if config.desired_kp_gains is not None and len(config.desired_kp_gains) != n:
        message = f"{len(config.desired_kp_gains)} gains stand where {n} joints move"
        site.fail(message, "give each joint one", "desired_kp_gains")
    return mode


def _add_guard(site: Site, mode: IiwaControlMode, measured: OutputPort) -> GuardPorts:
    return site.add_guard(
        GuardLimits.of_plant(site.plant, site.instance),
        measured,
        effort="feedforward_torque" if torque_enabled(mode) else "",
        position=position_enabled(mode),
        period=COMMAND_PERIOD if position_enabled(mode) else _TORQUE_PERIOD,
        default_position=site.plant.GetDefaultPositions(site.instance),
    )


def _simulate(site: Site) -> None:
    mode = _check(site)
    builder, config = site.builder, copy(site.config)
    n = site.plant.num_positions(site.instance)
    if position_enabled(mode) and config.desired_kp_gains is None and n != kIiwaArmNumJoints:
        config.desired_kp_gains = np.full(n, _POSITION_GAIN)
    # The arm's own model of itself: whatever is bolted to it counts as one rigid piece.
    controller_plant = make_robot_plant(site.scenario, [site.name], frozen_children=True)
    if controller_plant.num_positions() != n:
        site.fail(
            "the model stands on joints of another", "drive an arm that is fixed to the world"
        )
    builder.AddNamedSystem(f"{site.name}.controller_plant", SharedPointerSystem(controller_plant))
    driver = SimIiwaDriver.AddToBuilder(
        builder=builder,
        plant=site.plant,
        iiwa_instance=site.instance,
        driver_config=config,
        controller_plant=controller_plant,
    )
    driver.set_name(f"{site.name}.driver")
    guard = _add_guard(site, mode, driver.GetOutputPort("position_measured"))
    if position_enabled(mode):
        builder.Connect(guard.position, driver.GetInputPort("position"))
    if torque_enabled(mode):
        builder.Connect(guard.effort, driver.GetInputPort("torque"))
    for name in (*_MEASUREMENTS, "state_estimated"):
        site.export_output(driver.GetOutputPort(name), name)


def _connect(site: Site) -> tuple[OutputPort, np.ndarray]:
    mode = _check(site)
    builder, name = site.builder, site.name
    n = site.plant.num_positions(site.instance)
    receiver = builder.AddNamedSystem(f"{name}.status_receiver", IiwaStatusReceiver(n))
    subscriber = builder.AddNamedSystem(
        f"{name}.status_subscriber",
        LcmSubscriberSystem.Make(
            channel="IIWA_STATUS",
            lcm_type=lcmt_iiwa_status,
            lcm=site.lcm,
            use_cpp_serializer=True,
            wait_for_message_on_initialization_timeout=_STATUS_TIMEOUT,
        ),
    )
    builder.Connect(subscriber.get_output_port(), receiver.get_input_port())
    measured = receiver.get_position_measured_output_port()
    guard = _add_guard(site, mode, measured)

    sender = builder.AddNamedSystem(f"{name}.command_sender", IiwaCommandSender(n, mode))
    publisher = builder.AddNamedSystem(
        f"{name}.command_publisher",
        LcmPublisherSystem.Make(
            channel="IIWA_COMMAND",
            lcm_type=lcmt_iiwa_command,
            lcm=site.lcm,
            publish_period=COMMAND_PERIOD if position_enabled(mode) else _TORQUE_PERIOD,
            use_cpp_serializer=True,
        ),
    )
    builder.Connect(sender.get_output_port(), publisher.get_input_port())
    if position_enabled(mode):
        builder.Connect(guard.position, sender.get_position_input_port())
    if torque_enabled(mode):
        builder.Connect(guard.effort, sender.get_torque_input_port())

    for port_name in _MEASUREMENTS:
        port = receiver.GetOutputPort(port_name)
        if port_name in ("torque_commanded", "torque_measured"):
            # The messages carry these two with the opposite sign.
            negate = builder.AddSystem(Gain(-1.0, n))
            builder.Connect(port, negate.get_input_port())
            port = negate.get_output_port()
        site.export_output(port, port_name)
    state = builder.AddSystem(Multiplexer([n, n]))
    builder.Connect(measured, state.get_input_port(0))
    builder.Connect(receiver.get_velocity_estimated_output_port(), state.get_input_port(1))
    site.export_output(state.get_output_port(0), "state_estimated")
    return measured, np.eye(n)


DRIVER = Driver(IiwaDriver, _simulate, _connect)
