"""What a user can choose about a conversion."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from prehensile.errors import Finding, InputError

COLLISIONS = ("hull", "decompose", "box", "keep")
"""What stands for a collision mesh: its convex hull, several convex pieces, its box, itself."""

UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254}


@dataclass(frozen=True)
class ConvertOptions:
    """Choices for :func:`prehensile.models.convert.conversion.convert`.

    Attributes:
        name: of the model and its file; "" for that in the source.
        scale: factor on the coordinates in mesh files, > 0 (0.001 for millimetres).
        density: kg/m³, > 0, of whatever has a shape but no mass.
        mass: kg, > 0, of a bare mesh; None for volume times density.
        collision: one of :data:`COLLISIONS`, for collision meshes.
        packages: package name to its root folder, for ``package://`` and ``model://``.
        root: the folder that relative paths may not leave; None for the package that the file
            is in (the nearest folder above with a ``package.xml``), else the file's own folder.
        base: "source" as the file has it, "fixed" welds the root link to the world, "free" does
            away with a weld to the world.
        actuators: "source" drives the joints that the file says are driven (all, if it says
            nothing), "all" drives every joint that moves and follows no other.
        skip_missing: leave out meshes that cannot be found, instead of refusing.
    """

    name: str = ""
    scale: float = 1.0
    density: float = 1000.0
    mass: float | None = None
    collision: str = "hull"
    packages: Mapping[str, str | Path] = field(default_factory=dict)
    root: Path | None = None
    base: str = "source"
    actuators: str = "source"
    skip_missing: bool = False

    def __post_init__(self) -> None:
        for name in ("scale", "density", "mass"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise InputError(Finding(f"{value:g} is not > 0 and finite", key=f"--{name}"))
        for name, choices in (
            ("collision", COLLISIONS),
            ("base", ("source", "fixed", "free")),
            ("actuators", ("source", "all")),
        ):
            value = getattr(self, name)
            if value not in choices:
                mend = "one of " + ", ".join(choices)
                raise InputError(Finding(f"unknown choice '{value}'", mend, key=f"--{name}"))
