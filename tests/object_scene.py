"""Scenes with household objects for the tests: a floor, a bin of boxes, two squeezing fingers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.models.generate import DATA


def rigid_properties(mu: float = 0.6) -> ProximityProperties:
    """A rigid floor or wall."""
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(properties)
    AddContactMaterial(friction=CoulombFriction(mu, mu), properties=properties)
    properties.AddProperty("material", "relaxation_time", 0.02)
    return properties


def soft_properties(mu: float = 1.0) -> ProximityProperties:
    """A compliant finger tip."""
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(0.01, 2e6, properties)
    AddContactMaterial(friction=CoulombFriction(mu, mu), properties=properties)
    properties.AddProperty("material", "relaxation_time", 0.02)
    return properties


@dataclass
class Scene:
    """A plant with objects; made by `floor_scene` and the like, run by `simulate`."""

    builder: DiagramBuilder
    plant: MultibodyPlant
    bodies: dict[str, RigidBody]

    def simulator(self, poses: Mapping[str, RigidTransform]) -> Simulator:
        """A simulator with each object at its pose in the world."""
        diagram = self.builder.Build()
        simulator = Simulator(diagram)
        context = self.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        for key, X_WO in poses.items():
            self.plant.SetFreeBodyPose(context, self.bodies[key], X_WO)
        simulator.Initialize()
        return simulator

    def pose(self, simulator: Simulator, key: str) -> RigidTransform:
        """Pose of an object in the world now."""
        context = self.plant.GetMyContextFromRoot(simulator.get_context())
        return self.plant.EvalBodyPoseInWorld(context, self.bodies[key])

    def energy(self, simulator: Simulator) -> float:
        """Kinetic energy of everything, J."""
        context = self.plant.GetMyContextFromRoot(simulator.get_context())
        return self.plant.CalcKineticEnergy(context)


def new_scene(time_step: float, names: Mapping[str, str]) -> Scene:
    """A plant as stations use it; ``names`` maps a key to the model of an object."""
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=time_step,
        discrete_contact_approximation="sap",
        contact_model="hydroelastic_with_fallback",
    )
    plant, _ = AddMultibodyPlant(config, builder)
    parser = Parser(plant)
    parser.package_map().Add("prehensile", DATA)
    parser.SetAutoRenaming(True)
    bodies = {}
    for key, name in names.items():
        (model,) = parser.AddModels(DATA / name / f"{name}.sdf")
        bodies[key] = plant.GetBodyByName("base_link", model)
    return Scene(builder, plant, bodies)


def add_wall(
    plant: MultibodyPlant, name: str, size: Sequence[float], center: Sequence[float]
) -> None:
    """A rigid box fixed to the world."""
    plant.RegisterCollisionGeometry(
        plant.world_body(),
        RigidTransform(p=list(center)),
        Box(*size),
        name,
        rigid_properties(),
    )


def floor_scene(time_step: float, names: Mapping[str, str]) -> Scene:
    """Objects above a thick rigid floor whose top is z = 0."""
    scene = new_scene(time_step, names)
    add_wall(scene.plant, "floor", [4.0, 4.0, 1.0], [0.0, 0.0, -0.5])
    scene.plant.Finalize()
    return scene


def bin_scene(time_step: float, names: Mapping[str, str]) -> Scene:
    """Objects above a bin with an interior of 0.56 x 0.38 x 0.16 m, its floor at z = 0."""
    scene = new_scene(time_step, names)
    x, y, z, thick = 0.56, 0.38, 0.16, 0.05
    add_wall(scene.plant, "floor", [x + 1, y + 1, 0.1], [0, 0, -0.05])
    for sign in (-1.0, 1.0):
        add_wall(
            scene.plant,
            f"x{sign}",
            [thick, y + 2 * thick, z],
            [sign * (x + thick) / 2, 0, z / 2],
        )
        add_wall(
            scene.plant,
            f"y{sign}",
            [x + 2 * thick, thick, z],
            [0, sign * (y + thick) / 2, z / 2],
        )
    scene.plant.Finalize()
    return scene
