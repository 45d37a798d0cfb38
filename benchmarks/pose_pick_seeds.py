"""How often the bottle is found and set upright: fifty seeds, as a table.

    python benchmarks/pose_pick_seeds.py [--seeds 50] [--first 0] [--out FILE]

Each seed is one run of the task of `prehensile demo pose-pick`, without browser and recording. A
pose is right if the first one acted upon has an ADD-S under 5 mm; the bottle is placed if it ends
within 2 cm of its goal, upright within 5 degrees, at rest and let go: all by the simulator's truth.
"""

import argparse
import math
import statistics
import sys
from pathlib import Path

from prehensile.files import write_json
from prehensile.tasks.pose_pick_object import PreparedObject, prepare_object
from prehensile.tasks.pose_pick_report import PosePickReport
from prehensile.tasks.pose_pick_run import PosePickRun

TIME_LIMIT = 180.0  # simulated seconds
HEAD = ("seed", "start", "pose", "ADD-S mm", "placed", "off mm", "tilt", "tries", "sim s", "ended")


def main() -> int:
    """Runs the seeds and prints a line each, then the totals."""
    parser = argparse.ArgumentParser(description="Fifty seeds of pose-pick, as a table.")
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, help="all reports, as JSON")
    args = parser.parse_args()
    row = "{:>4} {:8} {:>5} {:>8} {:>6} {:>7} {:>5} {:>5} {:>6}  {}"
    print(row.format(*HEAD))
    reports = []
    thing = prepare_object()
    for seed in range(args.first, args.first + args.seeds):
        report = run_seed(seed, thing)
        reports.append(report)
        print(
            row.format(
                seed,
                report.start,
                "right" if report.pose_right else "WRONG",
                f"{1e3 * first_error(report):.2f}",
                "yes" if report.placed else "NO",
                f"{1e3 * report.distance:.1f}",
                f"{math.degrees(report.tilt):.1f}",
                report.attempts,
                f"{report.sim_time:.1f}",
                "; ".join((report.finished, *report.failures)),
            ),
            flush=True,
        )
    right, placed = sum(r.pose_right for r in reports), sum(r.placed for r in reports)
    errors = [e for r in reports if math.isfinite(e := first_error(r))]
    sight = [look.see_wall for r in reports for look in r.looks if look.what != "check"]
    print(
        f"all: {right} of {len(reports)} poses right, {placed} placed; medians: ADD-S "
        f"{1e3 * statistics.median(errors):.2f} mm, {1e3 * statistics.median(sight):.0f} ms from "
        f"images to pose, {statistics.median(r.sim_time for r in reports):.1f} simulated s a run"
    )
    if args.out:
        write_json(args.out, {"runs": [report.to_json() for report in reports]})
    return 0


def run_seed(seed: int, thing: PreparedObject) -> PosePickReport:
    """One run, and a while longer to see whether the bottle rests."""
    run = PosePickRun(seed=seed, thing=thing)
    while run.advance() and run.time < TIME_LIMIT:
        pass
    for _ in range(3):
        run.advance()
    return run.report()


def first_error(report: PosePickReport) -> float:
    """ADD-S of the first pose acted upon [m]; NaN if there was none."""
    return next((k.adds for k in report.looks if not k.reason and k.what != "check"), math.nan)


if __name__ == "__main__":
    sys.exit(main())
