"""The guard as a Drake System: :func:`~prehensile.station.guard.guard_step` at the command rate."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, EventStatus, LeafSystem

from prehensile.station.guard import (
    COMMAND_PERIOD,
    COMMAND_TIMEOUT,
    GuardLimits,
    GuardState,
    GuardStatus,
    guard_step,
)


@dataclass(frozen=True)
class _Group:
    """One model's joints in the guard: its limits, and where its ports and state are.

    The discrete state ``memory`` holds n last commands, n velocities, and one number that tells
    whether the next update would change nothing: _SETTLED if the same command comes again,
    _WAITING if again there is none.
    """

    limits: GuardLimits
    period: float
    timeout: float
    start: np.ndarray
    command: int
    effort: int
    time: int
    measured: int
    positions: int
    efforts: int
    status: int
    memory: int
    rest: bytes


_SETTLED, _WAITING = 1.0, 2.0
_NOTHING_DONE = EventStatus.DidNothing()


class JointGuard(LeafSystem):
    """Samples :func:`guard_step` at the command rate, for any number of models.

    Input ports of each model that is added::

        MODEL.position (n)          commanded positions; may stay unconnected (the joints hold)
        MODEL.effort (n)            feed-forward efforts; may stay unconnected
        MODEL.command_time (1)      time stamp of the command on the station's clock [s]; optional
        MODEL.measured (n or more)  where the joints are; read once, at the start

    Output ports, all of them state (nothing is computed when they are read)::

        MODEL.position (n), MODEL.effort (n)
        MODEL.status (1)            a :class:`GuardStatus` as a float

    It is one system for all models because a system written in Python costs something at every
    step of a simulation, whether it does anything or not.
    """

    def add(
        self,
        model: str,
        limits: GuardLimits,
        *,
        period: float = COMMAND_PERIOD,
        timeout: float = COMMAND_TIMEOUT,
        default_position: Sequence[float] | np.ndarray | None = None,
        measured_size: int | None = None,
    ) -> None:
        """Adds the joints of a model.

        Args:
            model: first part of the ports' names.
            limits: the limits.
            period: seconds between two commands (> 0).
            timeout: age in seconds at which a command with a time stamp is stale (> 0).
            default_position: n positions put out before the start; zeros by default.
            measured_size: size of the measured port, of which the first n values count; n by
                default.
        """
        n = limits.size
        start = np.array(np.zeros(n) if default_position is None else default_position, float)
        position = self.DeclareDiscreteState(start)
        effort = self.DeclareDiscreteState(np.array(limits.effort_default))
        status = self.DeclareDiscreteState(np.array([float(GuardStatus.UNCONNECTED)]))
        memory = self.DeclareDiscreteState(np.concatenate([start, np.zeros(n + 1)]))
        self.DeclareStateOutputPort(f"{model}.position", position)
        self.DeclareStateOutputPort(f"{model}.effort", effort)
        self.DeclareStateOutputPort(f"{model}.status", status)
        group = _Group(
            limits=limits,
            period=period,
            timeout=timeout,
            start=start,
            command=int(self.DeclareVectorInputPort(f"{model}.position", n).get_index()),
            effort=int(self.DeclareVectorInputPort(f"{model}.effort", n).get_index()),
            time=int(self.DeclareVectorInputPort(f"{model}.command_time", 1).get_index()),
            measured=int(
                self.DeclareVectorInputPort(f"{model}.measured", measured_size or n).get_index()
            ),
            positions=int(position),
            efforts=int(effort),
            status=int(status),
            memory=int(memory),
            rest=np.array([0.0] * n + [_SETTLED]).tobytes(),
        )
        self.DeclareInitializationDiscreteUpdateEvent(partial(_initialize, group, self))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, partial(_update, group, self))


def _initialize(group: _Group, guard: LeafSystem, context: Context, values: DiscreteValues) -> None:
    """Holds the joints where they are."""
    q = group.start
    measured = guard.EvalVectorInput(context, group.measured)
    if measured is not None and np.isfinite(measured.value()).all():
        q = measured.value()[: group.limits.size]
    values.set_value(group.positions, q)
    values.set_value(group.efforts, group.limits.effort_default)
    values.set_value(group.status, [float(GuardStatus.UNCONNECTED)])
    values.set_value(group.memory, np.concatenate([q, np.zeros(len(q) + 1)]))


def _update(
    group: _Group, guard: LeafSystem, context: Context, values: DiscreteValues
) -> EventStatus:
    # The one place where Python runs in an idle station, hence the short way out for it: nothing
    # done, so that Drake keeps what it has computed from the commands.
    command = guard.EvalVectorInput(context, group.command)
    command = None if command is None else command.value()
    effort = guard.EvalVectorInput(context, group.effort)
    stamp = guard.EvalVectorInput(context, group.time)
    fresh = stamp is None or context.get_time() - stamp[0] <= group.timeout
    memory = values.value(group.memory)
    if fresh and effort is None:
        if command is None:
            if memory[-1] == _WAITING:
                return _NOTHING_DONE
        elif command.tobytes() + group.rest == memory.tobytes():
            return _NOTHING_DONE
    n = group.limits.size
    state = GuardState(
        position=values.value(group.positions).tolist(),
        velocity=memory[n : 2 * n].tolist(),
        effort=(),
        command=memory[:n].tolist(),
        status=GuardStatus(int(values.value(group.status)[0])),
    )
    state = guard_step(
        state,
        None if command is None else command.tolist(),
        None if effort is None else effort.value().tolist(),
        group.limits,
        group.period,
        fresh=fresh,
    )
    settled = 0.0
    if not any(state.velocity):
        if state.status is GuardStatus.OK and state.position == state.command:
            settled = _SETTLED
        elif state.status is GuardStatus.UNCONNECTED:
            settled = _WAITING
    values.set_value(group.positions, state.position)
    values.set_value(group.efforts, state.effort)
    values.set_value(group.status, [float(state.status)])
    values.set_value(group.memory, [*state.command, *state.velocity, settled])
    return EventStatus.Succeeded()
