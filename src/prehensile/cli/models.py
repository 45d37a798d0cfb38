"""``prehensile models``: list the models, show one, or convert somebody else's."""

import argparse
import math
from collections import Counter
from typing import TYPE_CHECKING

from prehensile.cli import models_convert
from prehensile.models.registry import CATEGORIES, ModelInfo, find_model, list_models

if TYPE_CHECKING:
    from prehensile.models.summary import JointSummary, ModelSummary


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the subcommands ``list``, ``show`` and ``convert``."""
    parser.description = (
        "The models that come with prehensile, and those in the folders that the environment "
        "variable PREHENSILE_MODEL_PATH lists."
    )
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    listing = commands.add_parser("list", help="list the models")
    listing.add_argument("--category", choices=CATEGORIES, help="only those of one category")
    listing.set_defaults(start=_list)
    show = commands.add_parser("show", help="show what a model consists of")
    show.add_argument("name", metavar="NAME", help="a model's name, or package://PACKAGE/PATH")
    show.set_defaults(start=_show)
    convert = commands.add_parser("convert", help="make a model that Drake loads out of a file")
    models_convert.add_arguments(convert)
    convert.set_defaults(start=models_convert.run)
    for command in (listing, show, convert):
        command.add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand."""
    return args.start(args)


def _list(args: argparse.Namespace) -> int:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    models = [m for m in list_models() if args.category in (None, m.category)]
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("name", "category", "title"):
        table.add_column(heading, no_wrap=heading != "title")
    for i, model in enumerate(models):
        if i and model.category != models[i - 1].category:
            table.add_section()
        table.add_row(model.name, model.category, model.title)
    Console().print(table)
    return 0


def _show(args: argparse.Namespace) -> int:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    info = find_model(args.name)
    from prehensile.models.summary import summarize  # imports Drake

    summary = summarize(info)
    console = Console()
    console.print(f"[bold]{info.name}[/bold]  {info.title}", highlight=False)
    if info.description:
        console.print(info.description, highlight=False)
    facts = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    facts.add_column(style="dim", no_wrap=True)
    facts.add_column(overflow="fold")
    for name, text in _facts(info, summary):
        facts.add_row(name, text)
    console.print()
    console.print(facts, highlight=False)
    if summary.joints:
        joints = Table(box=box.SIMPLE_HEAD)
        joints.add_column("joint", no_wrap=True)
        joints.add_column("type")
        for heading in ("position", "velocity", "effort"):
            joints.add_column(heading, justify="right")
        for joint in summary.joints:
            joints.add_row(joint.name, joint.type, *_limits(joint))
        console.print(joints, highlight=False)
    return 0


def _facts(info: ModelInfo, summary: "ModelSummary") -> list[tuple[str, str]]:
    """The rows of the table of facts."""
    size = " x ".join(f"{extent:.3f}" for extent in summary.upper - summary.lower)
    corners = " to ".join(
        "[" + ", ".join(f"{round(x, 3) + 0.0:.3f}" for x in corner) + "]"
        for corner in (summary.lower, summary.upper)
    )
    rows = [
        ("category", info.category),
        ("URL", info.url),
        ("mass", f"{summary.mass:.4g} kg"),
        ("size", f"{size} m, from {corners} in the frame of {summary.links[0]}"),
        ("links", f"{len(summary.links)}: {', '.join(summary.links)}"),
    ]
    shapes = Counter(kind for kinds in summary.collisions.values() for kind in kinds)
    said = ", ".join(f"{n} {kind.lower()}" for kind, n in shapes.most_common())
    rows.append(("collision shapes", said or "none"))
    spheres = sum(summary.spheres.values())
    rows.append(("sphere model", f"{spheres} spheres" if spheres else "none"))
    rows += [("sources" if i == 0 else "", source) for i, source in enumerate(info.sources)]
    return rows


def _limits(joint: "JointSummary") -> tuple[str, str, str]:
    """Position, velocity and effort limits with their units."""
    if len(joint.lower) != 1:
        return ("", "", "")
    unit, force = ("m", "N") if joint.type == "prismatic" else ("rad", "N m")

    def said(value: float, unit: str) -> str:
        return f"{value:.4g} {unit}" if math.isfinite(value) else "no limit"

    lower, upper = joint.lower[0], joint.upper[0]
    if math.isinf(lower) and math.isinf(upper):
        position = "no limit"
    else:
        position = f"{lower:.4g} .. {upper:.4g} {unit}"
    effort = "no actuator" if joint.effort is None else said(joint.effort, force)
    return position, said(joint.velocity[0], f"{unit}/s"), effort
