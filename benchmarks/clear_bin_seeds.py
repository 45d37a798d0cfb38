"""How much of the clutter is cleared: ten seeds with ten objects each, as a table.

    python benchmarks/clear_bin_seeds.py [--seeds 10] [--first 0] [--objects 10] [--jobs 1]

Each seed is one `prehensile demo clear-bin --no-browser` in a process of its own, so the times
include the camera pictures and the recording. The reports and replays stay in the folder that is
named at the end.
"""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

COLUMNS = ("seed", "cleared", "moved/tried", "sim s", "s/pick", "wall/sim", "cpu/sim", "ended")


def main() -> int:
    """Runs the seeds and prints a line each, then the totals."""
    parser = argparse.ArgumentParser(description="Ten seeds with ten objects each, as a table.")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--objects", type=int, default=10)
    parser.add_argument("--jobs", type=int, default=1, help="seeds at the same time")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    out = args.out or Path(tempfile.mkdtemp(prefix="clear-bin-"))

    def clear(seed: int) -> dict | None:
        folder = out / f"seed{seed:02d}"
        command = [sys.executable, "-m", "prehensile", "demo", "clear-bin", "--no-browser"]
        command += ["--objects", str(args.objects), "--seed", str(seed), "--out", str(folder)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 1) or not (folder / "report.json").exists():
            print(f"seed {seed} crashed with status {done.returncode}:\n{done.stderr[-2000:]}")
            return None
        return json.loads((folder / "report.json").read_text())

    print("{:>4} {:>8} {:>11} {:>7} {:>7} {:>8} {:>8}  {}".format(*COLUMNS))
    reports = []
    with ThreadPoolExecutor(args.jobs) as pool:
        for report in pool.map(clear, range(args.first, args.first + args.seeds)):
            if report is not None:
                reports.append(report)
                print(_line(report), flush=True)
    if reports:
        total = [report["summary"] for report in reports]
        cleared, objects = (sum(s[key] for s in total) for key in ("cleared", "objects"))
        moved, tried = (sum(s[key] for s in total) for key in ("successes", "grasp_attempts"))
        wall = statistics.median(s["wall_time"] / s["sim_time"] for s in total)
        print(
            f"all: {cleared} of {objects} objects cleared ({cleared / objects:.0%}), "
            f"{moved} of {tried} grasps moved something ({moved / max(tried, 1):.0%}), "
            f"median {wall:.2f} wall seconds per simulated second"
        )
    print(f"reports: {out}")
    return 0 if len(reports) == args.seeds else 1


def _line(report: dict) -> str:
    s = report["summary"]
    return (
        f"{report['seed']:>4} {s['cleared']:>5}/{s['objects']:<2} "
        f"{s['successes']:>6}/{s['grasp_attempts']:<4} {s['sim_time']:>7.1f} "
        f"{s['seconds_per_pick'] or 0:>7.2f} {s['wall_time'] / s['sim_time']:>8.2f} "
        f"{s['cpu_time'] / s['sim_time']:>8.2f}  {report['finished']}"
    )


if __name__ == "__main__":
    sys.exit(main())
