"""A finite state machine that decides slowly and moves fast, as one Drake System.

A task supplies the states; the System supplies time, measurements and commands. Decisions are
taken a few times a second (they may look at images and plan), while the motion that was decided
last is played at the command rate. Commands leave through discrete state, so nothing in Python
runs when an output is evaluated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import Context, DiscreteValues, InputPort, LeafSystem, State


class Motion(Protocol):
    """What a state machine plays between two decisions."""

    def command(self, t: float) -> tuple[np.ndarray, float, bool]:
        """Command at time `t` after the motion's start.

        Returns:
            Joint positions (n,) in rad, hand opening in m, and whether the motion has ended.
        """
        ...


class Senses(Protocol):
    """What a task may know: the measured state of the robot and its cameras, nothing else."""

    @property
    def q(self) -> np.ndarray:
        """Measured joint positions (n,) in rad."""
        ...

    @property
    def width(self) -> float:
        """Measured opening of the hand in m."""
        ...

    def image(self, port: str) -> Any:
        """Value of a camera's port, such as ``camera0.depth_image``; rendered only if asked."""
        ...


@dataclass(frozen=True)
class Decision:
    """What a task wants from now on.

    Attributes:
        state: name of the state to be in.
        memory: what the task remembers; never changed in place.
        motion: what to play from now on; None goes on with the motion of before.
        finished: the task has nothing more to do.
    """

    state: str
    memory: Any
    motion: Motion | None = None
    finished: bool = False


class Task(Protocol):
    """The states of a task and what leads from one to the next."""

    def start(self) -> Decision:
        """The first decision, taken before anything is measured."""
        ...

    def decide(
        self, state: str, memory: Any, *, time: float, motion_done: bool, senses: Senses
    ) -> Decision | None:
        """Called at each decision step.

        Args:
            state: name of the state the machine is in.
            memory: what the last decision wanted remembered.
            time: seconds since the start of the simulation.
            motion_done: whether the motion of the last decision has ended.
            senses: the measurements at this time.

        Returns:
            The next decision, or None to go on as before.
        """
        ...


@dataclass(frozen=True)
class MachineStatus:
    """Abstract state of a `StateMachine`: what it is doing and since when.

    Immutable, so that Drake may share it instead of copying it at every update.
    """

    decision: Decision
    motion: Motion | None = None
    motion_start: float = 0.0
    history: tuple[tuple[float, str], ...] = field(default_factory=tuple)

    def __deepcopy__(self, memo: dict) -> MachineStatus:
        return self


class StateMachine(LeafSystem):
    """Runs a `Task` against a station.

    Ports::

        position_measured (n) ->  +--------------+ -> position (n)
        hand_state (2)        ->  | StateMachine | -> width (1)
        <each image port>     ->  +--------------+ -> status (abstract MachineStatus)

    Before the first motion the commands are `initial_position` and `initial_width`.
    """

    def __init__(
        self,
        task: Task,
        *,
        initial_position: np.ndarray,
        initial_width: float,
        image_ports: Mapping[str, AbstractValue],
        decision_period: float = 0.05,
        command_period: float = 0.005,
    ) -> None:
        """Makes the System.

        Args:
            task: the states and decisions.
            initial_position: joint command (n,) in rad until the first motion.
            initial_width: opening of the hand in m until the first motion.
            image_ports: input ports that the task may look at, with a model value of each.
            decision_period: seconds between decisions (> 0).
            command_period: seconds between commands (> 0).
        """
        super().__init__()
        self._task = task
        n = len(initial_position)
        self._position_port = self.DeclareVectorInputPort("position_measured", n)
        self._hand_port = self.DeclareVectorInputPort("hand_state", 2)
        self._image_ports: dict[str, InputPort] = {
            name: self.DeclareAbstractInputPort(name, value) for name, value in image_ports.items()
        }
        self._q_index = self.DeclareDiscreteState(np.asarray(initial_position, dtype=float))
        self._width_index = self.DeclareDiscreteState([initial_width])
        first = task.start()
        self._status_index = self.DeclareAbstractState(
            AbstractValue.Make(MachineStatus(first, first.motion, 0.0, ((0.0, first.state),)))
        )
        self.DeclareStateOutputPort("position", self._q_index)
        self.DeclareStateOutputPort("width", self._width_index)
        self.DeclareStateOutputPort("status", self._status_index)
        self.DeclarePeriodicUnrestrictedUpdateEvent(decision_period, 0.0, self._decide)
        self.DeclarePeriodicDiscreteUpdateEvent(command_period, 0.0, self._play)

    def status(self, context: Context) -> MachineStatus:
        """The machine's status in a context of this System."""
        return context.get_abstract_state(self._status_index).get_value()

    def _decide(self, context: Context, state: State) -> None:
        status = self.status(context)
        if status.decision.finished:
            return
        time = context.get_time()
        done = status.motion is None or status.motion.command(time - status.motion_start)[2]
        decision = self._task.decide(
            status.decision.state,
            status.decision.memory,
            time=time,
            motion_done=done,
            senses=_PortSenses(self, context),
        )
        if decision is None:
            return
        moves = decision.motion is not None
        history = status.history
        if decision.state != status.decision.state:
            history = (*history, (time, decision.state))
        state.get_mutable_abstract_state(self._status_index).set_value(
            MachineStatus(
                decision,
                decision.motion if moves else status.motion,
                time if moves else status.motion_start,
                history,
            )
        )

    def _play(self, context: Context, discrete: DiscreteValues) -> None:
        status = self.status(context)
        if status.motion is None:
            return
        q, width, _ = status.motion.command(context.get_time() - status.motion_start)
        discrete.set_value(self._q_index, q)
        discrete.set_value(self._width_index, [width])


class _PortSenses:
    def __init__(self, machine: StateMachine, context: Context) -> None:
        self._machine = machine
        self._context = context

    @property
    def q(self) -> np.ndarray:
        return self._machine._position_port.Eval(self._context)

    @property
    def width(self) -> float:
        return float(self._machine._hand_port.Eval(self._context)[0])

    def image(self, port: str) -> Any:
        return self._machine._image_ports[port].Eval(self._context)
