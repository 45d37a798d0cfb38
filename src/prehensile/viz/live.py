"""Running a simulation in front of somebody: pace, clock, stop button."""

import math
import time
from dataclasses import dataclass
from typing import Literal

from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator

from prehensile.viz.progress import Report

STOP_BUTTON = "Stop"
STOP_KEY = "Escape"
CLOCK = "time (s)"
# Simulated seconds between two looks at the stop button and the clock.
_TICK = 0.125


@dataclass(frozen=True)
class LiveResult:
    """How a run went.

    Attributes:
        status: "finished" (the time was up) or "stopped" (by the button).
        simulated: simulated seconds.
        wall: wall-clock seconds.
    """

    status: Literal["finished", "stopped"]
    simulated: float
    wall: float

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per wall second; infinite if no time passed."""
        return self.simulated / self.wall if self.wall > 0 else math.inf


def run_live(
    simulator: Simulator, duration: float, meshcat: Meshcat, report: Report | None = None
) -> LiveResult:
    """Simulates until the time is up or somebody presses the stop button in the page.

    The page shows the simulated time; its own chart shows the real-time rate. The pace is the
    simulator's target real-time rate.

    Args:
        simulator: an initialized simulator.
        duration: simulated seconds from now on (> 0, may be infinite).
        meshcat: the browser view.
        report: called several times a second with the simulated seconds so far and a line with
            time and real-time factor.

    Returns:
        How it went.

    Raises:
        KeyboardInterrupt: Ctrl-C; the button and the clock are gone from the page then too.
    """
    context = simulator.get_context()
    begin = context.get_time()
    meshcat.AddButton(STOP_BUTTON, STOP_KEY)
    endless = math.isinf(duration)
    meshcat.AddSlider(CLOCK, 0.0, 3600.0 if endless else duration, 0.01, 0.0)
    wall_begin = time.monotonic()
    # Real-time factor over the last second or so.
    mark_wall, mark_time, factor = wall_begin, begin, math.nan
    status: Literal["finished", "stopped"] = "finished"
    try:
        simulated = 0.0
        while simulated < duration:
            if meshcat.GetButtonClicks(STOP_BUTTON) > 0:
                status = "stopped"
                break
            simulator.AdvanceTo(begin + min(simulated + _TICK, duration))
            now = context.get_time()
            simulated = now - begin
            wall = time.monotonic()
            if wall - mark_wall >= 1.0 or math.isnan(factor):
                factor = (now - mark_time) / max(wall - mark_wall, 1e-9)
                mark_wall, mark_time = wall, now
            meshcat.SetSliderValue(CLOCK, simulated)
            if report is not None:
                of = "" if endless else f" of {duration:g}"
                report(simulated, f"{simulated:.1f}{of} s, {factor:.2f} x real time")
    finally:
        meshcat.DeleteButton(STOP_BUTTON)
        meshcat.DeleteSlider(CLOCK)
    return LiveResult(status, context.get_time() - begin, time.monotonic() - wall_begin)
