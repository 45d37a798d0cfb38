"""What a driver is, and the place in a station that it is given."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn

import numpy as np
from pydrake.lcm import DrakeLcmInterface
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from prehensile.errors import Finding, InputError
from prehensile.station.guard import COMMAND_PERIOD, GuardLimits
from prehensile.station.guard_system import JointGuard
from prehensile.station.scenario import Scenario


class GuardPorts(NamedTuple):
    """What comes out of the guard, to be sent on to the joints.

    Attributes:
        position: n positions.
        effort: n efforts.
    """

    position: OutputPort
    effort: OutputPort


@dataclass(frozen=True)
class Site:
    """The place in a station where a driver goes.

    Attributes:
        name: name of the driven model (several joined by ``+``), first part of its ports' names.
        config: the driver's configuration.
        scenario: the scenario of the station.
        builder: the station's diagram so far.
        plant: the simulated plant; on hardware one that serves to look facts up.
        lcm: on hardware the bus to talk over, else None.
    """

    name: str
    config: Any
    scenario: Scenario
    builder: DiagramBuilder
    plant: MultibodyPlant
    lcm: DrakeLcmInterface | None = None

    @property
    def models(self) -> list[str]:
        """Names of the driven models."""
        return self.name.split("+")

    @property
    def instances(self) -> list[ModelInstanceIndex]:
        """The driven models in the plant.

        Raises:
            InputError: the plant has no such model.
        """
        for model in self.models:
            if not self.plant.HasModelInstanceNamed(model):
                self.fail(f"no model '{model}' to drive", "name a model that a directive adds")
        return [self.plant.GetModelInstanceByName(model) for model in self.models]

    @property
    def instance(self) -> ModelInstanceIndex:
        """The driven model in the plant, where the driver drives one only."""
        if len(self.models) != 1:
            self.fail("this driver drives one model", "give each model a driver of its own")
        return self.instances[0]

    def fail(self, message: str, mend: str, field: str = "") -> NoReturn:
        """Raises an InputError that names this driver's place in the scenario."""
        key = f"model_drivers.{self.name}" + (f".{field}" if field else "")
        raise InputError(Finding(message, mend, file=str(self.scenario.file or ""), key=key))

    def export_input(self, port: InputPort, name: str) -> None:
        """Makes a port an input of the station, ``MODEL.name``."""
        self.builder.ExportInput(port, f"{self.name}.{name}")

    def export_output(self, port: OutputPort, name: str) -> None:
        """Makes a port an output of the station, ``MODEL.name``."""
        self.builder.ExportOutput(port, f"{self.name}.{name}")

    def check_joints(self, count: int | None = None) -> None:
        """Checks that the driven models' joints have one degree of freedom and an actuator each.

        Args:
            count: how many joints there must be (None for any number above zero).

        Raises:
            InputError: they are not so.
        """
        n = sum(self.plant.num_positions(i) for i in self.instances)
        actuators = sum(self.plant.num_actuators(i) for i in self.instances)
        velocities = sum(self.plant.num_velocities(i) for i in self.instances)
        if n == 0 or not n == actuators == velocities or (count is not None and n != count):
            wanted = "joints" if count is None else f"{count} joints"
            self.fail(
                f"the model has {n} positions, {velocities} velocities and {actuators} actuators",
                f"drive a model with {wanted} of one degree of freedom, each with an actuator",
            )

    def add_guard(
        self,
        limits: GuardLimits,
        measured: OutputPort,
        *,
        effort: str = "feedforward_torque",
        position: bool = True,
        period: float = COMMAND_PERIOD,
        default_position: np.ndarray | None = None,
    ) -> GuardPorts:
        """Adds the model to the station's guard and exports the ports.

        These are ``MODEL.position``, the effort port, ``MODEL.command_time`` (all of which may
        stay unconnected) and ``MODEL.guard_status``.

        Args:
            limits: the limits of the joints.
            measured: port whose first values say where the joints are.
            effort: name of the effort port ("" for none).
            position: whether positions are commanded at all.
            period: seconds between two commands.
            default_position: where the joints are before the simulation starts.
        """
        guard = self._guard()
        guard.add(
            self.name,
            limits,
            period=period,
            default_position=default_position,
            measured_size=measured.size(),
        )
        ports = GuardPorts(
            position=guard.GetOutputPort(f"{self.name}.position"),
            effort=guard.GetOutputPort(f"{self.name}.effort"),
        )
        if position:
            self.export_input(guard.GetInputPort(f"{self.name}.position"), "position")
        if effort:
            self.export_input(guard.GetInputPort(f"{self.name}.effort"), effort)
        self.export_input(guard.GetInputPort(f"{self.name}.command_time"), "command_time")
        self.builder.Connect(measured, guard.GetInputPort(f"{self.name}.measured"))
        self.export_output(guard.GetOutputPort(f"{self.name}.status"), "guard_status")
        return ports

    def _guard(self) -> JointGuard:
        """The station's one guard, made for the first driver that needs it."""
        if not self.builder.HasSubsystemNamed("guard"):
            return self.builder.AddNamedSystem("guard", JointGuard())
        guard = self.builder.GetSubsystemByName("guard")
        assert isinstance(guard, JointGuard)
        return guard


@dataclass(frozen=True)
class Driver:
    """A kind of driver.

    Attributes:
        config: type of its configuration: a dataclass with defaults, or one of Drake's structs.
        simulate: adds its systems to a simulated station and exports their ports.
        connect: does the same over LCM for the real robot; returns a measured port of m values
            and the (n, m) matrix that makes the model's n positions of them (None: the driver
            exists in simulation only).
    """

    config: type
    simulate: Callable[[Site], None]
    connect: Callable[[Site], tuple[OutputPort, np.ndarray]] | None = None

    @property
    def tag(self) -> str:
        """Its tag in a scenario file, without the ``!``."""
        return self.config.__name__
