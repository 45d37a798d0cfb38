"""The control room in stations: the PID driver, gains for a bandwidth, arms with few joints."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from prehensile.errors import InputError
from prehensile.station.build import build
from prehensile.station.guard import GuardStatus
from prehensile.station.scenario_file import loads_scenario

ARM = """
plant_config: {{time_step: 0.002, discrete_contact_approximation: sap}}
directives:
- add_model:
    name: iiwa
    file: package://prehensile/iiwa7/iiwa7.sdf
    default_joint_positions:
      iiwa_joint_2: [0.6]
      iiwa_joint_4: [-1.2]
- add_weld: {{parent: world, child: iiwa::iiwa_link_0}}
model_drivers:
  iiwa: {driver}
"""

LINK = """
<link name="link{k}"><pose relative_to="joint{k}"/>
  <inertial><pose>0 0 0.1 0 0 0</pose><mass>1</mass>
    <inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial></link>
<joint name="joint{k}" type="revolute"><pose relative_to="{parent}">0 0 0.3 0 0 0</pose>
  <parent>{parent}</parent><child>link{k}</child>
  <axis><xyz>0 1 0</xyz>
    <limit><lower>-2</lower><upper>2</upper><effort>200</effort><velocity>2</velocity></limit>
  </axis></joint>"""


def station_with(driver: str):
    return build(loads_scenario(ARM.format(driver=driver)))


def planar_arm(folder, joints: int, driver: str = "!IiwaDriver {}") -> str:
    links = "".join(
        LINK.format(k=k, parent=f"link{k - 1}" if k > 1 else "base") for k in range(1, joints + 1)
    )
    (folder / "planar.sdf").write_text(
        f'<sdf version="1.9"><model name="planar"><link name="base"/>{links}</model></sdf>'
    )
    return f"""
packages: {{mine: {folder}}}
plant_config: {{time_step: 0.002, discrete_contact_approximation: sap}}
directives:
- add_model: {{name: iiwa, file: "package://mine/planar.sdf"}}
- add_weld: {{parent: world, child: "iiwa::base"}}
model_drivers:
  iiwa: {driver}
"""


@pytest.mark.parametrize(
    ("driver", "sag"),
    [
        ("!JointPidDriver {gravity_compensation: false, integral_rate: 5}", 0.02),
        ("!JointPidDriver {}", 1e-3),
        ("!JointStiffnessDriver {bandwidth: 20}", 1e-3),
    ],
)
def test_gains_for_a_bandwidth_hold_and_follow(driver, sag):
    station = station_with(driver)
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    measured = station.GetOutputPort("iiwa.position_measured")
    start = measured.Eval(context)
    simulator.AdvanceTo(0.5)
    assert np.max(np.abs(measured.Eval(context) - start)) < sag
    station.GetInputPort("iiwa.position").FixValue(context, start + 0.09)
    simulator.AdvanceTo(2.5)
    np.testing.assert_allclose(measured.Eval(context), start + 0.09, atol=2e-3)
    assert station.GetOutputPort("iiwa.guard_status").Eval(context) == GuardStatus.OK


def test_joints_without_gains_hang():
    station = station_with("!JointStiffnessDriver {}")
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    plant = station.plant()
    plant.SetVelocities(plant.GetMyMutableContextFromRoot(context), np.full(7, 0.1))
    simulator.AdvanceTo(0.5)
    # Gravity is held, and nothing else: the joints drift on.
    moved = station.GetOutputPort("iiwa.position_measured").Eval(context)
    assert np.all(np.abs(moved - [0.0, 0.6, 0.0, -1.2, 0.0, 0.0, 0.0]) > 0.02)


def test_named_gains_replace_those_for_the_bandwidth():
    # A soft elbow gives way under a torque by torque / kp.
    station = station_with("!JointPidDriver {gains: {iiwa_joint_4: {kp: 200, kd: 60}}}")
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("iiwa.feedforward_torque").FixValue(context, 5.0 * (np.arange(7) == 3))
    simulator.AdvanceTo(3.0)
    q = station.GetOutputPort("iiwa.position_measured").Eval(context)
    assert q[3] + 1.2 == pytest.approx(5.0 / 200.0, rel=0.05)
    assert np.max(np.abs(np.delete(q, 3) - [0.0, 0.6, 0.0, 0.0, 0.0, 0.0])) < 2e-3


@pytest.mark.parametrize(
    ("driver", "words"),
    [
        ("!JointPidDriver {bandwidth: -1}", "out of range"),
        ("!JointPidDriver {gains: {elbow: {kp: 1}}}", "elbow"),
        ("!JointPidDriver {gains: {iiwa_joint_1: {kp: -1}}}", "out of range"),
        ("!JointStiffnessDriver {bandwith: 3}", "bandwidth"),
    ],
)
def test_wrong_drivers_are_named(driver, words):
    with pytest.raises(InputError, match=words):
        station_with(driver)


@pytest.mark.parametrize("joints", [2, 3, 6])
def test_the_iiwa_driver_drives_other_numbers_of_joints(tmp_path, joints):
    station = build(loads_scenario(planar_arm(tmp_path, joints)))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("iiwa.position").FixValue(context, np.full(joints, 0.09))
    simulator.AdvanceTo(2.0)
    measured = station.GetOutputPort("iiwa.position_measured").Eval(context)
    np.testing.assert_allclose(measured, 0.09, atol=1e-3)
    # On hardware it has the same ports.
    interface = build(loads_scenario(planar_arm(tmp_path, joints)), hardware=True)
    assert interface.GetInputPort("iiwa.position").size() == joints
    assert interface.GetOutputPort("iiwa.state_estimated").size() == 2 * joints


def test_gains_of_another_number_of_joints_are_named(tmp_path):
    text = planar_arm(tmp_path, 3, "!IiwaDriver {desired_kp_gains: [1, 2]}")
    with pytest.raises(InputError, match="2 gains stand where 3 joints move"):
        build(loads_scenario(text))


TWO = """
plant_config: {{time_step: 0.002, discrete_contact_approximation: sap}}
directives:
- add_model: {{name: left, file: "package://prehensile/iiwa7/iiwa7.sdf"}}
- add_weld: {{parent: world, child: "left::iiwa_link_0"}}
- add_model: {{name: right, file: "package://prehensile/iiwa14/iiwa14.sdf"}}
- add_weld:
    parent: world
    child: right::iiwa_link_0
    X_PC: {{translation: [0, 1.5, 0]}}
model_drivers:
  {models}: {driver}
"""


@pytest.mark.parametrize("models", ["left+right", "right+left"])
def test_two_arms_driven_as_one_in_the_order_of_their_names(models):
    driver = "!JointPidDriver {gains: {right_iiwa_joint_1: {kp: 500, kd: 150}}}"
    station = build(loads_scenario(TWO.format(models=models, driver=driver)))
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    target = 0.005 * np.arange(1, 15)
    station.GetInputPort(f"{models}.position").FixValue(context, target)
    simulator.AdvanceTo(2.5)
    measured = station.GetOutputPort(f"{models}.position_measured").Eval(context)
    np.testing.assert_allclose(measured, target, atol=2e-3)
    plant = station.plant()
    first = plant.GetModelInstanceByName(models.split("+")[0])
    q = plant.GetPositions(plant.GetMyContextFromRoot(context), first)
    np.testing.assert_allclose(q, target[:7], atol=2e-3)


def test_stiffness_drives_one_model_at_a_time():
    text = TWO.format(models="left+right", driver="!JointStiffnessDriver {bandwidth: 20}")
    with pytest.raises(InputError, match="one model"):
        build(loads_scenario(text))
