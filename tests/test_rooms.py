"""The rooms of the package import only the rooms below them."""

import ast
from pathlib import Path

import pytest

import prehensile

PACKAGE = Path(prehensile.__file__).parent

FLOORS = {
    "native": 0,
    "models": 1,
    "viz": 1,
    "kinematics": 2,
    "perception": 2,
    "grasping": 2,
    "control": 3,
    "planning": 3,
    "station": 4,
    "behavior": 5,
    "scenes": 5,
    "tasks": 6,
    "evaluation": 7,
    "learning": 7,
    "cli": 8,
}
# Pairs on one floor of which the first may import the second.
NEIGHBOURS = {("grasping", "perception")}
# Modules outside the rooms. They import no room, and every room may import them.
COMMON = {"__init__", "__main__", "errors", "files", "yaml_lines"}


def imported_rooms(source: str, module: str) -> set[str]:
    """First component below ``prehensile`` of everything that a module's source imports.

    Args:
        source: Python source.
        module: full dotted name of the package that the module lives in.
    """
    rooms = set()
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = module.split(".")[: len(module.split(".")) - node.level + 1]
                base = ".".join([*above, base] if base else above)
            names = [base]
            if base == "prehensile":
                names = [f"prehensile.{alias.name}" for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "prehensile" and len(parts) > 1:
                rooms.add(parts[1])
    return rooms


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def may_import(room: str, other: str) -> bool:
    if other == room or other in COMMON or not (PACKAGE / other).is_dir():
        return True
    if room in COMMON:
        return False
    return FLOORS[other] < FLOORS[room] or (room, other) in NEIGHBOURS


def test_every_room_has_a_floor():
    rooms = {p.parent.name for p in PACKAGE.glob("*/__init__.py")}
    assert rooms <= set(FLOORS)
    modules = {p.stem for p in PACKAGE.glob("*.py")}
    assert modules <= COMMON


@pytest.mark.parametrize(
    "path",
    [p for p in sorted(PACKAGE.rglob("*.py")) if p.name != "__main__.py"],
    ids=lambda p: str(p.relative_to(PACKAGE)),
)
def test_nobody_steps_up_a_floor(path):
    room = room_of(path)
    package = ".".join(("prehensile", *path.relative_to(PACKAGE).parts[:-1]))
    wrong = {o for o in imported_rooms(path.read_text(), package) if not may_import(room, o)}
    assert not wrong, f"{room} may not import {', '.join(sorted(wrong))}"


@pytest.mark.parametrize(
    ("source", "rooms"),
    [
        ("import prehensile.station.build", {"station"}),
        ("from prehensile.viz import meshcat", {"viz"}),
        ("from prehensile import cli, errors", {"cli", "errors"}),
        ("def f():\n    from prehensile.tasks.a import b", {"tasks"}),
        ("from .cloud import crop", {"perception"}),
        ("from ..grasping import score", {"grasping"}),
        ("import numpy, pydrake.math", set()),
    ],
)
def test_imports_are_recognized(source, rooms):
    assert imported_rooms(source, "prehensile.perception") == rooms


def test_the_rules_of_the_table():
    assert may_import("planning", "grasping")
    assert may_import("grasping", "perception")
    assert not may_import("perception", "grasping")
    assert not may_import("perception", "station")
    assert not may_import("models", "viz")
    assert not may_import("errors", "native")
