"""Grasp candidates: places where the hand's closing axis meets a surface squarely."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prehensile.grasping.grasp import GraspConfig
from prehensile.perception.cloud import PointCloud

# Normals that lean no more than this count as level [rad].
_LEVEL = np.deg2rad(8)


@dataclass(frozen=True)
class Candidates:
    """Poses of the frame P midway between the pads, parallel to the hand's frame G.

    Attributes:
        R_WP: (M, 3, 3) orientations: columns are the closing axis x, the approach y, and z.
        p_WP: (M, 3) positions in W [m]; a point that is to be between the pads.
        segment: (M,) label of the piece of the cloud that is to be grasped.
        seed: (M,) number of the place it was made for; those of one place stand together.
    """

    R_WP: NDArray[np.float64]
    p_WP: NDArray[np.float64]
    segment: NDArray[np.int64]
    seed: NDArray[np.int64]

    def __len__(self) -> int:
        """The number of candidates."""
        return len(self.p_WP)

    def select(self, index: NDArray[np.bool_] | NDArray[np.int64]) -> "Candidates":
        """Those chosen by a mask or by indices."""
        return Candidates(self.R_WP[index], self.p_WP[index], self.segment[index], self.seed[index])


def antipodal_candidates(
    cloud: PointCloud,
    segments: NDArray[np.int64],
    rng: np.random.Generator,
    config: GraspConfig,
) -> Candidates:
    """Candidates whose closing axis is the normal of a sampled point, or its level part.

    For each seed point the closing axis x is its outward normal, and, if that leans, its level
    part too (what a camera sees of a round thing on the floor leans upward); the approach y is
    turned about x in steps from the steepest direction; the pads' centre is put at several depths
    past the point (Tedrake, Robotic Manipulation, section 5.4.4). Points whose normal is so steep
    that no approach perpendicular to it stays within ``max_tilt`` of straight down are no seeds.
    Seeds are spread over the segments with the root of their sizes, so that small things are not
    forgotten.

    Args:
        cloud: the scene, in a frame W whose z points up.
        segments: (N,) labels of its points (-1: none).
        rng: source of the seeds.
        config: settings.

    Returns:
        Candidates, those of one seed in succession; at most one set per usable point.
    """
    # The least tilt of a direction perpendicular to n is the angle of n to the horizontal plane.
    usable = np.nonzero(np.abs(cloud.require_normals()[:, 2]) < np.sin(config.max_tilt))[0]
    if len(usable) == 0:
        none = np.zeros(0, dtype=np.int64)
        return Candidates(np.zeros((0, 3, 3)), np.zeros((0, 3)), none, none)
    _, inverse, count = np.unique(segments[usable], return_inverse=True, return_counts=True)
    weight = 1.0 / np.sqrt(count[inverse])
    seeds = rng.choice(
        usable,
        size=min(config.num_seeds, len(usable)),
        replace=False,
        p=weight / weight.sum(),
    )
    axes = cloud.require_normals()[seeds]
    leaning = np.abs(axes[:, 2]) > np.sin(_LEVEL)
    order = np.argsort(np.append(np.arange(len(seeds)), np.nonzero(leaning)[0]), kind="stable")
    seeds = np.concatenate([seeds, seeds[leaning]])[order]
    axes = np.concatenate([axes, axes[leaning] * [1.0, 1.0, 0.0]])[order]
    R_W0 = _steepest_frames(axes)
    steps = int(config.max_tilt / config.tilt_step)
    angles = config.tilt_step * np.arange(-steps, steps + 1)
    depths = np.array(config.depths)
    # Turning about x: y' = y cos + z sin.
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    S, A, D = len(seeds), len(angles), len(depths)
    x = np.broadcast_to(R_W0[:, None, :, 0], (S, A, 3))
    y = cos * R_W0[:, None, :, 1] + sin * R_W0[:, None, :, 2]
    z = cos * R_W0[:, None, :, 2] - sin * R_W0[:, None, :, 1]
    R_WP = np.broadcast_to(np.stack([x, y, z], axis=-1)[:, :, None], (S, A, D, 3, 3))
    # A little inside the surface, so that the seed is between the pads whatever the rounding.
    inside = cloud.points[seeds] - 0.5 * config.voxel_size * cloud.require_normals()[seeds]
    p_WP = inside[:, None, None] + depths[:, None] * y[:, :, None]
    of_seed = np.repeat(np.arange(S), A * D)
    candidates = Candidates(
        R_WP.reshape(-1, 3, 3), p_WP.reshape(-1, 3), segments[seeds][of_seed], of_seed
    )
    return candidates.select(candidates.R_WP[:, 2, 1] <= -np.cos(config.max_tilt))


def _steepest_frames(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-handed frames (S, 3, 3) with the given x axes and y as near straight down as can be.

    No x axis may be vertical.
    """
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    z = np.cross(x, [0.0, 0.0, -1.0])
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    y = np.cross(z, x)
    return np.stack([x, y / np.linalg.norm(y, axis=1, keepdims=True), z], axis=-1)
