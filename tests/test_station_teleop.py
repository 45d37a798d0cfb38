"""Teleoperation: the hand goes where the sliders say, within limits, by the command ports alone."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from prehensile.errors import InputError
from prehensile.station.build import build
from prehensile.station.guard import GuardLimits
from prehensile.station.scenario import Scenario
from prehensile.station.scenario_file import load_scenario, loads_scenario
from prehensile.station.slider_source import Gamepad, Knob, SliderSource
from prehensile.station.teleop import Arm, Mode, find_arm, pose_follower, teleoperate
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.sliders import Slider


@dataclass
class FakeGamepad:
    index: int | None = None
    axes: list[float] = field(default_factory=lambda: [0.0] * 4)
    button_values: list[float] = field(default_factory=lambda: [0.0] * 16)


class Rig:
    """A station under teleoperation, with what a test looks at."""

    def __init__(self, scenario: Scenario, mode: Mode) -> None:
        self.meshcat: Meshcat = start_meshcat()
        self.gamepad = FakeGamepad()
        self.station: Diagram = build(scenario)
        self.arm: Arm = find_arm(self.station, scenario)
        self.diagram = teleoperate(
            self.station, scenario, self.meshcat, mode=mode, gamepad=lambda: self.gamepad
        )
        self.simulator = Simulator(self.diagram)
        self.simulator.Initialize()
        self.labels = {label.split(" (")[0]: label for label in self.meshcat.GetSliderNames()}

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self.meshcat.SetSliderValue(self.labels[name], value)

    def get(self, name: str) -> float:
        return self.meshcat.GetSliderValue(self.labels[name])

    def run(self, seconds: float) -> None:
        self.simulator.AdvanceTo(self.simulator.get_context().get_time() + seconds)

    def measured(self, port: str) -> np.ndarray:
        context = self.station.GetMyContextFromRoot(self.simulator.get_context())
        return self.station.GetOutputPort(port).Eval(context)

    def pose(self) -> RigidTransform:
        """X_WG of the simulated hand, from the arm's measured joints."""
        context = self.arm.plant.CreateDefaultContext()
        self.arm.plant.SetPositions(context, self.measured(f"{self.arm.name}.position_measured"))
        return self.arm.plant.EvalBodyPoseInWorld(context, self.arm.end)


def angle_between(X: RigidTransform, Y: RigidTransform) -> float:
    return X.rotation().InvertAndCompose(Y.rotation()).ToAngleAxis().angle()


def test_only_command_ports_are_driven() -> None:
    scenario = load_scenario("iiwa_wsg")
    rig = Rig(scenario, "pose")
    driven = {
        rig.station.get_input_port(port).get_name()
        for (system, port) in rig.diagram.connection_map()
        if system is rig.station
    }
    assert driven == {"iiwa.position", "wsg.position"}


def test_untouched_sliders_move_nothing() -> None:
    rig = Rig(load_scenario("iiwa_wsg"), "pose")
    start = rig.measured("iiwa.position_measured").copy()
    rig.run(1.0)
    np.testing.assert_allclose(rig.measured("iiwa.position_measured"), start, atol=1e-4)
    assert rig.measured("wsg.state_measured")[0] == pytest.approx(0.1, abs=1e-3)


def test_hand_reaches_the_pose_of_the_sliders() -> None:
    rig = Rig(load_scenario("iiwa_wsg"), "pose")
    rpy = RollPitchYaw(rig.pose().rotation())
    x, y, z = rig.pose().translation()
    rig.set(x=x + 0.08, y=y - 0.2, z=z - 0.1)
    rig.set(roll=rpy.roll_angle() + 0.3, pitch=0.2, yaw=rpy.yaw_angle() - 0.4, opening=0.03)
    wanted = RigidTransform(
        RollPitchYaw(rig.get("roll"), rig.get("pitch"), rig.get("yaw")),
        np.array([rig.get("x"), rig.get("y"), rig.get("z")]),
    )
    limit = 0.7 * rig.arm.plant.GetVelocityUpperLimits()
    for _ in range(40):
        rig.run(0.1)
        assert (np.abs(rig.measured("iiwa.velocity_estimated")) < limit).all()
    np.testing.assert_allclose(rig.pose().translation(), wanted.translation(), atol=2e-3)
    assert angle_between(rig.pose(), wanted) < np.deg2rad(0.5)
    assert rig.measured("wsg.state_measured")[0] == pytest.approx(0.03, abs=1e-3)


def test_joint_limits_hold_when_the_goal_is_out_of_reach() -> None:
    rig = Rig(load_scenario("iiwa_wsg"), "pose")
    rig.set(x=1.4, y=0.9, z=1.2, yaw=-3.0, pitch=1.2)
    lower, upper = rig.arm.plant.GetPositionLowerLimits(), rig.arm.plant.GetPositionUpperLimits()
    for _ in range(20):
        rig.run(0.25)
        q = rig.measured("iiwa.position_measured")
        assert (q > lower - 1e-3).all()
        assert (q < upper + 1e-3).all()
        assert np.isfinite(q).all()


def test_the_arm_slides_along_its_limits_and_comes_to_rest() -> None:
    """A goal beyond its reach draws the hand as near as the arm is long, and holds it there."""
    scenario = load_scenario("iiwa_wsg")
    arm = find_arm(build(scenario), scenario)
    follower = pose_follower(arm, scenario, planar=False)
    context = follower.CreateDefaultContext()
    follower.GetInputPort("robot_state").FixValue(context, np.append(arm.q0, np.zeros(7)))
    start = arm.start_pose()
    wanted = follower.GetInputPort("X_AE_desired")
    simulator = Simulator(follower, context)
    commands = []

    def follow(p: np.ndarray, seconds: float) -> np.ndarray:
        """Where the hand is afterwards."""
        wanted.FixValue(context, RigidTransform(start.rotation(), p))
        for _ in range(round(seconds / 0.005)):
            simulator.AdvanceTo((len(commands) + 0.5) * 0.005)
            commands.append(follower.GetOutputPort("joint_positions").Eval(context).copy())
        plant_context = arm.plant.CreateDefaultContext()
        arm.plant.SetPositions(plant_context, commands[-1])
        return arm.plant.EvalBodyPoseInWorld(plant_context, arm.end).translation()

    out = follow(start.translation() + [0.8, 0.0, 0.2], 5.0)
    assert out[0] > start.translation()[0] + 0.15
    speeds = np.diff(commands, axis=0) / 0.005
    assert np.abs(speeds[-200:]).max() < 2e-3, "no trembling"
    aside = follow(start.translation() + [0.8, 0.4, 0.2], 5.0)
    assert aside[1] > out[1] + 0.1, "it is not stuck"
    back = follow(start.translation(), 6.0)
    np.testing.assert_allclose(back, start.translation(), atol=2e-3)
    limits = GuardLimits.of_plant(arm.plant, arm.plant.GetModelInstanceByName("iiwa"))
    speeds = np.diff(commands, axis=0) / 0.005
    assert (np.array(commands) <= np.array(limits.position_upper) + 1e-9).all()
    assert (np.array(commands) >= np.array(limits.position_lower) - 1e-9).all()
    assert (np.abs(speeds) <= np.array(limits.velocity) + 1e-9).all()
    assert (np.abs(np.diff(speeds, axis=0)) / 0.005 <= np.array(limits.acceleration) + 1e-8).all()


def test_planar_mode_stays_in_the_plane() -> None:
    rig = Rig(load_scenario("planar"), "planar")
    start = rig.pose()
    x, y, z = start.translation()
    rig.set(x=x + 0.12, z=z - 0.15, tilt=0.4)
    worst = 0.0
    for _ in range(30):
        rig.run(0.1)
        worst = max(worst, abs(float(rig.pose().translation()[1] - y)))
        # The axis of the hand that was parallel to y of the world still is.
        turned = rig.pose().rotation().multiply(start.rotation().inverse())
        assert turned.matrix()[1, 1] > 1 - 1e-4
    assert worst < 1e-3
    p = rig.pose().translation()
    np.testing.assert_allclose(p[[0, 2]], [rig.get("x"), rig.get("z")], atol=2e-3)
    turned = rig.pose().rotation().multiply(start.rotation().inverse())
    assert RollPitchYaw(turned).pitch_angle() == pytest.approx(rig.get("tilt"), abs=0.009)


def test_planar_mode_needs_a_planar_start() -> None:
    scenario = loads_scenario("""
        directives:
        - add_model:
            name: iiwa
            file: package://prehensile/iiwa7/iiwa7.sdf
            default_joint_positions: {iiwa_joint_1: [0.7]}
        - add_weld: {parent: world, child: iiwa::iiwa_link_0}
        model_drivers: {iiwa: !IiwaDriver {control_mode: position_only}}
        """)
    station = build(scenario)
    with pytest.raises(InputError, match="turn about y"):
        teleoperate(station, scenario, start_meshcat(), mode="planar")


def test_joint_mode_moves_each_joint_to_its_slider() -> None:
    rig = Rig(load_scenario("iiwa_wsg"), "joints")
    names = [f"iiwa_joint_{i}" for i in range(1, 8)]
    q = rig.measured("iiwa.position_measured") + [0.3, -0.2, 0.1, 0.4, -0.5, 0.2, 0.6]
    rig.set(**dict(zip(names, q, strict=True)))
    rig.run(2.5)
    goal = [rig.get(name) for name in names]
    np.testing.assert_allclose(rig.measured("iiwa.position_measured"), goal, atol=2e-3)
    # Sliders end where the joints end.
    rig.set(iiwa_joint_4=-9.0)
    assert rig.get("iiwa_joint_4") == pytest.approx(
        rig.arm.plant.GetPositionLowerLimits()[3], abs=0.02
    )


def test_gamepad_moves_hand_and_sliders() -> None:
    rig = Rig(load_scenario("iiwa_wsg"), "pose")
    before = rig.pose().translation().copy()
    rig.gamepad.index = 0
    rig.gamepad.axes = [0.0, -0.5, 0.05, 0.5]  # half forward, half down, a stick that rests badly
    rig.gamepad.button_values[0] = 1.0
    rig.run(0.5)
    rig.gamepad.index = None
    moved_slider = rig.get("x") - before[0]
    assert moved_slider == pytest.approx(0.5 * 0.3 * 0.5, abs=0.011)
    rig.run(1.0)
    moved = rig.pose().translation() - before
    np.testing.assert_allclose(moved, [moved_slider, 0, rig.get("z") - before[2]], atol=2e-3)
    assert moved[2] == pytest.approx(-moved[0], abs=6e-3)
    assert rig.get("opening") == pytest.approx(0.1 - 0.15 * 0.5, abs=0.007)


def test_arm_is_chosen_by_name() -> None:
    scenario = load_scenario("bimanual")
    arms = [
        name
        for name, driver in scenario.model_drivers.items()
        if hasattr(driver, "hand_model_name")
    ]
    station = build(scenario)
    assert [find_arm(station, scenario, name).name for name in arms] == arms
    with pytest.raises(InputError, match="no arm 'nobody'"):
        find_arm(station, scenario, "nobody")


def test_source_is_no_faster_than_its_speed_and_then_exact() -> None:
    meshcat = start_meshcat()
    knob = Knob(Slider("a", -1.0, 1.0, 0.25, 0.1), speed=0.8)
    idle: Gamepad = FakeGamepad()
    source = SliderSource(meshcat, [knob], gamepad=lambda: idle)
    simulator = Simulator(source)
    simulator.Initialize()
    simulator.AdvanceTo(0.5)
    value = source.GetOutputPort("values")
    assert value.Eval(simulator.get_context())[0] == 0.1, "the start is not rounded to a step"
    meshcat.SetSliderValue("a", 1.0)
    simulator.AdvanceTo(1.0)
    assert value.Eval(simulator.get_context())[0] == pytest.approx(0.1 + 0.8 * 0.5, abs=0.026)
    simulator.AdvanceTo(3.0)
    assert value.Eval(simulator.get_context())[0] == 1.0
    source.remove()
    assert meshcat.GetSliderNames() == []
