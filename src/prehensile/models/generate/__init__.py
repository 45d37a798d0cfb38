"""Writes the embedded models: meshes, SDF, descriptions and sphere sets.

A model is added by one new file: a module named like the model in one of the sub-packages
``objects``, ``robots`` and ``furniture``, with a function ``generate(folder: Path) -> None`` that
writes all of the model's files into that (existing, empty or outdated) folder. Modules whose name
starts with an underscore are shared helpers. ``files.py`` writes what all models have.

    python -m prehensile.models.generate                  # all models, into models/data
    python -m prehensile.models.generate mug --out /tmp   # one, elsewhere

Generation needs Pillow (for the textures); using the models does not.
"""

import importlib
import pkgutil
from collections.abc import Callable
from pathlib import Path

from prehensile.errors import Finding, InputError

DATA = Path(__file__).resolve().parent.parent / "data"
_SECTIONS = ("robots", "furniture", "objects")


def generators() -> dict[str, str]:
    """Model name to the dotted name of the module that generates it, without importing it."""
    table: dict[str, str] = {}
    for section in _SECTIONS:
        package = importlib.import_module(f"{__name__}.{section}")
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            name = module.name.rpartition(".")[2]
            if not name.startswith("_"):
                table[name] = module.name
    return table


def generate(name: str, out: Path = DATA) -> Path:
    """Writes the files of one model into ``out/name`` and returns that folder.

    Raises:
        InputError: there is no generator of that name.
    """
    table = generators()
    if name not in table:
        raise InputError(
            Finding(f"no generator makes a model '{name}'", "choose from: " + ", ".join(table))
        )
    write: Callable[[Path], None] = importlib.import_module(table[name]).generate
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    write(folder)
    return folder
