"""Finding a known object by depth cameras: the bin is subtracted, what is left is registered."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.behavior.state_machine import Senses
from prehensile.grasping import ParallelGripper
from prehensile.kinematics.poses import pose_distance
from prehensile.perception.camera_model import CameraModel, PosedCamera
from prehensile.perception.cloud import Box, PointCloud
from prehensile.perception.depth import DepthConfig
from prehensile.perception.free_space import DepthView
from prehensile.perception.fusion import fuse
from prehensile.perception.registration.known_object import KnownObject
from prehensile.perception.registration.locate import LocateConfig, LocateResult, locate
from prehensile.perception.registration.refine import RefineConfig, refine_pose
from prehensile.perception.registration.result import RegistrationStatus
from prehensile.perception.segmentation import euclidean_clusters, subtract
from prehensile.tasks.clear_bin_moves import BinGeometry
from prehensile.tasks.pose_pick import Sight


@dataclass(frozen=True)
class FinderConfig:
    """Settings of a finder."""

    # Edge of the voxels of the fused cloud [m]; above 0.
    voxel_size: float = 0.003
    # Points nearer than this to the bin's floor and walls are taken to be the bin [m]; 0 or more.
    bin_margin: float = 0.008
    # Points of one object are no further apart than this [m]; above 0.
    cluster_distance: float = 0.012
    # Clusters with fewer points are noise; 1 or more.
    min_points: int = 60
    # What the cameras' depth is like.
    depth: DepthConfig = field(
        default_factory=lambda: DepthConfig(
            min_depth=0.3, max_depth=1.5, window=11, noise_quadratic=0.0025
        )
    )
    # How the object is looked for. Flying pixels and ragged edges seem to see through its rim, and
    # walls hide much of it.
    locate: LocateConfig = field(
        default_factory=lambda: LocateConfig(
            tolerance=0.003, max_violation=0.3, min_coverage=0.3, min_score=0.3
        )
    )
    # How its pose is refined from a guess, where one is known.
    refine: RefineConfig = field(default_factory=RefineConfig)
    # The same in the hand, where less of it is seen.
    refine_in_hand: RefineConfig = field(
        default_factory=lambda: RefineConfig(initial_scale=0.012, min_overlap=0.3)
    )
    # What is no further from the hand than this is the hand [m]; 0 or more.
    hand_margin: float = 0.004
    # Furthest that the object can slip in the hand [m]; above 0.
    slip_distance: float = 0.04
    # And how far it can turn [rad]; above 0.
    slip_angle: float = 0.7


class CameraFinder:
    """Finds the object in the first bin by some cameras, and checks it in the second by others."""

    def __init__(
        self,
        known: KnownObject,
        models: dict[str, CameraModel],
        find_cameras: Sequence[str],
        check_cameras: Sequence[str],
        pick_bin: BinGeometry,
        place_bin: BinGeometry,
        symmetries: Sequence[RotationMatrix],
        gripper: ParallelGripper,
        config: FinderConfig | None = None,
    ) -> None:
        """Makes the finder.

        Args:
            known: the object.
            models: intrinsics by the camera's name, the prefix of its ports.
            find_cameras: those that look into the first bin.
            check_cameras: those that look into the second bin.
            pick_bin: the first bin.
            place_bin: the second bin.
            symmetries: rotations of O that leave the object's shape as it is.
            gripper: shape of the hand, which is not the object's.
            config: settings; ``FinderConfig()`` if None.
        """
        self._gripper = gripper
        self._known, self._models = known, models
        self._find_cameras, self._check_cameras = find_cameras, check_cameras
        self._pick_bin, self._place_bin = pick_bin, place_bin
        self._symmetries = symmetries
        self.config = config or FinderConfig()

    def find(self, senses: Senses) -> Sight:
        """Where the object is in the first bin; see :class:`prehensile.tasks.pose_pick.Finder`."""
        views = self._views(senses, self._find_cameras)
        started = time.perf_counter()
        cloud = object_cloud(views, self._pick_bin, self.config)
        sight = self.sight(cloud, views)
        return replace(sight, seconds=time.perf_counter() - started)

    def sight(self, cloud: PointCloud, views: Sequence[DepthView]) -> Sight:
        """The pose of the object in what was segmented, and whether to believe it."""
        if len(cloud) < self.config.min_points:
            return Sight(None, f"{len(cloud)} points are in the bin")
        result = locate(cloud, self._known, self.config.locate, views=views)
        if result.X_WO is None or not believed(result, self._symmetries):
            return Sight(result.X_WO, f"{result.status.value}: {result.message}")
        return Sight(result.X_WO)

    def check(self, senses: Senses, X_WGuess: RigidTransform) -> Sight:
        """Where the object is in the second bin, near a guess."""
        views = self._views(senses, self._check_cameras)
        started = time.perf_counter()
        cloud = object_cloud(views, self._place_bin, self.config)
        if len(cloud) < self.config.min_points:
            return Sight(None, f"{len(cloud)} points are in the second bin")
        result = refine_pose(cloud, self._known.field, X_WGuess, self.config.refine)
        if result.X_WO is None or not result.succeeded:
            return Sight(None, f"{result.status.value}: {result.message}")
        return Sight(result.X_WO, seconds=time.perf_counter() - started)

    def in_hand(self, senses: Senses, X_WGuess: RigidTransform, X_WG: RigidTransform) -> Sight:
        """Where the object is in the closed hand at X_WG, near a guess.

        What is near the guess but of the hand itself is left out. A pose further from the guess
        than an object can slip in a hand is none.
        """
        views = self._views(senses, self._find_cameras)
        started = time.perf_counter()
        config = self.config
        size = 2 * np.abs(self._known.cloud.points).max(axis=0) + 2 * config.slip_distance
        cloud = fuse(
            [view.depth for view in views],
            [view.camera for view in views],
            Box(X_WGuess, size),
            config.voxel_size,
            config=config.depth,
        )
        centres, sizes = self._gripper.boxes(np.array([senses.width]))
        hand = [
            Box(X_WG @ RigidTransform(centre), size)
            for centre, size in zip(centres[0], sizes[0], strict=True)
        ]
        cloud = subtract(cloud, hand, margin=config.hand_margin)
        if len(cloud) < config.min_points:
            return Sight(None, f"{len(cloud)} points are in the hand")
        result = refine_pose(cloud, self._known.field, X_WGuess, config.refine_in_hand)
        if result.X_WO is None or not result.succeeded:
            return Sight(None, f"{result.status.value}: {result.message}")
        distance, angle = pose_distance(result.X_WO, X_WGuess)
        if distance > config.slip_distance or angle > config.slip_angle:
            said = f"{1e3 * distance:.0f} mm and {np.rad2deg(angle):.0f} degrees"
            return Sight(None, f"{said} from where it should be in the hand")
        return Sight(result.X_WO, seconds=time.perf_counter() - started)

    def _views(self, senses: Senses, names: Sequence[str]) -> list[DepthView]:
        return [
            DepthView(
                senses.image(f"{name}.depth_image").data[:, :, 0],
                PosedCamera(self._models[name], senses.image(f"{name}.X_WC")),
            )
            for name in names
        ]


def object_cloud(
    views: Sequence[DepthView], bin_geometry: BinGeometry, config: FinderConfig
) -> PointCloud:
    """What stands in a bin: the largest cluster of points that are not the bin's."""
    region = bin_geometry.region(inset=0.0, above_floor=0.0, above_rim=0.15)
    cloud = fuse(
        [view.depth for view in views],
        [view.camera for view in views],
        region,
        config.voxel_size,
        config=config.depth,
    )
    cloud = subtract(cloud, bin_geometry.walls, margin=config.bin_margin)
    labels = euclidean_clusters(cloud.points, config.cluster_distance)
    return cloud.select(labels == 0)


def believed(result: LocateResult, symmetries: Sequence[RotationMatrix]) -> bool:
    """Whether a pose is certain, but for the object's own symmetries."""
    if result.status is not RegistrationStatus.AMBIGUOUS:
        return result.succeeded
    assert result.X_WO is not None
    X_OW = result.X_WO.inverse()

    def same(X_WOther: RigidTransform) -> bool:
        X_OOther = X_OW @ X_WOther
        return any(
            (X_OOther.rotation().inverse() @ R).ToAngleAxis().angle() < 0.15
            and np.linalg.norm(X_OOther.translation()) < 0.01
            for R in symmetries
        )

    return all(same(X) for X in result.alternatives)
