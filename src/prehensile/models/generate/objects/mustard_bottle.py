"""Mustard bottle: a yellow squeeze bottle with a red nozzle cap."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._contact import INSET, balls, hull, octagon, ring
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.generate.sdf_model import Collision
from prehensile.models.shapes import Material, Mesh, Part, circle, lathe, loft, superellipse
from prehensile.models.textures import Panel

A, B, HEIGHT = 0.029, 0.048, 0.191  # half thickness (x), half width (y), m
SHOULDER, NECK, CAP = 0.108, 0.152, 0.155  # heights above the base, m
NECK_RADIUS, CAP_RADIUS = 0.0155, 0.0165
YELLOW, RED, WHITE, GREEN = "#f5b700", "#c4161c", "#ffffff", "#2e7d32"
SEGMENTS = 72


def _body() -> Mesh:
    """Base rounded below, straight wall, then a shoulder that turns round towards the neck."""
    full = superellipse(A, B, 3.2, SEGMENTS)
    neck = circle(NECK_RADIUS, SEGMENTS)
    outlines, heights = [], []
    for turn in np.linspace(0.0, np.pi / 2.0, 6):  # base
        outlines.append(full * (1.0 - 0.12 * (1.0 - np.sin(turn))))
        heights.append(0.006 * (1.0 - np.cos(turn)))
    for z in np.linspace(0.02, SHOULDER, 7):
        waist = 1.0 - 0.02 * np.sin(np.pi * (z - 0.006) / (SHOULDER - 0.006)) ** 2
        outlines.append(full * waist)
        heights.append(z)
    for turn in np.linspace(0.0, np.pi / 2.0, 13)[1:]:
        share = np.cos(turn) ** 0.8
        outlines.append(share * full + (1.0 - share) * neck)
        heights.append(SHOULDER + (NECK - SHOULDER) * np.sin(turn))
    outlines.append(neck)
    heights.append(CAP)
    z = np.array(heights) - 0.5 * HEIGHT
    return loft(outlines, z, crease=np.radians(50.0))


def _cap() -> Mesh:
    angle = np.linspace(0.0, np.pi / 2.0, 6)
    profile = [
        (0.0, CAP - 0.002),
        (CAP_RADIUS, CAP - 0.002),
        (CAP_RADIUS, 0.166),
        *((CAP_RADIUS - 0.003 * (1 - np.cos(t)), 0.166 + 0.003 * np.sin(t)) for t in angle[1:]),
        (0.0085, 0.1705),
        (0.0055, 0.186),
        *((0.0055 - 0.0025 * (1 - np.cos(t)), 0.1885 + 0.0025 * np.sin(t)) for t in angle),
        (0.0, HEIGHT),
    ]
    return lathe(np.array(profile) - [0.0, 0.5 * HEIGHT], 48)


def _collisions() -> list[Collision]:
    gap, base = 2.0 * INSET, -0.5 * HEIGHT
    top = SHOULDER + base
    flat_a, flat_b = 0.72 * A, 0.66 * B  # where the octagon meets the rounded wall
    middle, tall = 0.5 * (top + base), top - base
    cap_low, cap_high = top, 0.169 + base
    return [
        hull("hull_broad", "box", [2 * A - gap, 2 * flat_b - gap, tall - gap], (0, 0, middle)),
        hull("hull_narrow", "box", [2 * flat_a - gap, 2 * B - gap, tall - gap], (0, 0, middle)),
        hull("hull_shoulder", "box", [0.036, 0.060, 0.024], (0, 0, top + 0.012)),
        hull(
            "hull_cap",
            "cylinder",
            [0.9 * CAP_RADIUS, cap_high - cap_low],
            (0, 0, 0.5 * (cap_low + cap_high)),
        ),
        hull("hull_nozzle", "cylinder", [0.006, 0.022], (0, 0, 0.5 * HEIGHT - 0.011)),
        *balls(octagon(A, B, flat_a, flat_b, base)),
        *balls(octagon(A, B, flat_a, flat_b, top), start=8),
        *balls(ring(CAP_RADIUS, 6, cap_high, np.pi / 6.0), start=16),
    ]


def _label(around: float, along: float) -> Panel:
    """The sheet wraps the whole bottle, so that its yellow is one with the print."""
    paper = Panel(1000.0 * around, 1000.0 * along, YELLOW)
    w, h = paper.width, paper.height
    for x in (0.5 * w, 0.0, w):
        paper.ellipse((x, 0.60 * h), (0.17 * w, 0.25 * h), WHITE)
        paper.ellipse((x, 0.60 * h), (0.155 * w, 0.228 * h), RED)
        paper.rect((x - 0.2 * w, 0.525 * h, x + 0.2 * w, 0.675 * h), WHITE)
        paper.text("MUSTARD", (x, 0.60 * h), height=14, max_width=0.34 * w, color=RED, weight=0.07)
        paper.text("HOT", (x, 0.465 * h), height=10, color=WHITE, weight=0.08)
        for k in range(5):  # seeds
            paper.ellipse((x + (k - 2) * 7.0, 0.735 * h + 2.5 * (k % 2)), (2.6, 2.6), YELLOW)
    paper.barcode((0.25 * w - 10, 0.70 * h, 0.25 * w + 10, 0.80 * h), seed=12)
    paper.barcode((0.75 * w - 10, 0.70 * h, 0.75 * w + 10, 0.80 * h), seed=13)
    return paper


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    body, cap = _body(), _cap()
    outline = superellipse(A, B, 3.2, SEGMENTS)
    around = float(np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1).sum())
    printed = Material("print", (1.0, 1.0, 1.0, 1.0), 0.0, 0.35, _label(around, 0.185).png())
    red = Material("red plastic", (0.55, 0.012, 0.015, 1.0), 0.0, 0.35)
    write_object(
        folder,
        HouseholdObject(
            title="Mustard bottle",
            description="A yellow squeeze bottle with a red oval label and a red nozzle cap.",
            number="006_mustard_bottle",
            mass=0.603,
            parts=[Part(body, printed), Part(cap, red)],
            body=body,
            collisions=_collisions(),
            scanned=True,
        ),
    )
