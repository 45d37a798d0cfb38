"""The files that every model has beside its SDF: the description and the sphere set."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml

from prehensile.files import write_atomic


def write_description(
    folder: Path, *, title: str, category: str, description: str, sources: Sequence[str]
) -> None:
    """Writes ``model.yaml``; category is arm, hand, camera, furniture or object."""
    content = {
        "title": title,
        "category": category,
        "description": description,
        "sources": list(sources),
    }
    text = yaml.safe_dump(content, sort_keys=False, width=90, allow_unicode=True)
    write_atomic(folder / "model.yaml", text)


def write_spheres(folder: Path, spheres: Mapping[str, np.ndarray]) -> None:
    """Writes ``spheres.yaml``: link name to rows [x, y, z, radius] in the link's frame, m."""
    lines = ["# Spheres that cover the collision geometry: [x, y, z, radius] in the link's frame."]
    for link, rows in spheres.items():
        lines.append(f"{link}:")
        for row in np.asarray(rows, dtype=float).reshape(-1, 4):
            lines.append("- [" + ", ".join(f"{v + 0.0:.5f}" for v in row) + "]")
    write_atomic(folder / "spheres.yaml", "\n".join(lines) + "\n")
