"""Bleach cleanser: a white bottle with a pinched grip, blue label and blue cap."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._contact import INSET, balls, hull, octagon, ring
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.generate.sdf_model import Collision
from prehensile.models.shapes import (
    Material,
    Mesh,
    Part,
    circle,
    extrude,
    lathe,
    loft,
    superellipse,
)
from prehensile.models.textures import Panel

A, B, HEIGHT = 0.0325, 0.049, 0.250  # half thickness (x), half width (y), m
SHOULDER, NECK = 0.165, 0.217  # heights above the base, m
NECK_Y, NECK_RADIUS, CAP_RADIUS = -0.014, 0.015, 0.019
WHITE, BLUE, AQUA, RED = "#f4f4f0", "#12409c", "#25a9e0", "#d5281f"
SEGMENTS = 72


def _smooth(x: np.ndarray | float, low: float, high: float) -> np.ndarray:
    t = np.clip((np.asarray(x) - low) / (high - low), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _body() -> Mesh:
    """A slab with a rounded base; above, the side opposite to the neck is pinched as a grip."""
    full = superellipse(A, B, 3.5, SEGMENTS)
    neck = circle(NECK_RADIUS, SEGMENTS) + np.array([0.0, NECK_Y])
    levels = [
        (full * (1.0 - 0.12 * (1.0 - np.sin(t))), 0.006 * (1.0 - np.cos(t)))
        for t in np.linspace(0.0, np.pi / 2.0, 6)
    ]
    levels += [(full, z) for z in np.linspace(0.03, SHOULDER, 18)]
    for t in np.linspace(0.0, np.pi / 2.0, 13)[1:]:
        share = np.cos(t) ** 0.85
        levels.append(
            (share * full + (1.0 - share) * neck, SHOULDER + (NECK - SHOULDER) * np.sin(t))
        )
    levels.append((neck, NECK + 0.006))
    outlines, heights = [], []
    for outline, z in levels:
        pinch = 0.62 * float(_smooth(z, 0.105, 0.135) * (1.0 - _smooth(z, 0.185, 0.21)))
        along = _smooth(outline[:, 1], -0.012, 0.014)
        outlines.append(outline * np.column_stack([1.0 - pinch * along, np.ones(len(along))]))
        heights.append(z - 0.5 * HEIGHT)
    return loft(outlines, heights, crease=np.radians(50.0))


def _cap() -> list[Mesh]:
    turn = np.linspace(-np.pi, np.pi, 96, endpoint=False)
    radius = CAP_RADIUS - 0.0005 + 0.0005 * np.cos(24 * turn)
    ribbed = np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])
    collar = lathe([(0.0, 0.0), (0.0175, 0.0), (0.0175, 0.004), (0.0, 0.004)], 48)
    low = NECK + 0.004 - 0.5 * HEIGHT
    return [
        extrude(ribbed, 0.5 * HEIGHT - low - 0.003, bevel=0.0015).transformed(
            p_AB=(0.0, NECK_Y, low + 0.003)
        ),
        collar.transformed(p_AB=(0.0, NECK_Y, low)),
    ]


def _collisions() -> list[Collision]:
    gap, base = 2.0 * INSET, -0.5 * HEIGHT
    waist, top = 0.118 + base, SHOULDER + 0.003 + base
    flat_a, flat_b = 0.74 * A, 0.7 * B
    low, tall = 0.5 * (base + waist), waist - base
    upper, rise = 0.5 * (waist + top), top - waist
    cap = ring(CAP_RADIUS, 6, 0.5 * HEIGHT, np.pi / 6.0)
    grip = 0.42 * A  # half thickness of the pinched side
    return [
        hull("hull_broad", "box", [2 * A - gap, 2 * flat_b - gap, tall - gap], (0, 0, low)),
        hull("hull_narrow", "box", [2 * flat_a - gap, 2 * B - gap, tall - gap], (0, 0, low)),
        hull("hull_front", "box", [2 * A - gap, 0.027, rise], (0, -0.0215, upper)),
        hull("hull_edge", "box", [2 * flat_a - gap, 0.02, rise], (0, -B + INSET + 0.01, upper)),
        hull(
            "hull_grip", "box", [2 * grip, B - INSET + 0.008, rise], (0, 0.5 * (B - 0.008), upper)
        ),
        hull("hull_shoulder", "box", [0.044, 0.056, 0.022], (0, -0.012, top + 0.011)),
        hull("hull_cap", "cylinder", [0.9 * CAP_RADIUS, 0.052], (0, NECK_Y, 0.5 * HEIGHT - 0.0263)),
        *balls(octagon(A, B, flat_a, flat_b, base)),
        *balls(
            [
                (sx * (A - 0.001), y, top - 0.001)
                for sx in (-1.0, 1.0)
                for y in (-flat_b + 0.001, -0.009)
            ],
            start=8,
        ),
        *balls(
            [
                (sx * (half - 0.001), sy * (B - 0.001), top - 0.001)
                for sx in (-1.0, 1.0)
                for sy, half in ((-1.0, flat_a), (1.0, grip))
            ],
            start=12,
        ),
        *balls(cap + np.array([0.0, NECK_Y, 0.0]), start=16),
    ]


def _label(around: float, along: float) -> Panel:
    paper = Panel(1000.0 * around, 1000.0 * along, WHITE)
    w, h = paper.width, paper.height
    paper.rect((0, 0.56 * h, w, 0.93 * h), BLUE)
    paper.rect((0, 0.545 * h, w, 0.565 * h), AQUA)
    paper.rect((0, 0.925 * h, w, 0.945 * h), AQUA)
    for x in (0.5 * w, 0.0, w):
        paper.text(
            "BLEACH", (x, 0.66 * h), height=17, max_width=0.36 * w, color="white", weight=0.1
        )
        for k in range(8):  # a sparkle
            turn = 2.0 * np.pi * k / 8.0
            reach = 15.0 if k % 2 == 0 else 8.0
            tip = (x + reach * np.cos(turn), 0.81 * h + reach * np.sin(turn))
            paper.line([(x, 0.81 * h), tip], AQUA, 2.4)
        paper.ellipse((x, 0.81 * h), (4.5, 4.5), "white")
    for x in (0.25 * w, 0.75 * w):
        paper.polygon([(x, 0.61 * h), (x + 11, 0.69 * h), (x - 11, 0.69 * h)], "#ffd400")
        paper.text("!", (x, 0.665 * h), height=8, color="black", weight=0.12)
        paper.barcode((x - 11, 0.76 * h, x + 11, 0.87 * h), seed=14)
    return paper


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    body = _body()
    outline = superellipse(A, B, 3.5, SEGMENTS)
    around = float(np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1).sum())
    printed = Material("print", (1.0, 1.0, 1.0, 1.0), 0.0, 0.4, _label(around, 0.25).png())
    blue = Material("blue plastic", (0.01, 0.05, 0.35, 1.0), 0.0, 0.4)
    write_object(
        folder,
        HouseholdObject(
            title="Bleach cleanser",
            description="A tall white bottle with a grip, a blue label and a blue screw cap.",
            number="021_bleach_cleanser",
            mass=1.131,
            parts=[Part(body, printed), *(Part(mesh, blue) for mesh in _cap())],
            body=body,
            collisions=_collisions(),
        ),
    )
