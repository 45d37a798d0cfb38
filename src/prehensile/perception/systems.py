"""Perception as Drake Systems: clouds, the pose of a known object, and its track.

They connect to a station by name: camera NAME of a station has the ports ``NAME.depth_image``,
``NAME.rgb_image`` and ``NAME.X_WC``, and so have these. A chain that finds an object and follows
it, and finds it again when it is lost::

    cameras -> CloudFusion -> ObjectLocator -> ObjectTracker -> X_WO
       |                                             ^
       +---------------------------------------------+

What is computed on demand is computed only when it is read: the locator of the chain only while
the tracker has no object.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.perception import PointCloud as DrakePointCloud
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem, State
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from prehensile.perception.body_evidence import Body
from prehensile.perception.camera_model import CameraModel, PosedCamera
from prehensile.perception.cloud import Box, PointCloud
from prehensile.perception.conversions import to_drake
from prehensile.perception.depth import DepthConfig
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.free_space import DepthView
from prehensile.perception.fusion import fuse
from prehensile.perception.registration.known_object import KnownObject
from prehensile.perception.registration.locate import LocateConfig, LocateResult, locate
from prehensile.perception.registration.result import RegistrationStatus
from prehensile.perception.tracking import (
    ObjectState,
    TrackerConfig,
    TrackingStatus,
    start_tracking,
    track_object,
)

NOWHERE = LocateResult(
    RegistrationStatus.NO_CONSENSUS, None, np.nan, np.zeros(0, dtype=bool), 0, message="not yet"
)
"""The result of a search that has not been made."""

_FITS = (RegistrationStatus.SUCCESS, RegistrationStatus.AMBIGUOUS, RegistrationStatus.DEGENERATE)


class CloudFusion(LeafSystem):
    """Depth images of several cameras to one cloud, by :func:`prehensile.perception.fuse`.

    Ports, the inputs once for each camera NAME::

                                            +-------------+
        NAME.depth_image (ImageDepth32F) -> |             | -> cloud (PointCloud)
        NAME.rgb_image   (ImageRgba8U)   -> | CloudFusion |
        NAME.X_WC        (RigidTransform)-> |             | -> point_cloud (Drake's PointCloud)
                                            +-------------+

    The cloud is that of :mod:`prehensile.perception.cloud`, in W with normals and sensor_origins;
    ``point_cloud`` is the same for Drake's own Systems. It has colours if every camera's
    ``rgb_image`` is connected, which must be pixel by pixel that of the depth. Everything is
    computed when it is read.
    """

    def __init__(
        self,
        cameras: Mapping[str, CameraModel],
        region: Box,
        voxel_size: float,
        *,
        config: DepthConfig | None = None,
        num_threads: int = 1,
    ) -> None:
        """Makes the System.

        Args:
            cameras: name and intrinsics of each, at least one.
            region, voxel_size, config, num_threads: as for :func:`prehensile.perception.fuse`.

        Raises:
            ValueError: if there is no camera.
        """
        super().__init__()
        self._cameras = _CameraPorts(self, cameras)
        self._colors = [
            self.DeclareAbstractInputPort(f"{name}.rgb_image", AbstractValue.Make(ImageRgba8U()))
            for name in cameras
        ]
        self._region, self._voxel_size = region, voxel_size
        self._config, self._num_threads = config, num_threads
        needed = {port.ticket() for port in (*self._cameras.ports, *self._colors)}
        cloud = self.DeclareAbstractOutputPort(
            "cloud",
            lambda: AbstractValue.Make(PointCloud(np.zeros((0, 3)))),
            self._calc,
            prerequisites_of_calc=needed,
        )
        self.DeclareAbstractOutputPort(
            "point_cloud",
            lambda: AbstractValue.Make(DrakePointCloud(0)),
            lambda context, value: value.set_value(to_drake(cloud.Eval(context))),
            prerequisites_of_calc=needed,
        )

    def _calc(self, context: Context, value: AbstractValue) -> None:
        views = self._cameras.views(context)
        colors = None
        if all(port.HasValue(context) for port in self._colors):
            colors = [port.Eval(context).data for port in self._colors]
        value.set_value(
            fuse(
                [view.depth for view in views],
                [view.camera for view in views],
                self._region,
                self._voxel_size,
                color_images=colors,
                config=self._config,
                num_threads=self._num_threads,
            )
        )


class ObjectLocator(LeafSystem):
    """Where a known object is in a cloud, by :func:`prehensile.perception.registration.locate`.

    Ports::

                              +---------------+
        cloud (PointCloud) -> | ObjectLocator | -> result (LocateResult)
                              +---------------+

    The cloud is that of :class:`CloudFusion`. The search is made when the result is read.
    """

    def __init__(
        self, model: KnownObject, config: LocateConfig | None = None, *, num_threads: int = 1
    ) -> None:
        """Makes the System.

        Args:
            model, config, num_threads: as for :func:`prehensile.perception.registration.locate`.
        """
        super().__init__()
        self._model, self._config, self._num_threads = model, config, num_threads
        self._cloud = self.DeclareAbstractInputPort(
            "cloud", AbstractValue.Make(PointCloud(np.zeros((0, 3))))
        )
        self.DeclareAbstractOutputPort(
            "result",
            lambda: AbstractValue.Make(NOWHERE),
            self._calc,
            prerequisites_of_calc={self._cloud.ticket()},
        )

    def _calc(self, context: Context, value: AbstractValue) -> None:
        cloud: PointCloud = self._cloud.Eval(context)
        value.set_value(locate(cloud, self._model, self._config, num_threads=self._num_threads))


class ObjectTracker(LeafSystem):
    """The pose of a moving object, by :func:`prehensile.perception.track_object`.

    Ports, the first two once for each camera NAME::

                                                 +---------------+
        NAME.depth_image (ImageDepth32F)      -> |               | -> state (ObjectState)
        NAME.X_WC        (RigidTransform)     -> |               | -> X_WO (RigidTransform)
        found            (LocateResult)       -> | ObjectTracker | -> V_WO (6)
        body_poses       (list[RigidTransform])->|               |
                                                 +---------------+

    The outputs are of the last image: the pose, and the velocity [w; v] of the object's origin in
    W. What they rest on is ``state.status``.

    While the status is LOST, ``found`` is read with every image if it is connected, and tracking
    starts anew from a pose there that fits (one of several alike will do). Before there is any
    pose, that is NaN. ``body_poses``, needed only with occluders, is the plant's port of that name,
    or one of the same order.
    """

    def __init__(
        self,
        body: Body,
        cameras: Mapping[str, CameraModel],
        *,
        X_WO: RigidTransform | None = None,
        occluders: Sequence[tuple[BodyIndex, DistanceField]] = (),
        period: float = 1 / 30,
        config: TrackerConfig | None = None,
    ) -> None:
        """Makes the System.

        Args:
            body: the object's shape.
            cameras: name and intrinsics of each, at least one.
            X_WO: where the object is at the start, at rest; None if it has to be found.
            occluders: bodies that may be in front of the object or touch it, such as the links of
                a hand, and their fields, each in its body's frame.
            period: from image to image [s], > 0.
            config: how to track; ``TrackerConfig()`` if None.

        Raises:
            ValueError: if there is no camera, or the period is not positive.
        """
        super().__init__()
        if not 0 < period < np.inf:
            raise ValueError(f"period: must be positive, not {period}")
        self._body, self._occluders = body, tuple(occluders)
        self._config = config = config or TrackerConfig()
        self._cameras = _CameraPorts(self, cameras)
        self._found = self.DeclareAbstractInputPort("found", AbstractValue.Make(NOWHERE))
        self._body_poses = self.DeclareAbstractInputPort(
            "body_poses", Value[list[RigidTransform]]()
        )
        start = start_tracking(X_WO or RigidTransform(), 0.0, config)
        if X_WO is None:
            nowhere = RigidTransform([np.nan] * 3)
            start = replace(start, X_WO=nowhere, status=TrackingStatus.LOST)
        self._state = self.DeclareAbstractState(AbstractValue.Make(start))
        needed = {self.abstract_state_ticket(self._state)}
        self.DeclareStateOutputPort("state", self._state)
        self.DeclareAbstractOutputPort(
            "X_WO",
            lambda: AbstractValue.Make(RigidTransform()),
            lambda context, value: value.set_value(self.state(context).X_WO),
            prerequisites_of_calc=needed,
        )
        self.DeclareVectorOutputPort("V_WO", 6, self._calc_velocity, prerequisites_of_calc=needed)
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)

    def state(self, context: Context) -> ObjectState:
        """What is known of the object in a context of this System."""
        return context.get_abstract_state(self._state).get_value()

    def start(self, context: Context, X_WO: RigidTransform) -> None:
        """Starts anew in a context of this System, from a pose at which the object is at rest."""
        value = context.get_mutable_abstract_state(self._state)
        value.set_value(start_tracking(X_WO, context.get_time(), self._config))

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.state(context).V_WO)

    def _update(self, context: Context, state: State) -> None:
        known = self.state(context)
        time = context.get_time()
        if known.status is TrackingStatus.LOST and self._found.HasValue(context):
            found: LocateResult = self._found.Eval(context)
            if found.X_WO is not None and found.status in _FITS:
                known = start_tracking(found.X_WO, time, self._config)
        if not np.isfinite(known.X_WO.translation()).all():
            return
        occluders = []
        if self._occluders:
            poses = self._body_poses.Eval(context)
            occluders = [(field, poses[int(index)]) for index, field in self._occluders]
        known = track_object(
            self._body,
            known,
            time,
            self._cameras.views(context),
            occluders=occluders,
            config=self._config,
        )
        state.get_mutable_abstract_state(self._state).set_value(known)


class _CameraPorts:
    """The input ports of depth images and poses of some cameras."""

    def __init__(self, system: LeafSystem, cameras: Mapping[str, CameraModel]) -> None:
        if not cameras:
            raise ValueError("cameras: there is none")
        self._models = tuple(cameras.values())
        image, pose = AbstractValue.Make(ImageDepth32F()), AbstractValue.Make(RigidTransform())
        self._depths: list[InputPort] = []
        self._poses: list[InputPort] = []
        for name in cameras:
            self._depths.append(system.DeclareAbstractInputPort(f"{name}.depth_image", image))
            self._poses.append(system.DeclareAbstractInputPort(f"{name}.X_WC", pose))

    @property
    def ports(self) -> list[InputPort]:
        return self._depths + self._poses

    def views(self, context: Context) -> list[DepthView]:
        """What the cameras see now."""
        return [
            DepthView(depth.Eval(context).data[:, :, 0], PosedCamera(model, pose.Eval(context)))
            for model, depth, pose in zip(self._models, self._depths, self._poses, strict=True)
        ]
