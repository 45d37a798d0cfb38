"""``prehensile models convert``: a model of somebody else's made into one that Drake loads."""

import argparse
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from prehensile.errors import Finding, InputError
from prehensile.models.convert.options import COLLISIONS, UNITS, ConvertOptions

if TYPE_CHECKING:
    from prehensile.models.convert.report import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the arguments of ``prehensile models convert``."""
    parser.description = (
        "Makes a folder with a model that Drake loads out of a URDF, SDF or MJCF file or a bare "
        "mesh (.obj .stl .dae .ply .glb .gltf .off), and reports everything that was changed. "
        "Meshes need the optional packages of 'prehensile[convert]'."
    )
    parser.add_argument("file", metavar="FILE", help="the description or mesh")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="folder to be made (default: ./NAME)"
    )
    parser.add_argument("--replace", action="store_true", help="replace an earlier conversion")
    parser.add_argument("--name", default="", help="name of the model (default: the file's)")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--scale", type=float, metavar="S", help="factor on mesh coordinates")
    size.add_argument("--units", choices=tuple(UNITS), help="what mesh files are in (default: m)")
    heavy = parser.add_mutually_exclusive_group()
    heavy.add_argument(
        "--density",
        type=float,
        default=ConvertOptions.density,
        metavar="D",
        help="kg/m³ of what has a shape but no mass (default: %(default)g)",
    )
    heavy.add_argument("--mass", type=float, metavar="M", help="mass of a bare mesh in kg")
    parser.add_argument(
        "--collision",
        choices=COLLISIONS,
        default=ConvertOptions.collision,
        help="what stands for collision meshes (default: %(default)s)",
    )
    parser.add_argument(
        "--actuators",
        choices=("source", "all"),
        default=ConvertOptions.actuators,
        help="which joints are driven: those the file drives, or all (default: %(default)s)",
    )
    base = parser.add_mutually_exclusive_group()
    base.add_argument("--fixed-base", action="store_true", help="weld the root to the world")
    base.add_argument("--free-base", action="store_true", help="undo a weld to the world")
    parser.add_argument(
        "--package",
        action="append",
        default=[],
        metavar="NAME=PATH",
        help="where package://NAME/ is; may be given several times",
    )
    parser.add_argument(
        "--root", type=Path, metavar="FOLDER", help="folder that relative paths may not leave"
    )
    parser.add_argument(
        "--skip-missing", action="store_true", help="leave out meshes that cannot be found"
    )


def run(args: argparse.Namespace) -> int:
    """Runs ``prehensile models convert``."""
    from prehensile.models.convert.conversion import convert
    from prehensile.viz.progress import progress

    scale = args.scale if args.scale is not None else UNITS[args.units or "m"]
    options = ConvertOptions(
        name=args.name,
        scale=scale,
        density=args.density,
        mass=args.mass,
        collision=args.collision,
        packages=_packages(args.package),
        root=args.root,
        base="fixed" if args.fixed_base else "free" if args.free_base else "source",
        actuators=args.actuators,
        skip_missing=args.skip_missing,
    )
    with progress(f"converting {args.file}"):
        done = convert(args.file, args.output, options, replace=args.replace)
    _show(done.path, done.report)
    return 0


def _packages(given: list[str]) -> dict[str, str]:
    packages = {}
    for text in given:
        name, sign, path = text.partition("=")
        if not (name and sign and path):
            raise InputError(Finding(f"'{text}' is not NAME=PATH", key="--package"))
        packages[name] = path
    return packages


def _show(path: Path, report: "Report") -> None:
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    console = Console()
    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("kind", "subject", "change", "line"):
        table.add_column(heading, overflow="fold")
    # Meshes are many and alike; the report has them one by one.
    plain = Counter(c.kind for c in report.changes if c.kind in ("mesh", "collision"))
    for change in report.changes:
        if plain[change.kind] <= 6:
            line = str(change.line or "")
            table.add_row(change.kind, escape(change.subject), escape(change.text), line)
    for kind, count in plain.items():
        if count > 6:
            table.add_row(kind, f"{count} meshes", "see the report")
    console.print(table)
    facts = ", ".join(f"{key} {value}" for key, value in report.summary.items())
    console.print(f"{report.format}: {facts}", highlight=False)
    console.print(f"{path}\nreport: {path.parent / 'report.md'}", highlight=False, soft_wrap=True)
    console.print(f"look at it: prehensile view {path}", highlight=False, soft_wrap=True)
