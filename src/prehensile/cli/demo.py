"""``prehensile demo``: complete behaviours to watch, each with a report and a replay to keep."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from prehensile.errors import Finding, InputError

if TYPE_CHECKING:
    from prehensile.tasks.gallery import Show


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds a subcommand for each demonstration."""
    demos = parser.add_subparsers(dest="demo", metavar="DEMO", required=True)
    clear_bin = demos.add_parser(
        "clear-bin", help="an arm clears a bin of objects it has never met into a second one"
    )
    clear_bin.add_argument("--objects", type=int, default=10, help="how many (default 10)")
    _add_seed(clear_bin)
    _add_common(clear_bin)
    clear_bin.set_defaults(start=_clear_bin)
    pick_place = demos.add_parser("pick-place", help="an arm moves a brick whose pose is known")
    pick_place.add_argument(
        "--trips", type=int, default=1, help="there, back, there ... (default 1)"
    )
    _add_seed(pick_place)
    _add_common(pick_place)
    pick_place.set_defaults(start=_pick_place)
    pose_pick = demos.add_parser(
        "pose-pick", help="an arm finds a known bottle in a bin and sets it upright in another"
    )
    pose_pick.add_argument(
        "--trials", type=int, default=1, help="how many, with SEED, SEED + 1, ... (default 1)"
    )
    _add_seed(pose_pick)
    _add_common(pose_pick)
    pose_pick.set_defaults(start=_pose_pick)
    arms = demos.add_parser("arms", help="every arm of the gallery holds still and follows")
    arms.add_argument(
        "--controller", choices=_CONTROLLERS, default=_CONTROLLERS[0],
        help=f"of all arms (default {_CONTROLLERS[0]})",
    )  # fmt: skip
    _add_models(arms)
    _add_common(arms)
    arms.set_defaults(start=_arms)
    hands = demos.add_parser("hands", help="every hand of the gallery closes, opens and waves")
    _add_models(hands)
    _add_common(hands)
    hands.set_defaults(start=_hands)
    bimanual = demos.add_parser("bimanual", help="two arms lift a box between their hands")
    _add_common(bimanual)
    bimanual.set_defaults(start=_bimanual)
    iiwa_allegro = demos.add_parser(
        "iiwa-allegro", help="an arm whose hand of four fingers lifts a can"
    )
    _add_common(iiwa_allegro)
    iiwa_allegro.set_defaults(start=_iiwa_allegro)


# As in prehensile.control.joint_controller, which would import Drake.
_CONTROLLERS = ("inverse-dynamics", "gravity-compensation", "pid", "stiffness")


def run(args: argparse.Namespace) -> int:
    """Runs the demonstration that was chosen."""
    return args.start(args)


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--out", type=Path, help="folder of report and replay (default prehensile-out/DEMO)"
    )
    parser.add_argument("--no-browser", action="store_true", help="do not open the browser")
    # Accepted after the demo's name too, as after any other command.
    parser.add_argument(
        "--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS
    )


def _add_models(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--models", nargs="+", metavar="NAME", help="those wanted (default: all in the registry)"
    )


def _add_seed(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=0, help="of every random choice (default 0)")


def _clear_bin(args: argparse.Namespace) -> int:
    if not 1 <= args.objects <= 40:
        raise InputError(Finding("must be between 1 and 40", key="--objects"))
    _check_seed(args.seed)
    from prehensile.cli.demo_clear_bin import run_demo

    report = run_demo(
        objects=args.objects,
        seed=args.seed,
        browser=not args.no_browser,
        out=args.out or Path("prehensile-out/clear-bin"),
    )
    if report.interrupted:
        return 130
    return 0 if report.cleared else 1


def _pick_place(args: argparse.Namespace) -> int:
    _check_seed(args.seed)
    if args.trips < 1:
        raise InputError(Finding("must be at least 1", key="--trips"))
    from prehensile.tasks.pick_place_run import run_demo

    report = run_demo(
        seed=args.seed,
        trips=args.trips,
        browser=not args.no_browser,
        out=args.out or Path("prehensile-out/pick-place"),
    )
    if report.interrupted:
        return 130
    return 0 if report.success else 1


def _pose_pick(args: argparse.Namespace) -> int:
    _check_seed(args.seed)
    if args.trials < 1:
        raise InputError(Finding("must be at least 1", key="--trials"))
    from prehensile.cli.demo_pose_pick import run_demo

    reports = run_demo(
        seed=args.seed,
        trials=args.trials,
        browser=not args.no_browser,
        out=args.out or Path("prehensile-out/pose-pick"),
    )
    if reports[-1].interrupted:
        return 130
    return 0 if all(report.placed for report in reports) else 1


def _arms(args: argparse.Namespace) -> int:
    from prehensile.tasks.gallery_scenes import arms

    return _gallery(args, arms(args.controller, args.models))


def _hands(args: argparse.Namespace) -> int:
    from prehensile.tasks.gallery_scenes import hands

    return _gallery(args, hands(args.models))


def _bimanual(args: argparse.Namespace) -> int:
    from prehensile.tasks.gallery_pairs import bimanual

    return _gallery(args, bimanual())


def _iiwa_allegro(args: argparse.Namespace) -> int:
    from prehensile.tasks.gallery_pairs import iiwa_allegro

    return _gallery(args, iiwa_allegro())


def _gallery(args: argparse.Namespace, show: "Show") -> int:
    """Runs a demonstration of the gallery."""
    from prehensile.tasks.gallery import run_demo

    out = args.out or Path(f"prehensile-out/{args.demo}")
    report = run_demo(show, args.demo, browser=not args.no_browser, out=out)
    if report.interrupted:
        return 130
    return 0 if report.success else 1


def _check_seed(seed: int) -> None:
    if seed < 0:
        raise InputError(Finding("must not be negative", key="--seed"))
