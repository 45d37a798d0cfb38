"""A Drake System whose output is what a person sets on the Meshcat page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from prehensile.viz.sliders import Slider, add_sliders, read_sliders, remove_sliders

# Binary, so that every update falls on the same instants as the page's publishing.
PERIOD = 1 / 32
# Sticks at rest do not read zero.
_DEAD_ZONE = 0.12


class Gamepad(Protocol):
    """What :meth:`pydrake.geometry.Meshcat.GetGamepad` returns."""

    @property
    def index(self) -> int | None:
        """None while no gamepad has been touched."""
        ...

    @property
    def axes(self) -> Sequence[float]:
        """-1 to 1 each; pushing a stick forward is negative."""
        ...

    @property
    def button_values(self) -> Sequence[float]:
        """0 to 1 each."""
        ...


@dataclass(frozen=True)
class Knob:
    """A slider and what else moves it.

    Attributes:
        slider: on the page.
        speed: greatest rate of change of the output, in the slider's unit per second (> 0).
        axis: number and sign of the gamepad's axis that moves it.
        buttons: numbers of the gamepad's buttons that lower and raise it.
    """

    slider: Slider
    speed: float
    axis: tuple[int, float] | None = None
    buttons: tuple[int, int] | None = None

    def push(self, gamepad: Gamepad) -> float:
        """How hard the gamepad moves this knob, -1 to 1."""
        if gamepad.index is None:
            return 0.0
        push = 0.0
        if self.axis is not None and self.axis[0] < len(gamepad.axes):
            value = gamepad.axes[self.axis[0]]
            push += self.axis[1] * value if abs(value) > _DEAD_ZONE else 0.0
        if self.buttons is not None and max(self.buttons) < len(gamepad.button_values):
            push += gamepad.button_values[self.buttons[1]]
            push -= gamepad.button_values[self.buttons[0]]
        return float(np.clip(push, -1.0, 1.0))


class SliderSource(LeafSystem):
    """Follows the sliders of the page, no faster than their speeds.

    ::

        ┌──────────────┐
        │              │──► values (n)
        │ SliderSource │
        │              │──► pose (RigidTransform, only with pose_of)
        └──────────────┘

    The page is read every :data:`PERIOD` seconds in a discrete update. The discrete state is the
    n values and the n parts of a slider's step that the gamepad has pushed but the slider has not
    yet moved.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        knobs: Sequence[Knob],
        *,
        gamepad: Callable[[], Gamepad],
        pose_of: Callable[[NDArray[np.float64]], RigidTransform] | None = None,
    ) -> None:
        """Puts the sliders on the page.

        Args:
            meshcat: the page.
            knobs: one for each value.
            gamepad: reads the gamepad.
            pose_of: the pose that n values stand for, if there shall be a port for it.
        """
        super().__init__()
        self._meshcat, self._knobs, self._gamepad = meshcat, tuple(knobs), gamepad
        self._sliders = [knob.slider for knob in knobs]
        self._speeds = np.array([knob.speed for knob in knobs])
        self._start = np.array([slider.value for slider in self._sliders])
        add_sliders(meshcat, self._sliders)
        values = self.DeclareDiscreteState(self._start)
        self._rest = self.DeclareDiscreteState(len(knobs))
        self.DeclareStateOutputPort("values", values)
        if pose_of is not None:
            self.DeclareAbstractOutputPort(
                "pose",
                lambda: Value(RigidTransform()),
                lambda context, output: output.set_value(
                    pose_of(context.get_discrete_state(values).value())
                ),
                {self.discrete_state_ticket(values)},
            )
        self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, self._update)

    def remove(self) -> None:
        """Takes the sliders off the page."""
        remove_sliders(self._meshcat, self._sliders)

    def _update(self, context: Context, next_state: DiscreteValues) -> None:
        rest = self._push_sliders(context.get_discrete_state(self._rest).value())
        values = context.get_discrete_state(0).value()
        step = self._speeds * PERIOD
        change = np.clip(self._wanted() - values, -step, step)
        next_state.set_value(0, values + change)
        next_state.set_value(int(self._rest), rest)

    def _wanted(self) -> NDArray[np.float64]:
        """What the sliders say; one that was never moved says its start, unrounded."""
        values = read_sliders(self._meshcat, self._sliders)
        steps = np.array([slider.step for slider in self._sliders])
        return np.where(np.abs(values - self._start) < 0.51 * steps, self._start, values)

    def _push_sliders(self, rest: NDArray[np.float64]) -> NDArray[np.float64]:
        """Moves the sliders by whole steps as the gamepad says; returns what is left."""
        gamepad = self._gamepad()
        push = np.array([knob.push(gamepad) for knob in self._knobs])
        rest = rest + push * self._speeds * PERIOD
        for i, slider in enumerate(self._sliders):
            whole = np.trunc(rest[i] / slider.step) * slider.step
            if whole:
                value = self._meshcat.GetSliderValue(slider.label)
                self._meshcat.SetSliderValue(slider.label, value + whole)
                rest[i] -= whole
        return rest
