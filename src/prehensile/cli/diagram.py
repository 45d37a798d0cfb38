"""``prehensile diagram``: draw the system diagram of a station, or its kinematic tree."""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments of ``prehensile diagram``."""
    parser.add_argument(
        "scenario", help="a scenario file, or the name of one that ships; with --tree also a model"
    )
    parser.add_argument(
        "--depth", type=int, default=1, metavar="N",
        help="levels of blocks drawn open (default 1: the station's systems as closed blocks)",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", metavar="FILE",
        help=".html (blocks open by click), .svg or .png (default: SCENARIO.html; tree: .svg)",
    )  # fmt: skip
    parser.add_argument(
        "--hardware", action="store_true", help="draw the interface to a real station instead"
    )
    parser.add_argument(
        "--tree", action="store_true",
        help="draw the kinematic tree, bodies and joints, instead (.svg or .png)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    """Runs ``prehensile diagram``."""
    from pathlib import Path

    from prehensile.station.build import build
    from prehensile.station.scenario_file import load_scenario
    from prehensile.viz.diagrams import check_arguments, save_diagram
    from prehensile.viz.progress import progress

    if args.tree:
        return _draw_tree(args)
    path = Path(args.output or f"{Path(args.scenario).stem}.html")
    check_arguments(path, args.depth)
    scenario = load_scenario(args.scenario)
    with progress(f"drawing {args.scenario}"):
        station = build(scenario, hardware=args.hardware)
        saved = save_diagram(station, path, depth=args.depth)
    print(saved)
    return 0


def _draw_tree(args: argparse.Namespace) -> int:
    from pathlib import Path

    from pydrake.multibody.plant import MultibodyPlant

    from prehensile.cli.view import find
    from prehensile.errors import Finding, InputError
    from prehensile.station.robot_plant import add_models, finalize
    from prehensile.viz.kinematic_tree import check_suffix, save_kinematic_tree

    if args.hardware:
        raise InputError(Finding("does not go with --tree", key="--hardware"))
    path = Path(args.output or f"{Path(args.scenario).stem}.svg")
    check_suffix(path)
    scenario = find(args.scenario)
    plant = MultibodyPlant(scenario.plant_config.time_step)
    add_models(scenario, plant)
    finalize(scenario, plant)
    print(save_kinematic_tree(plant, path))
    return 0
