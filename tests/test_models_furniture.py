"""The embedded furniture: its frames and sizes, and that it holds, swings and stops."""

import numpy as np
import pytest
from model_checks import scene
from pydrake.geometry import Box, ProximityProperties
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import RevoluteJoint, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.models.registry import find_model, package_map


def test_table_top_is_the_plane_z_0() -> None:
    table = scene("table", weld="base_link")
    for x, y in ((0.0, 0.0), (0.85, 0.75), (-0.85, -0.75)):
        for z in (0.03, 0.2):
            assert table.distance("base_link", np.array([x, y, z])) == pytest.approx(z, abs=1e-9)
    # It stands on the floor, 0.75 m below.
    below = table.distance("base_link", np.array([0.8, 0.7, -0.8]))
    assert below == pytest.approx(0.05, abs=1e-9)


def test_floor_is_the_plane_z_0() -> None:
    floor = scene("floor", weld="base_link")
    for x, y, z in ((0.0, 0.0, 0.1), (1.9, -1.9, 0.02), (-1.5, 1.0, 0.3)):
        assert floor.distance("base_link", np.array([x, y, z])) == pytest.approx(z, abs=1e-9)


def test_bin_has_the_interior_that_it_says() -> None:
    made = scene("bin", weld="base_link")

    def distance(x: float, y: float, z: float) -> float:
        return made.distance("base_link", np.array([x, y, z]))

    for z in (0.07, 0.18):
        assert distance(0.23, 0.0, z) == pytest.approx(min(0.05, z - 0.03), abs=1e-9)
        assert distance(-0.25, 0.0, z) == pytest.approx(0.03, abs=1e-9)
        assert distance(0.0, 0.16, z) == pytest.approx(0.03, abs=1e-9)
        assert distance(0.0, -0.16, z) == pytest.approx(0.03, abs=1e-9)
    assert distance(0.0, 0.0, 0.05) == pytest.approx(0.02, abs=1e-9)  # floor at 0.03
    assert distance(0.3, 0.0, 0.27) == pytest.approx(0.08, abs=1e-9)  # walls up to 0.19
    assert distance(0.295, 0.205, -0.02) == pytest.approx(0.02, abs=1e-9)  # stands at 0
    assert distance(0.29, 0.0, 0.1) < 0.0  # walls are thick


@pytest.mark.parametrize("v_WB", [(5.0, 0.0, 0.0), (0.0, -5.0, 0.0), (3.0, 3.0, -3.0)])
def test_nothing_flies_through_the_walls_of_the_bin(v_WB: tuple[float, float, float]) -> None:
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(time_step=0.004, discrete_contact_approximation="sap")
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.AddModelsFromUrl(find_model("bin").url)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_link"))
    cube = plant.AddRigidBody(
        "cube",
        plant.AddModelInstance("cube"),
        SpatialInertia.SolidBoxWithMass(0.5, 0.05, 0.05, 0.05),
    )
    properties = ProximityProperties()
    properties.AddProperty("material", "coulomb_friction", CoulombFriction(0.5, 0.5))
    plant.RegisterCollisionGeometry(cube, RigidTransform(), Box(0.05, 0.05, 0.05), "c", properties)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetFreeBodyPose(context, cube, RigidTransform([0.0, 0.0, 0.08]))
    state = plant.GetVelocities(context)
    state[3:] = v_WB
    plant.SetVelocities(context, state)
    simulator.AdvanceTo(1.0)
    p_WB = plant.EvalBodyPoseInWorld(context, cube).translation()
    assert abs(p_WB[0]) < 0.28
    assert abs(p_WB[1]) < 0.19
    assert 0.03 < p_WB[2] < 0.17


@pytest.mark.parametrize("name", ["table", "bin", "shelves", "cupboard"])
def test_it_stands_still_on_its_feet(name: str) -> None:
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=0.005,
        contact_model="hydroelastic_with_fallback",
        discrete_contact_approximation="sap",
    )
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (instance,) = parser.AddModelsFromUrl(find_model(name).url)
    ground = ProximityProperties()
    ground.AddProperty("material", "coulomb_friction", CoulombFriction(0.5, 0.5))
    plant.RegisterCollisionGeometry(
        plant.world_body(), RigidTransform([0, 0, -0.5]), Box(3, 3, 1), "ground", ground
    )
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    body = plant.GetBodyByName("base_link", instance)
    height = 0.75 if name == "table" else 0.0
    plant.SetFreeBodyPose(context, body, RigidTransform([0.0, 0.0, height + 0.002]))
    simulator.AdvanceTo(1.0)
    X_WB = plant.EvalBodyPoseInWorld(context, body)
    np.testing.assert_allclose(X_WB.translation(), [0.0, 0.0, height], atol=1e-3)
    for t in np.arange(1.05, 2.0, 0.05):
        simulator.AdvanceTo(t)
        assert plant.EvalKineticEnergy(context) < 1e-6
    moved = X_WB.InvertAndCompose(plant.EvalBodyPoseInWorld(context, body))
    assert np.linalg.norm(moved.translation()) < 1e-5


def test_shelves_have_three_compartments_open_to_the_front() -> None:
    shelves = scene("shelves", weld="base_link")
    column = [shelves.distance("base_link", np.array([0.1, 0.0, z])) for z in
              np.arange(0.0015, 0.8, 0.001)]  # fmt: skip
    inside = np.array(column) < 0.0
    starts = np.flatnonzero(inside[1:] & ~inside[:-1])
    assert inside[0]
    assert len(starts) == 3  # two shelves and the top, above the floor
    clear = np.diff(np.flatnonzero(np.diff(inside.astype(int)))[0::1])[0::2]
    assert (clear > 230).all()  # mm
    assert shelves.distance("base_link", np.array([0.16, 0.0, 0.15])) > 0.0


class TestCupboard:
    hinges = ("left_door_hinge", "right_door_hinge")

    def test_closed_doors_touch_nothing(self) -> None:
        cupboard = scene("cupboard", weld="base_link")
        assert not cupboard.query.ComputePointPairPenetration()
        np.testing.assert_array_equal(cupboard.plant.GetPositions(cupboard.context), [0.0, 0.0])

    def test_doors_turn_outwards_and_not_through_one_another(self) -> None:
        cupboard = scene("cupboard", weld="base_link")
        plant, context = cupboard.plant, cupboard.context
        for angles in np.random.default_rng(0).uniform(0.0, 2.0, size=(200, 2)):
            plant.SetPositions(context, angles)
            for hinge, angle in zip(self.hinges, angles, strict=True):
                side = hinge.removesuffix("_hinge")
                p_W = plant.GetFrameByName(f"{side}_handle").CalcPoseInWorld(context).translation()
                # Seen from the front the left door is at negative y; both handles move to +x.
                assert np.sign(p_W[1]) == (-1.0 if side.startswith("left") else 1.0)
                assert p_W[0] > 0.15 + 0.1 * min(angle, 1.5)
            pairs = cupboard.query.ComputePointPairPenetration()
            assert not pairs

    def test_there_is_room_for_a_finger_behind_the_handles(self) -> None:
        cupboard = scene("cupboard", weld="base_link")
        handle = cupboard.plant.GetFrameByName("left_door_handle")
        p_door = handle.GetFixedPoseInBodyFrame().translation()
        assert cupboard.distance("left_door", p_door) < 0.0
        behind = p_door - [0.0225, 0.0, 0.0]
        assert cupboard.distance("left_door", behind) > 0.0105  # fingers are about 20 mm thick

    @pytest.mark.parametrize("hinge", hinges)
    def test_a_pushed_door_coasts_as_its_damping_says(self, hinge: str) -> None:
        # I w' = -d w, so the door stops after turning by w I / d; the stop at 2 rad is beyond.
        cupboard = scene("cupboard", weld="base_link")
        plant = cupboard.plant
        joint = plant.GetJointByName(hinge)
        assert isinstance(joint, RevoluteJoint)
        plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
        simulator = Simulator(cupboard.diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        joint.set_angular_rate(context, 2.0)
        inertia = plant.CalcMassMatrixViaInverseDynamics(context)[
            joint.velocity_start(), joint.velocity_start()
        ]
        assert 0.01 < inertia < 0.1
        simulator.AdvanceTo(4.0)
        expected = 2.0 * inertia / joint.default_damping()
        assert joint.get_angle(context) == pytest.approx(expected, rel=0.03)
        other = next(h for h in self.hinges if h != hinge)
        angle = plant.GetPositions(context)[plant.GetJointByName(other).position_start()]
        assert abs(angle) < 1e-6

    def test_doors_stop_at_their_limits(self) -> None:
        cupboard = scene("cupboard", weld="base_link")
        plant = cupboard.plant
        simulator = Simulator(cupboard.diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        plant.get_applied_generalized_force_input_port().FixValue(context, [1.0, 1.0])
        simulator.AdvanceTo(2.0)
        np.testing.assert_allclose(plant.GetPositions(context), 2.0, atol=0.01)
        plant.get_applied_generalized_force_input_port().FixValue(context, [-1.0, -1.0])
        simulator.AdvanceTo(4.0)
        np.testing.assert_allclose(plant.GetPositions(context), 0.0, atol=0.01)
        assert np.isfinite(plant.GetVelocities(context)).all()
