"""Clutter falls into the bin, stays there, and falls the same way again."""

import numpy as np
import pytest
from pydrake.geometry import SceneGraphConfig
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlantConfig
from pydrake.systems.analysis import Simulator

from prehensile.errors import InputError
from prehensile.scenes.clutter import PlacedObject, drop_into_bin, inside_bin, with_objects
from prehensile.station import build, load_scenario

X_WB = RigidTransform(RollPitchYaw(0, 0, 0.7), [0.4, -0.2, 0.1])
MODELS = ["cracker_box", "mug", "foam_brick", "mug"]


def drop(seed, models=MODELS):
    config = MultibodyPlantConfig(time_step=0.005, discrete_contact_approximation="sap")
    return drop_into_bin(
        models, X_WB, seed=seed, plant_config=config, scene_graph_config=SceneGraphConfig()
    )


@pytest.fixture(scope="module")
def objects():
    return drop(3)


def test_each_object_lies_in_the_bin(objects):
    assert [o.model for o in objects] == MODELS
    assert [o.name for o in objects] == ["cracker_box_0", "mug_0", "foam_brick_0", "mug_1"]
    for placed in objects:
        x, y, z = X_WB.inverse().multiply(placed.X_WO.translation())
        # Interior 0.56 x 0.38 m over a floor at 0.03 m; no centre is nearer than 2 cm to a wall.
        assert abs(x) < 0.26
        assert abs(y) < 0.17
        assert 0.035 < z < 0.27


def test_the_same_seed_gives_the_same_clutter(objects):
    for placed, again in zip(objects, drop(3), strict=True):
        np.testing.assert_array_equal(
            placed.X_WO.GetAsMatrix4(), again.X_WO.GetAsMatrix4(), strict=True
        )
    other = drop(4, MODELS[:1])[0]
    assert not other.X_WO.IsNearlyEqualTo(objects[0].X_WO, 1e-3)


def test_a_station_starts_with_the_objects_where_they_lay():
    scenario = load_scenario("iiwa_wsg")
    X_WO = RigidTransform(RollPitchYaw(0.3, -1.2, 2.0), [0.5, 0.2, 0.4])
    placed = PlacedObject("cup", "mug", X_WO)
    before = len(scenario.directives)
    directives = with_objects(scenario.directives, [placed])
    assert len(scenario.directives) == before
    scenario.directives[:] = directives
    station = build(scenario)
    plant = station.GetSubsystemByName("plant")
    context = plant.GetMyContextFromRoot(station.CreateDefaultContext())
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("cup"))
    assert plant.EvalBodyPoseInWorld(context, body).IsNearlyEqualTo(X_WO, 1e-12)


def test_unknown_objects_are_refused():
    with pytest.raises(InputError, match="mug"):
        drop(0, ["mgu"])


@pytest.mark.parametrize(
    ("p_BO", "expected"),
    [
        ([0, 0, 0.05], True),
        ([0.27, 0.18, 0.16], True),
        ([0.29, 0, 0.05], False),
        ([0, -0.2, 0.05], False),
        ([0, 0, -0.01], False),
        ([0, 0, 0.5], False),
    ],
)
def test_inside_bin(p_BO, expected):
    assert inside_bin(X_WB.multiply(np.array(p_BO, dtype=float)), X_WB) is expected


def test_what_falls_off_the_table_ends_on_the_floor():
    # Without a floor a thing that falls spins faster and faster, until numbers overflow.
    scenario = load_scenario("two_bins")
    X_WO = RigidTransform([1.2, -1.0, 0.0])
    brick = PlacedObject("brick", "foam_brick", X_WO)
    scenario.directives[:] = with_objects(scenario.directives, [brick])
    station = build(scenario)
    simulator = Simulator(station)
    simulator.AdvanceTo(1.5)
    plant = station.GetSubsystemByName("plant")
    context = plant.GetMyContextFromRoot(simulator.get_context())
    body = plant.GetBodyByName("base_link", plant.GetModelInstanceByName("brick"))
    z = plant.EvalBodyPoseInWorld(context, body).translation()[2]
    assert -0.75 + 0.02 < z < -0.75 + 0.05
