"""The guard that every joint command passes, in simulation and on hardware alike.

:func:`guard_step` is the whole of it: one pure function from the last state and a command to the
next state. :class:`~prehensile.station.guard_system.JointGuard` samples it at the command rate.
"""

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from prehensile.errors import Finding, InputError

COMMAND_PERIOD = 0.005
"""Seconds between two commands to an arm; its driver accepts no faster ones in position mode."""

COMMAND_TIMEOUT = 0.2
"""Age in seconds at which a command with a time stamp counts as stale."""

START_JUMP = 0.1
"""Greatest distance (rad or m) of the first command from where the joints are held."""

_ACCELERATION_TIME = 0.1  # s to full speed, where a model states no acceleration limit
_ACCELERATION = 100.0  # rad/s^2, where it states no speed either
_FAR = 1e6  # rad or m; stands for a position without limit, so that arithmetic stays finite
_TOLERANCE = 1e-10  # rad/s^2; lets a command at a limit exactly survive rounding


class GuardStatus(enum.IntEnum):
    """What the guard did with the last command."""

    OK = 0
    """It was passed on unchanged."""
    LIMITED = 1
    """It broke a limit; the joints follow it as fast as they may."""
    STALE = 2
    """Its time stamp is too old; the joints brake and hold."""
    JUMP = 3
    """It is too far from where the joints are held to begin with; they hold."""
    NOT_FINITE = 4
    """It holds NaN or infinity; the joints brake and hold."""
    UNCONNECTED = 5
    """There is none; the joints hold."""


@dataclass(frozen=True)
class GuardLimits:
    """Limits of n joints, SI units (rad or m, N m or N).

    Attributes:
        position_lower: n least positions.
        position_upper: n greatest positions.
        velocity: n greatest speeds (> 0, may be infinite).
        acceleration: n greatest accelerations (> 0, finite).
        effort_lower: n least efforts.
        effort_upper: n greatest efforts.
        effort_default: n efforts that hold while no valid effort is commanded.
        jump: greatest distance of a first command from where the joints are held.
    """

    position_lower: tuple[float, ...]
    position_upper: tuple[float, ...]
    velocity: tuple[float, ...]
    acceleration: tuple[float, ...]
    effort_lower: tuple[float, ...]
    effort_upper: tuple[float, ...]
    effort_default: tuple[float, ...]
    jump: float = START_JUMP

    def __post_init__(self) -> None:
        n = len(self.position_lower)
        findings = [
            Finding(f"{len(values)} values for {n} joints", key=f"limits.{name}")
            for name, values in vars(self).items()
            if name != "jump" and len(values) != n
        ]
        if not findings:
            for name, ok in (
                ("position_lower", np.less_equal(self.position_lower, self.position_upper)),
                ("velocity", np.greater(self.velocity, 0.0)),
                ("acceleration", np.greater(self.acceleration, 0.0)),
                ("acceleration", np.isfinite(self.acceleration)),
                ("effort_lower", np.less_equal(self.effort_lower, self.effort_upper)),
                ("effort_default", np.isfinite(self.effort_default)),
                ("jump", np.greater(self.jump, 0.0)),
            ):
                if not np.all(ok):
                    findings.append(Finding("empty or not a range", key=f"limits.{name}"))
        if findings:
            raise InputError(*findings)

    @property
    def size(self) -> int:
        """Number of joints."""
        return len(self.position_lower)

    @staticmethod
    def of_plant(
        plant: MultibodyPlant, instance: ModelInstanceIndex, *, jump: float = START_JUMP
    ) -> "GuardLimits":
        """Reads the limits of a model's one-degree-of-freedom joints, in the order of its state.

        Where the model states no acceleration limit, full speed is reached in 0.1 s.

        Args:
            plant: a finalized plant.
            instance: the model, of which every joint that moves is actuated and has one degree
                of freedom.
            jump: greatest distance of a first command from where the joints are held.
        """
        lower, upper = (
            plant.GetPositionsFromArray(instance, values)
            for values in (plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits())
        )
        velocity, acceleration = (
            plant.GetVelocitiesFromArray(instance, values)
            for values in (plant.GetVelocityUpperLimits(), plant.GetAccelerationUpperLimits())
        )
        fallback = np.where(np.isfinite(velocity), velocity / _ACCELERATION_TIME, _ACCELERATION)
        acceleration = np.where(np.isfinite(acceleration), acceleration, fallback)
        effort = np.full(plant.num_velocities(instance), np.inf)
        start = plant.GetVelocitiesFromArray(instance, np.arange(plant.num_velocities()))
        for index in plant.GetJointActuatorIndices(instance):
            actuator = plant.get_joint_actuator(index)
            effort[start == actuator.joint().velocity_start()] = actuator.effort_limit()

        def floats(values: np.ndarray) -> tuple[float, ...]:
            return tuple(values.tolist())

        return GuardLimits(
            position_lower=floats(np.maximum(lower, -_FAR)),
            position_upper=floats(np.minimum(upper, _FAR)),
            velocity=floats(velocity),
            acceleration=floats(acceleration),
            effort_lower=floats(-effort),
            effort_upper=floats(effort),
            effort_default=(0.0,) * len(effort),
            jump=jump,
        )


class GuardState(NamedTuple):
    """What the guard remembers from one command to the next, and puts out.

    Attributes:
        position: n positions to hold (rad or m).
        velocity: n velocities of the step that led there (rad/s or m/s).
        effort: n efforts (N m or N).
        command: n positions last commanded (limited to the position limits).
        status: what was done with the last command.
    """

    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]
    command: Sequence[float]
    status: GuardStatus


def brake_speed(distance: float, acceleration: float, period: float) -> float:
    """Greatest speed at which the next period may be moved so that one can still stop in time.

    A joint that moves for one period at speed v and then slows down by ``acceleration * period``
    in each further one comes to rest after h ((n + 1) v - a h n (n + 1) / 2) with n = floor(v /
    (a h)); this is the inverse of that (piecewise linear) function, in closed form.

    Args:
        distance: room ahead, m or rad (a negative one counts as none).
        acceleration: deceleration available (> 0, finite).
        period: length of a step in seconds (> 0).
    """
    steps = max(distance, 0.0) / (acceleration * period * period)
    n = math.floor((math.sqrt(1.0 + 8.0 * steps) - 1.0) / 2.0)
    return (steps + n * (n + 1) / 2.0) / (n + 1) * acceleration * period


def guard_step(
    state: GuardState,
    command: Sequence[float] | None,
    effort: Sequence[float] | None,
    limits: GuardLimits,
    period: float,
    *,
    fresh: bool = True,
) -> GuardState:
    """Passes one command through the guard.

    Whatever the commands are, the sequence of positions put out keeps the position limits, and
    its first and second differences the velocity and acceleration limits: each joint moves only
    so fast that it can still stop at the end of its range (:func:`brake_speed`). A command within
    the limits is passed on bit for bit. One out of reach is approached as fast as the limits
    allow, and without overshoot if it moves at a constant velocity. After any fault (stale, not
    finite, jump) commands are followed again once one comes within ``limits.jump`` of the
    position held.

    Args:
        state: result of the last call.
        command: n positions, or None if there is no command.
        effort: n feed-forward efforts, or None for the default ones.
        limits: the limits.
        period: seconds since the last call (> 0).
        fresh: False if the command is too old to be followed.
    """
    status = GuardStatus.OK
    if command is None and effort is None:
        status = GuardStatus.UNCONNECTED
    elif not all(map(math.isfinite, (*(command or ()), *(effort or ())))):
        status = GuardStatus.NOT_FINITE
    elif not fresh:
        status = GuardStatus.STALE
    elif (
        command is not None
        and state.status > GuardStatus.LIMITED
        and any(abs(c - q) > limits.jump for c, q in zip(command, state.position, strict=True))
    ):
        status = GuardStatus.JUMP
    follow = status is GuardStatus.OK and command is not None
    targets = command if command is not None and follow else state.position
    limited = False
    positions, velocities, commands = [], [], []
    for q, v, target, last, lower, upper, top_speed, a in zip(
        state.position,
        state.velocity,
        targets,
        state.command,
        limits.position_lower,
        limits.position_upper,
        limits.velocity,
        limits.acceleration,
        strict=True,
    ):
        slack = _TOLERANCE * period
        v_max = min(v + a * period, top_speed) + slack
        v_min = max(v - a * period, -top_speed) - slack
        # Only near an end of the range does stopping in time bind.
        reach = top_speed * (period + top_speed / a)
        if upper - q < reach:
            v_max = min(v_max, brake_speed(upper - q, a, period))
        if q - lower < reach:
            v_min = max(v_min, -brake_speed(q - lower, a, period))
        c = min(max(target, lower), upper)
        v_next = (c - q) / period if follow else 0.0
        v_command = min(max((c - last) / period, -top_speed), top_speed)
        if (
            follow
            and v_min <= v_next <= v_max
            and abs(v_next - v_command) <= a * period + slack  # else it would overshoot
        ):
            q_next = c
            limited = limited or c != target
        else:
            if follow:
                limited = True
                # Approach the command in the frame that moves with it: braking there ends
                # beside it, at its speed.
                lag = c - q - v_command * period
                v_next = v_command + math.copysign(brake_speed(abs(lag), a, period), lag)
            v_next = min(max(v_next, v_min), v_max)
            # A joint that starts beyond its range may come back, but not go further out.
            q_next = min(max(q + period * v_next, min(lower, q)), max(upper, q))
        positions.append(q_next)
        velocities.append(v_next)
        commands.append(c if follow else q_next)
    efforts = limits.effort_default
    if effort is not None and status is GuardStatus.OK:
        efforts = [
            min(max(tau, lower), upper)
            for tau, lower, upper in zip(
                effort, limits.effort_lower, limits.effort_upper, strict=True
            )
        ]
        limited = limited or efforts != list(effort)
    return GuardState(
        position=positions,
        velocity=velocities,
        effort=efforts,
        command=commands,
        status=GuardStatus.LIMITED if limited else status,
    )
