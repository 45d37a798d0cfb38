"""Joint controllers on robots: each obeys its formula, holds and follows."""

import numpy as np
import pytest
from iiwa_plant import make_iiwa
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlantConfig
from pydrake.systems.analysis import Simulator
from pydrake.systems.controllers import JointStiffnessController
from pydrake.systems.framework import DiagramBuilder

from prehensile.control.gains import JointGains, gains_for_bandwidth, pid_torque
from prehensile.control.inertia import joint_inertia, random_configurations
from prehensile.control.joint_controller import (
    CONTROLLER_KINDS,
    JointControllerConfig,
    add_joint_controller,
    controlled_joints,
)
from prehensile.models.registry import find_model, package_map

# Two joints with motors whose actuators are declared from the last to the first, and a third
# joint that swings freely.
SCRAMBLED = """<?xml version="1.0"?>
<robot name="{name}">
  <link name="base"/>
  {links}
  {joints}
  {actuators}
</robot>"""


def scrambled(name: str = "scrambled", passive: bool = False) -> str:
    def link(k):
        return (
            f'<link name="link{k}"><inertial><origin xyz="0.1 0.02 -0.2"/><mass value="{k}"/>'
            '<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    def joint(k):
        parent = "base" if k == 1 else f"link{k - 1}"
        axis = "0 1 0" if k % 2 else "1 0 0"
        return (
            f'<joint name="joint{k}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link{k}"/><origin xyz="0.1 0 -0.3"/><axis xyz="{axis}"/>'
            '<limit lower="-2" upper="2" effort="100" velocity="3"/></joint>'
        )

    def actuator(k):
        return (
            f'<transmission type="SimpleTransmission"><joint name="joint{k}"/>'
            f'<actuator name="motor{k}"/></transmission>'
        )

    moving = range(1, 4) if passive else range(1, 3)
    return SCRAMBLED.format(
        name=name,
        links="".join(map(link, moving)),
        joints="".join(map(joint, moving)),
        actuators=actuator(2) + actuator(1),
    )


class Controlled:
    """A robot under a controller in a diagram."""

    def __init__(self, model: str | list[str], config, time_step=0.0):
        self.builder = DiagramBuilder()
        self.plant, _ = _add_plant(self.builder, time_step)
        parser = Parser(self.plant)
        parser.package_map().AddMap(package_map())
        texts = [model] if isinstance(model, str) else model
        self.instances = [
            parser.AddModelsFromString(text, "urdf")[0]
            if text.startswith("<")
            else parser.AddModels(str(find_model(text).path))[0]
            for text in texts
        ]
        for instance in self.instances:
            base = self.plant.get_body(self.plant.GetBodyIndices(instance)[0])
            self.plant.WeldFrames(self.plant.world_frame(), base.body_frame())
        self.plant.Finalize()
        self.ports = add_joint_controller(self.builder, self.plant, self.instances, config)
        self.builder.ExportInput(self.ports.desired_state, "desired")
        if self.ports.feedforward is not None:
            self.builder.ExportInput(self.ports.feedforward, "feedforward")
        self.builder.ExportOutput(self.ports.state, "state")
        self.diagram = self.builder.Build()
        self.simulator = Simulator(self.diagram)
        self.context = self.simulator.get_mutable_context()
        self.plant_context = self.plant.GetMyMutableContextFromRoot(self.context)

    def desire(self, q, v=None):
        v = np.zeros(len(q)) if v is None else v
        self.diagram.GetInputPort("desired").FixValue(self.context, np.concatenate([q, v]))

    def effort(self):
        return self.plant.get_net_actuation_output_port().Eval(self.plant_context)


def _add_plant(builder, time_step):
    return AddMultibodyPlant(MultibodyPlantConfig(time_step=time_step), builder)


@pytest.fixture(scope="module")
def iiwa():
    return make_iiwa()


def states(plant, count=5):
    rng = np.random.default_rng(3)
    Q = random_configurations(plant, count, seed=3)
    n = plant.num_velocities()
    return [(q, *rng.uniform(-0.5, 0.5, (3, n))) for q in Q]


def test_pid_obeys_its_formula(iiwa):
    gains = JointGains(np.arange(1.0, 8.0), np.arange(7.0), np.zeros(7))
    robot = Controlled("iiwa7", JointControllerConfig(gains, "pid"))
    for q, v, dq, v_desired in states(iiwa):
        robot.plant.SetPositionsAndVelocities(robot.plant_context, np.concatenate([q, v]))
        robot.desire(q + dq, v_desired)
        np.testing.assert_allclose(robot.effort(), pid_torque(gains, q, v, q + dq, v_desired))


def test_gravity_compensation_is_drakes_joint_stiffness_controller(iiwa):
    gains = JointGains(np.full(7, 10.0), np.full(7, 2.0), np.zeros(7))
    robot = Controlled("iiwa7", JointControllerConfig(gains))
    drakes = JointStiffnessController(iiwa, gains.kp, gains.kd)
    context = drakes.CreateDefaultContext()
    for q, v, dq, v_desired in states(iiwa):
        robot.plant.SetPositionsAndVelocities(robot.plant_context, np.concatenate([q, v]))
        robot.desire(q + dq, v_desired)
        drakes.get_input_port_estimated_state().FixValue(context, np.concatenate([q, v]))
        drakes.get_input_port_desired_state().FixValue(context, np.concatenate([q + dq, v_desired]))
        wanted = drakes.get_output_port_actuation().Eval(context)
        np.testing.assert_allclose(robot.effort(), wanted, atol=1e-9)


@pytest.mark.parametrize("model", ["iiwa7", scrambled()])
def test_inverse_dynamics_makes_the_joints_obey_a_linear_law(model):
    n = 7 if model == "iiwa7" else 2
    gains = JointGains(np.linspace(1.0, 3.0, n), np.linspace(0.5, 1.0, n), np.zeros(n))
    robot = Controlled(model, JointControllerConfig(gains, "inverse-dynamics"))
    for q, v, dq, v_desired in states(robot.plant):
        robot.plant.SetPositionsAndVelocities(robot.plant_context, 0.3 * np.concatenate([q, v]))
        robot.desire(0.3 * q + 0.1 * dq, v_desired)
        rates = robot.plant.EvalTimeDerivatives(robot.plant_context).CopyToVector()
        wanted = pid_torque(gains, 0.0, 0.3 * v, 0.1 * dq, v_desired)
        np.testing.assert_allclose(rates[n:], wanted, atol=1e-8)


@pytest.mark.parametrize("kind", CONTROLLER_KINDS)
@pytest.mark.parametrize("model", ["iiwa7", scrambled()])
def test_every_kind_holds_and_follows(kind, model):
    omega = 20.0
    probe = Controlled(model, JointControllerConfig(_zeros(model), "pid")).plant

    Q = random_configurations(probe, 50)
    gains = gains_for_bandwidth(joint_inertia(probe, Q).largest, omega)
    if kind == "inverse-dynamics":
        gains = gains_for_bandwidth(np.ones(gains.size), omega)
    if kind == "pid":
        gains = gains_for_bandwidth(joint_inertia(probe, Q).largest, omega, integral_rate=5.0)
    robot = Controlled(model, JointControllerConfig(gains, kind), time_step=0.002)
    start = np.full(gains.size, 0.2)
    robot.plant.SetPositions(robot.plant_context, start)
    robot.desire(start)
    robot.simulator.AdvanceTo(0.5)
    q = robot.plant.GetPositions(robot.plant_context)
    assert np.max(np.abs(q - start)) < (0.02 if kind == "pid" else 1e-3)
    robot.desire(start + 0.3)
    robot.simulator.AdvanceTo(2.5)
    state = robot.diagram.GetOutputPort("state").Eval(robot.context)
    np.testing.assert_allclose(state[: gains.size], start + 0.3, atol=1e-3)
    np.testing.assert_allclose(state[gains.size :], 0.0, atol=1e-3)


def _zeros(model):
    n = 7 if model == "iiwa7" else 2
    return JointGains(np.zeros(n), np.zeros(n), np.zeros(n))


def test_pid_without_integral_sags_by_the_weight_over_the_gain(iiwa):
    gains = JointGains(np.full(7, 2000.0), np.full(7, 200.0), np.zeros(7))
    robot = Controlled("iiwa7", JointControllerConfig(gains, "pid"), time_step=0.002)
    desired = np.array([0.0, 0.8, 0.0, -0.5, 0.0, 0.3, 0.0])
    robot.plant.SetPositions(robot.plant_context, desired)
    robot.desire(desired)
    robot.simulator.AdvanceTo(3.0)
    q = robot.plant.GetPositions(robot.plant_context)
    context = iiwa.CreateDefaultContext()
    iiwa.SetPositions(context, q)
    weight = -iiwa.CalcGravityGeneralizedForces(context)
    assert np.max(np.abs(weight)) > 20.0
    np.testing.assert_allclose(2000.0 * (desired - q), weight, atol=0.05)


def test_feedforward_is_added():
    config = JointControllerConfig(_zeros("iiwa7"), "pid", feedforward=True)
    robot = Controlled("iiwa7", config)
    robot.desire(np.zeros(7))
    robot.diagram.GetInputPort("feedforward").FixValue(robot.context, np.arange(7.0))
    np.testing.assert_array_equal(robot.effort(), np.arange(7.0))


def test_joints_without_a_motor_swing_while_the_others_are_held():
    gains = JointGains([500.0, 500.0], [50.0, 50.0], [0.0, 0.0])
    robot = Controlled(
        scrambled(passive=True), JointControllerConfig(gains, "stiffness"), time_step=0.002
    )
    assert [j.name() for j in controlled_joints(robot.plant, robot.instances)] == [
        "joint1", "joint2",
    ]  # fmt: skip
    robot.plant.SetPositions(robot.plant_context, [0.1, -0.2, 1.0])
    robot.desire([0.1, -0.2])
    robot.simulator.AdvanceTo(0.3)
    q = robot.plant.GetPositions(robot.plant_context)
    assert abs(q[2] - 1.0) > 0.2
    np.testing.assert_allclose(q[:2], [0.1, -0.2], atol=0.05)


@pytest.mark.parametrize("kind", ["pid", "gravity-compensation", "inverse-dynamics"])
def test_two_models_as_one_robot(kind):
    gains = gains_for_bandwidth(np.ones(4), 15.0)
    robot = Controlled(
        [scrambled("a"), scrambled("b")], JointControllerConfig(gains, kind), time_step=0.001
    )
    target = np.array([0.1, 0.2, -0.3, 0.4])
    robot.desire(target)
    robot.simulator.AdvanceTo(3.0)
    state = robot.diagram.GetOutputPort("state").Eval(robot.context)
    if kind == "pid":  # it sags, each joint its own way
        assert np.all(np.abs(state[:4] - target) < 0.1)
    else:
        np.testing.assert_allclose(state[:4], target, atol=2e-3)


@pytest.mark.parametrize(
    ("model", "config", "time_step", "words"),
    [
        ("iiwa7", JointControllerConfig(_zeros("b")), 0.0, "gains of 2 joints where 7"),
        ("iiwa7", JointControllerConfig(_zeros("iiwa7"), "stiffness"), 0.0, "discrete"),
        (scrambled(passive=True), JointControllerConfig(_zeros("b"), "inverse-dynamics"), 0.0,
         "actuator at every joint"),
        ("foam_brick", JointControllerConfig(_zeros("b")), 0.0, "no joint is driven"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named(model, config, time_step, words):
    with pytest.raises(ValueError, match=words):
        Controlled(model, config, time_step)


def test_a_robot_among_other_things_needs_a_model_of_itself():
    builder = DiagramBuilder()
    plant, _ = _add_plant(builder, 0.002)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (arm,) = parser.AddModels(str(find_model("iiwa7").path))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("iiwa_link_0"))
    parser.AddModels(str(find_model("mug").path))
    plant.Finalize()
    gains = gains_for_bandwidth(np.full(7, 5.0), 20.0)
    with pytest.raises(ValueError, match="controller_plant"):
        add_joint_controller(builder, plant, [arm], JointControllerConfig(gains))
    model = make_iiwa()
    ports = add_joint_controller(
        builder, plant, [arm], JointControllerConfig(gains), controller_plant=model, name="arm"
    )
    builder.ExportInput(ports.desired_state, "desired")
    simulator = Simulator(builder.Build())
    context = simulator.get_mutable_context()
    simulator.get_system().GetInputPort("desired").FixValue(context, np.zeros(14))
    simulator.AdvanceTo(0.2)
    q = plant.GetPositions(plant.GetMyContextFromRoot(context), arm)
    assert np.max(np.abs(q)) < 1e-6


def test_wrong_configurations_are_named():
    with pytest.raises(ValueError, match="kind"):
        JointControllerConfig(_zeros("b"), "magic")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="integral"):
        JointControllerConfig(JointGains([1.0], [1.0], [1.0]), "stiffness")
    with pytest.raises(ValueError, match="feedforward"):
        JointControllerConfig(_zeros("b"), "inverse-dynamics", feedforward=True)
