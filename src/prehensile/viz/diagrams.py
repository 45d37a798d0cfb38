"""Pictures of a Drake diagram: which systems there are and which port feeds which.

Drake can write Graphviz text, which needs the ``dot`` program and draws a station as a wall. Here
the layout is our own (:mod:`prehensile.viz.diagram_layout`), blocks deeper than a chosen depth are
drawn closed, and the page form lets a reader step into a block and out again.

The depth of a picture: 1 shows the systems in the diagram as closed blocks, 2 opens those which
are diagrams themselves, and so on.
"""

from pathlib import Path

from pydrake.systems.framework import System

from prehensile.errors import Finding, InputError
from prehensile.files import write_atomic
from prehensile.viz.diagram_blocks import read_block
from prehensile.viz.diagram_draw import to_page, to_png, to_svg
from prehensile.viz.diagram_layout import lay_out

SUFFIXES = (".html", ".svg", ".png")


def save_diagram(system: System, path: Path | str, *, depth: int = 1) -> Path:
    """Draws a system and writes the picture.

    Args:
        system: any Drake system.
        path: file to write; its suffix says what: ``.svg`` and ``.png`` are one picture,
            ``.html`` is a page in which blocks open and close by click and by depth.
        depth: levels of blocks drawn open (>= 1); the page starts with it.

    Returns:
        The absolute path of the file.

    Raises:
        InputError: another suffix, or ``depth`` below 1.
    """
    path = Path(path).resolve()
    check_arguments(path, depth)
    block = read_block(system)
    if path.suffix == ".html":
        write_atomic(path, to_page(block, depth))
    elif path.suffix == ".svg":
        write_atomic(path, to_svg(lay_out(block, depth)))
    else:
        write_atomic(path, to_png(lay_out(block, depth)))
    return path


def check_arguments(path: Path, depth: int) -> None:
    """Raises InputError for a picture that :func:`save_diagram` could not write.

    Args:
        path: file to write.
        depth: levels of blocks drawn open.

    Raises:
        InputError: with all faults.
    """
    findings = []
    if path.suffix not in SUFFIXES:
        message = f"no picture is written as '{path.suffix}'"
        findings.append(Finding(message, f"use one of {', '.join(SUFFIXES)}", str(path)))
    if depth < 1:
        findings.append(Finding(f"a depth of {depth}", "take 1 or more", key="--depth"))
    if findings:
        raise InputError(*findings)
