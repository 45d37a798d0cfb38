"""Keeping the figures of scripts and examples: one folder, complete files, shown in notebooks."""

import os
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from prehensile.files import write_atomic
from prehensile.viz.images import save_png

FOLDER_VARIABLE = "PREHENSILE_FIGURES"
"""Environment variable that names the folder of figures."""


def save_figure(picture: Figure | NDArray[np.uint8], name: str, folder: Path | None = None) -> Path:
    """Writes a figure as PNG and shows it, if a notebook is there to show it in.

    Args:
        picture: a matplotlib figure, or (H, W, 3) uint8 such as
            :func:`~prehensile.viz.render.render` returns.
        name: of the file, without ``.png``.
        folder: where to; default: what the environment variable ``PREHENSILE_FIGURES`` names, else
            ``prehensile-out/figures``. It is made if need be.

    Returns:
        The file.
    """
    folder = folder or Path(os.environ.get(FOLDER_VARIABLE, "prehensile-out/figures"))
    path = folder / f"{name}.png"
    if isinstance(picture, Figure):
        buffer = BytesIO()
        picture.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
        write_atomic(path, buffer.getvalue())
    else:
        save_png(path, picture)
    if "ipykernel" in sys.modules:
        from IPython.display import Image, display  # pyright: ignore[reportMissingImports]

        display(Image(filename=str(path)))
    return path
