"""``prehensile bench``: our speed beside that of the peers."""

import argparse
import importlib
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

import prehensile
from prehensile.errors import Finding, InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="what to run; all if not given")
    parser.add_argument(
        "--rounds", type=int, default=3, metavar="N", help="how often each side runs, default 3"
    )


def run(args: argparse.Namespace) -> int:
    """Runs the benchmarks of the clone that the package is installed from.

    Returns:
        0; 1 if a contender of ours gave no result.
    """
    root = Path(prehensile.__file__).resolve().parents[2]
    if not (root / "benchmarks" / "framework.py").exists():
        raise InputError(
            Finding(
                "the benchmarks are not part of the installed package",
                "clone the repository and run `make bench` in it",
            )
        )
    if args.rounds < 1:
        raise InputError(Finding(f"must be at least 1, not {args.rounds}", key="--rounds"))
    sys.path.insert(0, str(root))
    framework = importlib.import_module("benchmarks.framework")
    names = framework.names()
    for name in args.names:
        if name not in names:
            raise InputError(Finding(f"no benchmark {name!r}", f"there are: {', '.join(names)}"))

    console = Console()
    status = 0
    for name in args.names or names:
        module = importlib.import_module(f"benchmarks.{name}")
        console.print(f"[bold]{module.TITLE}[/bold]")
        results = framework.run(
            name, args.rounds, lambda line: console.print(line, style="dim", highlight=False)
        )
        if module.CONTENDERS[0].name not in results:
            status = 1
        console.print(_table(framework.summarize(module, results)))
    return status


def _table(rows: list) -> Table:
    table = Table()
    for heading in ("case", "who", "median", "range over rounds", "we are better by"):
        table.add_column(heading, justify="left" if heading in ("case", "who") else "right")
    last_case = None
    for row in rows:
        factor, unit = (1e3, "ms") if row.unit == "s" else (1, row.unit)
        table.add_row(
            "" if row.case == last_case else row.case,
            row.contender,
            f"{factor * row.median:.3g} {unit}",
            f"{factor * row.low:.3g} to {factor * row.high:.3g}",
            "" if row.ratio is None else f"{row.ratio:.2f}×",
        )
        last_case = row.case
    return table
