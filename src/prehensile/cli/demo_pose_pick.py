"""``prehensile demo pose-pick``: shows the runs, and keeps their reports, pictures and replay."""

import math
from pathlib import Path

import numpy as np
from rich.console import Console

from prehensile.files import write_json
from prehensile.tasks.pose_pick_object import PreparedObject, prepare_object
from prehensile.tasks.pose_pick_report import PosePickReport
from prehensile.tasks.pose_pick_run import PosePickRun
from prehensile.viz.images import colorize_depth, draw_points, save_png, side_by_side
from prehensile.viz.meshcat import start_meshcat
from prehensile.viz.replay import Recorder, check_writable

_TIME_LIMIT = 180.0  # simulated seconds after which any run ends
_NEAR, _FAR = 0.5, 1.4  # m, ends of the depth pictures' colour scale
_MISSED = (230, 30, 30)


def run_demo(*, seed: int, trials: int, browser: bool, out: Path) -> list[PosePickReport]:
    """Runs the task and writes what came of it.

    Args:
        seed: of the first trial; the next has the next one.
        trials: how many.
        browser: open the live view in the user's browser.
        out: folder of `report.json`, `replay.html` and a picture of each first look; with several
            trials, each has a folder of its own in it, and the replay is the first one's.

    Returns:
        The reports, one for each trial, fewer if the user pressed Ctrl-C.

    Raises:
        InputError: if the folder cannot be written.
    """
    out.mkdir(parents=True, exist_ok=True)
    check_writable(out / "replay.html")
    console = Console()
    reports = []
    thing = prepare_object()
    for number in range(trials):
        folder = out if trials == 1 else out / f"seed{seed + number:03d}"
        folder.mkdir(exist_ok=True)
        shown = number == 0
        report = _trial(console, seed + number, thing, folder, out, shown=shown, browser=browser)
        reports.append(report)
        if report.interrupted:
            break
    if trials > 1:
        placed, right = sum(r.placed for r in reports), sum(r.pose_right for r in reports)
        console.print(f"[bold]{placed} of {len(reports)} placed[/bold], {right} poses right")
        summary = {"trials": len(reports), "placed": placed, "poses_right": right}
        write_json(out / "report.json", summary | {"runs": [r.to_json() for r in reports]})
    console.print(f"report: {out / 'report.json'}\nreplay: {out / 'replay.html'}")
    return reports


def _trial(
    console: Console,
    seed: int,
    thing: PreparedObject,
    folder: Path,
    out: Path,
    *,
    shown: bool,
    browser: bool,
) -> PosePickReport:
    """One run; the first one is shown and recorded."""
    recorder = meshcat = None
    if shown:
        meshcat = start_meshcat(open_browser=browser)
        console.print(f"watching at [link]{meshcat.web_url()}[/link]")
        recorder = Recorder(meshcat)
    run = PosePickRun(seed=seed, thing=thing, meshcat=meshcat)
    if recorder is not None:
        recorder.start()
    console.print(f"[bold]seed {seed}[/bold]: the bottle was let go {run.start.start}")
    interrupted = False
    said = 0
    try:
        going = True
        while going and run.time < _TIME_LIMIT:
            going = run.advance()
            history = run.phases
            for (begin, state), (end, _) in zip(history[said:], history[said + 1 :], strict=False):
                console.print(f"  {begin:6.2f} s  {state:8} {end - begin:5.2f} s")
                said += 1
            if run.time < 0.15:
                _picture(run, folder / "look.png")
    except KeyboardInterrupt:
        interrupted = True
    report = run.report(interrupted=interrupted)
    write_json(folder / "report.json", report.to_json())
    if recorder is not None:
        with console.status("packing the replay"):
            recorder.save(out / "replay.html")
    _print(console, report)
    return report


def _picture(run: PosePickRun, path: Path) -> None:
    """What the cameras see, missed returns in red, and the object where it was found."""
    context = run.station_context()
    rows = []
    for name, K in run.cameras.items():
        color = run.station.GetOutputPort(f"{name}.rgb_image").Eval(context).data
        depth = run.station.GetOutputPort(f"{name}.depth_image").Eval(context).data[:, :, 0]
        X_WC = run.station.GetOutputPort(f"{name}.X_WC").Eval(context)
        picture = colorize_depth(depth, _NEAR, _FAR)
        picture[depth == 0] = _MISSED
        points = run.found_points
        if points is not None:
            color = draw_points(color, K, X_WC, points[::7], radius=1)
        rows.append(side_by_side([color, picture]))
    save_png(path, np.concatenate(rows))


def _print(console: Console, report: PosePickReport) -> None:
    for look in report.looks:
        error = "no pose" if math.isnan(look.adds) else f"ADD-S {1e3 * look.adds:.1f} mm"
        console.print(
            f"  look at {look.time:.2f} s: {error}, {1e3 * look.see_wall:.0f} ms to see, "
            f"{look.plan_wall:.1f} s to plan; {look.what or look.reason}"
        )
    for failure in report.failures:
        console.print(f"  went wrong: {failure}")
    verdict = "[green]placed[/green]" if report.placed else "[red]not placed[/red]"
    console.print(
        f"  {verdict}: {1e3 * report.distance:.1f} mm from the goal, tilted by "
        f"{math.degrees(report.tilt):.1f} degrees, turned by {math.degrees(report.yaw):.1f} "
        f"degrees; simulated {report.sim_time:.1f} s in {report.wall_time:.1f} s. "
        f"Ended because {report.finished}."
    )
