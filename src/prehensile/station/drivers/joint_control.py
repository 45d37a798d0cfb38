"""Two drivers for any robot in simulation: inverse dynamics with PID, and joint stiffness.

Both hold commanded joint positions against gravity, and read scenarios written for the drivers of
the same names elsewhere. Their ports are those of an arm: ``MODEL.position``,
``MODEL.feedforward_torque`` (stiffness only), ``MODEL.position_measured``,
``MODEL.velocity_estimated``, ``MODEL.position_commanded``, ``MODEL.state_estimated``.
"""

import dataclasses as dc
from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.multibody.tree import PdControllerGains
from pydrake.systems.controllers import InverseDynamics, InverseDynamicsController
from pydrake.systems.framework import InputPort, OutputPort
from pydrake.systems.primitives import (
    Adder,
    Demultiplexer,
    MatrixGain,
    Multiplexer,
    SharedPointerSystem,
    StateInterpolatorWithDiscreteDerivative,
)

from prehensile.station.drivers.site import Driver, GuardPorts, Site
from prehensile.station.guard import COMMAND_PERIOD, GuardLimits
from prehensile.station.robot_plant import make_robot_plant


@dc.dataclass
class JointPidControllerGains:
    """Gains of one joint of the inverse-dynamics driver.

    Attributes:
        kp: position gain, 1/s^2 (>= 0).
        ki: integral gain, 1/s^3 (>= 0).
        kd: velocity gain, 1/s (>= 0).
    """

    kp: float = 100
    ki: float = 1
    kd: float = 20


@dc.dataclass
class InverseDynamicsDriver:
    """Inverse dynamics with a PID controller.

    Attributes:
        gains: gains by actuator (``MODEL_ACTUATOR`` where several models are driven as one);
            actuators not named get the default ones.
    """

    gains: Mapping[str, JointPidControllerGains] = dc.field(default_factory=dict)


@dc.dataclass
class JointPdControllerGains:
    """Gains of one joint of the stiffness driver.

    Attributes:
        kp: stiffness, N m/rad or N/m (>= 0).
        kd: damping, N m s/rad or N s/m (>= 0).
    """

    kp: float = 0
    kd: float = 0


@dc.dataclass
class JointStiffnessDriver:
    """Springs and dampers at the joints, with gravity compensated.

    Attributes:
        gains: gains by actuator; joints of actuators not named have none and hang.
        hand_model_name: the hand on the arm. What is welded to the arm is accounted for in any
            case; a name given here is checked.
    """

    gains: Mapping[str, JointPdControllerGains] = dc.field(default_factory=dict)
    hand_model_name: str = ""


def _actuator_names(site: Site) -> list[str]:
    """Names of the driven actuators as the gains' keys use them, checked against the keys."""
    names = []
    for model, instance in zip(site.models, site.instances, strict=True):
        prefix = f"{model}_" if len(site.models) > 1 else ""
        # Before the plant is finalized it lists actuators for all models together only.
        every = (site.plant.get_joint_actuator(i) for i in site.plant.GetJointActuatorIndices())
        names += [prefix + a.name() for a in every if a.model_instance() == instance]
    for name in site.config.gains:
        if name not in names:
            known = ", ".join(names)
            site.fail(f"no actuator '{name}'", f"the model has {known}", f"gains.{name}")
    return names


def _joint_limits(site: Site) -> GuardLimits:
    """Limits of all driven models' joints, one model after the other."""
    each = [GuardLimits.of_plant(site.plant, instance) for instance in site.instances]

    def joined(name: str) -> tuple[float, ...]:
        return tuple(value for limits in each for value in getattr(limits, name))

    return GuardLimits(
        position_lower=joined("position_lower"),
        position_upper=joined("position_upper"),
        velocity=joined("velocity"),
        acceleration=joined("acceleration"),
        effort_lower=joined("effort_lower"),
        effort_upper=joined("effort_upper"),
        effort_default=joined("effort_default"),
    )


def _joined_state(site: Site) -> OutputPort:
    """The state [q, v] of all driven models, one model after the other in q and in v."""
    ports = [site.plant.get_state_output_port(instance) for instance in site.instances]
    if len(ports) == 1:
        return ports[0]
    sizes = [port.size() // 2 for port in ports]
    n = sum(sizes)
    # From (q1, v1, q2, v2, ...) to (q1, q2, ..., v1, v2, ...).
    order = np.zeros((2 * n, 2 * n))
    q_row, column = 0, 0
    for size in sizes:
        for i in range(size):
            order[q_row + i, column + i] = 1.0
            order[n + q_row + i, column + size + i] = 1.0
        q_row, column = q_row + size, column + 2 * size
    mux = site.builder.AddNamedSystem(f"{site.name}.states", Multiplexer([2 * s for s in sizes]))
    for i, port in enumerate(ports):
        site.builder.Connect(port, mux.get_input_port(i))
    gain = site.builder.AddNamedSystem(f"{site.name}.state", MatrixGain(order))
    site.builder.Connect(mux.get_output_port(0), gain.get_input_port())
    return gain.get_output_port()


def _connect_actuation(site: Site, effort: OutputPort) -> None:
    """Gives each driven model its part of the efforts."""
    sizes = [site.plant.num_actuators(instance) for instance in site.instances]
    split = site.builder.AddNamedSystem(f"{site.name}.efforts", Demultiplexer(sizes))
    site.builder.Connect(effort, split.get_input_port())
    for i, instance in enumerate(site.instances):
        site.builder.Connect(
            split.get_output_port(i), site.plant.get_actuation_input_port(instance)
        )


def _command(
    site: Site, state: OutputPort, desired_state: InputPort, *, effort: bool
) -> GuardPorts:
    """Adds the guard and what makes a desired state of its positions; exports the ports."""
    limits = _joint_limits(site)
    n = limits.size
    builder = site.builder
    split = builder.AddNamedSystem(f"{site.name}.measured", Demultiplexer([n, n]))
    builder.Connect(state, split.get_input_port())
    defaults = [site.plant.GetDefaultPositions(instance) for instance in site.instances]
    guard = site.add_guard(
        limits,
        split.get_output_port(0),
        effort="feedforward_torque" if effort else "",
        default_position=np.concatenate(defaults),
    )
    derivative = builder.AddNamedSystem(
        f"{site.name}.desired",
        StateInterpolatorWithDiscreteDerivative(n, COMMAND_PERIOD, suppress_initial_transient=True),
    )
    builder.Connect(guard.position, derivative.get_input_port())
    builder.Connect(derivative.get_output_port(), desired_state)
    site.export_output(guard.position, "position_commanded")
    site.export_output(split.get_output_port(0), "position_measured")
    site.export_output(split.get_output_port(1), "velocity_estimated")
    site.export_output(state, "state_estimated")
    return guard


def _controller_plant(site: Site) -> Any:
    plant = make_robot_plant(site.scenario, site.models, frozen_children=True)
    site.builder.AddNamedSystem(f"{site.name}.controller_plant", SharedPointerSystem(plant))
    return plant


def _simulate_inverse_dynamics(site: Site) -> None:
    site.check_joints()
    names = _actuator_names(site)
    plant = _controller_plant(site)
    default = JointPidControllerGains()
    gains = [site.config.gains.get(name, default) for name in names]
    controller = site.builder.AddNamedSystem(
        f"{site.name}.controller",
        InverseDynamicsController(
            plant,
            kp=np.array([g.kp for g in gains]),
            ki=np.array([g.ki for g in gains]),
            kd=np.array([g.kd for g in gains]),
            has_reference_acceleration=False,
        ),
    )
    state = _joined_state(site)
    site.builder.Connect(state, controller.get_input_port_estimated_state())
    _connect_actuation(site, controller.get_output_port_control())
    _command(site, state, controller.get_input_port_desired_state(), effort=False)


def _prepare_stiffness(site: Site) -> None:
    _actuator_names(site)
    for name, gains in site.config.gains.items():
        actuator = site.plant.GetJointActuatorByName(name, site.instance)
        actuator.set_controller_gains(PdControllerGains(p=gains.kp, d=gains.kd))


def _simulate_stiffness(site: Site) -> None:
    site.check_joints()
    hand = site.config.hand_model_name
    if hand and not site.plant.HasModelInstanceNamed(hand):
        site.fail(f"no model '{hand}'", "name the hand's model, or leave it out", "hand_model_name")
    plant, builder = _controller_plant(site), site.builder
    gravity = builder.AddNamedSystem(
        f"{site.name}.gravity_compensation",
        InverseDynamics(plant, InverseDynamics.InverseDynamicsMode.kGravityCompensation),
    )
    state = _joined_state(site)
    builder.Connect(state, gravity.get_input_port_estimated_state())
    guard = _command(
        site, state, site.plant.get_desired_state_input_port(site.instance), effort=True
    )
    total = builder.AddNamedSystem(f"{site.name}.effort", Adder(2, plant.num_velocities()))
    builder.Connect(gravity.get_output_port_generalized_force(), total.get_input_port(0))
    builder.Connect(guard.effort, total.get_input_port(1))
    _connect_actuation(site, total.get_output_port())


INVERSE_DYNAMICS = Driver(InverseDynamicsDriver, _simulate_inverse_dynamics)
JOINT_STIFFNESS = Driver(JointStiffnessDriver, _simulate_stiffness, prepare=_prepare_stiffness)
