"""Progress on the terminal: a live line for people, one final line for logs."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

Report = Callable[[float, str], None]


@contextmanager
def progress(title: str, total: float | None = None) -> Iterator[Report]:
    """Shows the progress of a job on standard error.

    On a terminal a line is redrawn while the job runs. Elsewhere (a log, a pipe) nothing is
    written before the end. Either way one line says at the end what was done and how long it
    took, also when the job is interrupted.

        with progress("scoring grasps", total=500) as report:
            for i in range(500):
                ...
                report(i + 1, f"best so far {best:.2f}")

    Args:
        title: what is being done, as a participle: "dropping objects".
        total: the amount of work, in any unit; None if nobody knows.

    Yields:
        A function of the amount done so far and a note to show.
    """
    start = time.monotonic()
    note = ""
    console = Console(file=sys.stderr)
    bar = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        *([BarColumn(bar_width=24)] if total is not None else []),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    task = bar.add_task(title, total=total, note="")

    def report(completed: float, text: str = "") -> None:
        nonlocal note
        note = text
        bar.update(task, completed=completed, note=text)

    try:
        with bar:
            yield report
    finally:
        took = time.monotonic() - start
        print(": ".join(filter(None, (title, note))) + f" ({took:.1f} s)", file=sys.stderr)
