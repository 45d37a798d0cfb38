"""Scenes with household objects for the tests: a floor, a bin of boxes, two squeezing fingers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.models.generate import DATA


def vector(*values: Any) -> Any:
    """A float array (typed Any: the stubs of pydrake name array types that NumPy has not)."""
    return np.array(values, dtype=float)


def rigid_properties(mu: float = 0.6) -> ProximityProperties:
    """A rigid floor or wall."""
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(properties)
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
        RigidTransform(vector(*center)),
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
    """Objects in a shaft over a bin of 0.56 x 0.38 m, its floor at z = 0.

    The walls go up so far that what is dropped from a height cannot bounce out.
    """
    scene = new_scene(time_step, names)
    x, y, z, thick = 0.56, 0.38, 1.8, 0.05
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


class GripScene:
    """An object on the floor and the embedded WSG 50 above it, pointing down, on a lift.

    The lift is a sliding joint with strong damping, driven at v by the force damping * v: stiff
    enough for the test and without a controller. The hand closes along the world's x axis.
    """

    LIFT_DAMPING = 1e5  # N s / m
    FINGER_DAMPING = 200.0  # N s / m: the fingers close at 0.15 m/s, as real ones

    def __init__(self, time_step: float, name: str) -> None:
        scene = new_scene(time_step, {"object": name})
        plant = scene.plant
        parser = Parser(plant)
        parser.package_map().Add("prehensile", DATA)
        (self.hand,) = parser.AddModels(DATA / "wsg50" / "wsg50.sdf")
        body = plant.GetBodyByName("body", self.hand)
        # The hand's y axis points out of the palm: down.
        R_WB = RotationMatrix(vector([1, 0, 0], [0, 0, 1], [0, -1, 0]))
        frame = plant.AddFrame(
            FixedOffsetFrame("lift", plant.world_frame(), RigidTransform(R_WB, vector(0, 0, 0)))
        )
        self.lift: Any = plant.AddJoint(
            PrismaticJoint(
                "lift", frame, body.body_frame(), vector(0, -1, 0), damping=self.LIFT_DAMPING
            )
        )
        plant.AddJointActuator("lift", self.lift)
        self.fingers: list[Any] = [
            plant.GetJointByName(f"{side}_finger_sliding_joint", self.hand)
            for side in ("left", "right")
        ]
        for finger in self.fingers:
            finger.set_default_damping_vector(vector(self.FINGER_DAMPING))
        plant.AddCouplerConstraint(self.fingers[0], self.fingers[1], -1.0)
        add_wall(plant, "floor", [4.0, 4.0, 1.0], [0.0, 0.0, -0.5])
        plant.set_gravity_enabled(self.hand, False)
        plant.Finalize()
        self.scene = scene

    def run(self, X_WO: RigidTransform, pad_height: float, force: float) -> tuple[float, float]:
        """Closes with ``force`` N, lifts 0.12 m in 0.6 s and holds for 0.5 s.

        Returns:
            How far the object rose, m, and by how much it moved in the hand after it was closed, m.
        """
        plant, scene = self.scene.plant, self.scene
        simulator = scene.simulator({"object": X_WO})
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        for finger, sign in zip(self.fingers, (-1.0, 1.0), strict=True):
            finger.set_translation(context, 0.0535 * sign)
        left = plant.GetBodyByName("left_finger", self.hand)
        p_LP = vector(-0.00775, 0.025, 0.0)  # middle of the finger tip
        now = (plant.EvalBodyPoseInWorld(context, left) @ p_LP)[2]
        self.lift.set_translation(context, pad_height - now)
        port = plant.get_actuation_input_port(self.hand)

        def drive(speed: float, seconds: float) -> RigidTransform:
            port.FixValue(context, [force, -force, self.LIFT_DAMPING * speed])
            simulator.AdvanceTo(simulator.get_context().get_time() + seconds)
            X_WL = plant.EvalBodyPoseInWorld(context, left)
            return X_WL.inverse() @ scene.pose(simulator, "object")

        X_LO = drive(0.0, 0.6)
        drive(0.2, 0.6)
        slip = np.subtract(drive(0.0, 0.5).translation(), X_LO.translation())
        rise = scene.pose(simulator, "object").translation()[2] - X_WO.translation()[2]
        return float(rise), float(np.linalg.norm(slip))
