"""Kinematics as Drake Systems."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from prehensile.kinematics.differential_ik import (
    DifferentialIkConfig,
    DifferentialIkStatus,
    FrameTask,
    JointLimits,
    LinearConstraints,
    compile_frame_ik,
    compile_ik,
)
from prehensile.kinematics.tree import PlantTree

Array = NDArray[np.float64]


class DifferentialInverseKinematics(LeafSystem):
    """Differential inverse kinematics of any formulation, once in every period.

    Input ports, F the name of a task's frame::

        F.pose (RigidTransform)   desired pose X_WF; may stay unconnected
        F.velocity (6)            desired spatial velocity V_WF in W, added to what the pose asks
                                  for; may stay unconnected
        estimated_state (2 n)     where the joints are: positions, then velocities

    Output ports, all of them state (nothing is computed when they are read)::

        position (n)              commanded positions
        velocity (n)              commanded velocities, that led there within the last period
        status (1)                a DifferentialIkStatus
        alpha (1)                 part of the desired velocity achieved ("direction")

    As an integrator, it reads the estimated state at the start alone and goes on from its own
    commands, which therefore keep the limits of position, velocity and acceleration whatever comes
    in. Otherwise the positions are those estimated in every period and the velocities those last
    commanded: positions are then commanded h v ahead of where the joints are.

    While a frame's input is missing or not finite, the joints slow down and hold, with the status
    INVALID.
    """

    def __init__(
        self,
        tree: PlantTree,
        tasks: Sequence[FrameTask],
        config: DifferentialIkConfig,
        *,
        limits: JointLimits | None = None,
        integrator: bool = True,
        constraints: Callable[[Array], LinearConstraints | None] | None = None,
        default_position: ArrayLike | None = None,
        names: Sequence[str] | None = None,
    ) -> None:
        """Builds the system.

        Args:
            tree: joints and frames.
            tasks: frames that are to go somewhere.
            config: what is wanted; its period is that of the updates.
            limits: of the joints; default: those of the plant.
            integrator: whether to go on from its own commands.
            constraints: further ones on the velocities, from the positions (n,).
            default_position: (n,) put out before the start; zeros by default.
            names: of the frames, first parts of the ports' names; default: those in the tree.
        """
        super().__init__()
        limits = JointLimits.of_tree(tree) if limits is None else limits
        self._n = n = len(limits.velocity)
        self._period = config.period
        self._integrator = integrator
        self._constraints = constraints
        self._tree = tree.tree
        self._tasks = tuple(tasks)
        self._frame_ik = compile_frame_ik(config, limits, tree, tasks)
        self._joint_ik = compile_ik(config, limits)
        if names is None:
            names = [tree.frames[task.frame] for task in tasks]
        identity = Value(RigidTransform())
        self._inputs = [
            (
                int(self.DeclareAbstractInputPort(f"{name}.pose", identity).get_index()),
                int(self.DeclareVectorInputPort(f"{name}.velocity", 6).get_index()),
            )
            for name in names
        ]
        self._estimated = int(self.DeclareVectorInputPort("estimated_state", 2 * n).get_index())
        start = np.zeros(n) if default_position is None else np.array(default_position, float)
        self._q = self._declare("position", start)
        self._v = self._declare("velocity", np.zeros(n))
        self._status = self._declare("status", np.array([float(DifferentialIkStatus.OPTIMAL)]))
        self._alpha = self._declare("alpha", np.ones(1))
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(config.period, 0.0, self._update)

    def _declare(self, port: str, start: Array) -> int:
        """Declares a discrete state with an output port; returns the state's index."""
        state = self.DeclareDiscreteState(start)
        self.DeclareStateOutputPort(port, state)
        return int(state)

    def _initialize(self, context: Context, values: DiscreteValues) -> None:
        state = self._estimated_state(context)
        if state is not None:
            values.set_value(self._q, state[: self._n])
            values.set_value(self._v, state[self._n :])

    def _estimated_state(self, context: Context) -> Array | None:
        """(2 n,), or None if there is none that is finite."""
        port = self.EvalVectorInput(context, self._estimated)
        if port is None:
            return None
        state = port.value()
        return state if np.isfinite(state).all() else None

    def _update(self, context: Context, values: DiscreteValues) -> None:
        q = context.get_discrete_state(self._q).value()
        v = context.get_discrete_state(self._v).value()
        valid = True
        if not self._integrator:
            state = self._estimated_state(context)
            valid = state is not None
            if state is not None:
                q = state[: self._n]
        desired = self._desired(context, q) if valid else None
        if desired is None:
            lower, upper, _ = self._joint_ik.velocity_interval(q, v)
            v_next = np.clip(0.0, lower, upper)
            status, alpha = DifferentialIkStatus.INVALID, 0.0
        else:
            rows = () if self._constraints is None else _rows(self._constraints(q))
            step = self._frame_ik.step(q, v, *desired, *rows)
            v_next, status, alpha = step.v, step.status, step.alpha
        values.set_value(self._q, q + self._period * v_next)
        values.set_value(self._v, v_next)
        values.set_value(self._status, [float(status)])
        values.set_value(self._alpha, [alpha])

    def _desired(self, context: Context, q: Array) -> tuple[Array, Array | None] | None:
        """Poses (m, 4, 4) and velocities (m, 6) wanted, or None if some frame has neither."""
        X_WD = np.empty((len(self._tasks), 4, 4))
        V_WD = None
        for i, (task, (pose, velocity)) in enumerate(zip(self._tasks, self._inputs, strict=True)):
            X = self.EvalAbstractInput(context, pose)
            V = self.EvalVectorInput(context, velocity)
            if V is not None:
                if V_WD is None:
                    V_WD = np.zeros((len(self._tasks), 6))
                V_WD[i] = V.value()
            if X is not None:
                X_WD[i] = X.get_value().GetAsMatrix4()
            elif V is not None:
                X_WD[i] = self._tree.pose(q, task.frame)
            else:
                return None
        if not np.isfinite(X_WD).all() or (V_WD is not None and not np.isfinite(V_WD).all()):
            return None
        return X_WD, V_WD


def _rows(constraints: LinearConstraints | None) -> tuple[Array, ...]:
    if constraints is None:
        return ()
    return constraints.A, constraints.lower, constraints.upper
