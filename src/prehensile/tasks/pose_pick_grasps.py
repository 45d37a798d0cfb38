"""An object whose shape is known: its surface, its grasps from every side, how it may lie.

Frames: O the object, G the hand, P the point between its pads (parallel to G).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from prehensile.grasping.candidates import Candidates
from prehensile.grasping.grasp import GraspConfig
from prehensile.grasping.gripper import ParallelGripper
from prehensile.grasping.scoring import evaluate
from prehensile.perception.cloud import PointCloud
from prehensile.perception.fusion import downsample

_VOXEL = 0.004
_TURN = np.deg2rad(15)  # between neighbouring approaches about one closing axis
_ARM_WEIGHT = 0.5  # score lost per 5 cm between the grasp and the vertical of the centre of mass
_CONFIG = GraspConfig(
    voxel_size=_VOXEL,
    min_clearance=0.003,
    weight_tilt=0.0,
    weight_offset=0.0,
    max_contact_angle=float(np.deg2rad(25)),
)


@dataclass(frozen=True)
class ModelGrasp:
    """A grasp in the frame of the object.

    Attributes:
        X_OG: pose of the hand.
        width: opening command for the approach [m].
        score: the higher the better; 1 is flawless.
    """

    X_OG: RigidTransform
    width: float
    score: float


def model_grasps(
    cloud_O: PointCloud,
    p_OCm: NDArray[np.float64],
    gripper: ParallelGripper,
    *,
    seed: int = 0,
    num_seeds: int = 320,
) -> list[ModelGrasp]:
    """Antipodal grasps of a known object, best first.

    Closing axes are the normals of points of its surface; about each the hand is turned all the way
    round. Contacts, openings and collisions of the hand with the object are judged as for clouds
    (:func:`prehensile.grasping.scoring.evaluate`), and a grasp loses by its distance from the
    centre of mass, across the closing axis: so far the object's weight turns it in the hand.

    Args:
        cloud_O: the whole surface, one point per voxel of 4 mm, with normals, in O.
        p_OCm: (3,) the centre of mass in O [m].
        gripper: the hand.
        seed: of the choice of points.
        num_seeds: how many points to take.

    Returns:
        The grasps, none closer to a better one than 8 mm and 14 degrees.
    """
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(cloud_O), size=min(num_seeds, len(cloud_O)), replace=False)
    turns = np.arange(0, 2 * np.pi - 1e-9, _TURN)
    x = cloud_O.require_normals()[chosen]
    y0 = np.cross(x, np.eye(3)[np.argmin(np.abs(x), axis=1)])
    y0 /= np.linalg.norm(y0, axis=1, keepdims=True)
    z0 = np.cross(x, y0)
    y = np.cos(turns)[:, None] * y0[:, None] + np.sin(turns)[:, None] * z0[:, None]
    x = np.broadcast_to(x[:, None], y.shape)
    frames = np.stack([x, y, np.cross(x, y)], axis=-1)
    R_OP: NDArray[np.float64] = frames.astype(float).reshape(-1, 3, 3)
    p_OP = (cloud_O.points[chosen, None] - 0.5 * _VOXEL * x).reshape(-1, 3)
    place = np.repeat(np.arange(len(chosen)), len(turns))
    # Collisions are judged for hands that do not point up: for those that do, upside down.
    p_found, widths, scores = p_OP.copy(), np.zeros(len(p_OP)), np.full(len(p_OP), -np.inf)
    for up in (False, True):
        rows = np.nonzero((R_OP[:, 2, 1] > 0) == up)[0]
        R_VO = np.diag([1.0, -1.0, -1.0]) if up else np.eye(3)
        found = evaluate(
            Candidates(R_VO @ R_OP[rows], p_OP[rows] @ R_VO.T, np.zeros_like(rows), place[rows]),
            cloud_O.transformed(RigidTransform(RotationMatrix(R_VO), np.zeros(3))),
            np.zeros(len(cloud_O), dtype=np.int64),
            gripper,
            [],
            _CONFIG,
        )
        p_found[rows] = found.p_WP @ R_VO
        widths[rows] = found.width
        scores[rows] = found.score  # minus infinity where it is none
    offset = np.linalg.norm(np.cross(p_found - p_OCm, R_OP[:, :, 0]), axis=1)
    scores -= _ARM_WEIGHT * offset / 0.05
    order = np.argsort(-scores, kind="stable")
    order = order[np.isfinite(scores[order])]
    kept: list[int] = []
    for i in order:
        if not kept:
            kept.append(i)
            continue
        near = np.linalg.norm(p_found[kept] - p_found[i], axis=1) < 0.008
        # Half a turn about the approach exchanges the fingers: the same grasp.
        d = np.sum(R_OP[kept] * R_OP[i], axis=1)
        trace = d[:, 1] + np.abs(d[:, 0] + d[:, 2])
        if not np.any(near & (0.5 * (trace - 1.0) > np.cos(np.deg2rad(14)))):
            kept.append(i)
    return [
        ModelGrasp(
            RigidTransform(
                RotationMatrix.ProjectToRotationMatrix(R_OP[i]),
                p_found[i] - R_OP[i] @ gripper.p_GPad,
            ),
            float(widths[i]),
            float(scores[i]),
        )
        for i in kept
    ]


def lying_poses(
    center: NDArray[np.float64], half_thickness: float, rng: np.random.Generator, count: int = 8
) -> Iterator[RigidTransform]:
    """Poses in which the object lies on either broad side (its x axis vertical), turned at random.

    Args:
        center: (3,) of the floor below it, in W [m].
        half_thickness: half the object's extent along x [m].
        rng: of the turns.
        count: how many turns.
    """
    p_WO = np.array(center) + [0, 0, half_thickness]
    first = rng.uniform(0, 2 * np.pi)
    for k in range(count):
        turn = RotationMatrix.MakeZRotation(first + 2 * np.pi * k / count)
        for side in (0.5 * np.pi, -0.5 * np.pi):
            yield RigidTransform(turn @ RollPitchYaw(0, side, 0).ToRotationMatrix(), p_WO)


def surface_cloud(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> PointCloud:
    """A surface as points with normals, one per voxel of 4 mm.

    Args:
        vertices: (V, 3) [m].
        faces: (F, 3), counter-clockwise seen from outside.
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(cross, axis=1)
    wide = area > 1e-12
    corners, cross, area = corners[wide], cross[wide], area[wide]
    rng = np.random.default_rng(0)
    count = int(area.sum() / _VOXEL**2 * 20)
    face = rng.choice(len(area), size=count, p=area / area.sum())
    u, v = rng.random((2, count))
    flip = u + v > 1
    u[flip], v[flip] = 1 - u[flip], 1 - v[flip]
    a, b, c = (corners[face, k] for k in range(3))
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    normals = cross[face] / (2 * area[face, None])
    return downsample(PointCloud(points, normals), _VOXEL)
