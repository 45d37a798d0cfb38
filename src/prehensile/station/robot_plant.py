"""Plants of parts of a scenario: an arm for its controller, the fixed world for a planner."""

from collections.abc import Collection, Iterable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

from pydrake.math import RigidTransform
from pydrake.multibody.parsing import (
    FlattenModelDirectives,
    ModelDirective,
    ModelDirectives,
    ModelInstanceInfo,
    Parser,
    ProcessModelDirectives,
)
from pydrake.multibody.plant import ApplyMultibodyPlantConfig, MultibodyPlant
from pydrake.multibody.tree import WeldJoint
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from prehensile.errors import Finding, InputError
from prehensile.models.registry import package_map
from prehensile.station.scenario import Scenario


def flat_directives(scenario: Scenario) -> list[ModelDirective]:
    """The scenario's directives, with those that other files add put in their places."""
    packages = package_map({name: Path(path) for name, path in scenario.packages.items()})
    try:
        directives = ModelDirectives(directives=scenario.directives)
        return FlattenModelDirectives(directives, packages).directives
    except (RuntimeError, SystemExit) as error:  # DRAKE_DEMAND raises SystemExit
        raise _directives_error(scenario, error) from error


def add_models(
    scenario: Scenario, plant: MultibodyPlant, directives: list[ModelDirective] | None = None
) -> list[ModelInstanceInfo]:
    """Applies the scenario's plant settings and directives to a plant, which stays open.

    Args:
        scenario: the scenario.
        plant: a plant that is not yet finalized.
        directives: those to apply (None for all of the scenario).

    Returns:
        Drake's record of each model added.

    Raises:
        InputError: Drake cannot carry the directives out.
    """
    ApplyMultibodyPlantConfig(scenario.plant_config, plant)
    parser = Parser(plant)
    packages = package_map({name: Path(path) for name, path in scenario.packages.items()})
    for name in parser.package_map().GetPackageNames():
        parser.package_map().Remove(name)
    parser.package_map().AddMap(packages)
    parser.SetAutoRenaming(False)
    try:
        return ProcessModelDirectives(
            directives=ModelDirectives(
                directives=scenario.directives if directives is None else directives
            ),
            parser=parser,
        )
    except (RuntimeError, SystemExit) as error:  # DRAKE_DEMAND raises SystemExit
        raise _directives_error(scenario, error) from error


def finalize(scenario: Scenario, plant: MultibodyPlant) -> None:
    """Finalizes a plant that :func:`add_models` has filled.

    Raises:
        InputError: Drake refuses the whole, for instance because welds close a loop.
    """
    try:
        plant.Finalize()
    except (RuntimeError, SystemExit) as error:
        raise _directives_error(scenario, error) from error


def make_robot_plant(
    scenario: Scenario, model_names: Iterable[str], *, frozen_children: bool = False
) -> MultibodyPlant:
    """Makes a plant, without geometry, of some of the scenario's models.

    Args:
        scenario: the scenario.
        model_names: the models wanted; those that they are welded to, back to the world, come
            with them.
        frozen_children: also add what is welded to the wanted models, with its joints made
            rigid at their zero positions: the arm with its hand, as the arm's controller sees it.

    Returns:
        A finalized plant; the models keep their names and their places in the world.

    Raises:
        InputError: the scenario has no such model.
    """
    plant = MultibodyPlant(scenario.plant_config.time_step)
    add_part(scenario, plant, model_names, frozen_children=frozen_children)
    plant.Finalize()
    return plant


def make_robot_diagram(
    scenario: Scenario,
    model_names: Iterable[str] | None = None,
    *,
    frozen_children: bool = False,
) -> RobotDiagram:
    """Makes a plant with its scene graph of some of the scenario's models, for planning.

    Args:
        scenario: the scenario.
        model_names: the models wanted, as in :func:`make_robot_plant`; None for all those that
            are not free to move: arms, hands, furniture, camera bodies, but no loose objects.
        frozen_children: as in :func:`make_robot_plant`.

    Returns:
        A diagram with the subsystems ``plant`` and ``scene_graph``.

    Raises:
        InputError: the scenario has no such model.
    """
    builder = RobotDiagramBuilder(time_step=scenario.plant_config.time_step)
    builder.scene_graph().set_config(scenario.scene_graph_config)
    names = fixed_models(scenario) if model_names is None else model_names
    add_part(scenario, builder.plant(), names, frozen_children=frozen_children)
    return builder.Build()


def fixed_models(scenario: Scenario) -> list[str]:
    """Names of the scenario's models that are attached to the world, free objects left out."""
    plant = MultibodyPlant(scenario.plant_config.time_step)
    infos = add_models(scenario, plant)
    plant.Finalize()
    loose = {plant.get_body(i).model_instance() for i in plant.GetFloatingBaseBodies()}
    return [info.model_name for info in infos if info.model_instance not in loose]


def add_part(
    scenario: Scenario,
    plant: MultibodyPlant,
    model_names: Iterable[str],
    *,
    frozen_children: bool = False,
) -> list[ModelInstanceInfo]:
    """Adds some of the scenario's models to a plant, which stays open.

    Args:
        scenario: the scenario.
        plant: a plant that is not yet finalized.
        model_names: the models wanted, as in :func:`make_robot_plant`.
        frozen_children: as in :func:`make_robot_plant`.

    Returns:
        Drake's record of each model added.

    Raises:
        InputError: the scenario has no such model.
    """
    wanted = list(model_names)
    directives = flat_directives(scenario)
    models = [d.add_model.name for d in directives if d.add_model]
    findings = [
        Finding(f"the scenario has no model '{name}'", f"it has {', '.join(models)}")
        for name in wanted
        if name not in models
    ]
    if findings:
        raise InputError(*findings)
    links = [link for d in directives if (link := _link(d, models))]
    keep = {"world", *wanted}
    while new := {link.parent for link in links if link.child in keep} - keep:
        keep |= new
    children: set[str] = set()
    if frozen_children:
        while new := {k.child for k in links if k.parent in {*wanted, *children}} - keep:
            keep |= new
            children |= new
    infos = add_models(scenario, plant, _select(directives, keep, models))
    _freeze(plant, children.intersection(models))
    return infos


@dataclass(frozen=True)
class _Link:
    """A weld, or a frame's fixture: what is attached to what (``world``, a model, or a frame)."""

    parent: str
    child: str


def _select(
    directives: list[ModelDirective], keep: Collection[str], models: Collection[str]
) -> list[ModelDirective]:
    """The directives that concern what is to be kept, in their order."""
    part = []
    groups = set()
    for directive in directives:
        link = _link(directive, models)
        group = directive.add_collision_filter_group
        if link is not None:
            if link.child in keep and link.parent in keep:
                part.append(directive)
        elif directive.add_model:
            if directive.add_model.name in keep:
                part.append(directive)
        elif group is not None:
            members = [member for member in group.members if _owner(member, models) in keep]
            if members:
                directive, groups = deepcopy(directive), groups | {group.name}
                group = directive.add_collision_filter_group
                group.members = members
                group.ignored_collision_filter_groups = [
                    name for name in group.ignored_collision_filter_groups if name in groups
                ]
                part.append(directive)
        elif directive.add_model_instance:
            part.append(directive)
    return part


def _link(directive: ModelDirective, models: Collection[str]) -> _Link | None:
    if directive.add_weld:
        weld = directive.add_weld
        return _Link(_owner(weld.parent, models), _owner(weld.child, models))
    if directive.add_frame:
        frame = directive.add_frame
        child = _owner(frame.name, models)
        return _Link(_owner(frame.X_PF.base_frame or "world", models), child)
    return None


def _owner(frame: str, models: Collection[str]) -> str:
    """The model that a scoped frame belongs to, else the frame's own name."""
    scope = frame.rpartition("::")[0]
    return scope if scope in models else frame.removeprefix("world::")


def _freeze(plant: MultibodyPlant, models: Collection[str]) -> None:
    """Replaces the models' joints by welds at their zero positions."""
    instances = [plant.GetModelInstanceByName(model) for model in sorted(models)]
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        if actuator.model_instance() in instances:
            plant.RemoveJointActuator(actuator)
    for instance in instances:
        for index in plant.GetJointIndices(instance):
            joint = plant.get_joint(index)
            if joint.type_name() != WeldJoint.kTypeName:
                name, parent, child = joint.name(), joint.frame_on_parent(), joint.frame_on_child()
                plant.RemoveJoint(joint)
                plant.AddJoint(WeldJoint(name, parent, child, RigidTransform()))


def _directives_error(scenario: Scenario, error: BaseException) -> InputError:
    message = " ".join(str(error).split())
    return InputError(Finding(message, file=str(scenario.file or ""), key="directives"))
