"""Depth images of bodies given by distance fields, by sphere tracing, before a wall and a table."""

from collections.abc import Sequence

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception.camera_model import CameraModel, PosedCamera
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.mesh import TriangleMesh


def look_at(eye: Sequence[float], target: Sequence[float]) -> RigidTransform:
    """X_WC of a camera at a point that looks at another, its y axis downward."""
    z = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x)
    return RigidTransform(RotationMatrix(np.column_stack([x, np.cross(z, x), z])), eye)


def boxes_mesh(boxes: Sequence[tuple[Sequence[float], Sequence[float]]]) -> TriangleMesh:
    """Boxes (centre, size) along the axes, which may overlap."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
         [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    )  # fmt: skip
    vertices = [np.asarray(centre) + corners * size for centre, size in boxes]
    return TriangleMesh(
        np.concatenate(vertices), np.concatenate([faces + 8 * i for i in range(len(boxes))])
    )


def render_depth(
    camera: PosedCamera,
    bodies: Sequence[tuple[DistanceField, RigidTransform]],
    background: float = 1.6,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> np.ndarray:
    """(H, W) float32 depth; the wall is ``background`` away along the optical axis."""
    model, X_WC = camera
    depth = np.full((model.height, model.width), background)
    slopes = np.moveaxis(np.array(model.rays, dtype=float), 0, -1)
    for field, X_WB in bodies:
        X_CB = X_WC.inverse() @ X_WB
        low = field.origin
        high = low + field.spacing * (np.array(field.shape) - 1)
        corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1])
                            for z in (low[2], high[2])])  # fmt: skip
        pixels = model.project((X_CB @ corners.T).T)
        u0, v0 = np.clip(np.floor(pixels.min(axis=0)), 0, None).astype(int)
        u1, v1 = np.clip(np.ceil(pixels.max(axis=0)) + 1, 0, None).astype(int)
        part = slopes[v0:v1, u0:u1]
        if not part.size:
            continue
        rays = np.concatenate([part, np.ones((*part.shape[:2], 1))], axis=-1).reshape(-1, 3)
        length = np.linalg.norm(rays, axis=1)
        R, p = X_CB.inverse().rotation().matrix(), X_CB.inverse().translation()
        z = np.full(len(rays), max(float((X_CB @ corners.T)[2].min()), 0.05))
        active = np.arange(len(rays))
        hit = np.zeros(len(rays), dtype=bool)
        far = float((X_CB @ corners.T)[2].max())
        for _ in range(60):
            distance = field.at(rays[active] * z[active, None] @ R.T + p).distances
            hit[active[distance < 2e-4]] = True
            z[active] += distance / length[active]
            active = active[(distance >= 2e-4) & (z[active] < far)]
            if not len(active):
                break
        z = np.where(hit, z, np.inf).reshape(part.shape[:2])
        depth[v0:v1, u0:u1] = np.minimum(depth[v0:v1, u0:u1], z)
    if rng is not None:
        depth += noise * rng.standard_normal(depth.shape, dtype=np.float32) * depth**2
        depth[rng.random(depth.shape, dtype=np.float32) < 0.02] = 0
    return depth.astype(np.float32)


def d415(X_WC: RigidTransform) -> PosedCamera:
    """A camera of 640 x 480 with a D415's field of view."""
    return PosedCamera(CameraModel(640, 480, 610.0, 610.0, 319.5, 239.5), X_WC)
