"""Tracking of an arm through depth images: its joint angles as the camera sees them.

An arm's encoders are precise, but not where the camera believes the arm to be: gears wind, mounts
are off, calibration drifts. The joint angles that lay the links' shapes onto the depth images
differ from the measured ones by a bias, which is what is tracked (Schmidt, Newcombe and Fox,
"DART", RSS 2014; Garcia Cifuentes et al., "Probabilistic articulated real-time tracking for robot
manipulation", RA-L 2017).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.math import RigidTransform

from prehensile.perception.body_evidence import Body, BodyEvidence, Evidence, EvidenceConfig
from prehensile.perception.distance_field import DistanceField
from prehensile.perception.free_space import DepthView
from prehensile.perception.ranges import require_ranges
from prehensile.perception.registration.sequential_qp import constrained_step
from prehensile.perception.tracking import TrackingStatus

Array = NDArray[np.float64]

Kinematics = Callable[[Array], tuple[Array, Array]]
"""q (n,) -> poses X_WL (L, 4, 4) of the links and their Jacobians J_WL (L, 6, n), rotational rows
first, at the links' origins, expressed in W."""


@dataclass(frozen=True)
class ArmTrackerConfig:
    """How an arm is tracked.

    Attributes:
        evidence: how images are read.
        initial_bias: standard deviation of a joint's bias at the start [rad or m], > 0.
        bias_drift: how much a bias wanders in a second [rad or m per sqrt(s)], > 0.
        max_iterations: Gauss-Newton steps per image, >= 1.
        min_seen: a smaller part of the samples facing a camera is too little to see, 0 to 1.
        max_in_free: of the samples neither occluded nor unknown, a larger part where the camera
            saw through means that the arm is not there, 0 to 1.
        observable: a joint is observable if its images have brought its standard deviation below
            this part of the initial one.
    """

    evidence: EvidenceConfig = field(
        default_factory=lambda: EvidenceConfig(max_distance=0.06, loss_scale=0.01)
    )
    initial_bias: float = 0.1
    bias_drift: float = 0.01
    max_iterations: int = 15
    min_seen: float = 0.1
    max_in_free: float = 0.3
    observable: float = 0.2

    def __post_init__(self) -> None:
        """Checks the ranges.

        Raises:
            ValueError: naming the field.
        """
        require_ranges(
            self,
            initial_bias=(1e-9, 1e9),
            bias_drift=(1e-9, 1e9),
            max_iterations=(1, 1e6),
            min_seen=(0, 1),
            max_in_free=(0, 1),
            observable=(0, 1),
        )


@dataclass(frozen=True, eq=False)
class ArmState:
    """What is known of an arm at a time.

    Attributes:
        time: [s].
        q: (n,) joint angles as the images say, q = measured - bias.
        bias: (n,) of the encoders.
        covariance: (n, n) of the bias.
        status: what it rests on.
        observable: (n,) bool, which joints the images have determined.
        evidence: what the last images said; None at the start.
        iterations: Gauss-Newton steps of the last images.
    """

    time: float
    q: Array
    bias: Array
    covariance: Array
    status: TrackingStatus
    observable: NDArray[np.bool_]
    evidence: Evidence | None = None
    iterations: int = 0


def start_arm_tracking(
    q_measured: ArrayLike, time: float = 0.0, config: ArmTrackerConfig | None = None
) -> ArmState:
    """The state of an arm of which only the encoders are known.

    Args:
        q_measured: (n,) what they say.
        time: when [s].
        config: the initial standard deviation.

    Raises:
        ValueError: if q_measured or time is not finite.
    """
    config = config or ArmTrackerConfig()
    q = np.array(q_measured, dtype=float)
    if q.ndim != 1 or not np.isfinite(q).all():
        raise ValueError(f"q_measured: expected (n,) finite numbers, not {q.shape}")
    if not np.isfinite(time):
        raise ValueError(f"time: must be finite, not {time}")
    return ArmState(
        time,
        q,
        np.zeros(len(q)),
        config.initial_bias**2 * np.eye(len(q)),
        TrackingStatus.TRACKING,
        np.zeros(len(q), dtype=bool),
    )


def track_arm(
    links: Sequence[Body],
    kinematics: Kinematics,
    state: ArmState,
    time: float,
    q_measured: ArrayLike,
    views: DepthView | Sequence[DepthView],
    *,
    limits: tuple[ArrayLike, ArrayLike] | None = None,
    occluders: Sequence[tuple[DistanceField, RigidTransform]] = (),
    config: ArmTrackerConfig | None = None,
) -> ArmState:
    """The arm's state after the depth images of one moment.

    Every measured point belongs to the link whose surface is nearest: the distance field of the
    whole arm is composed of the links' own. The bias of the moment before, with what it may have
    wandered, is the prior; joints that the images do not determine keep it.

    Args:
        links: the shapes of the links that are looked for. Each joint is known as well as the
            fields of the links beyond it are true: 10 mm of spacing do for an arm's large links,
            3 to 5 mm for a flange or hand (of an iiwa's joint 6, 0.3 and 0.1 degrees).
        kinematics: poses and Jacobians of the links' frames, in the same order.
        state: after the images before, or :func:`start_arm_tracking`.
        time: when the images were taken [s], not before the state's.
        q_measured: (n,) what the encoders said then.
        views: one or several.
        limits: lowest and highest joint angles (n,), which the estimate keeps.
        occluders: as for :func:`.track_object`.
        config: how to track.

    Returns:
        The next state; while its status is not TRACKING, the bias is as before.

    Raises:
        ValueError: if the time runs backward or an argument has a wrong shape.
    """
    config = config or ArmTrackerConfig()
    measured = np.array(q_measured, dtype=float)
    n = len(state.bias)
    if measured.shape != (n,) or not np.isfinite(measured).all():
        raise ValueError(f"q_measured: expected {n} finite numbers")
    dt = time - state.time
    if not 0 <= dt < np.inf:
        raise ValueError(f"time: {time} lies before the state's, {state.time}")
    low, high = limits if limits is not None else (np.full(n, -np.inf), np.full(n, np.inf))
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if low.shape != (n,) or high.shape != (n,) or not (low <= high).all():
        raise ValueError(f"limits: expected {n} lowest and highest angles each")
    views = [views] if isinstance(views, DepthView) else views
    data = BodyEvidence(links, views, occluders, config.evidence)
    predicted = np.clip(measured - state.bias, low, high)
    P = state.covariance + config.bias_drift**2 * dt * np.eye(n)
    prior = np.asarray(np.linalg.inv(P), dtype=np.float64)
    q, information, evidence, iterations = _fitted(
        data, kinematics, predicted, prior, low, high, config
    )
    visible = evidence.seen + evidence.in_free
    if evidence.seen < config.min_seen or evidence.in_free > config.max_in_free * visible:
        contradicted = evidence.in_free > config.max_in_free * visible
        status = TrackingStatus.LOST if contradicted else TrackingStatus.OCCLUDED
        return ArmState(
            time, predicted, state.bias, P, status, state.observable, evidence, iterations
        )
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    observable = np.sqrt(np.diag(covariance)) < config.observable * config.initial_bias
    return ArmState(
        time,
        q,
        measured - q,
        covariance,
        TrackingStatus.TRACKING,
        observable,
        evidence,
        iterations,
    )


def _fitted(
    data: BodyEvidence,
    kinematics: Kinematics,
    predicted: Array,
    prior: Array,
    low: Array,
    high: Array,
    config: ArmTrackerConfig,
) -> tuple[Array, Array, Evidence, int]:
    """The most likely q, its information (n, n), the evidence there, and the steps."""
    gate = config.evidence.max_distance
    bounded = np.concatenate([np.isfinite(low), np.isfinite(high)])
    rows = np.vstack([np.eye(len(low)), -np.eye(len(low))])[bounded]
    q = predicted
    X_WL, J_WL = kinematics(q)
    gathered_at = X_WL
    points = data.points_near(X_WL, gate)
    iterations = 0
    for iterations in range(1, config.max_iterations + 1):
        if np.abs(X_WL[:, :3, 3] - gathered_at[:, :3, 3]).max() > 0.3 * gate:
            points, gathered_at = data.points_near(X_WL, gate), X_WL
        if not len(points):
            break
        scale = data.loss_scale(iterations - 1, gate)
        here = data.at(points, X_WL, scale)
        gradient = np.einsum("lin,li->n", J_WL, here.gradient) + prior @ (q - predicted)
        information = _joint_information(here, J_WL) + prior
        ends = np.concatenate([low - q, q - high])[bounded]
        step, _ = constrained_step(information, gradient, rows, ends)
        q = np.clip(q + step, low, high)
        X_WL, J_WL = kinematics(q)
        if scale == config.evidence.loss_scale and np.abs(step).max() < 1e-4:
            break
    evidence = data.at(points, X_WL, config.evidence.loss_scale)
    return q, _joint_information(evidence, J_WL) + prior, evidence, iterations


def _joint_information(evidence: Evidence, J_WL: Array) -> Array:
    """(n, n) sum over the links of J^T H J."""
    return np.einsum("lin,lij,ljm->nm", J_WL, evidence.information, J_WL, optimize=True)
