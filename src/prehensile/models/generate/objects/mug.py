"""Mug: a hollow cup with a handle, sky blue with a white band."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._contact import INSET, balls, hull, prism, ring
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.generate.sdf_model import Collision
from prehensile.models.shapes import Material, Mesh, Part, lathe, merge, superellipse, sweep
from prehensile.models.textures import Panel

RADIUS, HEIGHT, WALL, FLOOR = 0.040, 0.082, 0.0045, 0.006
HANDLE = 0.031  # m, how far the handle reaches out along +y
GRIP = (0.0055, 0.0045)  # half thickness of the handle along x and across
SIDES = 10  # staves of the collision shape
BLUE, WHITE, NAVY = "#2f9bd8", "#ffffff", "#10386b"


def _outer() -> Mesh:
    turn = np.linspace(0.0, np.pi / 2.0, 6)
    foot = np.column_stack([RADIUS - 0.004 + 0.004 * np.sin(turn), 0.004 - 0.004 * np.cos(turn)])
    lip = HEIGHT - 0.5 * WALL
    return lathe([(0.0, 0.0), *foot, (RADIUS, lip)], 64)


def _inner() -> Mesh:
    half = 0.5 * WALL
    lip = np.linspace(0.0, np.pi, 9)
    rim = np.column_stack([RADIUS - half + half * np.cos(lip), HEIGHT - half + half * np.sin(lip)])
    turn = np.linspace(0.0, np.pi / 2.0, 6)
    well = np.column_stack(
        [RADIUS - WALL - 0.008 * (1.0 - np.cos(turn)), FLOOR + 0.008 * (1.0 - np.sin(turn))]
    )
    return lathe([*rim, *well, (0.0, FLOOR)], 64)


def _loop(turns: np.ndarray) -> np.ndarray:
    """Centre line (n, 3) of the handle: a half oval in the y-z plane."""
    reach = HANDLE - GRIP[1]
    y = RADIUS - 0.003 + (reach + 0.003) * np.sin(turns) ** 0.8
    z = 0.043 - 0.026 * np.cos(turns)
    return np.column_stack([np.zeros_like(turns), y, z])


def _handle() -> Mesh:
    turns = np.linspace(0.0, np.pi, 40)
    section = superellipse(GRIP[1], GRIP[0], 2.6, 24)
    return sweep(_loop(turns), section, up=(1.0, 0.0, 0.0), crease=np.pi / 3.0)


def _shift() -> np.ndarray:
    """From the middle of the foot to the middle of the bounding box, negative."""
    return np.array([0.0, -0.5 * HANDLE, -0.5 * HEIGHT])


def _collisions() -> list[Collision]:
    shift = _shift()
    corner, flat = prism(RADIUS, SIDES)
    outer, inner = flat - INSET, RADIUS - WALL - 0.0005
    width = 2.0 * outer * np.tan(np.pi / SIDES)
    shapes = [
        hull(
            "hull_floor",
            "cylinder",
            [inner + 0.001, FLOOR - INSET],
            shift + np.array([0.0, 0.0, 0.5 * (FLOOR + INSET)]),
        )
    ]
    for k in range(SIDES):
        turn = 2.0 * np.pi * (k + 0.5) / SIDES
        middle = 0.5 * (outer + inner)
        place = shift + np.array([middle * np.cos(turn), middle * np.sin(turn), 0.5 * HEIGHT])
        size = [outer - inner, width, HEIGHT - 2.0 * INSET]
        shapes.append(hull(f"hull_{k}", "box", size, (*place, 0.0, 0.0, turn)))
    knots = _loop(np.array([0.1, 0.27, 0.5, 0.73, 0.9]) * np.pi) + shift
    for k in range(len(knots) - 1):
        way = knots[k + 1] - knots[k]
        roll = float(np.arctan2(-way[1], way[2]))
        pose = (*(0.5 * (knots[k] + knots[k + 1])), roll, 0.0, 0.0)
        size = [GRIP[1], float(np.linalg.norm(way))]
        shapes.append(hull(f"handle_{k}", "capsule", size, pose, resolution=0.004))
    low = ring(corner, SIDES, -0.5 * HEIGHT) + shift * [0.0, 1.0, 0.0]
    high = ring(corner, SIDES, 0.5 * HEIGHT) + shift * [0.0, 1.0, 0.0]
    return [*shapes, *balls(low), *balls(high, start=SIDES)]


def _glaze() -> Panel:
    around, along = 2000.0 * np.pi * RADIUS, 1000.0 * (RADIUS + HEIGHT - 0.004)
    paper = Panel(around, along, BLUE)
    w = paper.width
    wall = 1000.0 * HEIGHT - 4.0  # the sheet's upper part is the wall, the rest the foot
    paper.rect((0, 0.30 * wall, w, 0.72 * wall), WHITE)
    for y in (0.26, 0.76):
        paper.rect((0, (y - 0.015) * wall, w, (y + 0.015) * wall), NAVY)
    for x in (0.5 * w, 0.0, w):
        paper.text(
            "COFFEE", (x, 0.51 * wall), height=16, max_width=0.29 * w, color=NAVY, weight=0.1
        )
    for k in range(8):
        paper.ellipse(
            ((0.25 if k < 4 else 0.75) * w + (k % 4 - 1.5) * 8, 0.51 * wall), (2.4, 2.4), BLUE
        )
    return paper


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    outer, inner, handle = (m.transformed(p_AB=_shift()) for m in (_outer(), _inner(), _handle()))
    glazed = Material("print", (1.0, 1.0, 1.0, 1.0), 0.0, 0.25, _glaze().png())
    white = Material("white glaze", (0.9, 0.9, 0.88, 1.0), 0.0, 0.25)
    blue = Material("blue glaze", (0.028, 0.328, 0.687, 1.0), 0.0, 0.25)
    write_object(
        folder,
        HouseholdObject(
            title="Mug",
            description="A hollow sky-blue coffee mug with a white band and a handle.",
            number="025_mug",
            mass=0.118,
            parts=[Part(outer, glazed), Part(inner, white), Part(handle, blue)],
            body=merge([outer, inner, handle]),
            collisions=_collisions(),
        ),
    )
