"""What a clutter-clearing run reports: attempts, outcomes, times."""

import dataclasses as dc
import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
from pydrake.math import RigidTransform

import prehensile


@dc.dataclass(frozen=True)
class Attempt:
    """One look at the bin and what came of it.

    Attributes:
        number: 1, 2, ... in order.
        start: simulated time of the look, in seconds.
        end: simulated time at which its outcome was known.
        outcome: ``moved``, ``empty`` (the fingers met), ``dropped`` (lost on the way),
            ``no grasp``, ``no path`` or ``unfinished`` (the run ended first).
        reason: the outcome in words.
        X_WG: pose of the hand at the grasp; None if none was chosen.
        width: opening of the hand before closing, in m.
        score: score of the grasp chosen (higher is better).
        candidates: number of feasible grasps that were found.
        points: number of points seen in the bin.
        think_wall: wall seconds that perception, grasp selection and planning took.
    """

    number: int
    start: float
    end: float
    outcome: str
    reason: str
    X_WG: RigidTransform | None = None
    width: float = math.nan
    score: float = math.nan
    candidates: int = 0
    points: int = 0
    think_wall: float = 0.0


@dc.dataclass(frozen=True)
class ObjectResult:
    """Where an object of the scene ended: in which bin, or ``elsewhere``."""

    name: str
    model: str
    place: str


@dc.dataclass(frozen=True)
class ClearBinReport:
    """Result of a clutter-clearing run.

    Attributes:
        seed: seed of the scene and of every choice.
        finished: why the run ended, in words.
        interrupted: the user stopped it.
        attempts: every attempt in order.
        objects: where each object ended (known to the simulator alone).
        sim_time: simulated seconds, from the first look on.
        wall_time: wall seconds that these took.
        cpu_time: seconds of processor time that these took, on all cores.
    """

    seed: int
    finished: str
    interrupted: bool
    attempts: Sequence[Attempt]
    objects: Sequence[ObjectResult]
    sim_time: float
    wall_time: float
    cpu_time: float

    @property
    def grasp_attempts(self) -> int:
        """Number of attempts in which the hand closed."""
        return sum(a.X_WG is not None for a in self.attempts)

    @property
    def successes(self) -> int:
        """Number of attempts that carried something to the second bin."""
        return sum(a.outcome == "moved" for a in self.attempts)

    @property
    def cleared(self) -> int:
        """Number of objects that ended in the second bin."""
        return sum(o.place == "bin1" for o in self.objects)

    @property
    def seconds_per_pick(self) -> float:
        """Simulated seconds per attempt in which the hand closed (nan if none)."""
        return self.sim_time / self.grasp_attempts if self.grasp_attempts else math.nan

    @property
    def realtime_factor(self) -> float:
        """Simulated seconds per wall second."""
        return self.sim_time / self.wall_time if self.wall_time > 0 else math.nan

    def to_json(self) -> dict[str, Any]:
        """The report as plain JSON values, NaN as null."""
        return _plain(
            {
                "task": "clear-bin",
                "seed": self.seed,
                "finished": self.finished,
                "interrupted": self.interrupted,
                "summary": {
                    "objects": len(self.objects),
                    "cleared": self.cleared,
                    "attempts": len(self.attempts),
                    "grasp_attempts": self.grasp_attempts,
                    "successes": self.successes,
                    "seconds_per_pick": self.seconds_per_pick,
                    "sim_time": self.sim_time,
                    "wall_time": self.wall_time,
                    "cpu_time": self.cpu_time,
                    "realtime_factor": self.realtime_factor,
                },
                "attempts": [vars(a) for a in self.attempts],
                "objects": [vars(o) for o in self.objects],
                "versions": {
                    "prehensile": prehensile.__version__,
                    "drake": version("drake"),
                    "numpy": version("numpy"),
                    "python": platform.python_version(),
                },
            }
        )


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, RigidTransform):
        return _plain(value.GetAsMatrix4())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
