"""Runs contenders of a benchmark as separate processes; see the package's docstring.

Imports only the standard library at the top: it also runs in the environments of the peers.
"""

import importlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Samples:
    """Repeated measurements of one case.

    Attributes:
        values: the measurements.
        unit: "s" for seconds (printed as milliseconds), else any word.
        more_is_better: whether a larger value is the better one, as for a rate.
    """

    values: Sequence[float]
    unit: str
    more_is_better: bool = False


Results = Mapping[str, Samples]


@dataclass(frozen=True)
class Contender:
    """One of those that are compared.

    Attributes:
        name: as it is printed.
        run: reads the input from the folder, returns samples for each case by name.
        requirements: what to install from the package registry, in an environment of its own; none
            if it runs with the project's Python.
    """

    name: str
    run: Callable[[Path], Results]
    requirements: tuple[str, ...] = ()


def time_calls(call: Callable[[], object], repeats: int = 15) -> list[float]:
    """Seconds of wall time of each of so many calls, after one that is not counted."""
    call()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return seconds


def names() -> list[str]:
    """Names of the benchmarks there are: the modules with contenders."""
    modules = sorted(Path(__file__).parent.glob("*.py"))
    return [path.stem for path in modules if "\nCONTENDERS = " in path.read_text()]


def run(name: str, rounds: int, say: Callable[[str], None]) -> dict[str, list[Results]]:
    """Runs one benchmark.

    Args:
        name: one of names().
        rounds: how often each contender runs, in turns.
        say: is told what goes on, line by line.

    Returns:
        For each contender that ran, by name, the results of its rounds.
    """
    module = importlib.import_module(f"benchmarks.{name}")
    pythons = {}
    for contender in module.CONTENDERS:
        try:
            pythons[contender.name] = _python_for(contender, say)
        except subprocess.CalledProcessError as error:
            say(f"{contender.name} cannot be installed here, going on: {_last_line(error.stderr)}")
    results: dict[str, list[Results]] = {}
    with tempfile.TemporaryDirectory(prefix="prehensile-bench-") as text:
        folder = Path(text)
        module.prepare(folder)
        for number in range(1, rounds + 1):
            for contender_name, python in list(pythons.items()):
                say(f"round {number} of {rounds}: {contender_name}")
                try:
                    got = _run_in_process(python, name, contender_name, folder)
                except subprocess.CalledProcessError as error:
                    say(f"{contender_name} failed, going on: {_last_line(error.stderr)}")
                    del pythons[contender_name]
                    continue
                results.setdefault(contender_name, []).append(got)
    return results


@dataclass(frozen=True)
class Row:
    """One line of the table: a contender in one case.

    Attributes:
        median, low, high: of the rounds' medians.
        ratio: how many times as good as it we are, median over the rounds; None for ourselves.
    """

    case: str
    contender: str
    unit: str
    median: float
    low: float
    high: float
    ratio: float | None


def summarize(module: ModuleType, results: dict[str, list[Results]]) -> list[Row]:
    """Reduces what run() returned to one row for each case and contender."""
    ours = module.CONTENDERS[0].name
    cases = dict.fromkeys(case for rounds in results.values() for one in rounds for case in one)
    rows = []
    for case in cases:
        for contender, rounds in results.items():
            if not all(case in one for one in rounds):
                continue
            medians = [statistics.median(one[case].values) for one in rounds]
            first = rounds[0][case]
            ratio = None
            if contender != ours and all(case in one for one in results.get(ours, ())):
                pairs = zip(medians, results.get(ours, ()), strict=False)
                ratios = [theirs / statistics.median(mine[case].values) for theirs, mine in pairs]
                if ratios:
                    middle = statistics.median(ratios)
                    if first.more_is_better:
                        middle = 1 / middle if middle else float("inf")
                    ratio = middle
            middle = statistics.median(medians)
            rows.append(Row(case, contender, first.unit, middle, min(medians), max(medians), ratio))
    return rows


def _python_for(contender: Contender, say: Callable[[str], None]) -> str:
    """Path of the Python that runs a contender; makes its environment if there is none."""
    if not contender.requirements:
        return sys.executable
    peers = ROOT / "build" / "peers"
    wanted = "\n".join(contender.requirements)
    for stamp in sorted(peers.glob("*/requirements.txt")):
        if stamp.read_text() == wanted:  # Another contender's may have the same.
            return str(stamp.parent / "bin" / "python")
    folder = peers / contender.name.lower().replace(" ", "-")
    python = folder / "bin" / "python"
    stamp = folder / "requirements.txt"
    say(f"installing {contender.name} into {folder.relative_to(ROOT)}")
    base = Path(sys.base_prefix) / "bin" / "python3"
    _call(base, "-m", "venv", "--clear", folder)
    pip = (python, "-m", "pip", "install", "--disable-pip-version-check", "--quiet")
    _call(*pip, *contender.requirements)
    stamp.write_text(wanted)
    return str(python)


def _run_in_process(python: str, name: str, contender: str, folder: Path) -> Results:
    output = folder / "results.json"
    output.unlink(missing_ok=True)
    _call(python, "-m", "benchmarks.framework", name, contender, folder, output)
    return {case: Samples(**samples) for case, samples in json.loads(output.read_text()).items()}


def _call(*command: str | Path) -> None:
    """Runs a command in the clone's root; its text is kept for the error's message."""
    environment = {**os.environ, "PYTHONPATH": ""}
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True)


def _last_line(text: str) -> str:
    lines = text.strip().splitlines()
    return lines[-1] if lines else "no message"


def _main(name: str, contender_name: str, folder: str, output: str) -> None:
    """The process of one contender."""
    module = importlib.import_module(f"benchmarks.{name}")
    contender = next(c for c in module.CONTENDERS if c.name == contender_name)
    results = contender.run(Path(folder))
    Path(output).write_text(
        json.dumps({case: asdict(samples) for case, samples in results.items()})
    )


if __name__ == "__main__":
    _main(*sys.argv[1:])
