"""One of Drake's joint controllers on a robot in a diagram, whatever robot it is.

::

    desired state [q_d, v_d] ──►┌────────────┐
                                │ controller ├──► actuation of the plant
    state [q, v] of the plant ─►└────────────┘

The kinds of controllers:

- ``pid``: τ = kp (q_d - q) + kd (v_d - v) + ki ∫(q_d - q). It knows nothing of the robot.
- ``gravity-compensation``: the same plus the torques that hold the robot's weight. With ki = 0 that
  is Drake's ``JointStiffnessController``.
- ``inverse-dynamics``: τ = M(q) (kp (q_d - q) + kd (v_d - v) + ki ∫(q_d - q)) + C(q, v) v - τ_g(q),
  also called computed torque; the gains make accelerations, 1/s^2, 1/s, 1/s^3.
- ``stiffness``: gravity compensation, and springs kp and dampers kd that are part of the plant,
  which solves them implicitly together with contact: stable at any gain, also on a finger of a few
  grams where a sampled controller is not. The plant must be discrete.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Joint, JointActuator, ModelInstanceIndex, PdControllerGains
from pydrake.systems.controllers import (
    InverseDynamics,
    InverseDynamicsController,
    PidController,
)
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort
from pydrake.systems.primitives import Adder, MatrixGain

from prehensile.control.gains import JointGains

ControllerKind = Literal["pid", "gravity-compensation", "inverse-dynamics", "stiffness"]
CONTROLLER_KINDS: tuple[ControllerKind, ...] = get_args(ControllerKind)
"""The kinds of controllers, as in the list above."""


@dataclass(frozen=True)
class JointControllerConfig:
    """A joint controller.

    Attributes:
        gains: of the n controlled joints in the order of :func:`controlled_joints`.
        kind: one of :data:`CONTROLLER_KINDS`.
        feedforward: whether there is a port for n efforts that are added.
    """

    gains: JointGains
    kind: ControllerKind = "gravity-compensation"
    feedforward: bool = False

    def __post_init__(self) -> None:
        if self.kind not in CONTROLLER_KINDS:
            raise ValueError(f"kind: '{self.kind}' is none of {', '.join(CONTROLLER_KINDS)}")
        if self.kind == "stiffness" and self.gains.ki.any():
            raise ValueError("gains: stiffness has no integral, ki must be 0")
        if self.kind == "inverse-dynamics" and self.feedforward:
            raise ValueError("feedforward: inverse dynamics has no such port")


@dataclass(frozen=True)
class JointControllerPorts:
    """Where a joint controller is connected; n controlled joints in their order.

    Attributes:
        desired_state: input for [q_d, v_d] (2n), to be connected.
        state: output with the joints' [q, v] (2n) as the controller sees them.
        feedforward: input for n efforts to be added, to be connected; None if not asked for.
    """

    desired_state: InputPort
    state: OutputPort
    feedforward: InputPort | None = None


def actuators_of(
    plant: MultibodyPlant, instances: Sequence[ModelInstanceIndex]
) -> list[JointActuator]:
    """The actuators of models of a finalized plant, in the order of their actuation ports."""
    return [
        plant.get_joint_actuator(index)
        for instance in instances
        for index in plant.GetJointActuatorIndices(instance)
    ]


def controlled_joints(
    plant: MultibodyPlant, instances: Sequence[ModelInstanceIndex]
) -> list[Joint]:
    """The joints with an actuator of models, one model after the other, each in its state's order.

    Args:
        plant: a finalized plant.
        instances: the models.

    Raises:
        ValueError: the plant is not finalized, there is none, or one has more than one degree of
            freedom.
    """
    if not plant.is_finalized():
        raise ValueError("plant: must be finalized")
    joints = []
    for instance in instances:
        own = [actuator.joint() for actuator in actuators_of(plant, [instance])]
        joints += sorted(own, key=lambda joint: joint.position_start())
    odd = [joint.name() for joint in joints if joint.num_velocities() != 1]
    if not joints or odd:
        said = f"{', '.join(odd)} have not one degree of freedom" if odd else "no joint is driven"
        raise ValueError(f"instances: {said}")
    return joints


def add_joint_controller(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    instances: Sequence[ModelInstanceIndex],
    config: JointControllerConfig,
    *,
    controller_plant: MultibodyPlant | None = None,
    name: str = "joint",
) -> JointControllerPorts:
    """Puts a controller on models of a plant and connects it to their state and actuation.

    Args:
        builder: the diagram, which holds the plant.
        plant: the plant, finalized.
        instances: the models, controlled as one robot.
        config: the controller.
        controller_plant: what the controller knows of the robot: a finalized plant with the
            controlled joints under their names, and nothing else that moves but joints that
            ``plant`` has, too. It must outlive the diagram (a ``SharedPointerSystem`` in the
            diagram sees to that). Default: ``plant`` itself, where nothing else moves.
        name: first part of the names of the systems added.

    Returns:
        The ports that are left to be connected.

    Raises:
        ValueError: the robot has joints that such a controller cannot move, gains of another
            number of joints, or no model of the robot without other things was given.
    """
    joints = controlled_joints(plant, instances)
    n = len(joints)
    if config.gains.size != n:
        raise ValueError(f"config: gains of {config.gains.size} joints where {n} are controlled")
    wire = _Wiring(builder, plant, joints, name)
    state = wire.state(plant, joints, "state")
    if config.kind == "pid":
        desired, effort = wire.pid(config.gains, state)
    else:
        model = controller_plant or plant
        every = _moving_joints(model)
        if controller_plant is None and {j.model_instance() for j in every} - set(instances):
            raise ValueError("controller_plant: give one, other things move in this plant")
        if config.kind == "inverse-dynamics":
            desired, effort = wire.inverse_dynamics(config.gains, model, every)
        else:
            effort = wire.gravity_compensation(model, every)
            if config.kind == "stiffness":
                desired = wire.springs(config.gains)
            else:
                desired, feedback = wire.pid(config.gains, state)
                effort = wire.sum(effort, feedback, "effort")
    feedforward = None
    if config.feedforward:
        total = builder.AddNamedSystem(f"{name}.total_effort", Adder(2, n))
        builder.Connect(effort, total.get_input_port(0))
        feedforward, effort = total.get_input_port(1), total.get_output_port()
    wire.actuation(instances, effort)
    return JointControllerPorts(desired, state, feedforward)


class _Wiring:
    """Adds the parts of a controller of ``joints`` to a diagram."""

    def __init__(
        self, builder: DiagramBuilder, plant: MultibodyPlant, joints: list[Joint], name: str
    ) -> None:
        self.builder, self.plant, self.joints, self.name = builder, plant, joints, name

    def state(self, plant: MultibodyPlant, joints: list[Joint], name: str) -> OutputPort:
        """The simulated state [q, v] of joints, which may be another plant's of equal names."""
        own = [_counterpart(self.plant, plant, joint) for joint in joints]
        instances = {joint.model_instance() for joint in own}
        nq, nv = self.plant.num_positions(), self.plant.num_velocities()
        q, v = np.arange(nq), np.arange(nv)
        port = self.plant.get_state_output_port()
        if len(instances) == 1:  # its own port does not change when other things move
            (instance,) = instances
            q = self.plant.GetPositionsFromArray(instance, q).astype(int)
            v = self.plant.GetVelocitiesFromArray(instance, v).astype(int)
            port = self.plant.get_state_output_port(instance)
        selection = np.zeros((2 * len(own), len(q) + len(v)))
        for i, joint in enumerate(own):
            selection[i, q.tolist().index(joint.position_start())] = 1.0
            column = len(q) + v.tolist().index(joint.velocity_start())
            selection[len(own) + i, column] = 1.0
        return self.through(port, selection, name)

    def through(self, port: OutputPort, matrix: NDArray[np.floating], name: str) -> OutputPort:
        """A port multiplied by a matrix; the port itself if that changes nothing."""
        if matrix.shape[0] == matrix.shape[1] and np.array_equal(matrix, np.eye(len(matrix))):
            return port
        gain = self.builder.AddNamedSystem(f"{self.name}.{name}", MatrixGain(matrix))
        self.builder.Connect(port, gain.get_input_port())
        return gain.get_output_port()

    def before(self, port: InputPort, matrix: NDArray[np.floating], name: str) -> InputPort:
        """An input port whose value reaches ``port`` multiplied by a matrix."""
        if np.array_equal(matrix, np.eye(len(matrix))):
            return port
        gain = self.builder.AddNamedSystem(f"{self.name}.{name}", MatrixGain(matrix))
        self.builder.Connect(gain.get_output_port(), port)
        return gain.get_input_port()

    def sum(self, a: OutputPort, b: OutputPort, name: str) -> OutputPort:
        """The sum of two ports."""
        adder = self.builder.AddNamedSystem(f"{self.name}.{name}", Adder(2, a.size()))
        self.builder.Connect(a, adder.get_input_port(0))
        self.builder.Connect(b, adder.get_input_port(1))
        return adder.get_output_port()

    def pid(self, gains: JointGains, state: OutputPort) -> tuple[InputPort, OutputPort]:
        """A PID controller."""
        pid = self.builder.AddNamedSystem(
            f"{self.name}.controller", PidController(gains.kp, gains.ki, gains.kd)
        )
        self.builder.Connect(state, pid.get_input_port_estimated_state())
        return pid.get_input_port_desired_state(), pid.get_output_port_control()

    def gravity_compensation(self, model: MultibodyPlant, every: list[Joint]) -> OutputPort:
        """Efforts at the controlled joints that hold the weight of the robot."""
        gravity = self.builder.AddNamedSystem(
            f"{self.name}.gravity_compensation",
            InverseDynamics(model, InverseDynamics.InverseDynamicsMode.kGravityCompensation),
        )
        state = self.state(model, every, "model_state")
        self.builder.Connect(state, gravity.get_input_port_estimated_state())
        selection = _selection(self.joints, every)
        return self.through(
            gravity.get_output_port_generalized_force(), selection, "gravity_effort"
        )

    def springs(self, gains: JointGains) -> InputPort:
        """Gives the plant's own springs and dampers their gains."""
        by_joint = {joint.index(): i for i, joint in enumerate(self.joints)}
        instances = list(dict.fromkeys(joint.model_instance() for joint in self.joints))
        actuators = actuators_of(self.plant, instances)
        if self.plant.time_step() == 0.0:
            raise ValueError("plant: stiffness needs a discrete one")
        if len(instances) != 1:
            raise ValueError("instances: stiffness is for one model at a time")
        for actuator in actuators:
            i = by_joint[actuator.joint().index()]
            own = self.plant.get_mutable_joint_actuator(actuator.index())
            own.set_controller_gains(PdControllerGains(p=gains.kp[i], d=gains.kd[i]))
        order = _selection([actuator.joint() for actuator in actuators], self.joints)
        port = self.plant.get_desired_state_input_port(instances[0])
        return self.before(port, np.kron(np.eye(2), order), "desired_order")

    def inverse_dynamics(
        self, gains: JointGains, model: MultibodyPlant, every: list[Joint]
    ) -> tuple[InputPort, OutputPort]:
        """Drake's controller on the robot's model, whose joints may have another order."""
        if len(every) != len(self.joints):
            raise ValueError("instances: inverse dynamics needs an actuator at every joint")
        order = _selection(every, self.joints)  # from controlled joints to the model's
        controller = self.builder.AddNamedSystem(
            f"{self.name}.controller",
            InverseDynamicsController(
                model,
                kp=order @ gains.kp,
                ki=order @ gains.ki,
                kd=order @ gains.kd,
                has_reference_acceleration=False,
            ),
        )
        state = self.state(model, every, "model_state")
        self.builder.Connect(state, controller.get_input_port_estimated_state())
        desired = self.before(
            controller.get_input_port_desired_state(), np.kron(np.eye(2), order), "desired_order"
        )
        # Its output is in the order of the model's actuators.
        driven = [
            model.get_joint_actuator(index).joint() for index in model.GetJointActuatorIndices()
        ]
        effort = controller.get_output_port_control()
        return desired, self.through(effort, _selection(self.joints, driven), "effort_order")

    def actuation(self, instances: Sequence[ModelInstanceIndex], effort: OutputPort) -> None:
        """Gives each model its part of the efforts."""
        for instance in instances:
            driven = [actuator.joint() for actuator in actuators_of(self.plant, [instance])]
            if driven:
                part = _selection(driven, self.joints)
                name = f"efforts_{self.plant.GetModelInstanceName(instance)}"
                port = self.plant.get_actuation_input_port(instance)
                self.builder.Connect(self.through(effort, part, name), port)


def _moving_joints(plant: MultibodyPlant) -> list[Joint]:
    """A plant's joints that move, in the order of its velocities."""
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    moving = [joint for joint in joints if joint.num_velocities() > 0]
    if any(joint.num_velocities() != 1 or joint.num_positions() != 1 for joint in moving):
        raise ValueError("controller_plant: every joint must have one degree of freedom")
    return sorted(moving, key=lambda joint: joint.velocity_start())


def _counterpart(plant: MultibodyPlant, other: MultibodyPlant, joint: Joint) -> Joint:
    """The joint of a plant with the model and name of another plant's joint."""
    model = other.GetModelInstanceName(joint.model_instance())
    if not plant.HasModelInstanceNamed(model):
        raise ValueError(f"controller_plant: the simulated plant has no model '{model}'")
    return plant.GetJointByName(joint.name(), plant.GetModelInstanceByName(model))


def _selection(wanted: Sequence[Joint], given: Sequence[Joint]) -> NDArray[np.float64]:
    """The (len(wanted), len(given)) matrix that picks values of joints, told apart by name."""

    def key(joint: Joint) -> tuple[str, str]:
        plant = joint.GetParentPlant()
        return plant.GetModelInstanceName(joint.model_instance()), joint.name()

    matrix = np.zeros((len(wanted), len(given)))
    place = {key(joint): column for column, joint in enumerate(given)}
    for row, joint in enumerate(wanted):
        if key(joint) not in place:
            raise ValueError(f"controller_plant: it has no joint '{joint.name()}'")
        matrix[row, place[key(joint)]] = 1.0
    return matrix
