"""Point-pair features: where a model may be, by a vote of pairs of oriented points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prehensile.native import _core
from prehensile.perception.cloud import PointCloud


@dataclass(frozen=True, eq=False)
class PoseVotes:
    """Poses that pairs of points of a scene voted for, most votes first.

    Attributes:
        X_WO: (K, 4, 4) poses of the model.
        votes: (K,) how many pairs spoke for each; larger models and scenes have more.
    """

    X_WO: NDArray[np.float64]
    votes: NDArray[np.float64]


class PointPairModel:
    """A table of all pairs of a model's oriented points, by distance and angles between them.

    In a scene, each of some reference points votes with all other points for the point of the
    model that it may be and the rotation about its normal; poses that many agree on are found
    however many points belong to other things. Drost, Ulrich, Navab and Ilic, "Model globally,
    match locally", CVPR 2010; a pair near the edge of a bucket votes in the next one, too
    (Hinterstoisser et al., "Going further with point pair features", ECCV 2016).

    Args:
        cloud: points on the model's surface with outward normals, 2 to 8191 of them, evenly
            spread: some 300 to 800. Time and memory grow with their square (500: 25 ms, 1 MB).
        distance_step: width of a bucket along the distance; by default a twentieth of the model's
            diameter [m].

    Raises:
        InputError: if the cloud has no normals.
        ValueError: naming the argument.
    """

    def __init__(self, cloud: PointCloud, distance_step: float | None = None) -> None:
        if len(cloud) < 2:
            raise ValueError(f"cloud: needs at least two points, not {len(cloud)}")
        if distance_step is None:
            distance_step = 0.05 * float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
        self._table = _core.PointPairTable(cloud.points, cloud.require_normals(), distance_step)

    @property
    def diameter(self) -> float:
        """The longest distance of two points of the model [m]."""
        return self._table.diameter

    def vote(
        self,
        scene: PointCloud,
        *,
        num_references: int = 40,
        peaks_per_reference: int = 5,
        max_poses: int = 100,
        num_threads: int = 1,
    ) -> PoseVotes:
        """Poses of the model in a scene.

        Poses within a tenth of the diameter and 20 degrees of each other count as one.

        Args:
            scene: points with normals toward the sensor, evenly spread, about as dense as the
                model's; a normal of zero length leaves its point out.
            num_references: how many points of the scene vote, spread over its rows, at least 1.
            peaks_per_reference: most poses that each of them proposes, at least 1.
            max_poses: most poses returned, at least 1.
            num_threads: at least 1; does not change the result.

        Raises:
            InputError: if the scene has no normals.
            ValueError: naming the argument.
        """
        X_WO, votes = self._table.vote(
            scene.points,
            scene.require_normals(),
            num_references,
            peaks_per_reference,
            max_poses,
            num_threads,
        )
        return PoseVotes(X_WO, votes)
