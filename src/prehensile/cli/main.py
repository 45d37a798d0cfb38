"""Entry point of the ``prehensile`` command.

Every subcommand is a module of this package with two functions, ``add_arguments(parser)`` and
``run(args) -> int``. Only the module of the command that was asked for is imported, so that
``prehensile --help`` answers at once (it imports no Drake).
"""

import argparse
import importlib
import logging
import os
import sys
from collections.abc import Sequence

import prehensile
from prehensile.errors import InputError

# name: (module in prehensile.cli, one line of help)
COMMANDS: dict[str, tuple[str, str]] = {
    "demo": ("demo", "run a demonstration, from clear-bin to arms, hands, bimanual"),
    "run": ("run", "simulate a scenario and watch it in the browser"),
    "view": ("view", "look at a model or a scenario, with joint sliders"),
    "teleop": ("teleop", "drive a station's arm and hand from the browser"),
    "models": ("models", "list the models, show one, or convert yours"),
    "reach": ("reachability", "map what an arm reaches, and how freely"),
    "diagram": ("diagram", "draw the system diagram of a station"),
    "bench": ("bench", "run the benchmarks beside their peers"),
    "doctor": ("doctor", "say what is missing on this machine, in words"),
}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="prehensile", description="Robotic manipulation: from depth images to joint torques."
    )
    parser.add_argument("--version", action="version", version=prehensile.__version__)
    parser.add_argument(
        "--debug", action="store_true", help="show the traceback of an error instead of its text"
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, (_, text) in COMMANDS.items():
        # The real arguments are added once the command is known; -h must reach them too.
        commands.add_parser(name, help=text, add_help=False)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command.

    Args:
        argv: the arguments after the program's name; default ``sys.argv[1:]``.

    Returns:
        The exit status: 0 done, 1 done but without success, 2 bad input, 3 a fault of ours (or of
        a library below us), 130 interrupted, 141 nobody reads the output any more.
    """
    args, rest = _parser().parse_known_args(argv)
    # --debug may stand anywhere, after subcommands of a command too.
    debug = args.debug or "--debug" in rest
    try:
        return _run(args.command, [argument for argument in rest if argument != "--debug"])
    except InputError as error:
        if debug:
            raise
        for finding in error.findings:
            print(f"prehensile: {finding}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        if debug:
            raise
        print("prehensile: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # As in `prehensile models list | head -1`. Python would complain once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except Exception as error:
        if debug:
            raise
        if isinstance(error, OSError) and error.filename is not None:
            print(f"prehensile: {error.filename}: {error.strerror}", file=sys.stderr)
            return 2
        print(
            f"prehensile: {type(error).__name__}: {error}\n"
            "prehensile: this is unexpected; the same command with --debug shows where it happened",
            file=sys.stderr,
        )
        return 3


def _run(command: str, arguments: Sequence[str]) -> int:
    # What Drake does is its own affair, what is wrong is ours. (It sets the level when imported.)
    logging.getLogger("drake").addFilter(lambda record: record.levelno >= logging.WARNING)
    module_name, text = COMMANDS[command]
    module = importlib.import_module(f"prehensile.cli.{module_name}")
    parser = argparse.ArgumentParser(prog=f"prehensile {command}", description=text)
    parser.add_argument("--debug", action="store_true", help=argparse.SUPPRESS)
    module.add_arguments(parser)
    return module.run(parser.parse_args(arguments))
