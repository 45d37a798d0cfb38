"""What a step of differential inverse kinematics answers."""

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from prehensile.native.differential_ik import IkStep

_AT_LIMIT = 1e-9  # rad/s or m/s


class DifferentialIkStatus(enum.IntEnum):
    """How a step came out, from best to worst; every one of them keeps the joints' limits."""

    OPTIMAL = 0
    """The optimum of the formulation."""
    RECOVERING = 1
    """The optimum too, but a joint started beyond its limits or too fast to stop within them; it
    comes back as fast as its limits of acceleration and velocity permit."""
    RELAXED = 2
    """The linear constraints contradict the joints' limits or each other; their greatest violation
    is as small as possible."""
    BRAKING = 3
    """There is no solution, for instance none in the desired direction: the joints slow down."""
    INVALID = 4
    """An input was missing or not finite: the joints slow down. Only Systems say so; functions
    raise ValueError."""


@dataclass(frozen=True)
class DifferentialIkResult:
    """The next joint velocities, and how they came about.

    Attributes:
        v: (n,) joint velocities (rad/s or m/s).
        status: how it came out.
        alpha: the part of V achieved where the formulation keeps its direction; 1 otherwise.
        residual: (k,) J v − V, for all rows given.
        at_limit: (n,) −1 where a joint moves at the least velocity that its limits and state
            allow, 1 at the greatest, else 0.
        violation: greatest violation of a linear constraint; 0 if there is none.
    """

    v: NDArray[np.float64]
    status: DifferentialIkStatus
    alpha: float
    residual: NDArray[np.float64]
    at_limit: NDArray[np.int8]
    violation: float

    @property
    def succeeded(self) -> bool:
        """Whether v is the optimum of what was asked for."""
        return self.status <= DifferentialIkStatus.RECOVERING


def result_of(step: IkStep, J: NDArray[np.float64], V: NDArray[np.float64]) -> DifferentialIkResult:
    """The result of a compiled step with task rows J v ≈ V."""
    v = step.v
    at_limit = (v >= step.upper - _AT_LIMIT).astype(np.int8)
    at_limit -= v <= step.lower + _AT_LIMIT
    return DifferentialIkResult(
        v, DifferentialIkStatus(step.status), step.alpha, J @ v - V, at_limit, step.violation
    )
