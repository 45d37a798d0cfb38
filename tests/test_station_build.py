"""A station end to end: ports, the arm that holds and follows, the hand that grips."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from prehensile.errors import InputError
from prehensile.station.build import build
from prehensile.station.guard import GuardStatus
from prehensile.station.robot_plant import fixed_models, make_robot_diagram, make_robot_plant
from prehensile.station.scenario_file import load_scenario, loads_scenario

ARM_PORTS = {
    "position_commanded": 7,
    "position_measured": 7,
    "velocity_estimated": 7,
    "torque_commanded": 7,
    "torque_measured": 7,
    "torque_external": 7,
    "state_estimated": 14,
    "guard_status": 1,
}

# A foam brick held up between the fingers' pads.
GRIP = """
plant_config:
  time_step: 0.002
  contact_model: hydroelastic_with_fallback
  discrete_contact_approximation: sap
directives:
- add_model:
    name: wsg
    file: package://prehensile/wsg50/wsg50.sdf
    default_joint_positions:
      left_finger_sliding_joint: [-0.05]
      right_finger_sliding_joint: [0.05]
- add_weld:
    parent: world
    child: wsg::body
- add_model:
    name: shelf
    file: package://prehensile/foam_brick/foam_brick.sdf
- add_weld:
    parent: world
    child: shelf::base_link
    X_PC: {translation: [0, 0.12, -0.05]}
- add_model:
    name: brick
    file: package://prehensile/foam_brick/foam_brick.sdf
    default_free_body_pose:
      base_link:
        translation: [0, 0.12, 0.0]
model_drivers:
  wsg: !SchunkWsgDriver {}
"""


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("iiwa_wsg")


@pytest.fixture(scope="module")
def station(scenario):
    return build(scenario)


def read(simulator, port):
    system = simulator.get_system()
    station = system if system.HasOutputPort(port) else system.GetSubsystemByName("station")
    context = station.GetMyContextFromRoot(simulator.get_context())
    return station.GetOutputPort(port).Eval(context)


def test_ports_are_those_documented(station):
    assert station.GetSubsystemByName("plant") is station.plant()
    assert station.HasSubsystemNamed("scene_graph")
    for name, size in ARM_PORTS.items():
        assert station.GetOutputPort(f"iiwa.{name}").size() == size
    for name, size in {"state_measured": 2, "force_measured": 1, "guard_status": 1}.items():
        assert station.GetOutputPort(f"wsg.{name}").size() == size
    sizes = {"iiwa.position": 7, "iiwa.feedforward_torque": 7, "iiwa.command_time": 1}
    sizes |= {"wsg.position": 1, "wsg.force_limit": 1, "wsg.command_time": 1}
    for name, size in sizes.items():
        assert station.GetInputPort(name).size() == size
    for name in ("rgb_image", "depth_image", "label_image", "point_cloud", "X_WC"):
        assert station.HasOutputPort(f"camera0.{name}")
    others = {
        port.partition(".")[0]
        for port in (
            *(station.get_output_port(i).get_name() for i in range(station.num_output_ports())),
            *(station.get_input_port(i).get_name() for i in range(station.num_input_ports())),
        )
    }
    assert others == {"iiwa", "wsg", "camera0", "cheat"}


def test_an_arm_without_commands_holds_against_gravity(station):
    simulator = Simulator(station)
    start = read(simulator, "iiwa.position_measured")
    simulator.AdvanceTo(2.0)
    assert np.max(np.abs(read(simulator, "iiwa.position_measured") - start)) < 1e-3
    assert np.max(np.abs(read(simulator, "iiwa.torque_external"))) < 1e-6
    assert read(simulator, "iiwa.guard_status") == GuardStatus.UNCONNECTED
    assert read(simulator, "iiwa.position_commanded") == pytest.approx(start, abs=1e-12)
    # It holds with the torque that statics asks for, whatever the sign of the convention.
    plant = station.plant()
    context = plant.GetMyContextFromRoot(simulator.get_context())
    gravity = plant.CalcGravityGeneralizedForces(context)
    wanted = -plant.GetVelocitiesFromArray(plant.GetModelInstanceByName("iiwa"), gravity)
    assert read(simulator, "iiwa.torque_commanded") == pytest.approx(wanted, abs=0.05)


def test_the_arm_follows_a_smooth_motion(scenario):
    station = build(scenario)
    builder = DiagramBuilder()
    builder.AddSystem(station)
    start = station.GetOutputPort("iiwa.position_measured").Eval(station.CreateDefaultContext())
    t = np.linspace(0, 3, 31)
    q = start[:, None] + 0.15 * (1 - np.cos(2 * np.pi * t / 3)) * np.ones((7, 1))
    trajectory = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(
        t, q, np.zeros((7, 1)), np.zeros((7, 1))
    )
    source = builder.AddSystem(TrajectorySource(trajectory))
    builder.Connect(source.get_output_port(), station.GetInputPort("iiwa.position"))
    log = LogVectorOutput(station.GetOutputPort("iiwa.position_measured"), builder, 0.1)
    status = LogVectorOutput(station.GetOutputPort("iiwa.guard_status"), builder, 0.01)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(3.0)
    times = log.FindLog(simulator.get_context()).sample_times()
    measured = log.FindLog(simulator.get_context()).data()
    wanted = np.hstack([trajectory.value(t) for t in times])
    # At most a few samples late: 0.31 rad/s at most.
    assert np.max(np.abs(measured - wanted)) < 0.012
    assert set(status.FindLog(simulator.get_context()).data().ravel()[5:]) == {GuardStatus.OK}


def test_a_command_far_away_is_refused_at_the_start(station):
    simulator = Simulator(station)
    start = read(simulator, "iiwa.position_measured")
    port = station.GetInputPort("iiwa.position")
    port.FixValue(simulator.get_mutable_context(), start + 0.5)
    simulator.AdvanceTo(0.3)
    assert read(simulator, "iiwa.guard_status") == GuardStatus.JUMP
    assert np.max(np.abs(read(simulator, "iiwa.position_measured") - start)) < 1e-3
    port.FixValue(simulator.get_mutable_context(), start + 0.05)
    simulator.AdvanceTo(1.3)
    assert read(simulator, "iiwa.guard_status") == GuardStatus.OK
    assert read(simulator, "iiwa.position_measured") == pytest.approx(start + 0.05, abs=2e-3)


def test_feed_forward_torque_pushes_and_is_clipped(station):
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    start = read(simulator, "iiwa.position_measured")
    torque = np.zeros(7)
    torque[0] = 20.0
    station.GetInputPort("iiwa.feedforward_torque").FixValue(context, torque)
    simulator.AdvanceTo(0.3)
    assert read(simulator, "iiwa.position_measured")[0] > start[0] + 1e-3
    torque[0] = 1e4
    station.GetInputPort("iiwa.feedforward_torque").FixValue(context, torque)
    simulator.AdvanceTo(0.31)
    assert read(simulator, "iiwa.guard_status") == GuardStatus.LIMITED
    guard = station.GetSubsystemByName("guard")
    effort = guard.GetOutputPort("iiwa.effort").Eval(guard.GetMyContextFromRoot(context))
    limit = station.plant().GetJointActuatorByName("iiwa_joint_1").effort_limit()
    assert effort.tolist() == [limit, 0, 0, 0, 0, 0, 0]


def test_a_push_shows_as_external_torque():
    # A block falls onto an arm that is stretched out level, and pushes it down.
    data = """
directives:
- add_model:
    name: iiwa
    file: package://prehensile/iiwa7/iiwa7.sdf
    default_joint_positions: {iiwa_joint_2: [1.5707963267948966]}
- add_weld: {parent: world, child: iiwa::iiwa_link_0}
- add_model:
    name: block
    file: package://prehensile/wood_block/wood_block.sdf
    default_free_body_pose:
      base_link: {translation: [0.55, 0, 0.6]}
plant_config: {time_step: 0.002, discrete_contact_approximation: sap}
model_drivers: {iiwa: !IiwaDriver {}}
"""
    station = build(loads_scenario(data))
    simulator = Simulator(station)
    simulator.AdvanceTo(0.02)
    assert np.max(np.abs(read(simulator, "iiwa.torque_external"))) < 1e-6
    # Joint 2 turns about +y, so that a positive torque lowers an arm that points along +x.
    pushed = 0.0
    for k in range(1, 60):
        simulator.AdvanceTo(0.02 + 0.01 * k)
        pushed = max(pushed, read(simulator, "iiwa.torque_external")[1])
    assert pushed > 0.5


def test_applied_forces_move_the_arm(station):
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    force = ExternallyAppliedSpatialForce()
    force.body_index = station.plant().GetBodyByName("iiwa_link_7").index()
    force.F_Bq_W = SpatialForce([0, 0, 0], [0, 0, -40.0])
    station.GetInputPort("cheat.applied_spatial_force").FixValue(
        context, Value[list[ExternallyAppliedSpatialForce]]([force])
    )
    start = read(simulator, "iiwa.position_measured")
    simulator.AdvanceTo(0.5)
    assert read(simulator, "iiwa.position_measured")[1] > start[1] + 1e-3


def test_the_hand_opens_closes_and_reports_its_grip():
    station = build(loads_scenario(GRIP))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    width = station.GetInputPort("wsg.position")
    assert read(simulator, "wsg.state_measured")[0] == pytest.approx(0.1)
    width.FixValue(context, [0.02])
    station.GetInputPort("wsg.force_limit").FixValue(context, [20.0])
    simulator.AdvanceTo(1.0)
    # The brick lies along: 5 cm between the pads; they press as hard as they may.
    closed, rate = read(simulator, "wsg.state_measured")
    assert closed == pytest.approx(0.05, abs=0.004)
    assert abs(rate) < 1e-3
    assert abs(read(simulator, "wsg.force_measured")[0]) == pytest.approx(20.0, rel=0.05)
    width.FixValue(context, [5.0])
    simulator.AdvanceTo(2.0)
    assert read(simulator, "wsg.guard_status") == GuardStatus.LIMITED
    opened = read(simulator, "wsg.state_measured")[0]
    assert opened == pytest.approx(0.11, abs=0.004)


def test_cheat_ports_agree_with_the_plant(station):
    simulator = Simulator(station)
    plant = station.plant()
    context = plant.GetMyContextFromRoot(simulator.get_context())
    state = read(simulator, "cheat.plant_state")
    assert state.tolist() == plant.GetPositionsAndVelocities(context).tolist()
    body = plant.GetBodyByName("iiwa_link_7")
    pose = read(simulator, "cheat.body_poses")[int(body.index())]
    assert pose.IsExactlyEqualTo(plant.EvalBodyPoseInWorld(context, body))


def test_the_same_station_twice_moves_alike_bit_for_bit(scenario):
    states = []
    for _ in range(2):
        simulator = Simulator(build(scenario))
        simulator.AdvanceTo(0.2)
        states.append(read(simulator, "cheat.plant_state").tobytes())
    assert states[0] == states[1]


@pytest.fixture(scope="module")
def bins():
    return load_scenario("two_bins")


class TestRobotPlant:
    """Parts of a scenario."""

    def test_frozen_arm_weighs_as_much_as_the_whole(self, bins):
        station = build(bins).plant()
        context = station.CreateDefaultContext()
        arm = make_robot_plant(bins, ["iiwa"], frozen_children=True)
        assert arm.num_positions() == arm.num_velocities() == arm.num_actuators() == 7
        instances = [station.GetModelInstanceByName(name) for name in ("iiwa", "wsg")]
        q = np.linspace(-0.5, 0.7, 7)
        station.SetPositions(context, instances[0], q)
        station.SetPositions(context, instances[1], np.zeros(2))
        arm_context = arm.CreateDefaultContext()
        arm.SetPositions(arm_context, q)
        gravity = station.GetVelocitiesFromArray(
            instances[0], station.CalcGravityGeneralizedForces(context)
        )
        assert arm.CalcGravityGeneralizedForces(arm_context) == pytest.approx(gravity, abs=1e-9)
        X_WH = [
            plant.GetFrameByName("body").CalcPoseInWorld(c)
            for plant, c in ((station, context), (arm, arm_context))
        ]
        assert X_WH[0].IsNearlyEqualTo(X_WH[1], 1e-12)

    def test_arm_alone_has_no_hand(self, bins):
        arm = make_robot_plant(bins, ["iiwa"])
        assert not arm.HasModelInstanceNamed("wsg")
        assert not arm.HasModelInstanceNamed("bin0")

    def test_fixed_models_leave_free_objects_out(self):
        pick = load_scenario("pick_brick")
        plant = build(pick).plant()
        free = {
            plant.GetModelInstanceName(plant.get_body(i).model_instance())
            for i in plant.GetFloatingBaseBodies()
        }
        assert free
        assert not free & set(fixed_models(pick))
        diagram = make_robot_diagram(pick)
        assert diagram.plant().num_positions() == 9
        assert not diagram.plant().HasModelInstanceNamed(next(iter(free)))
        query = diagram.scene_graph().get_query_output_port()
        assert (
            query.Eval(diagram.scene_graph().GetMyContextFromRoot(diagram.CreateDefaultContext()))
            .inspector()
            .num_geometries()
            > 0
        )

    def test_unknown_model(self, bins):
        with pytest.raises(InputError, match="no model 'robot'"):
            make_robot_plant(bins, ["robot"])


def test_drivers_that_do_not_fit(scenario):
    drivers = scenario.model_drivers
    iiwa, wsg = drivers["iiwa"], drivers["wsg"]
    for wrong, words in (
        ({"wsg": iiwa}, ["model_drivers.wsg", "joints of another"]),
        ({"iiwa": wsg}, ["model_drivers.iiwa", "2 joints"]),
        ({"robot": wsg}, ["model_drivers.robot", "no model 'robot'"]),
        ({"iiwa": object()}, ["model_drivers.iiwa", "IiwaDriver"]),
    ):
        with pytest.raises(InputError) as error:
            build(dc.replace(scenario, model_drivers=wrong))
        for word in words:
            assert word in str(error.value)


def test_no_camera_costs_nothing(scenario):
    station = build(dc.replace(scenario, cameras={}))
    assert not station.HasSubsystemNamed("cameras")
    assert station.scene_graph().RendererCount() == 0


def test_constant_source_is_followed_from_the_first_sample(scenario):
    station = build(scenario)
    builder = DiagramBuilder()
    builder.AddSystem(station)
    q = station.GetOutputPort("iiwa.position_measured").Eval(station.CreateDefaultContext())
    source = builder.AddSystem(ConstantVectorSource(q))
    builder.Connect(source.get_output_port(), station.GetInputPort("iiwa.position"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.02)
    assert read(simulator, "iiwa.guard_status") == GuardStatus.OK
