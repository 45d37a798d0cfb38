"""``prehensile run``: simulate a scenario and watch it in the browser."""

import argparse
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat
    from pydrake.systems.analysis import Simulator

    from prehensile.station.scenario import Scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments of ``prehensile run``."""
    parser.add_argument("scenario", help="a scenario file, or the name of one that ships")
    add_live_arguments(parser)


def add_live_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares what every command that simulates in front of somebody has in common."""
    parser.add_argument(
        "--duration", type=float, metavar="S", help="simulated seconds (default: the scenario's)"
    )
    parser.add_argument(
        "--realtime-rate", type=float, metavar="R",
        help="pace: 1 is real time, 0 as fast as possible (default: the scenario's)",
    )  # fmt: skip
    parser.add_argument("--record", metavar="FILE.html", help="write a replay that plays offline")
    add_page_arguments(parser)


def add_page_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares what every command with a page in the browser has in common."""
    parser.add_argument(
        "--no-browser", action="store_true", help="do not open the page, only say where it is"
    )
    parser.add_argument("--port", type=int, help="TCP port of the page (default: a free one)")


def run(args: argparse.Namespace) -> int:
    """Runs ``prehensile run``."""
    from pydrake.systems.analysis import Simulator

    from prehensile.station.build import build
    from prehensile.station.scenario_file import load_scenario
    from prehensile.viz.meshcat import start_meshcat
    from prehensile.viz.progress import progress

    check_live_arguments(args)
    scenario = load_scenario(args.scenario)
    meshcat = start_meshcat(port=args.port, open_browser=not args.no_browser)
    with progress(f"building {args.scenario}"):
        simulator = Simulator(build(scenario, meshcat=meshcat))
    return simulate(args, scenario, simulator, meshcat)


def check_live_arguments(args: argparse.Namespace) -> None:
    """Raises InputError for numbers and files that cannot be."""
    from pathlib import Path

    from prehensile.errors import Finding, InputError
    from prehensile.viz.replay import check_writable

    findings = []
    if args.duration is not None and not args.duration > 0:
        findings.append(
            Finding(f"a duration of {args.duration:g} s", "take more than 0", key="--duration")
        )
    rate = args.realtime_rate
    if rate is not None and not (rate >= 0 and math.isfinite(rate)):
        findings.append(Finding(f"a pace of {rate:g}", "take 0 or more", key="--realtime-rate"))
    if findings:
        raise InputError(*findings)
    if args.record:
        check_writable(Path(args.record))


def simulate(
    args: argparse.Namespace, scenario: "Scenario", simulator: "Simulator", meshcat: "Meshcat"
) -> int:
    """Simulates a station in the page until time is up, the button is pressed or Ctrl-C.

    Args:
        args: with the fields of :func:`add_live_arguments`.
        scenario: gives duration and pace where ``args`` do not.
        simulator: of the station.
        meshcat: the page that the station is shown in.

    Returns:
        The exit status.

    Raises:
        KeyboardInterrupt: Ctrl-C; a replay is written before.
    """
    from contextlib import ExitStack

    from pydrake.systems.analysis import ApplySimulatorConfig

    from prehensile.viz.live import run_live
    from prehensile.viz.progress import progress
    from prehensile.viz.replay import Recorder

    duration = scenario.simulation_duration if args.duration is None else args.duration
    ApplySimulatorConfig(scenario.simulator_config, simulator)
    if args.realtime_rate is not None:
        simulator.set_target_realtime_rate(args.realtime_rate)
    hint = "stop: the Stop button, Escape in the page, or Ctrl-C"
    print(f"watch at {meshcat.web_url()}  ({hint})", flush=True)
    with ExitStack() as stack:
        if args.record:
            stack.push(_announce(args.record))
            stack.enter_context(Recorder(meshcat, args.record))
        simulator.Initialize()
        total = duration if math.isfinite(duration) else None
        report = stack.enter_context(progress("simulating", total))
        result = run_live(simulator, duration, meshcat, report)
    print(
        f"{result.status} after {result.simulated:.2f} s simulated in {result.wall:.2f} s: "
        f"{result.real_time_factor:.2f} x real time"
    )
    return 0


def _announce(path: str) -> Callable[..., None]:
    """An exit function that says where the replay is, if it was saved."""

    def announce(kind: type | None, error: BaseException | None, trace: object) -> None:
        if error is None or isinstance(error, KeyboardInterrupt):
            print(f"replay: {path}")

    return announce
