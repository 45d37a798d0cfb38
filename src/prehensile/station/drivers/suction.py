"""A suction cup in simulation: ``MODEL.vacuum`` draws it, the surface before it may be held.

Ports: input ``MODEL.vacuum`` (1: draw, 0 or unconnected: vent); outputs ``MODEL.sealed`` (1 while a
surface closes the cup and there is a vacuum, else 0) and ``MODEL.pressure`` (Pa below the
atmosphere's).

The cup is sealed when one body's surface lies within reach of the lip all round. The vacuum then
pulls that body to the cup, and the cup to it, with pressure times area; the lip's contact carries
everything else: it pushes back, holds by friction, and resists tilting as far as it is pressed. So
the grasp breaks as a real one does: a pull of more than pressure times area takes the body off the
lip, shear that friction does not hold slides it, a moment peels it off (compare the contact model
of Mahler et al., "Dex-Net 3.0", ICRA 2018, section III). Forces of gravity and inertia up to there
need no spring between cup and body, whose stiffness would have to suit the body's mass.
"""

import dataclasses as dc
from collections.abc import Iterable

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import QueryObject
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Frame
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from prehensile.station.drivers.site import Driver, Site

_RIM_POINTS = 8
_VENTED = 1e-3  # of the pump's pressure, less than which holds nothing


@dc.dataclass
class SuctionDriver:
    """A suction cup.

    Attributes:
        frame: the frame in the middle of the lip's face, z away from the cup.
        radius: m (> 0, at most 1), of the area that the vacuum works on.
        vacuum: Pa below the atmosphere's pressure (> 0, at most 1e5) that the pump reaches.
        reach: m (> 0, at most 0.1), gap between lip and surface that the lip still closes.
        response: s (> 0, at most 100), time constant of drawing and venting.
        period: s (1e-4 to 1), between two looks at the seal and the pressure.
    """

    frame: str = "lip"
    radius: float = 0.016
    vacuum: float = 60e3
    reach: float = 0.002
    response: float = 0.03
    period: float = 0.005


def holding_force(pressure: float, radius: float) -> float:
    """The force in N that a vacuum of ``pressure`` Pa holds with over a disc of ``radius`` m."""
    return pressure * np.pi * radius**2


def next_pressure(pressure: float, aim: float, elapsed: float, response: float) -> float:
    """The vacuum in Pa after ``elapsed`` s of drawing or venting towards ``aim`` Pa."""
    return aim + (pressure - aim) * float(np.exp(-elapsed / response))


def sealing_body(gaps: Iterable[dict[int, float]], reach: float) -> int | None:
    """The body that closes the cup.

    Args:
        gaps: for each point of the lip, signed distance in m by body.
        reach: m, gap that is still closed.

    Returns:
        The one of the bodies within reach of every point that is nearest on the whole, or None.
    """
    gaps = list(gaps)
    total = {
        body: sum(gap[body] for gap in gaps)
        for body in gaps[0]
        if all(gap.get(body, np.inf) <= reach for gap in gaps)
    }
    return min(total, key=lambda body: total[body]) if total else None


@dc.dataclass(frozen=True)
class _Cup:
    """One cup in the system: its configuration, and where its port and state are."""

    config: SuctionDriver
    frame: Frame
    vacuum: int
    state: int


class SuctionSystem(LeafSystem):
    """All suction cups of a station.

    Input ports::

        query_object          of the scene graph
        body_poses            of the plant
        applied_spatial_force further forces, handed on; may stay unconnected
        MODEL.vacuum (1)      whether to draw; may stay unconnected

    Output ports::

        spatial_forces        for the plant
        MODEL.sealed (1), MODEL.pressure (1)
    """

    def __init__(self, plant: MultibodyPlant) -> None:
        super().__init__()
        self._plant = plant
        self._cups: list[_Cup] = []
        forces = Value[list[ExternallyAppliedSpatialForce]]
        self._query = self.DeclareAbstractInputPort("query_object", Value(QueryObject()))
        self._poses = self.DeclareAbstractInputPort("body_poses", Value[list[RigidTransform]]())
        self._others = self.DeclareAbstractInputPort("applied_spatial_force", forces())
        self.DeclareAbstractOutputPort("spatial_forces", forces, self._forces)

    def add(self, model: str, frame: Frame, config: SuctionDriver) -> None:
        """Adds a cup.

        Args:
            model: first part of its ports' names.
            frame: of its lip.
            config: the cup.
        """
        # Sealing body's index (-1 for none), pressure.
        state = self.DeclareDiscreteState([-1.0, 0.0])
        vacuum = self.DeclareVectorInputPort(f"{model}.vacuum", 1).get_index()
        cup = _Cup(config, frame, vacuum, state)
        self._cups.append(cup)
        self.DeclarePeriodicDiscreteUpdateEvent(
            config.period, 0.0, lambda context, values: self._update(cup, context, values)
        )
        depends = {self.discrete_state_ticket(state)}

        def sealed(context: Context, output) -> None:
            output.SetAtIndex(0, float(self._state(cup, context)[0] >= 0.0))

        def pressure(context: Context, output) -> None:
            output.SetAtIndex(0, self._state(cup, context)[1])

        self.DeclareVectorOutputPort(f"{model}.sealed", 1, sealed, depends)
        self.DeclareVectorOutputPort(f"{model}.pressure", 1, pressure, depends)

    def _state(self, cup: _Cup, context: Context) -> np.ndarray:
        return context.get_discrete_state(cup.state).value()

    def _lip(self, cup: _Cup, context: Context) -> RigidTransform:
        """X_WL."""
        X_WB = self._poses.Eval(context)[int(cup.frame.body().index())]
        return X_WB @ cup.frame.GetFixedPoseInBodyFrame()

    def _update(self, cup: _Cup, context: Context, values: DiscreteValues) -> None:
        port = self.get_input_port(cup.vacuum)
        drawn = port.HasValue(context) and port.Eval(context)[0] > 0.5
        pressure = self._state(cup, context)[1]
        # What is left of a vacuum holds on while the cup is vented.
        draws = drawn or pressure > _VENTED * cup.config.vacuum
        body = self._look(cup, context) if draws else None
        aim = cup.config.vacuum if drawn and body is not None else 0.0
        pressure = next_pressure(pressure, aim, cup.config.period, cup.config.response)
        values.set_value(cup.state, [-1.0 if body is None else float(body), pressure])

    def _look(self, cup: _Cup, context: Context) -> int | None:
        """The body that closes the cup."""
        X_WL, query = self._lip(cup, context), self._query.Eval(context)
        inspector, own = query.inspector(), cup.frame.model_instance()
        angles = 2.0 * np.pi * np.arange(_RIM_POINTS) / _RIM_POINTS
        gaps = []
        for angle in angles:
            p_L = cup.config.radius * np.array([np.cos(angle), np.sin(angle), 0.0])
            gap: dict[int, float] = {}
            for hit in query.ComputeSignedDistanceToPoint(X_WL @ p_L, cup.config.reach):
                body = self._plant.GetBodyFromFrameId(inspector.GetFrameId(hit.id_G))
                if body.model_instance() != own:
                    index = int(body.index())
                    gap[index] = min(hit.distance, gap.get(index, np.inf))
            if not gap:
                return None
            gaps.append(gap)
        return sealing_body(gaps, cup.config.reach)

    def _forces(self, context: Context, output: AbstractValue) -> None:
        forces = list(self._others.Eval(context)) if self._others.HasValue(context) else []
        for cup in self._cups:
            body, pressure = self._state(cup, context)
            if body < 0.0:
                continue
            X_WL = self._lip(cup, context)
            pull = holding_force(pressure, cup.config.radius) * X_WL.rotation().col(2)
            holder = cup.frame.body().index()
            for index, f_W in ((BodyIndex(int(body)), -pull), (holder, pull)):
                X_WB = self._poses.Eval(context)[int(index)]
                force = ExternallyAppliedSpatialForce()
                force.body_index = index
                force.p_BoBq_B = X_WB.inverse() @ X_WL.translation()
                force.F_Bq_W = SpatialForce(tau=np.zeros(3), f=f_W)
                forces.append(force)
        output.set_value(forces)


def _suction(site: Site) -> SuctionSystem:
    """The station's one system for cups, made for the first driver that needs it."""
    builder, plant = site.builder, site.plant
    if builder.HasSubsystemNamed("suction"):
        system = builder.GetSubsystemByName("suction")
        assert isinstance(system, SuctionSystem)
        return system
    system = builder.AddNamedSystem("suction", SuctionSystem(plant))
    scene_graph = builder.GetSubsystemByName("scene_graph")
    builder.Connect(scene_graph.get_query_output_port(), system.GetInputPort("query_object"))
    builder.Connect(plant.get_body_poses_output_port(), system.GetInputPort("body_poses"))
    builder.Connect(
        system.GetOutputPort("spatial_forces"), plant.get_applied_spatial_force_input_port()
    )
    builder.ExportInput(system.GetInputPort("applied_spatial_force"), "cheat.applied_spatial_force")
    return system


def _simulate(site: Site) -> None:
    config, plant, instance = site.config, site.plant, site.instance
    if not plant.HasFrameNamed(config.frame, instance):
        site.fail(f"the model has no frame '{config.frame}'", "name the lip's frame", "frame")
    system = _suction(site)
    system.add(site.name, plant.GetFrameByName(config.frame, instance), config)
    site.export_input(system.GetInputPort(f"{site.name}.vacuum"), "vacuum")
    for name in ("sealed", "pressure"):
        site.export_output(system.GetOutputPort(f"{site.name}.{name}"), name)


DRIVER = Driver(SuctionDriver, _simulate)
