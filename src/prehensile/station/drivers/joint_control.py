"""Drivers for any robot in simulation: PID, inverse dynamics with PID, and joint stiffness.

All hold commanded joint positions, by the controllers of
:mod:`prehensile.control.joint_controller`; inverse dynamics and stiffness read scenarios written
for the drivers of the same names elsewhere. Their ports are those of an arm, with a value for each
joint that has an actuator: ``MODEL.position``, ``MODEL.feedforward_torque`` (not with inverse
dynamics), ``MODEL.position_measured``, ``MODEL.velocity_estimated``, ``MODEL.position_commanded``,
``MODEL.state_estimated``. Joints without one, such as those of a linkage, follow as they must; only
inverse dynamics does not drive such models.
"""

import dataclasses as dc
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint
from pydrake.systems.primitives import (
    Demultiplexer,
    SharedPointerSystem,
    StateInterpolatorWithDiscreteDerivative,
)

from prehensile.control.gains import JointGains, gains_for_bandwidth
from prehensile.control.inertia import joint_inertia, random_configurations
from prehensile.control.joint_controller import (
    ControllerKind,
    JointControllerConfig,
    actuators_of,
    add_joint_controller,
    controlled_joints,
)
from prehensile.station.drivers.site import Driver, Site
from prehensile.station.guard import COMMAND_PERIOD, GuardLimits
from prehensile.station.robot_plant import make_robot_plant

_POSTURES = 64  # at which the inertia is taken that gains for a bandwidth are made for


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
        gains: gains by actuator.
        hand_model_name: the hand on the arm. What is welded to the arm is accounted for in any
            case; a name given here is checked.
        bandwidth: rad/s (>= 0), for which joints whose actuators are not named get critically
            damped gains, see :func:`prehensile.control.gains.gains_for_bandwidth`; 0 gives them
            none, and they hang.
    """

    gains: Mapping[str, JointPdControllerGains] = dc.field(default_factory=dict)
    hand_model_name: str = ""
    bandwidth: float = 0


@dc.dataclass
class JointPidGains:
    """Gains of one joint of the PID driver.

    Attributes:
        kp: position gain, N m/rad or N/m (>= 0).
        ki: integral gain, N m/(rad s) or N/(m s) (>= 0).
        kd: velocity gain, N m s/rad or N s/m (>= 0).
    """

    kp: float = 0
    ki: float = 0
    kd: float = 0


@dc.dataclass
class JointPidDriver:
    """A PID controller for each joint by itself.

    Attributes:
        gains: gains by actuator (``MODEL_ACTUATOR`` where several models are driven as one).
        gravity_compensation: whether the robot's weight is held by a model of it.
        bandwidth: rad/s (>= 0), for which joints whose actuators are not named get critically
            damped gains; 0 gives them none.
        integral_rate: rad/s (>= 0), the pole of the integral in these gains; 0 for none.
    """

    gains: Mapping[str, JointPidGains] = dc.field(default_factory=dict)
    gravity_compensation: bool = True
    bandwidth: float = 20
    integral_rate: float = 0


def _check(site: Site) -> list[str]:
    """Checks the names of actuators and hand; returns the names as the gains' keys use them."""
    names = []
    for model, instance in zip(site.models, site.instances, strict=True):
        prefix = f"{model}_" if len(site.models) > 1 else ""
        names += [prefix + actuator.name() for actuator in actuators_of(site.plant, [instance])]
    for name in site.config.gains:
        if name not in names:
            known = ", ".join(names)
            site.fail(f"no actuator '{name}'", f"the model has {known}", f"gains.{name}")
    return names


def _joints(site: Site) -> list[Joint]:
    """The joints that are driven."""
    try:
        return controlled_joints(site.plant, site.instances)
    except ValueError as error:
        site.fail(str(error), "drive a model whose joints have actuators")


def _joint_limits(site: Site, joints: Sequence[Joint]) -> GuardLimits:
    """Limits of the driven joints in their order."""
    values: dict[str, list[float]] = {
        field.name: [] for field in dc.fields(GuardLimits) if field.name != "jump"
    }
    for joint in joints:
        every = site.plant.GetVelocitiesFromArray(
            joint.model_instance(), np.arange(site.plant.num_velocities())
        )
        limits = GuardLimits.of_plant(site.plant, joint.model_instance())
        place = every.tolist().index(joint.velocity_start())
        for name, numbers in values.items():
            numbers.append(getattr(limits, name)[place])
    joined: dict[str, Any] = {name: tuple(numbers) for name, numbers in values.items()}
    return GuardLimits(**joined)


def _add(site: Site, kind: ControllerKind, gains: JointGains, model: MultibodyPlant) -> None:
    """Adds controller, guard, and what makes a desired state of its positions; exports ports."""
    builder, joints = site.builder, _joints(site)
    n = len(joints)
    feedforward = kind != "inverse-dynamics"
    try:
        controller = add_joint_controller(
            builder,
            site.plant,
            site.instances,
            JointControllerConfig(gains, kind, feedforward=feedforward),
            controller_plant=model,
            name=site.name,
        )
    except ValueError as error:
        site.fail(str(error), "take another driver for this model")
    split = builder.AddNamedSystem(f"{site.name}.measured", Demultiplexer([n, n]))
    builder.Connect(controller.state, split.get_input_port())
    default = site.plant.GetDefaultPositions()
    guard = site.add_guard(
        _joint_limits(site, joints),
        split.get_output_port(0),
        effort="feedforward_torque" if feedforward else "",
        default_position=default[[joint.position_start() for joint in joints]],
    )
    if controller.feedforward is not None:
        builder.Connect(guard.effort, controller.feedforward)
    derivative = builder.AddNamedSystem(
        f"{site.name}.desired",
        StateInterpolatorWithDiscreteDerivative(n, COMMAND_PERIOD, suppress_initial_transient=True),
    )
    builder.Connect(guard.position, derivative.get_input_port())
    builder.Connect(derivative.get_output_port(), controller.desired_state)
    site.export_output(guard.position, "position_commanded")
    site.export_output(split.get_output_port(0), "position_measured")
    site.export_output(split.get_output_port(1), "velocity_estimated")
    site.export_output(controller.state, "state_estimated")


def _controller_plant(site: Site) -> MultibodyPlant:
    plant = make_robot_plant(site.scenario, site.models, frozen_children=True)
    site.builder.AddNamedSystem(f"{site.name}.controller_plant", SharedPointerSystem(plant))
    return plant


def _gains(site: Site, names: Sequence[str], given: Mapping[str, Any]) -> JointGains:
    """Gains in the order of the joints, from those given by actuator."""
    actuators = actuators_of(site.plant, site.instances)
    by_joint = {a.joint().index(): given[n] for a, n in zip(actuators, names, strict=True)}
    each = [by_joint[joint.index()] for joint in _joints(site)]
    return JointGains(*(np.array([getattr(g, k, 0.0) for g in each]) for k in ("kp", "kd", "ki")))


def _default_gains(
    site: Site, model: MultibodyPlant, names: Sequence[str], integral_rate: float = 0.0
) -> dict[str, JointPidGains]:
    """Gains by actuator for the bandwidth that is wanted, at the robot's greatest inertia."""
    if site.config.bandwidth == 0.0:
        return dict.fromkeys(names, JointPidGains())
    default = model.GetDefaultPositions()
    postures = np.vstack([default, random_configurations(model, _POSTURES)])
    largest = joint_inertia(model, postures).largest
    made = {}
    for actuator, name in zip(actuators_of(site.plant, site.instances), names, strict=True):
        instance = site.plant.GetModelInstanceName(actuator.model_instance())
        joint = model.GetJointByName(
            actuator.joint().name(), model.GetModelInstanceByName(instance)
        )
        gains = gains_for_bandwidth(
            largest[joint.velocity_start()], site.config.bandwidth, integral_rate=integral_rate
        )
        made[name] = JointPidGains(kp=gains.kp[0], ki=gains.ki[0], kd=gains.kd[0])
    return made


def _simulate_inverse_dynamics(site: Site) -> None:
    site.check_joints()
    names = _check(site)
    default = dict.fromkeys(names, JointPidControllerGains())
    gains = _gains(site, names, {**default, **site.config.gains})
    _add(site, "inverse-dynamics", gains, _controller_plant(site))


def _simulate_stiffness(site: Site) -> None:
    names = _check(site)
    hand = site.config.hand_model_name
    if hand and not site.plant.HasModelInstanceNamed(hand):
        site.fail(f"no model '{hand}'", "name the hand's model, or leave it out", "hand_model_name")
    model = _controller_plant(site)
    gains = {**_default_gains(site, model, names), **site.config.gains}
    _add(site, "stiffness", _gains(site, names, gains), model)


def _simulate_pid(site: Site) -> None:
    names = _check(site)
    model = _controller_plant(site)
    default = _default_gains(site, model, names, site.config.integral_rate)
    gains = _gains(site, names, {**default, **site.config.gains})
    _add(site, "gravity-compensation" if site.config.gravity_compensation else "pid", gains, model)


INVERSE_DYNAMICS = Driver(InverseDynamicsDriver, _simulate_inverse_dynamics)
JOINT_STIFFNESS = Driver(JointStiffnessDriver, _simulate_stiffness)
JOINT_PID = Driver(JointPidDriver, _simulate_pid)
