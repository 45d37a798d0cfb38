"""Scenes of one object at rest in a bin: upright, leaning on a wall, or as it fell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlant
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from prehensile.errors import Finding, InputError
from prehensile.models.registry import find_model, package_map
from prehensile.scenes.clutter import BIN_INTERIOR_MAX, BIN_INTERIOR_MIN, inside_bin
from prehensile.station.scenario import Scenario

START_KINDS = ("upright", "leaning", "fallen")
_SHARES = (0.25, 0.25, 0.5)
_SETTLE = 4.0  # s, longest wait for rest
_REST = 1e-6  # J
_TRIES = 20


@dataclass(frozen=True)
class RestPose:
    """Where an object came to rest.

    Attributes:
        X_WO: its pose.
        start: how it was let go: ``upright``, ``leaning`` or ``fallen``.
    """

    X_WO: RigidTransform
    start: str


def random_rest_pose(
    model: str,
    vertices: NDArray[np.float64],
    X_WB: RigidTransform,
    scenario: Scenario,
    *,
    seed: int,
) -> RestPose:
    """Lets go of an object in the embedded bin, and waits until it rests.

    A quarter of the seeds sets it upright, a quarter leans it against a wall, and half drops it
    turned at random; wherever it then comes to rest in the bin, it stays.

    Args:
        model: name of the embedded object.
        vertices: (V, 3) of its surface, in its frame O [m]; z_O is its upward axis.
        X_WB: pose of the bin.
        scenario: whose contact model and time step it settles with.
        seed: of everything.

    Raises:
        InputError: it does not stay in the bin.
    """
    rng = np.random.default_rng([seed, 4])
    start = str(rng.choice(START_KINDS, p=_SHARES))
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlant(scenario.plant_config, scenario.scene_graph_config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    (bin_instance,) = parser.AddModels(url=find_model("bin").url)
    bin_frame = plant.GetBodyByName("base_link", bin_instance).body_frame()
    plant.WeldFrames(plant.world_frame(), bin_frame, X_WB)
    (instance,) = parser.AddModels(url=find_model(model).url)
    body = plant.GetBodyByName("base_link", instance)
    plant.Finalize()
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for _ in range(_TRIES):
        simulator.get_mutable_context().SetTime(0.0)
        plant.SetFreeBodyPose(context, body, X_WB @ _start_pose(start, vertices, rng))
        plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity.Zero())
        simulator.Initialize()
        energy = np.inf
        while simulator.get_context().get_time() < _SETTLE:
            before = energy
            simulator.AdvanceTo(simulator.get_context().get_time() + 0.1)
            energy = plant.CalcKineticEnergy(context)
            if max(before, energy) < _REST:
                break
        X_WO = plant.GetFreeBodyPose(context, body)
        if energy < _REST and inside_bin(X_WO.translation(), X_WB):
            return RestPose(X_WO, start)
    raise InputError(Finding("the object does not stay in the bin", "use another seed"))


def _start_pose(
    start: str, vertices: NDArray[np.float64], rng: np.random.Generator
) -> RigidTransform:
    """X_BO at which the object is let go."""
    low, high = BIN_INTERIOR_MIN, BIN_INTERIOR_MAX
    spin = RotationMatrix.MakeZRotation(rng.uniform(-np.pi, np.pi))
    if start == "fallen":
        wxyz = rng.normal(size=4)
        R_BO = RotationMatrix(Quaternion(wxyz / np.linalg.norm(wxyz)))
        spread = 0.6 * (high - low)[:2] / 2
        return RigidTransform(R_BO, np.append(rng.uniform(-spread, spread), high[2] + 0.12))
    R_BO = spin
    outward = np.zeros(2)
    if start == "leaning":
        # Tipped by the angle toward a wall, the spin being about its own axis.
        side = int(rng.integers(4))
        angle = 0.5 * np.pi * side
        outward = np.round([np.cos(angle), np.sin(angle)])
        tip = RotationMatrix.MakeYRotation(rng.uniform(np.deg2rad(12), np.deg2rad(40)))
        R_BO = RotationMatrix.MakeZRotation(angle) @ tip @ spin
    points = vertices @ R_BO.matrix().T
    least, most = low[:2] - points.min(axis=0)[:2], high[:2] - points.max(axis=0)[:2]
    p_BO = rng.uniform(least + 0.004, most - 0.004)
    for axis in range(2):
        if outward[axis] > 0:
            p_BO[axis] = most[axis] - 0.003
        elif outward[axis] < 0:
            p_BO[axis] = least[axis] + 0.003
    return RigidTransform(R_BO, np.append(p_BO, low[2] - points[:, 2].min() + 0.002))
