"""``prehensile bench`` and the framework under it."""

import argparse
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

import prehensile
from prehensile.cli import bench
from prehensile.errors import InputError

ROOT = Path(__file__).parents[1]

PROBE = """
from benchmarks.framework import Contender, Samples, time_calls

TITLE = "A probe"

def prepare(folder):
    (folder / "input.txt").write_text("3")

def ours(folder):
    number = int((folder / "input.txt").read_text())
    return {"time": Samples([1.0, 5.0, number], "s"), "rate": Samples([30.0], "Hz", True)}

def peer(folder):
    return {"time": Samples([6.0], "s"), "rate": Samples([10.0], "Hz", True)}

def broken(folder):
    raise RuntimeError("no such thing")

CONTENDERS = (
    Contender("ours", ours),
    Contender("peer", peer),
    Contender("broken", broken),
    Contender("absent", peer, requirements=("nowhere",)),
)
"""


@pytest.fixture
def framework(monkeypatch, tmp_path):
    """A copy of the benchmarks' framework in an otherwise empty clone with one benchmark."""
    folder = tmp_path / "benchmarks"
    folder.mkdir()
    for name in ("__init__.py", "framework.py"):
        (folder / name).write_text((ROOT / "benchmarks" / name).read_text())
    (folder / "probe.py").write_text(PROBE)
    for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield importlib.import_module("benchmarks.framework")
    for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
        del sys.modules[name]


def test_contenders_run_and_are_compared(framework, monkeypatch):
    call = framework._call

    def call_without_registry(*command):
        if "venv" in command:
            raise subprocess.CalledProcessError(1, command, stderr="no registry")
        call(*command)

    monkeypatch.setattr(framework, "_call", call_without_registry)
    said = []
    assert framework.names() == ["probe"]
    results = framework.run("probe", 2, said.append)
    assert set(results) == {"ours", "peer"}
    assert any(line.startswith("broken failed, going on: RuntimeError") for line in said)
    assert "absent cannot be installed here, going on: no registry" in said

    module = importlib.import_module("benchmarks.probe")
    rows = {(row.case, row.contender): row for row in framework.summarize(module, results)}
    assert rows["time", "ours"].median == 3.0
    assert rows["time", "ours"].ratio is None
    # We take half the time, and reach three times the rate.
    assert rows["time", "peer"].ratio == pytest.approx(2)
    assert rows["rate", "peer"].ratio == pytest.approx(3)


def test_time_calls_times(framework):
    calls = []
    seconds = framework.time_calls(lambda: calls.append(1), repeats=4)
    assert len(seconds) == 4
    assert len(calls) == 5
    assert all(s >= 0 for s in seconds)


def test_an_installed_package_says_that_it_has_none(monkeypatch, tmp_path):
    monkeypatch.setattr(prehensile, "__file__", str(tmp_path / "a" / "b" / "c" / "__init__.py"))
    with pytest.raises(InputError, match="not part of the installed package.*clone"):
        bench.run(argparse.Namespace(name=None, rounds=1))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [(["frobnicate"], "no benchmark 'frobnicate'"), (["voxel", "--rounds", "0"], "--rounds")],
)
def test_bad_arguments(arguments, text):
    done = subprocess.run(
        [sys.executable, "-m", "prehensile", "bench", *arguments], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert text in done.stderr
    assert "Traceback" not in done.stderr
