"""``prehensile teleop``: drive a station's arm and hand from the browser."""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments of ``prehensile teleop``."""
    from prehensile.cli.run import add_live_arguments

    parser.add_argument(
        "scenario", nargs="?",
        help="a scenario file, or the name of one that ships "
        "(default: pick_brick; with --mode planar: planar)",
    )  # fmt: skip
    parser.add_argument(
        "--mode", choices=("pose", "planar", "joints"), default="pose",
        help="what the sliders set: the pose of the hand, its pose in the x-z plane, or each joint",
    )  # fmt: skip
    parser.add_argument("--arm", default="", help="which arm (default: the first)")
    add_live_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Runs ``prehensile teleop``."""
    from pydrake.systems.analysis import Simulator

    from prehensile.cli.run import check_live_arguments, simulate
    from prehensile.station.build import build
    from prehensile.station.scenario_file import load_scenario
    from prehensile.station.teleop import teleoperate
    from prehensile.viz.meshcat import start_meshcat
    from prehensile.viz.progress import progress

    check_live_arguments(args)
    name = args.scenario or ("planar" if args.mode == "planar" else "pick_brick")
    scenario = load_scenario(name)
    meshcat = start_meshcat(port=args.port, open_browser=not args.no_browser)
    with progress(f"building {name}"):
        station = build(scenario, meshcat=meshcat)
        simulator = Simulator(teleoperate(station, scenario, meshcat, mode=args.mode, arm=args.arm))
    print("sliders: 'Open Controls' at the top right of the page; keys stand beside their names")
    print("gamepad: press one of its buttons in the page to wake it")
    return simulate(args, scenario, simulator, meshcat)
