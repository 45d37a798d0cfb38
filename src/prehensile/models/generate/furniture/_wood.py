"""Boards with a grain: one texture for a model, laid on every face along the board."""

import dataclasses
import io
from collections.abc import Sequence

import numpy as np
from PIL import Image

from prehensile.models.generate.furniture._parts import Block
from prehensile.models.shapes import Material, Mesh, rounded_box

SPAN = 2.0  # m, that the texture covers along the grain and across


def grain(
    light: Sequence[float], dark: Sequence[float], seed: int, *, pixels: int = 512, staves: int = 32
) -> bytes:
    """A picture of glued staves of wood, the grain along its width, as PNG.

    Args:
        light: red, green, blue (0..255) of the early wood.
        dark: of the late wood.
        seed: of the random numbers.
        pixels: width and height.
        staves: number of strips across the height.
    """
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[0:pixels, 0:pixels] / pixels
    stave = np.minimum((rows * staves).astype(int), staves - 1)
    shift, tone, density = (
        rng.uniform(0, 40, staves),
        rng.normal(0, 0.10, staves),
        rng.uniform(90, 170, staves),
    )
    # Fibres: waves across the stave that wander slowly along it.
    wander = sum(
        np.sin(2 * np.pi * f * columns + phase[stave]) / f
        for f, phase in ((1.0, rng.uniform(0, 9, staves)), (3.0, rng.uniform(0, 9, staves)))
    )
    fibre = np.sin(density[stave] * (rows + 0.004 * wander) * 6.0 + shift[stave])
    speckle = rng.normal(0, 1.0, (pixels, pixels // 16)).repeat(16, axis=1)
    amount = 0.32 + tone[stave] + 0.10 * fibre + 0.05 * speckle
    joint = np.abs(rows * staves - np.round(rows * staves)) < 0.5 * staves / pixels
    amount = np.clip(np.where(joint, amount + 0.22, amount), 0.0, 1.0)[..., None]
    color = (1.0 - amount) * np.asarray(light, float) + amount * np.asarray(dark, float)
    picture = Image.fromarray(color.round().astype(np.uint8)).quantize(48)
    stream = io.BytesIO()
    picture.save(stream, "PNG", optimize=True)
    return stream.getvalue()


def wood(name: str, texture: bytes) -> Material:
    """A material with a grain."""
    return Material(name, roughness=0.7, texture=texture)


def board(block: Block, along: int, rounding: float = 0.0015, place: float = 0.0) -> Mesh:
    """A board with its texture laid along an axis.

    Args:
        block: its corners.
        along: axis of the grain.
        rounding: of the edges, m.
        place: where across the texture it is cut from, 0..1.
    """
    size = np.subtract(block.high, block.low)
    mesh = rounded_box(size, rounding, 2).transformed(p_AB=block.pose[:3])
    facing = np.abs(mesh.normals).argmax(axis=1)
    across = np.where(facing == along, (along + 1) % 3, 3 - along - facing)
    p = mesh.vertices - np.array(block.low)
    rows = np.arange(len(p))
    u = np.where(facing == along, p[rows, (along + 2) % 3], p[:, along]) / SPAN
    v = place + p[rows, across] / SPAN
    return dataclasses.replace(mesh, uvs=np.column_stack([u, np.clip(v, 0.0, 1.0)]))
