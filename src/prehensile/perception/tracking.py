"""Tracking of a free object of known shape through depth images.

A filter on poses: a model of constant velocity predicts, the depth images correct, and the step
between the two is the maximum of the posterior, found by Gauss-Newton from the prediction. All
covariances are of [w; v], a small turn and shift of the object's origin, expressed in W.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from prehensile.perception.body_evidence import Body, BodyEvidence, Evidence, EvidenceConfig
from prehensile.perception.cloud import FARTHEST, within
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.free_space import DepthView
from prehensile.perception.ranges import require_ranges
from prehensile.perception.turns import rotation_of, rotation_vector

Array = NDArray[np.float64]


class TrackingStatus(Enum):
    """What a pose rests on."""

    TRACKING = "tracking"
    """The images show the object where the pose says."""
    OCCLUDED = "occluded"
    """Too little of it can be seen: the pose is predicted from what was known before."""
    LOST = "lost"
    """The images contradict the pose, or it has been out of sight for too long."""


@dataclass(frozen=True)
class TrackerConfig:
    """How an object is tracked.

    Attributes:
        evidence: how images are read.
        angular_acceleration: standard deviation of what the object does unforeseen between two
            images [rad/s^2], > 0.
        acceleration: the same of its origin [m/s^2], > 0.
        initial_pose: standard deviations of a turn [rad] and a shift [m] at the start, > 0.
        initial_velocity: standard deviations of the velocities [rad/s, m/s] at the start, > 0.
        max_iterations: Gauss-Newton steps per image, >= 1.
        min_seen: a smaller part of the samples facing a camera is too little to see, 0 to 1.
        max_in_free: of the samples neither occluded nor unknown, a larger part where the camera
            saw through means that the object is not there, 0 to 1.
        max_coasting: after so long out of sight the object is lost [s].
        velocity_decay: time in which the velocity of an object out of sight fades [s], > 0.
    """

    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    angular_acceleration: float = 20.0
    acceleration: float = 5.0
    initial_pose: tuple[float, float] = (0.1, 0.01)
    initial_velocity: tuple[float, float] = (2.0, 0.5)
    max_iterations: int = 12
    min_seen: float = 0.1
    max_in_free: float = 0.15
    max_coasting: float = 0.5
    velocity_decay: float = 0.2

    def __post_init__(self) -> None:
        """Checks the ranges.

        Raises:
            ValueError: naming the field.
        """
        require_ranges(
            self,
            angular_acceleration=(1e-9, 1e9),
            acceleration=(1e-9, 1e9),
            max_iterations=(1, 1e6),
            min_seen=(0, 1),
            max_in_free=(0, 1),
            max_coasting=(0, np.inf),
            velocity_decay=(1e-9, np.inf),
        )
        for name in ("initial_pose", "initial_velocity"):
            pair = np.asarray(getattr(self, name), dtype=float)
            if pair.shape != (2,) or not ((pair >= 1e-9) & (pair <= 1e9)).all():
                raise ValueError(f"{name}: expected two positive numbers, not {pair}")


@dataclass(frozen=True, eq=False)
class ObjectState:
    """What is known of an object at a time.

    Attributes:
        time: [s].
        X_WO: its pose.
        V_WO: (6,) its spatial velocity [w; v] at its origin, in W [rad/s, m/s].
        covariance: (12, 12) of the errors of [pose; velocity].
        status: what the pose rests on.
        evidence: what the last images said at the pose; None at the start.
        coasting: for how long it has been out of sight [s].
        iterations: Gauss-Newton steps of the last image.
    """

    time: float
    X_WO: RigidTransform
    V_WO: Array
    covariance: Array
    status: TrackingStatus
    evidence: Evidence | None = None
    coasting: float = 0.0
    iterations: int = 0


def start_tracking(
    X_WO: RigidTransform, time: float = 0.0, config: TrackerConfig = TrackerConfig()
) -> ObjectState:
    """The state of an object that was found at a pose, at rest as far as is known.

    Args:
        X_WO: where a registration found it.
        time: when [s].
        config: its initial standard deviations.

    Raises:
        ValueError: if X_WO or time is not finite.
    """
    if not within(X_WO.translation(), FARTHEST):
        raise ValueError("X_WO: must be finite")
    if not np.isfinite(time):
        raise ValueError(f"time: must be finite, not {time}")
    deviations = [s for s in (*config.initial_pose, *config.initial_velocity) for _ in range(3)]
    return ObjectState(
        time, X_WO, np.zeros(6), np.diag(np.square(deviations)), TrackingStatus.TRACKING
    )


def predict(state: ObjectState, time: float, config: TrackerConfig) -> ObjectState:
    """The state at a later time if the velocity stays as it is, give or take accelerations.

    Raises:
        ValueError: if the time lies before the state's.
    """
    dt = time - state.time
    if not 0 <= dt < np.inf:
        raise ValueError(f"time: {time} lies before the state's, {state.time}")
    F = np.eye(12)
    F[:6, 6:] = dt * np.eye(6)
    variance = np.square([config.angular_acceleration] * 3 + [config.acceleration] * 3)
    G = np.vstack([0.5 * dt * dt * np.eye(6), dt * np.eye(6)])
    R, p = _moved(state.X_WO.rotation().matrix(), state.X_WO.translation(), dt * state.V_WO)
    return replace(
        state,
        time=time,
        X_WO=_pose(R, p),
        covariance=F @ state.covariance @ F.T + (G * variance) @ G.T,
    )


def track_object(
    body: Body,
    state: ObjectState,
    time: float,
    views: DepthView | Sequence[DepthView],
    *,
    occluders: Sequence[tuple[DistanceField, RigidTransform]] = (),
    config: TrackerConfig = TrackerConfig(),
) -> ObjectState:
    """The object's state after the depth images of one moment.

    Points measured near the predicted surface draw it to them, free space pushes it out, and the
    prediction holds what neither determines: an axis of symmetry, a part that is hidden. What is
    in front of the object is no evidence against it.

    A table or bin that the object touches need not be known: points whose surface is turned away
    from the object's are not taken for its own (``max_normal_angle`` of the evidence). A surface
    close by that faces as the object's does, as the next one's in a row of boxes, is told apart by
    its field among the occluders. An object that is LOST is retried only around where it was; a
    search through the scene starts it anew: ``start_tracking(locate(cloud, known).X_WO, time)``, as
    :class:`~prehensile.perception.systems.ObjectTracker` does.

    Args:
        body: the object's shape.
        state: after the images before, or :func:`start_tracking`.
        time: when the images were taken [s], not before the state's.
        views: one or several.
        occluders: distance fields and poses X_WK of bodies that may be in front of the object or
            touch it, such as the links of a hand or a table; their points are not taken for the
            object's. Large flat bodies do with a coarse field, ``DistanceField.from_mesh(mesh,
            spacing=0.02, margin=0.04)``.
            Pixels known otherwise not to be the object's: ``DepthView.ignored``.
        config: how to track.

    Returns:
        The next state. While the status is not TRACKING the pose is the prediction; every later
        image is tried again from there.

    Raises:
        ValueError: if the time runs backward or an argument has a wrong shape.
    """
    views = [views] if isinstance(views, DepthView) else views
    predicted = predict(state, time, config)
    data = BodyEvidence([body], views, occluders, config.evidence)
    R, p, covariance, evidence, iterations = _corrected(predicted, data, config)
    visible = evidence.seen + evidence.in_free
    strictness = 1.0 if state.status is TrackingStatus.TRACKING else 0.5
    contradicted = evidence.in_free > strictness * config.max_in_free * visible
    if evidence.seen >= config.min_seen and not contradicted:
        return _updated(predicted, R, p, covariance, evidence, iterations)
    coasting = state.coasting + time - state.time
    lost = (contradicted and visible >= config.min_seen) or coasting > config.max_coasting
    fade = 0.0 if lost else float(np.exp(-(time - state.time) / config.velocity_decay))
    return replace(
        predicted,
        V_WO=fade * predicted.V_WO,
        covariance=start_tracking(predicted.X_WO, time, config).covariance
        if lost
        else predicted.covariance,
        status=TrackingStatus.LOST if lost else TrackingStatus.OCCLUDED,
        evidence=evidence,
        coasting=coasting,
        iterations=iterations,
    )


def _corrected(
    predicted: ObjectState, data: BodyEvidence, config: TrackerConfig
) -> tuple[Array, Array, Array, Evidence, int]:
    """The most likely pose (R, p), its covariance (6, 6), the evidence there, and the steps."""
    R_0 = np.array(predicted.X_WO.rotation().matrix())
    p_0 = np.array(predicted.X_WO.translation())
    prior = np.linalg.inv(predicted.covariance[:6, :6])
    R, p = R_0, p_0
    gate = data.gate(float(np.sqrt(np.diag(predicted.covariance)[3:6].max())))
    points, gathered_at = data.points_near(_matrix(R, p), gate), p
    iterations = 0
    for iterations in range(1, config.max_iterations + 1):
        if np.linalg.norm(p - gathered_at) > 0.3 * gate:
            points, gathered_at = data.points_near(_matrix(R, p), gate), p
        if not len(points):
            break
        scale = data.loss_scale(iterations - 1, gate)
        here = data.at(points, _matrix(R, p), scale)
        offset = np.concatenate([rotation_vector(R @ R_0.T), p - p_0])
        step = -np.linalg.solve(prior + here.information[0], here.gradient[0] + prior @ offset)
        R, p = _moved(R, p, step)
        settled = scale == config.evidence.loss_scale
        if settled and np.abs(step[:3]).max() < 1e-4 and np.abs(step[3:]).max() < 1e-5:
            break
    evidence = data.at(points, _matrix(R, p), config.evidence.loss_scale)
    covariance = np.linalg.inv(prior + evidence.information[0])
    return R, p, covariance, evidence, iterations


def _updated(
    predicted: ObjectState,
    R: Array,
    p: Array,
    covariance: Array,
    evidence: Evidence,
    iterations: int,
) -> ObjectState:
    """Pose as found; velocity and covariances by what they have in common with the pose."""
    P = predicted.covariance
    R_0 = predicted.X_WO.rotation().matrix()
    offset = np.concatenate([rotation_vector(R @ R_0.T), p - predicted.X_WO.translation()])
    gain = np.linalg.solve(P[:6, :6], P[:6, 6:]).T  # velocity by pose
    updated = np.zeros((12, 12))
    updated[:6, :6] = covariance
    updated[6:, :6] = gain @ covariance
    updated[:6, 6:] = updated[6:, :6].T
    updated[6:, 6:] = P[6:, 6:] - gain @ (P[:6, :6] - covariance) @ gain.T
    return replace(
        predicted,
        X_WO=_pose(R, p),
        V_WO=predicted.V_WO + gain @ offset,
        covariance=updated,
        status=TrackingStatus.TRACKING,
        evidence=evidence,
        coasting=0.0,
        iterations=iterations,
    )


def _moved(R: Array, p: Array, motion: Array) -> tuple[Array, Array]:
    return rotation_of(motion[:3]) @ R, p + motion[3:]


def _pose(R: Array, p: Array) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), p)


def _matrix(R: Array, p: Array) -> Array:
    X = np.zeros((1, 4, 4))
    X[0, :3, :3], X[0, :3, 3], X[0, 3, 3] = R, p, 1.0
    return X
