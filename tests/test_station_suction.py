"""The suction cup's driver: what it holds, what it does not, and when it lets go."""

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.analysis import Simulator

from prehensile.errors import InputError
from prehensile.station.build import build
from prehensile.station.drivers.suction import holding_force, next_pressure, sealing_body
from prehensile.station.scenario_file import loads_scenario

# A cup, its lip down, that a joint lifts; a box under it.
LIFT = """<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="lift">
    <link name="base"/>
    <link name="carriage">
      <inertial><mass>2</mass>
        <inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>
    </link>
    <joint name="rise" type="prismatic">
      <parent>base</parent><child>carriage</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-0.5</lower><upper>0.5</upper><effort>500</effort>
        <velocity>1</velocity><drake:acceleration>5</drake:acceleration></limit></axis>
    </joint>
  </model>
</sdf>
"""
BOX = """<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu">
  <model name="box">
    <link name="box">
      <inertial><mass>{mass}</mass>
        <inertia><ixx>{i}</ixx><iyy>{i}</iyy><izz>{i}</izz></inertia></inertial>
      <collision name="box"><geometry><box><size>0.1 0.1 0.1</size></box></geometry>
        <drake:proximity_properties><drake:compliant_hydroelastic/>
          <drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>
          <drake:relaxation_time>0.1</drake:relaxation_time>
          <drake:mu_static>0.6</drake:mu_static></drake:proximity_properties></collision>
    </link>
  </model>
</sdf>
"""
SCENARIO = """
plant_config: {{time_step: 0.004, discrete_contact_approximation: sap}}
directives:
- add_model: {{name: lift, file: "package://mine/lift.sdf"}}
- add_weld: {{parent: world, child: lift::base, X_PC: {{translation: [0, 0, 0.265]}}}}
- add_model: {{name: cup, file: "package://prehensile/suction_cup/suction_cup.sdf"}}
- add_weld:
    parent: lift::carriage
    child: cup::suction_base
    X_PC: {{rotation: !Rpy {{deg: [180, 0, 0]}}}}
- add_model:
    name: box
    file: "package://mine/box.sdf"
    default_free_body_pose: {{box: {{translation: [0, 0, 0.05]}}}}
- add_model: {{name: floor, file: "package://prehensile/floor/floor.sdf"}}
- add_weld: {{parent: world, child: floor::base_link}}
model_drivers:
  lift: !JointPidDriver {{bandwidth: 60}}
  cup: !SuctionDriver {{{config}}}
"""


def station(tmp_path, mass: float = 0.3, config: str = ""):
    """A cup 5 cm over a box of 10 cm and a mass."""
    (tmp_path / "lift.sdf").write_text(LIFT)
    (tmp_path / "box.sdf").write_text(BOX.format(mass=mass, i=mass * 0.1**2 / 6))
    text = SCENARIO.format(config=config)
    return build(loads_scenario(text, packages={"mine": tmp_path}))


class Run:
    """A station at work: the cup goes down to the box, draws, and comes up again."""

    def __init__(self, diagram) -> None:
        self.diagram = diagram
        self.simulator = Simulator(diagram)
        self.context = self.simulator.get_mutable_context()
        plant = diagram.plant()
        self.plant, self.plant_context = plant, plant.GetMyMutableContextFromRoot(self.context)
        self.box = plant.GetBodyByName("box")
        self.vacuum(0.0)
        self.move(0.0)

    def vacuum(self, on: float) -> None:
        self.diagram.GetInputPort("cup.vacuum").FixValue(self.context, [on])

    def move(self, rise: float) -> None:
        self.diagram.GetInputPort("lift.position").FixValue(self.context, [rise])

    def wait(self, duration: float) -> None:
        self.simulator.AdvanceTo(self.context.get_time() + duration)

    def value(self, port: str) -> float:
        return float(self.diagram.GetOutputPort(f"cup.{port}").Eval(self.context)[0])

    @property
    def height(self) -> float:
        """Of the box over where it stood, m."""
        X_WB = self.plant.EvalBodyPoseInWorld(self.plant_context, self.box)
        return float(X_WB.translation()[2]) - 0.05

    def lift(self) -> None:
        self.move(-0.051)  # a millimetre into the rubber
        self.wait(1.0)
        self.vacuum(1.0)
        self.wait(0.3)
        self.move(0.05)
        self.wait(1.2)


def test_lifts_a_box_and_lets_it_go(tmp_path):
    run = Run(station(tmp_path))
    run.wait(0.1)
    assert run.value("sealed") == 0.0
    run.lift()
    assert run.value("sealed") == 1.0
    assert run.value("pressure") == pytest.approx(60e3, rel=1e-3)
    assert run.height == pytest.approx(0.10, abs=0.003)
    X_WB = run.plant.EvalBodyPoseInWorld(run.plant_context, run.box)
    run.wait(1.0)
    moved = X_WB.InvertAndCompose(run.plant.EvalBodyPoseInWorld(run.plant_context, run.box))
    assert np.linalg.norm(moved.translation()) < 5e-4
    assert moved.rotation().ToAngleAxis().angle() < np.radians(0.2)
    run.move(-0.045)
    run.wait(1.0)
    assert run.height == pytest.approx(0.005, abs=0.002)
    run.vacuum(0.0)
    run.wait(0.5)
    assert run.value("sealed") == 0.0
    assert run.value("pressure") < 1.0
    assert abs(run.height) < 2e-3


def test_lets_go_when_the_vacuum_is_too_weak_for_the_weight(tmp_path):
    response, weight = 0.2, 0.3 * 9.81
    run = Run(station(tmp_path, config=f"response: {response}"))
    run.lift()
    run.wait(1.0)
    height = run.height
    run.vacuum(0.0)
    falls = response * np.log(holding_force(60e3, 0.016) / weight)  # 0.56 s
    run.wait(falls - 0.05)
    assert run.height == pytest.approx(height, abs=1e-3)
    assert run.value("sealed") == 1.0
    run.wait(0.3)
    assert run.height < height - 0.05
    assert run.value("sealed") == 0.0


def test_nothing_is_held_without_vacuum(tmp_path):
    run = Run(station(tmp_path))
    run.vacuum(0.0)
    run.move(-0.051)
    run.wait(1.0)
    run.move(0.05)
    run.wait(1.0)
    assert abs(run.height) < 2e-3


@pytest.mark.parametrize(("share", "held"), [(0.85, True), (1.15, False)])
def test_holds_pressure_times_area(tmp_path, share: float, held: bool):
    # Lifted slowly, so that the box's weight is all that pulls.
    weight = share * holding_force(20e3, 0.016)
    run = Run(station(tmp_path, mass=weight / 9.81, config="vacuum: 20000"))
    run.move(-0.051)
    run.wait(1.0)
    run.vacuum(1.0)
    run.wait(0.3)
    for rise in np.linspace(-0.051, -0.02, 32):
        run.move(rise)
        run.wait(0.05)
    assert run.value("sealed") == float(held)
    assert run.height == pytest.approx(0.03 if held else 0.0, abs=0.003)


def test_a_heavy_box_stays(tmp_path):
    run = Run(station(tmp_path, mass=6.0))
    run.lift()
    assert abs(run.height) < 2e-3
    assert run.value("sealed") == 0.0


def test_forces_from_outside_still_reach_the_plant(tmp_path):
    run = Run(station(tmp_path))
    port = run.diagram.GetInputPort("cheat.applied_spatial_force")
    force = ExternallyAppliedSpatialForce()
    force.body_index = run.box.index()
    force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=[0.0, 0.0, 5.0])
    port.FixValue(run.context, Value[list[ExternallyAppliedSpatialForce]]([force]))
    run.wait(0.1)
    # 5 N against 0.3 kg.
    assert run.height == pytest.approx(0.5 * (5.0 / 0.3 - 9.81) * 0.1**2, rel=0.1)


def test_force_law():
    # The cup of 40 mm with its 32 mm of area at 60 kPa: 48 N by any pocket calculator.
    assert holding_force(60e3, 0.016) == pytest.approx(48.25, abs=0.01)
    assert next_pressure(0.0, 60e3, 0.03, 0.03) == pytest.approx(60e3 * (1 - np.exp(-1)))
    assert next_pressure(500.0, 500.0, 1.0, 0.03) == 500.0
    half = next_pressure(next_pressure(9e3, 0.0, 0.01, 0.03), 0.0, 0.02, 0.03)
    assert half == pytest.approx(next_pressure(9e3, 0.0, 0.03, 0.03))


def test_what_closes_the_cup():
    assert sealing_body([{3: 1e-3}, {3: -1e-4}], 2e-3) == 3
    assert sealing_body([{3: 1e-3}, {3: 3e-3}], 2e-3) is None  # open on one side
    assert sealing_body([{3: 1e-3}, {4: 1e-3}], 2e-3) is None  # two bodies, a gap between them
    assert sealing_body([{3: 1e-3, 4: 0.0}, {3: 1e-3, 4: 5e-4}], 2e-3) == 4
    assert sealing_body([{}, {3: 0.0}], 2e-3) is None


@pytest.mark.parametrize(
    ("config", "key"), [("radius: 0", "radius"), ("vacuum: -1", "vacuum"), ("frame: tip", "frame")]
)
def test_bad_configurations_are_named(tmp_path, config: str, key: str):
    with pytest.raises(InputError) as error:
        station(tmp_path, config=config)
    assert f"model_drivers.cup.{key}" in str(error.value)
