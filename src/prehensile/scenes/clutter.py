"""Random clutter: household objects dropped one after another into a bin."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.schema import Transform
from pydrake.geometry import SceneGraphConfig
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.parsing import AddModel, ModelDirective, Parser
from pydrake.multibody.plant import AddMultibodyPlant, MultibodyPlant, MultibodyPlantConfig
from pydrake.multibody.tree import RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from prehensile.errors import Finding, InputError
from prehensile.models.registry import find_model, package_map

# Interior of the embedded `bin`, expressed in its frame B: the box that objects must stay in.
BIN_INTERIOR_MIN = np.array([-0.28, -0.19, 0.03])
BIN_INTERIOR_MAX = np.array([0.28, 0.19, 0.19])


@dataclass(frozen=True)
class PlacedObject:
    """A free object of a scene and where it lies.

    Attributes:
        name: name of the model instance, unique in the scene.
        model: name of the embedded model.
        X_WO: pose of the object's `base_link` in the world.
    """

    name: str
    model: str
    X_WO: RigidTransform


@dataclass(frozen=True)
class DropConfig:
    """How objects fall into the bin.

    Attributes:
        interval: simulated seconds between two drops (> 0).
        height: drop height of an object's centre above the bin's rim in metres (> 0).
        settle_time: longest wait for rest after the last drop in seconds (> 0).
        rest_energy: kinetic energy in joules below which the clutter is at rest (> 0).
        redrops: how often objects that ended outside are dropped again before giving up (>= 0).
    """

    interval: float = 0.35
    height: float = 0.12
    settle_time: float = 4.0
    rest_energy: float = 1e-5
    redrops: int = 5


def inside_bin(p_WO: np.ndarray, X_WB: RigidTransform, margin: float = 0.0) -> bool:
    """Tells whether a point lies over the interior of a bin, up to 0.15 m above its rim.

    Args:
        p_WO: the point in W, shape (3,).
        X_WB: pose of the bin's frame B in the world.
        margin: grows the interior on all sides, in metres.
    """
    p_BO = X_WB.inverse().multiply(p_WO)
    low, high = BIN_INTERIOR_MIN - margin, BIN_INTERIOR_MAX + margin + [0, 0, 0.15]
    return bool(np.all(p_BO >= low) and np.all(p_BO <= high))


def object_names(models: Sequence[str]) -> list[str]:
    """Unique instance names for models that may repeat: ``mug_0``, ``banana_0``, ``mug_1``."""
    seen: dict[str, int] = {}
    names = []
    for model in models:
        names.append(f"{model}_{seen.setdefault(model, 0)}")
        seen[model] += 1
    return names


def drop_into_bin(
    models: Sequence[str],
    X_WB: RigidTransform,
    *,
    seed: int,
    plant_config: MultibodyPlantConfig,
    scene_graph_config: SceneGraphConfig,
    config: DropConfig | None = None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> list[PlacedObject]:
    """Drops objects one by one into the embedded bin and returns them where they came to rest.

    Each object is released at a random orientation over a random place of the interior; those
    that end outside are dropped again.

    Args:
        models: names of the embedded objects, with repetition if wanted.
        X_WB: pose of the bin in the world.
        seed: seed of positions and orientations.
        plant_config: contact model and time step to settle with (those of the station).
        scene_graph_config: proximity defaults to settle with (those of the station).
        config: heights and times of the drops; ``DropConfig()`` if None.
        progress: called with the fraction done.

    Returns:
        The objects in the order given, at rest (or after `settle_time`).

    Raises:
        InputError: if a model is not in the registry, or the objects do not stay in the bin.
    """
    config = config or DropConfig()
    rng = np.random.default_rng(seed)
    names = object_names(models)
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlant(plant_config, scene_graph_config, builder)
    parser = Parser(plant)
    parser.package_map().AddMap(package_map())
    parser.SetAutoRenaming(True)
    (bin_instance,) = parser.AddModels(url=find_model("bin").url)
    bin_body = plant.GetBodyByName("base_link", bin_instance)
    plant.WeldFrames(plant.world_frame(), bin_body.body_frame(), X_WB)
    bodies = [
        plant.GetBodyByName("base_link", parser.AddModels(url=find_model(model).url)[0])
        for model in models
    ]
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    for i, body in enumerate(bodies):
        # Waiting objects hang far away, each in a place of its own, until their turn.
        plant.SetFreeBodyPose(context, body, RigidTransform([10.0, i, 1.0]))
        body.Lock(context)

    def drop(body: RigidBody) -> None:
        spread = 0.55 * (BIN_INTERIOR_MAX - BIN_INTERIOR_MIN)[:2] / 2
        p_BO = np.append(rng.uniform(-spread, spread), BIN_INTERIOR_MAX[2] + config.height)
        body.Unlock(context)
        plant.SetFreeBodyPose(context, body, X_WB @ RigidTransform(_random_rotation(rng), p_BO))
        plant.SetFreeBodySpatialVelocity(context, body, SpatialVelocity.Zero())
        simulator.AdvanceTo(simulator.get_context().get_time() + config.interval)

    def outside() -> list[RigidBody]:
        return [
            body
            for body in bodies
            if not inside_bin(plant.GetFreeBodyPose(context, body).translation(), X_WB)
        ]

    simulator.Initialize()
    for i, body in enumerate(bodies):
        drop(body)
        progress((i + 1) / (len(bodies) + 2))
    _advance_to_rest(simulator, plant, context, config)
    for _ in range(config.redrops):
        if not (stray := outside()):
            break
        for body in stray:
            drop(body)
        _advance_to_rest(simulator, plant, context, config)
    if stray := outside():
        raise InputError(
            Finding(
                f"{len(stray)} of {len(bodies)} objects do not stay in the bin",
                mend="drop fewer objects or use another seed",
            )
        )
    progress(1.0)
    return [
        PlacedObject(name, model, plant.GetFreeBodyPose(context, body))
        for name, model, body in zip(names, models, bodies, strict=True)
    ]


def with_objects(
    directives: Sequence[ModelDirective], objects: Sequence[PlacedObject]
) -> list[ModelDirective]:
    """Model directives that add placed objects to those of a station.

    Args:
        directives: the station's own directives.
        objects: the free objects to add, with their poses in the world.

    Returns:
        A new list; the one given is unchanged.
    """
    return [*directives, *(ModelDirective(add_model=_add_model(o)) for o in objects)]


def _add_model(placed: PlacedObject) -> AddModel:
    return AddModel(
        name=placed.name,
        file=find_model(placed.model).url,
        default_free_body_pose={"base_link": Transform(placed.X_WO)},
    )


def _random_rotation(rng: np.random.Generator) -> RotationMatrix:
    """A rotation drawn uniformly from SO(3): a normalized Gaussian quaternion (Marsaglia)."""
    wxyz = rng.normal(size=4)
    return RotationMatrix(Quaternion(wxyz / np.linalg.norm(wxyz)))


def _advance_to_rest(
    simulator: Simulator, plant: MultibodyPlant, context: Context, config: DropConfig
) -> None:
    end = simulator.get_context().get_time() + config.settle_time
    while simulator.get_context().get_time() < end:
        simulator.AdvanceTo(simulator.get_context().get_time() + 0.1)
        if plant.CalcKineticEnergy(context) < config.rest_energy:
            return
