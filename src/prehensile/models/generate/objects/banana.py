"""Banana: a bent, tapered sweep, lying on its side."""

from pathlib import Path

import numpy as np

from prehensile.models.generate.objects._contact import hull
from prehensile.models.generate.objects._object import HouseholdObject, write_object
from prehensile.models.generate.sdf_model import Collision
from prehensile.models.shapes import Material, Mesh, Part, sweep
from prehensile.models.textures import Panel

RADIUS, BEND = 0.018, 0.110  # of the section at the middle, of the curve, m
HALF_ANGLE = np.radians(55.0)
BALL_ANGLES = np.radians([-49.0, -38.0, -24.0, -8.0, 8.0, 24.0, 38.0, 49.0])


def _thickness(angle: np.ndarray) -> np.ndarray:
    """Radius of the section along the curve as a part of RADIUS: blunt tip, long stem."""
    s = (np.asarray(angle) + HALF_ANGLE) / (2.0 * HALF_ANGLE)  # 0 at the tip, 1 at the stem
    blunt = np.clip(s / 0.22, 0.0, 1.0)
    rise = 0.22 + 0.78 * np.sqrt(1.0 - (1.0 - blunt) ** 2)
    fall = np.clip((s - 0.68) / 0.24, 0.0, 1.0)
    fall = fall * fall * (3.0 - 2.0 * fall)
    return rise * (1.0 - 0.72 * fall)


def _center(angle: np.ndarray) -> np.ndarray:
    """Points (n, 3) of the curve in the frame of the object; it bends about the z axis."""
    angle = np.asarray(angle, dtype=float)
    back = BEND * (1.0 + np.cos(HALF_ANGLE)) / 2.0
    return np.column_stack(
        [BEND * np.cos(angle) - back, BEND * np.sin(angle), np.zeros_like(angle)]
    )


def _mesh() -> Mesh:
    """Five soft edges along, as a banana has."""
    angle = np.linspace(-HALF_ANGLE, HALF_ANGLE, 56)
    turn = np.linspace(-np.pi, np.pi, 40, endpoint=False)
    edge = 1.0 + 0.035 * np.cos(5.0 * turn + 0.6)
    section = RADIUS * edge[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    mesh = sweep(_center(angle), section, _thickness(angle), crease=np.radians(60.0))
    low, high = mesh.bounds()
    return mesh.transformed(p_AB=-0.5 * (low + high))


def _collisions() -> list[Collision]:
    """Balls as thick as the banana, on which it lies, and thinner capsules between them."""
    angle = np.linspace(-HALF_ANGLE, HALF_ANGLE, 56)
    turn = np.linspace(-np.pi, np.pi, 40, endpoint=False)
    edge = 1.0 + 0.035 * np.cos(5.0 * turn + 0.6)
    section = RADIUS * edge[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    raw = sweep(_center(angle), section, _thickness(angle))
    shift = -0.5 * np.sum(raw.bounds(), axis=0)
    centers = _center(BALL_ANGLES) + shift
    radii = np.round(1.03 * RADIUS * _thickness(BALL_ANGLES), 5)
    shapes = [
        hull(f"ball_{k}", "sphere", [radius], center, mu=0.6, resolution=0.006)
        for k, (center, radius) in enumerate(zip(centers, radii, strict=True))
    ]
    for k in range(len(centers) - 1):
        way = centers[k + 1] - centers[k]
        length = float(np.linalg.norm(way))
        yaw = float(np.arctan2(way[1], way[0]))
        middle = 0.5 * (centers[k] + centers[k + 1])
        thin = min(radii[k], radii[k + 1]) - 0.0005
        pose = (*middle, 0.0, np.pi / 2.0, yaw)
        shapes.append(hull(f"hull_{k}", "capsule", [thin, length], pose, resolution=0.006))
    return shapes


def _skin() -> Panel:
    """Yellow with brown flecks; green at the neck, dark at both ends (v runs tip to stem)."""
    rng = np.random.default_rng(20)
    rows, columns = 220, 120
    v = np.linspace(1.0, 0.0, rows)[:, None, None]  # the top of the picture is the stem
    colors = np.broadcast_to(np.array([248.0, 208.0, 52.0]), (rows, columns, 3)).copy()
    colors += 10.0 * np.sin(2.0 * np.pi * 5.0 * np.arange(columns) / columns)[None, :, None]

    def blend(color: tuple[float, float, float], share: np.ndarray) -> None:
        nonlocal colors
        colors = colors * (1.0 - share) + np.array(color) * share

    blend((170.0, 180.0, 60.0), np.clip((v - 0.76) / 0.16, 0.0, 1.0) * np.ones((1, columns, 1)))
    y, x = np.mgrid[0:rows, 0:columns]
    for _ in range(70):
        cy, cx, size, length = rng.random(4)
        dy = (y - cy * rows) / (2.0 + 9.0 * length**3)
        dx = (x - cx * columns) / (1.0 + 2.0 * size**2)
        blend((120.0, 78.0, 30.0), 0.75 * np.exp(-(dx**2) - dy**2)[:, :, None])
    blend((84.0, 56.0, 26.0), np.clip((v - 0.955) / 0.03, 0.0, 1.0) * np.ones((1, columns, 1)))
    blend((52.0, 38.0, 22.0), np.clip((0.045 - v) / 0.03, 0.0, 1.0) * np.ones((1, columns, 1)))
    paper = Panel(110.0, 190.0)
    paper.paint(colors)
    return paper


def generate(folder: Path) -> None:
    """Writes the model's files into ``folder``."""
    mesh = _mesh()
    skin = Material("peel", (1.0, 1.0, 1.0, 1.0), 0.0, 0.6, _skin().png())
    write_object(
        folder,
        HouseholdObject(
            title="Banana",
            description="A ripe yellow banana, bent in the plane it lies on.",
            number="011_banana",
            mass=0.066,
            parts=[Part(mesh, skin)],
            body=mesh,
            collisions=_collisions(),
        ),
    )
