"""``prehensile demo clear-bin``: shows the run, and keeps its report, pictures and replay."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table

from prehensile.files import write_json
from prehensile.tasks.clear_bin_run import ClearBinRun, choose_models
from prehensile.tasks.report import Attempt, ClearBinReport
from prehensile.viz.images import draw_grasp, save_png, side_by_side
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.replay import Recorder, check_writable

_TIME_LIMIT = 600.0  # simulated seconds after which any run ends


def run_demo(*, objects: int, seed: int, browser: bool, out: Path) -> ClearBinReport:
    """Clears a bin in simulation and writes what came of it.

    Args:
        objects: number of household objects.
        seed: of the scene and of every choice.
        browser: open the live view in the user's browser.
        out: folder for `report.json`, `replay.html` and a picture per grasp.

    Returns:
        The report; a partial one if the user pressed Ctrl-C.

    Raises:
        InputError: if the folder cannot be written, or the objects do not stay in the bin.
    """
    out.mkdir(parents=True, exist_ok=True)
    check_writable(out / "replay.html")
    for old in out.glob("grasp_*.png"):
        old.unlink()
    console = Console()
    models = choose_models(objects, seed)
    meshcat = start_meshcat(open_browser=browser)
    console.print(f"watching at [link]{meshcat.web_url()}[/link]")
    with _progress(console) as progress:
        bar = progress.add_task(f"dropping {objects} objects", total=1.0)
        run = ClearBinRun(
            models,
            seed=seed,
            meshcat=meshcat,
            progress=lambda fraction: progress.update(bar, completed=fraction),
        )
        progress.remove_task(bar)
        recorder = Recorder(meshcat)
        recorder.start()
        with _interruptible() as interrupted:
            bar = progress.add_task("clearing", total=objects)
            _clear(run, out, progress, bar, interrupted)
        report = run.report(interrupted=interrupted.is_set())
    write_json(out / "report.json", report.to_json())
    with console.status("packing the replay"):
        recorder.save(out / "replay.html")
    _print(console, report)
    console.print(f"report: {out / 'report.json'}\nreplay: {out / 'replay.html'}")
    return report


def _clear(
    run: ClearBinRun, out: Path, progress: Progress, bar: TaskID, stop: threading.Event
) -> None:
    """Runs the task to its end, the time limit or Ctrl-C; a picture at each new grasp."""
    pictured = 0
    while run.advance() and run.time < _TIME_LIMIT and not stop.is_set():
        pick = run.memory.pick
        if pick is not None and pick.attempt.number > pictured:
            pictured = pick.attempt.number
            _picture(run, pick.attempt, out / f"grasp_{pictured:02d}.png")
        moved = sum(a.outcome == "moved" for a in run.memory.attempts)
        progress.update(
            bar,
            completed=moved,
            description=f"{run.state:8} {run.time:6.1f} s, {run.realtime_factor:4.2f} x real time",
        )


def _picture(run: ClearBinRun, attempt: Attempt, path: Path) -> None:
    """What the cameras see, with the chosen grasp drawn in."""
    assert attempt.X_WG is not None
    context = run.station_context()
    pictures = [
        draw_grasp(
            run.station.GetOutputPort(f"{camera.name}.rgb_image").Eval(context).data,
            camera.model.K,
            run.station.GetOutputPort(f"{camera.name}.X_WC").Eval(context),
            attempt.X_WG,
            attempt.width,
            label=str(attempt.number),
        )
        for camera in run.cameras
    ]
    save_png(path, side_by_side(pictures))


def _print(console: Console, report: ClearBinReport) -> None:
    table = Table(title=f"clear-bin, seed {report.seed}", title_justify="left")
    for column in ("attempt", "outcome", "from", "s", "score", "thought", "reason"):
        table.add_column(column, justify="left" if column in ("outcome", "reason") else "right")
    for a in report.attempts:
        table.add_row(
            str(a.number),
            a.outcome,
            f"{a.start:.1f}",
            f"{a.end - a.start:.1f}",
            f"{a.score:.2f}",
            f"{a.think_wall:.2f} s",
            a.reason,
        )
    console.print(table)
    console.print(
        f"[bold]{report.cleared} of {len(report.objects)} objects cleared[/bold], "
        f"{report.successes} of {report.grasp_attempts} grasps moved something, "
        f"{report.seconds_per_pick:.1f} s per pick. Simulated {report.sim_time:.1f} s in "
        f"{report.wall_time:.1f} s: {report.realtime_factor:.2f} x real time. "
        f"Ended because {report.finished}."
    )


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=console
    )


@contextmanager
def _interruptible() -> Iterator[threading.Event]:
    """Turns the first Ctrl-C into an event, so that a step in progress is finished first."""
    event = threading.Event()

    def note(number: int, frame: object) -> None:
        event.set()
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield event
    finally:
        signal.signal(signal.SIGINT, before)
