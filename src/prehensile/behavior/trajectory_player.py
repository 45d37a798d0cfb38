"""Playing a planned sequence: the arm moves and waits, the hand opens and closes."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from prehensile.errors import InputError
from prehensile.planning.trajectory import TimedPath


@dataclass(frozen=True)
class Segment:
    """A motion of the arm, or a wait, with one opening of the hand.

    Attributes:
        width: commanded opening of the hand (m).
        duration: how long the segment lasts (s); a motion that ends sooner holds its end.
        q: where the arm waits (n,); None if it moves.
        motion: how the arm moves; None if it waits.
    """

    width: float
    duration: float
    q: np.ndarray | None = None
    motion: TimedPath | None = None

    @staticmethod
    def move(motion: TimedPath, width: float, settle: float = 0.0) -> "Segment":
        """The arm moves with the hand at a width, and waits for `settle` seconds at the end."""
        return Segment(width, motion.duration + settle, motion=motion)

    @staticmethod
    def wait(q: np.ndarray, width: float, duration: float) -> "Segment":
        """The arm waits while the hand goes to a width."""
        return Segment(width, duration, q=np.array(q, dtype=float))

    def position(self, t: float) -> np.ndarray:
        """Joint positions (n,) at a time after the segment's start."""
        if self.motion is not None:
            return self.motion.value(t)
        assert self.q is not None
        return self.q


class SegmentPlayer:
    """Segments one after the other, as a function of time.

    It has no state: the same time gives the same command, in any order of calls.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        """Makes the player.

        Raises:
            InputError: if there are no segments.
        """
        if not segments:
            raise InputError("a player needs at least one segment")
        self._segments = tuple(segments)
        self._ends = list(accumulate(segment.duration for segment in segments))

    @property
    def duration(self) -> float:
        """Length of the whole sequence (s)."""
        return self._ends[-1]

    def command(self, t: float) -> tuple[np.ndarray, float, bool]:
        """Command at a time after the start.

        Returns:
            Joint positions (n,), opening of the hand (m), and whether the sequence has ended; the
            last command is held for ever after.
        """
        for segment, end in zip(self._segments, self._ends, strict=True):
            if t < end:
                return segment.position(t - end + segment.duration), segment.width, False
        last = self._segments[-1]
        return last.position(last.duration), last.width, True
