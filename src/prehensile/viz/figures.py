"""Keeping the figures of scripts and examples: one folder, complete files, shown in notebooks."""

import os
import sys
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from prehensile.files import write_atomic

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
    if isinstance(picture, Figure):
        buffer = BytesIO()
        picture.savefig(buffer, format="png", dpi=110, bbox_inches="tight")
        data = buffer.getvalue()
    else:
        image = BytesIO()
        Image.fromarray(picture).save(image, format="png")
        data = image.getvalue()
    return _keep(data, f"{name}.png", folder)


def save_animation(
    pictures: Iterable[Figure | NDArray[np.uint8]],
    name: str,
    folder: Path | None = None,
    *,
    period: float = 0.5,
) -> Path:
    """Writes figures, one after the other, as an animated GIF and shows it in a notebook.

    Args:
        pictures: at least one, all of one size; matplotlib figures or (H, W, 3) uint8. They are
            taken one at a time, so a generator may draw into the same figure again and again.
        name: of the file, without ``.gif``.
        folder: as for :func:`save_figure`.
        period: how long each is shown [s]; the last one four times as long.

    Returns:
        The file.

    Raises:
        ValueError: if there is no picture.
    """
    frames = []
    for picture in pictures:
        if isinstance(picture, Figure):
            with BytesIO() as buffer:
                picture.savefig(buffer, format="png", dpi=80)
                picture_rgb = Image.open(buffer).convert("RGB")
        else:
            picture_rgb = Image.fromarray(picture)
        frames.append(picture_rgb.quantize(64))
    if not frames:
        raise ValueError("pictures: there is none")
    milliseconds = [round(1000 * period)] * (len(frames) - 1) + [round(4000 * period)]
    gif = BytesIO()
    frames[0].save(
        gif, format="gif", save_all=True, append_images=frames[1:], duration=milliseconds, loop=0
    )
    return _keep(gif.getvalue(), f"{name}.gif", folder)


def _keep(data: bytes, file: str, folder: Path | None) -> Path:
    """Writes the file where figures go, and shows it if a notebook is there."""
    path = (folder or Path(os.environ.get(FOLDER_VARIABLE, "prehensile-out/figures"))) / file
    write_atomic(path, data)
    if "ipykernel" in sys.modules:
        from IPython.display import Image as Shown  # pyright: ignore[reportMissingImports]
        from IPython.display import display  # pyright: ignore[reportMissingImports]

        display(Shown(filename=str(path)))
    return path
