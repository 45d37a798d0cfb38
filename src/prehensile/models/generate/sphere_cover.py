"""Covers collision shapes by spheres, for planners that test spheres against spheres."""

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from prehensile.models.generate.sdf_model import Link, Model, Pose, Shape

BULGE = 0.03
"""How far a sphere may stand out of the shape that it covers, in metres."""


def transform(pose: Pose) -> RigidTransform:
    """The rigid transform that an SDF pose means."""
    return RigidTransform(RollPitchYaw(pose[3:]), pose[:3])


def cover_link(link: Link, bulge: float = BULGE) -> np.ndarray:
    """Spheres whose union holds every collision shape of a link.

    Args:
        link: with collision shapes other than meshes.
        bulge: how far a sphere may stand out of its shape, m.

    Returns:
        (K, 4) rows of centre (link frame) and radius, m.
    """
    rows = []
    for collision in link.collisions:
        spheres = cover_shape(collision.shape, bulge)
        X_LS = transform(collision.pose)
        rows.append(np.column_stack([X_LS.multiply(spheres[:, :3].T).T, spheres[:, 3]]))
    return np.concatenate(rows) if rows else np.empty((0, 4))


def cover_shape(shape: Shape, bulge: float = BULGE) -> np.ndarray:
    """Spheres that together hold a primitive, (K, 4), in the frame of the primitive."""
    if shape.kind == "sphere":
        return np.array([[0.0, 0.0, 0.0, shape.size[0]]])
    if shape.kind == "box":
        return _cover_box(np.asarray(shape.size), bulge)
    radius, length = shape.size
    if shape.kind == "capsule":
        # Spheres on the axis; between two of them their union is thinnest half way.
        half_step = np.sqrt((radius + min(bulge, 0.2 * radius)) ** 2 - radius**2)
        count = int(np.ceil(length / (2.0 * half_step))) if length > 0.0 else 0
        z = np.linspace(-0.5 * length, 0.5 * length, count + 1)
        step = length / count if count else 0.0
        # The end spheres need not grow: beyond them the capsule is a sphere itself.
        grown = np.hypot(radius, 0.5 * step)
        return np.column_stack([np.zeros((len(z), 2)), z, np.full(len(z), grown)])
    if shape.kind == "cylinder":
        return _cover_cylinder(radius, length, bulge)
    raise ValueError(f"no spheres for a {shape.kind}")


def _cover_cylinder(radius: float, length: float, bulge: float) -> np.ndarray:
    """A grid of spheres, each about the part of the cylinder that lies in its cell."""
    counts = np.ones(3, dtype=int)
    size = np.array([2.0 * radius, 2.0 * radius, length])
    while True:
        rows = []
        half = 0.5 * size / counts
        axes = [h * (2.0 * np.arange(n) - n + 1.0) for h, n in zip(half, counts, strict=True)]
        fractions = np.linspace(-1.0, 1.0, 33)
        for x in axes[0]:
            for y in axes[1]:
                u, v = np.meshgrid(x + half[0] * fractions, y + half[1] * fractions)
                # Points beyond the rim are drawn back to it; all of the cell's rim is met so.
                shrink = np.minimum(1.0, radius / np.maximum(np.hypot(u, v), 1e-12))
                p = np.column_stack([(u * shrink).ravel(), (v * shrink).ravel()])
                middle = 0.5 * (p.min(axis=0) + p.max(axis=0))
                reach = np.hypot(np.linalg.norm(p - middle, axis=1).max(), half[2])
                rows += [[*middle, z, reach] for z in axes[2]]
        spheres = np.array(rows)
        out_side = (np.hypot(spheres[:, 0], spheres[:, 1]) + spheres[:, 3]).max() - radius
        out_top = (np.abs(spheres[:, 2]) + spheres[:, 3]).max() - 0.5 * length
        if max(out_side, out_top) <= bulge:
            return spheres
        longest = np.argmax(half)
        counts[[0, 1] if longest < 2 else 2] += 1


def _cover_box(size: np.ndarray, bulge: float) -> np.ndarray:
    """A grid of spheres, each through the corners of its cell."""
    counts = np.ones(3, dtype=int)
    while True:
        half = 0.5 * size / counts
        radius = float(np.linalg.norm(half))
        if radius - half.min() <= bulge:
            break
        counts[np.argmax(half)] += 1
    axes = [h * (2.0 * np.arange(n) - n + 1.0) for h, n in zip(half, counts, strict=True)]
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.column_stack([centers, np.full(len(centers), radius)])


def cover_model(model: Model, bulge: float = BULGE) -> dict[str, np.ndarray]:
    """Link name to spheres (K, 4), for the links that collide."""
    covers = {link.name: cover_link(link, bulge) for link in model.links if link.collisions}
    # Rounding in the file must not open a gap.
    return {name: rows + np.array([0.0, 0.0, 0.0, 2e-5]) for name, rows in covers.items()}
