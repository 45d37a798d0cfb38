"""``prehensile view``: look at a model or a scenario, with joint sliders."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import BodyIndex

    from prehensile.station.scenario import Scenario

_MODEL_SUFFIXES = (".sdf", ".urdf", ".xml", ".obj", ".gltf", ".glb")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments of ``prehensile view``."""
    from prehensile.cli.run import add_page_arguments

    parser.add_argument(
        "what",
        metavar="MODEL|SCENARIO|FILE",
        help="a model's name or package:// URL, a scenario's name, or a file of either",
    )
    parser.add_argument(
        "--spheres", action="store_true", help="also show the sphere models that planners use"
    )
    parser.add_argument(
        "--duration", type=float, default=math.inf, metavar="S", help="stop after so many seconds"
    )
    add_page_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Runs ``prehensile view``."""
    from pydrake.planning import RobotDiagramBuilder

    from prehensile.errors import Finding, InputError
    from prehensile.station.robot_plant import add_models, finalize
    from prehensile.station.visualization import add_visualization
    from prehensile.viz.meshcat import start_meshcat
    from prehensile.viz.progress import progress
    from prehensile.viz.viewer import view

    if not args.duration > 0:
        message = f"a duration of {args.duration:g} s"
        raise InputError(Finding(message, "take more than 0", key="--duration"))
    scenario = find(args.what)
    meshcat = start_meshcat(port=args.port, open_browser=not args.no_browser)
    with progress(f"loading {args.what}"):
        robot_builder = RobotDiagramBuilder(time_step=scenario.plant_config.time_step)
        plant, scene_graph = robot_builder.plant(), robot_builder.scene_graph()
        add_models(scenario, plant)
        finalize(scenario, plant)
        add_visualization(scenario.visualization, robot_builder.builder(), scene_graph, meshcat)
        diagram = robot_builder.Build()
        spheres = sphere_models(scenario, plant) if args.spheres else {}
    print("sliders and buttons: 'Open Controls' at the top right of the page")
    hint = "stop: the Stop button, Escape in the page, or Ctrl-C"
    print(f"look at {meshcat.web_url()}  ({hint})", flush=True)
    view(diagram, plant, meshcat, spheres=spheres, duration=args.duration)
    return 0


def find(what: str) -> "Scenario":
    """The scenario to look at; a model becomes a scenario of that model alone.

    Args:
        what: a scenario's file or name, or a model's file, name or URL.

    Returns:
        A validated scenario.

    Raises:
        InputError: nothing of that name, or the file is faulty.
    """
    import json  # whose strings are YAML strings too

    from prehensile.errors import Finding, InputError
    from prehensile.models.registry import find_model, list_models
    from prehensile.station.scenario_file import list_scenarios, load_scenario, loads_scenario
    from prehensile.yaml_lines import close_to

    path, names = Path(what), [model.name for model in list_models()]
    if what in list_scenarios() or path.suffix in (".yaml", ".yml"):
        return load_scenario(what)
    if path.suffix in _MODEL_SUFFIXES and not what.startswith("package://"):
        if not path.is_file():
            raise InputError(Finding("no such file", file=what))
        name, url = path.stem, f"file://{path.resolve()}"
    elif what.startswith("package://") or what in names:
        info = find_model(what)
        name, url = info.name, info.url
    else:
        mend = close_to(what, [*list_scenarios(), *names], "'prehensile models list' names models")
        raise InputError(Finding(f"no model, scenario or file is called '{what}'", mend))
    return loads_scenario(
        f"directives: [{{add_model: {{name: {json.dumps(name)}, file: {json.dumps(url)}}}}}]"
    )


def sphere_models(scenario: "Scenario", plant: "MultibodyPlant") -> "dict[BodyIndex, np.ndarray]":
    """The sphere models of a scenario's models, those that have one.

    Args:
        scenario: its directives say which model each instance is.
        plant: with these models added.

    Returns:
        (K, 4) rows of centre and radius in the body's frame, by body.
    """
    from prehensile.models.registry import find_model, load_spheres
    from prehensile.station.robot_plant import flat_directives

    spheres = {}
    for directive in flat_directives(scenario):
        model = directive.add_model
        if not model or not model.file.startswith("package://"):
            continue
        info = find_model(model.file, scenario.packages)
        if not (info.path.parent / "spheres.yaml").is_file():
            continue
        instance = plant.GetModelInstanceByName(model.name)
        for link, rows in load_spheres(info).items():
            spheres[plant.GetBodyByName(link, instance).index()] = rows
    return spheres
