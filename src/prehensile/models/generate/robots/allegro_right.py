"""The right Allegro hand."""

from pathlib import Path

from prehensile.models.generate.robots import _allegro

SIDE = 1


def generate(folder: Path) -> None:
    """Writes the model."""
    _allegro.generate(folder, SIDE)
