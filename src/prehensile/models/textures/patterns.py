"""Surfaces that nature prints: wood grain and speckles, as (rows, columns, 3) colour arrays."""

import numpy as np


def speckle(
    rows: int, columns: int, color: tuple[int, int, int], contrast: float, seed: int
) -> np.ndarray:
    """An even colour with random light and dark grains (foam, stone)."""
    noise = np.random.default_rng(seed).random((rows, columns)) - 0.5
    noise = 0.5 * noise + 0.25 * (np.roll(noise, 1, axis=0) + np.roll(noise, 1, axis=1))
    return np.array(color) + 255.0 * contrast * noise[:, :, None]


def grain(
    rows: int,
    columns: int,
    light: tuple[int, int, int],
    dark: tuple[int, int, int],
    rings: float,
    seed: int,
) -> np.ndarray:
    """Wood cut along the trunk, the grain running from top to bottom.

    Args:
        rows: of the picture.
        columns: of the picture.
        light: colour of the early wood.
        dark: colour of the late wood.
        rings: number of year rings across the width.
        seed: of the waviness.
    """
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(0, 1, rows))
    bend = np.zeros_like(x)
    for k in range(1, 5):
        a, b, c = rng.random(3)
        bend += 0.12 / k * np.sin(2 * np.pi * (k * y * (0.4 + 0.4 * a) + b) + 2.0 * c * x)
    phase = rings * np.sqrt((0.35 + np.abs(x + bend - 0.15)) ** 2 + 0.15 * y**2)
    late = (phase % 1.0) ** 3
    fibre = 0.12 * (rng.random((1, columns)) - 0.5)
    share = np.clip(late + fibre, 0.0, 1.0)[:, :, None]
    return np.array(light) * (1.0 - share) + np.array(dark) * share
