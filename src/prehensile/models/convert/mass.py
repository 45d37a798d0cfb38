"""Mass properties: of shapes of uniform density, put together, and made physically possible."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from prehensile.models.shapes.mesh import MassProperties

TOLERANCE = 1e-6
"""Relative; how far a moment of inertia may break the triangle inequality and be left alone."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A body of density 1, in a frame L.

    Attributes:
        volume: m³.
        p_LScm: (3,) its centre, m.
        G_S: (3, 3) rotational inertia about the centre, expressed in L, per unit of mass, m².
    """

    volume: float
    p_LScm: np.ndarray
    G_S: np.ndarray

    def moved(self, X_LS: np.ndarray) -> "Solid":
        """Given in frame S, the solid in frame L; X_LS is (4, 4)."""
        R = X_LS[:3, :3]
        return Solid(self.volume, R @ self.p_LScm + X_LS[:3, 3], R @ self.G_S @ R.T)


def primitive(kind: str, size: Sequence[float]) -> Solid:
    """A solid primitive, centred on its frame's origin.

    Args:
        kind: box (edge lengths), sphere (radius), cylinder or capsule (radius, length along z,
            a capsule's without its caps), ellipsoid (half axes).
        size: in m.
    """
    if kind == "box":
        x, y, z = (s * s for s in size)
        volume, moments = math.prod(size), ((y + z) / 12, (x + z) / 12, (x + y) / 12)
    elif kind in ("sphere", "ellipsoid"):
        a, b, c = (size[0],) * 3 if kind == "sphere" else size
        volume = 4 / 3 * math.pi * a * b * c
        moments = ((b * b + c * c) / 5, (a * a + c * c) / 5, (a * a + b * b) / 5)
    elif kind == "cylinder":
        r, length = size
        volume, across = math.pi * r * r * length, (3 * r * r + length * length) / 12
        moments = (across, across, r * r / 2)
    elif kind == "capsule":
        r, length = size
        barrel, caps = math.pi * r * r * length, 4 / 3 * math.pi * r**3
        volume = barrel + caps
        # A half ball's centre is 3/8 r from its flat face.
        across = barrel * (3 * r * r + length * length) / 12
        across += caps * (2 / 5 * r * r + length * length / 4 + 3 / 8 * r * length)
        moments = (across / volume,) * 2 + ((barrel / 2 + caps * 2 / 5) * r * r / volume,)
    else:
        raise ValueError(f"kind: unknown primitive '{kind}'")
    return Solid(volume, np.zeros(3), np.diag(moments))


def combined(solids: Sequence[tuple[Solid, float]]) -> MassProperties:
    """Mass properties of solids together, each with its density; overlaps count twice.

    Args:
        solids: with their densities in kg/m³; of more than zero mass.
    """
    masses = np.array([solid.volume * density for solid, density in solids])
    centres = np.array([solid.p_LScm for solid, _ in solids])
    mass = float(masses.sum())
    p_LLcm = masses @ centres / mass
    inertia = np.zeros((3, 3))
    for m, (solid, _) in zip(masses, solids, strict=True):
        r = solid.p_LScm - p_LLcm
        inertia += m * (solid.G_S + (r @ r) * np.eye(3) - np.outer(r, r))
    return MassProperties(mass, p_LLcm, inertia)


def nearest_possible(inertia: np.ndarray) -> np.ndarray:
    """The rotational inertia nearest to one that no body can have.

    A rotational inertia I belongs to a body exactly if the matrix of its second moments,
    S = tr(I)/2 1 - I, has no negative eigenvalue (Wensing, Kim and Slotine, "Linear Matrix
    Inequalities for Physically-Consistent Inertial Parameter Identification", 2018); negative
    ones are set to zero, which is the projection in the Frobenius norm of S.

    Args:
        inertia: (3, 3) symmetric, about the centre of mass, kg m².

    Returns:
        (3, 3); ``inertia`` itself if a body can have it to a relative :data:`TOLERANCE`.
    """
    second = np.trace(inertia) / 2 * np.eye(3) - inertia
    values, vectors = np.linalg.eigh(second)
    if values[0] >= -TOLERANCE * np.abs(values).max():
        return inertia
    second = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.trace(second) * np.eye(3) - second
