"""The registry of drivers, the drivers for any robot, and the interface to hardware."""

import dataclasses as dc
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from pydrake.common.schema import Transform
from pydrake.lcm import DrakeLcm
from pydrake.manipulation import (
    BuildIiwaControl,
    BuildSchunkWsgControl,
    IiwaDriver,
    SchunkWsgDriver,
)
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.lcm import LcmBuses, LcmInterfaceSystem
from pydrake.systems.primitives import ConstantVectorSource, SharedPointerSystem
from pydrake.systems.sensors import CameraConfig

from prehensile.errors import InputError
from prehensile.station import drivers as registry
from prehensile.station.build import build
from prehensile.station.drivers import Driver, driver_types, drivers
from prehensile.station.guard import GuardStatus
from prehensile.station.hardware import build_interface
from prehensile.station.robot_plant import add_models, make_robot_plant
from prehensile.station.scenario_file import load_scenario, loads_scenario

ARM = """
plant_config: {time_step: 0.002, discrete_contact_approximation: sap}
directives:
- add_model:
    name: iiwa
    file: package://prehensile/iiwa7/iiwa7.sdf
    default_joint_positions:
      iiwa_joint_2: [0.6]
      iiwa_joint_4: [-1.2]
- add_weld: {parent: world, child: iiwa::iiwa_link_0}
- add_model:
    name: wsg
    file: package://prehensile/wsg50/wsg50.sdf
- add_weld:
    parent: iiwa::iiwa_link_7
    child: wsg::body
    X_PC:
      translation: [0, 0, 0.09]
      rotation: !Rpy {deg: [90, 0, 90]}
model_drivers:
"""
ACTUATORS = [f"iiwa_joint_{k}" for k in range(1, 8)]


@dc.dataclass
class FakeHandDriver:
    """A driver of another package."""

    strength: float = 1.0


def _simulate_fake(site):
    source = site.builder.AddNamedSystem(
        f"{site.name}.source", ConstantVectorSource([site.config.strength] * 2)
    )
    site.builder.Connect(
        source.get_output_port(), site.plant.get_actuation_input_port(site.instance)
    )
    site.export_output(source.get_output_port(), "strength")


DRIVER = Driver(FakeHandDriver, _simulate_fake)


@pytest.fixture
def entry_points(monkeypatch):
    def use(*entries):
        monkeypatch.setattr(
            registry,
            "entry_points",
            lambda group: [EntryPoint(name, value, group) for name, value in entries],
        )
        drivers.cache_clear()

    yield use
    monkeypatch.undo()
    drivers.cache_clear()


def test_a_driver_of_another_package_needs_no_change_here(entry_points):
    assert "FakeHandDriver" not in driver_types()
    entry_points(("FakeHandDriver", f"{__name__}:DRIVER"))
    assert driver_types()["FakeHandDriver"] is FakeHandDriver
    scenario = loads_scenario(ARM + "  wsg: !FakeHandDriver {strength: 2.5}")
    station = build(scenario)
    context = station.CreateDefaultContext()
    assert station.GetOutputPort("wsg.strength").Eval(context).tolist() == [2.5, 2.5]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("FakeHandDriver", "no_such_package:DRIVER", "cannot be loaded"),
        ("Misnamed", f"{__name__}:DRIVER", "is not that driver"),
        ("FakeHandDriver", f"{__name__}:FakeHandDriver", "is not that driver"),
        ("IiwaDriver", "prehensile.station.drivers.iiwa:DRIVER", "already"),
    ],
)
def test_broken_entry_points_are_named(entry_points, name, value, words):
    entry_points((name, value))
    with pytest.raises(InputError, match=words) as error:
        driver_types()
    assert f"prehensile.drivers.{name}" in str(error.value)


def test_the_drivers_that_come_along():
    types = driver_types()
    assert types["IiwaDriver"] is IiwaDriver
    assert types["SchunkWsgDriver"] is SchunkWsgDriver
    assert {"ZeroForceDriver", "InverseDynamicsDriver", "JointStiffnessDriver"} <= set(types)


def gains(**values: float) -> str:
    inner = ", ".join(f"{key}: {value}" for key, value in values.items())
    return ", ".join(f"{name}: {{{inner}}}" for name in ACTUATORS)


@pytest.mark.parametrize(
    "driver",
    [
        "!InverseDynamicsDriver {}",
        f"!InverseDynamicsDriver {{gains: {{{gains(kp=400, ki=0, kd=40)}}}}}",
        f"!JointStiffnessDriver {{gains: {{{gains(kp=800, kd=60)}}}, hand_model_name: wsg}}",
    ],
)
def test_drivers_for_any_robot_hold_and_follow(driver):
    station = build(loads_scenario(ARM + f"  iiwa: {driver}\n  wsg: !SchunkWsgDriver {{}}"))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    measured = station.GetOutputPort("iiwa.position_measured")
    start = measured.Eval(context)
    simulator.AdvanceTo(0.5)
    assert np.max(np.abs(measured.Eval(context) - start)) < 2e-3
    station.GetInputPort("iiwa.position").FixValue(context, start + 0.05)
    simulator.AdvanceTo(2.5)
    assert np.max(np.abs(measured.Eval(context) - start - 0.05)) < 3e-3
    assert station.GetOutputPort("iiwa.guard_status").Eval(context) == GuardStatus.OK
    state = station.GetOutputPort("iiwa.state_estimated").Eval(context)
    assert state[:7].tolist() == measured.Eval(context).tolist()
    assert state[7:].tolist() == (
        station.GetOutputPort("iiwa.velocity_estimated").Eval(context).tolist()
    )


def test_two_arms_driven_as_one():
    second = """
- add_model:
    name: other
    file: package://prehensile/iiwa7/iiwa7.sdf
- add_weld:
    parent: world
    child: other::iiwa_link_0
    X_PC: {translation: [0, 1.5, 0]}
model_drivers:
  iiwa+other: !InverseDynamicsDriver {}
  wsg: !ZeroForceDriver {}
"""
    station = build(loads_scenario(ARM.replace("model_drivers:\n", second.lstrip("\n"))))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    measured = station.GetOutputPort("iiwa+other.position_measured")
    start = measured.Eval(context)
    assert start[[1, 3]].tolist() == [0.6, -1.2]
    target = start + 0.01 * np.arange(1, 15) / 2
    station.GetInputPort("iiwa+other.position").FixValue(context, target)
    simulator.AdvanceTo(2.0)
    assert measured.Eval(context) == pytest.approx(target, abs=3e-3)


def test_zero_force_lets_the_arm_fall():
    station = build(loads_scenario(ARM + "  iiwa: !ZeroForceDriver {}"))
    simulator = Simulator(station)
    plant = station.plant()
    context = plant.GetMyContextFromRoot(simulator.get_context())
    before = plant.CalcPotentialEnergy(context)
    simulator.AdvanceTo(0.3)
    assert plant.CalcPotentialEnergy(context) < before - 1.0


def test_unknown_actuators_are_named():
    scenario = loads_scenario(ARM + "  iiwa: !InverseDynamicsDriver {gains: {elbow: {}}}")
    with pytest.raises(InputError) as error:
        build(scenario)
    assert "model_drivers.iiwa.gains.elbow" in str(error.value)
    assert "iiwa_joint_4" in str(error.value)


@pytest.mark.parametrize("mode", ["position_only", "torque_only"])
def test_control_modes_have_the_ports_they_can_follow(mode):
    station = build(loads_scenario(ARM + f"  iiwa: !IiwaDriver {{control_mode: {mode}}}"))
    assert station.HasInputPort("iiwa.position") == (mode == "position_only")
    assert station.HasInputPort("iiwa.feedforward_torque") == (mode == "torque_only")
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    start = station.GetOutputPort("iiwa.position_measured").Eval(context)
    simulator.AdvanceTo(0.2)
    # Gravity is compensated in either.
    moved = station.GetOutputPort("iiwa.position_measured").Eval(context) - start
    assert np.max(np.abs(moved)) < 0.02


class TestHardware:
    """Our interface on one side of a bus, Drake's simulation of the robots on the other."""

    SCENARIO = ARM + "  iiwa: !IiwaDriver {hand_model_name: wsg}\n  wsg: !SchunkWsgDriver {}"

    def make(self, camera=None):
        scenario = loads_scenario(self.SCENARIO)
        if camera is not None:
            scenario = dc.replace(scenario, cameras={"eye": camera})
        lcm = DrakeLcm("memq://")
        # The robots, as Drake simulates them behind their messages.
        robots_builder = DiagramBuilder()
        robots_builder.AddSystem(LcmInterfaceSystem(lcm))
        plant, _ = AddMultibodyPlantSceneGraph(robots_builder, 0.002)
        add_models(scenario, plant)
        plant.Finalize()
        controller_plant = make_robot_plant(scenario, ["iiwa"], frozen_children=True)
        robots_builder.AddSystem(SharedPointerSystem(controller_plant))
        BuildIiwaControl(
            builder=robots_builder,
            lcm=lcm,
            plant=plant,
            iiwa_instance=plant.GetModelInstanceByName("iiwa"),
            driver_config=scenario.model_drivers["iiwa"],
            controller_plant=controller_plant,
        )
        BuildSchunkWsgControl(plant, plant.GetModelInstanceByName("wsg"), lcm, robots_builder)
        robots = Simulator(robots_builder.Build())
        # The interface, in its own simulator, handling messages on its own.
        builder = DiagramBuilder()
        buses = LcmBuses()
        buses.Add("default", lcm)
        builder.AddSystem(LcmInterfaceSystem(lcm))
        station = builder.AddSystem(build_interface(scenario, lcm_buses=buses))
        interface = Simulator(builder.Build())
        return robots, plant, interface, station

    def test_commands_go_out_guarded_and_measurements_come_back(self):
        robots, plant, interface, station = self.make()
        plant_context = plant.GetMyContextFromRoot(robots.get_context())
        context = station.GetMyMutableContextFromRoot(interface.get_mutable_context())
        arm, hand = (plant.GetModelInstanceByName(name) for name in ("iiwa", "wsg"))
        start = plant.GetPositions(plant_context, arm)

        def step(until):
            for t in np.arange(robots.get_context().get_time(), until, 0.005):
                robots.AdvanceTo(t + 0.005)
                interface.AdvanceTo(t + 0.005)

        def read(port):
            return station.GetOutputPort(port).Eval(context)

        # The first messages of the robots are on the bus before the interface starts.
        robots.AdvanceTo(0.06)
        interface.get_mutable_context().SetTime(0.06)
        interface.Initialize()
        step(0.5)
        assert read("iiwa.position_measured") == pytest.approx(start, abs=1e-3)
        assert read("iiwa.guard_status") == GuardStatus.UNCONNECTED
        assert plant.GetPositions(plant_context, arm) == pytest.approx(start, abs=1e-3)

        # A step within reach is not sent as a step: the joints never exceed their speed.
        station.GetInputPort("iiwa.position").FixValue(context, start + 0.09)
        station.GetInputPort("wsg.position").FixValue(context, [0.03])
        step(0.52)
        ahead = read("iiwa.position_commanded") - start
        assert np.all(ahead < 0.02)
        step(2.5)
        assert read("iiwa.guard_status") == GuardStatus.OK
        assert plant.GetPositions(plant_context, arm) == pytest.approx(start + 0.09, abs=2e-3)
        assert read("iiwa.position_measured") == pytest.approx(start + 0.09, abs=2e-3)
        assert read("iiwa.position_commanded") == pytest.approx(start + 0.09, abs=1e-9)
        assert read("wsg.state_measured")[0] == pytest.approx(0.03, abs=2e-3)
        left, right = plant.GetPositions(plant_context, hand)
        assert right - left == pytest.approx(0.03, abs=2e-3)
        # Torques have the signs of the simulated station.
        gravity = plant.CalcGravityGeneralizedForces(plant_context)
        wanted = -plant.GetVelocitiesFromArray(arm, gravity)
        assert read("iiwa.torque_commanded") == pytest.approx(wanted, abs=0.3)
        assert read("iiwa.torque_measured") == pytest.approx(wanted, abs=0.3)

        # A jump is refused by the same code as in simulation, once the command was lost.
        station.GetInputPort("iiwa.position").FixValue(context, np.full(7, np.nan))
        step(2.6)
        assert read("iiwa.guard_status") == GuardStatus.NOT_FINITE
        station.GetInputPort("iiwa.position").FixValue(context, start - 0.5)
        step(2.8)
        assert read("iiwa.guard_status") == GuardStatus.JUMP
        assert plant.GetPositions(plant_context, arm) == pytest.approx(start + 0.09, abs=2e-3)

    def test_ports_are_those_of_the_simulation_without_cheats(self):
        scenario = load_scenario("iiwa_wsg")
        interface, simulation = build(scenario, hardware=True), build(scenario)

        def ports(diagram):
            outputs = (diagram.get_output_port(i) for i in range(diagram.num_output_ports()))
            inputs = (diagram.get_input_port(i) for i in range(diagram.num_input_ports()))
            every = {(p.get_name(), p.size()) for p in (*outputs, *inputs)}
            return {p for p in every if not p[0].startswith("cheat.")}

        assert ports(interface) == ports(simulation)

    def test_a_camera_on_the_hand_knows_where_it_is(self):
        camera = CameraConfig(
            name="eye", width=64, height=48, X_PB=Transform(base_frame="wsg::body")
        )
        robots, plant, interface, station = self.make(camera)
        robots.AdvanceTo(0.06)
        interface.Initialize()
        interface.AdvanceTo(0.01)
        context = station.GetMyContextFromRoot(interface.get_context())
        body = plant.GetBodyByName("body", plant.GetModelInstanceByName("wsg"))
        X_WH = plant.EvalBodyPoseInWorld(plant.GetMyContextFromRoot(robots.get_context()), body)
        X_WC = station.GetOutputPort("eye.X_WC").Eval(context)
        assert X_WC.IsNearlyEqualTo(X_WH, 1e-3)

    def test_simulation_only_drivers_and_unknown_buses_are_named(self):
        scenario = loads_scenario(ARM + "  iiwa: !InverseDynamicsDriver {}")
        with pytest.raises(InputError, match="simulation only"):
            build(scenario, hardware=True)
        scenario = loads_scenario(self.SCENARIO)
        drivers = {"iiwa": IiwaDriver(lcm_bus="backup")}
        with pytest.raises(InputError) as error:
            build(dc.replace(scenario, model_drivers=drivers), hardware=True)
        assert "model_drivers.iiwa.lcm_bus" in str(error.value)
