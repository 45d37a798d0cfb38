"""Linear constraints on joint velocities: the user's own, virtual walls, distances to be kept.

All of them are rows of lower ≤ A v ≤ upper, to be stacked by :func:`stack_constraints`. Walls and
distances are velocity dampers: B. Faverjon and P. Tournassoud, "A local based approach for path
planning of manipulators with a high number of degrees of freedom", ICRA 1987.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import QueryObject, SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import Context

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearConstraints:
    """lower ≤ A v ≤ upper; equal sides make an equality, infinite ones constrain nothing.

    Attributes:
        A: (m, n).
        lower, upper: (m,).
    """

    A: Array
    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        A = np.array(self.A, float)
        if A.ndim != 2 or not np.isfinite(A).all():
            raise ValueError("A: expected finite numbers (m, n)")
        object.__setattr__(self, "A", A)
        for name in ("lower", "upper"):
            side = np.array(getattr(self, name), float)
            if side.shape != (len(A),) or np.isnan(side).any():
                raise ValueError(f"{name}: expected a number for each row of A")
            object.__setattr__(self, name, side)


def at_most(A: ArrayLike, b: ArrayLike) -> LinearConstraints:
    """A v ≤ b."""
    b = np.asarray(b, float)
    return LinearConstraints(np.asarray(A, float), np.full(b.shape, -np.inf), b)


def equal(A: ArrayLike, b: ArrayLike) -> LinearConstraints:
    """A v = b."""
    b = np.asarray(b, float)
    return LinearConstraints(np.asarray(A, float), b, b)


def stack_constraints(constraints: Iterable[LinearConstraints]) -> LinearConstraints | None:
    """All of them together; None if there are none."""
    parts = list(constraints)
    if not parts:
        return None
    return LinearConstraints(
        np.vstack([part.A for part in parts]),
        np.concatenate([part.lower for part in parts]),
        np.concatenate([part.upper for part in parts]),
    )


def virtual_walls(
    normals_W: ArrayLike, offsets: ArrayLike, p_WP: ArrayLike, Jp_WP: ArrayLike, *, gain: float
) -> LinearConstraints:
    """Keeps a point P on the side n · p_WP ≤ d of planes.

    n · J v ≤ gain (d − n · p): the nearer the plane, the slower P may approach it, and beyond it
    P has to come back. With gain = 1 / h the point may reach the plane in one step, which a limit
    of acceleration may make impossible; a gain of a few 1/s leaves room to slow down.

    Args:
        normals_W: (m, 3) unit normals, towards what is forbidden.
        offsets: (m,) distances d of the planes from the origin, along the normals (m).
        p_WP: (3,) where P is (m).
        Jp_WP: (3, n) translational Jacobian of P.
        gain: 1/s, above 0 and at most 1 / h.
    """
    normals = np.asarray(normals_W, float)
    distance = np.asarray(offsets, float) - normals @ np.asarray(p_WP, float)
    return at_most(normals @ np.asarray(Jp_WP, float), gain * distance)


def point_jacobian(J_WF: ArrayLike, p_FP_W: ArrayLike) -> Array:
    """(3, n) translational Jacobian of a point P fixed in F, from F's (6, n): v_P = v_F + ω × p.

    Args:
        J_WF: (6, n) Jacobian of F, rotational rows first.
        p_FP_W: (3,) from F's origin to P, expressed in W.
    """
    J = np.asarray(J_WF, float)
    return J[3:] + np.cross(J[:3], np.asarray(p_FP_W, float), axis=0)


def distance_constraints(
    distances: ArrayLike,
    normals_W: ArrayLike,
    Jp_A: ArrayLike,
    Jp_B: ArrayLike,
    *,
    gain: float,
    minimum: float = 0.0,
    influence: float = np.inf,
) -> LinearConstraints:
    """Keeps bodies apart, by signed distances linearized at the pairs' nearest points.

    With the distance φ of a pair and n = ∂φ/∂p_A, the unit vector from B to A, the pair may
    approach at most as fast as −φ̇ = −n · (J_A − J_B) v ≤ gain (φ − minimum).

    Args:
        distances: (m,) signed distances φ (m).
        normals_W: (m, 3) unit vectors from B to A.
        Jp_A, Jp_B: (m, 3, n) translational Jacobians of the nearest points on A and on B.
        gain: 1/s, above 0 and at most 1 / h.
        minimum: distance to keep (m).
        influence: pairs farther apart than this are left out (m).
    """
    distance = np.asarray(distances, float)
    near = distance <= influence
    relative = (np.asarray(Jp_A, float) - np.asarray(Jp_B, float))[near]
    A = -np.einsum("mi,min->mn", np.asarray(normals_W, float)[near], relative)
    return at_most(A, gain * (distance[near] - minimum))


def collision_constraints(
    plant: MultibodyPlant,
    context: Context,
    velocity_indices: Sequence[int] | NDArray[np.intp],
    *,
    gain: float,
    minimum: float = 0.005,
    influence: float = 0.1,
    max_pairs: int = 32,
    considers: Callable[[SceneGraphInspector, object, object], bool] | None = None,
) -> LinearConstraints | None:
    """Keeps the bodies of a plant apart, by Drake's signed distances.

    Args:
        plant: connected to a scene graph.
        context: its context within that of the diagram, at the configuration in question.
        velocity_indices: (n,) where the joints that move are in the plant's v.
        gain: 1/s; see :func:`distance_constraints`.
        minimum: distance to keep (m).
        influence: pairs farther apart are not looked at (m).
        max_pairs: only so many, the nearest (at most 96).
        considers: of the inspector and a pair of geometries, whether it counts; default: all that
            the scene graph does not filter out.

    Returns:
        The constraints; None if nothing is near.
    """
    query: QueryObject = plant.get_geometry_query_input_port().Eval(context)
    inspector = query.inspector()
    pairs = query.ComputeSignedDistancePairwiseClosestPoints(influence)
    if considers is not None:
        pairs = [pair for pair in pairs if considers(inspector, pair.id_A, pair.id_B)]
    pairs.sort(key=lambda pair: (pair.distance, pair.id_A.get_value(), pair.id_B.get_value()))
    rows, distances, normals = [], [], []
    indices = np.asarray(velocity_indices)
    for pair in pairs:
        # No one direction leads apart; what moves them together is not known either.
        if not np.isfinite(pair.nhat_BA_W).all():
            continue
        points = []
        for geometry, p_GC in ((pair.id_A, pair.p_ACa), (pair.id_B, pair.p_BCb)):
            frame = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).body_frame()
            p_FC = inspector.GetPoseInFrame(geometry) @ p_GC
            J = plant.CalcJacobianTranslationalVelocity(
                context,
                JacobianWrtVariable.kV,
                frame,
                p_FC,
                plant.world_frame(),
                plant.world_frame(),
            )
            points.append(J[:, indices])
        if not (points[0] - points[1]).any():
            continue  # Nothing that moves is part of it.
        rows.append(points)
        distances.append(pair.distance)
        normals.append(pair.nhat_BA_W)
        if len(rows) == max_pairs:
            break
    if not rows:
        return None
    Jp = np.array(rows)
    return distance_constraints(distances, normals, Jp[:, 0], Jp[:, 1], gain=gain, minimum=minimum)
