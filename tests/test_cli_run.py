"""``prehensile run``: what it prints, what it leaves, how it ends."""

import base64
import gzip
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from prehensile.cli.main import main


def test_runs_a_scenario_and_says_how_fast(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    replay = tmp_path / "replay.html"
    status = main(
        ["run", "pick_brick", "--duration", "0.5", "--realtime-rate", "0", "--no-browser",
         "--record", str(replay)]
    )  # fmt: skip
    assert status == 0
    out = capfd.readouterr().out
    assert re.search(r"watch at http://localhost:\d+", out)
    assert re.search(r"finished after 0\.50 s simulated in [\d.]+ s: [\d.]+ x real time", out)
    assert f"replay: {replay}" in out
    assert "foam_brick" in _unpacked(replay)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--duration", "0"], "a duration of 0 s"),
        (["--duration", "nan"], "a duration of nan s"),
        (["--realtime-rate", "-1"], "a pace of -1"),
        (["--realtime-rate", "inf"], "a pace of inf"),
        (["--port", "70000"], "70000 is not a TCP port"),
        (["--record", "/"], "is a folder"),
    ],
)
def test_bad_arguments_are_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "iiwa_wsg", "--no-browser", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_unknown_scenario_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "no_such_place", "--no-browser"]) == 2
    assert "no_such_place" in capsys.readouterr().err


@pytest.mark.slow
def test_ctrl_c_leaves_a_whole_replay(tmp_path: Path) -> None:
    replay = tmp_path / "replay.html"
    process = subprocess.Popen(
        [sys.executable, "-m", "prehensile", "run", "pick_brick", "--no-browser",
         "--record", str(replay)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # In a background job of a shell the interrupt is ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stdout is not None
    for line in process.stdout:
        if "watch at" in line:
            break
    time.sleep(3.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert f"replay: {replay}" in out
    html = _unpacked(replay)
    assert "set_animation" in "".join(
        base64.b64decode(m).decode("latin1") for m in re.findall(r"base64,([A-Za-z0-9+/=]+)", html)
    )
    assert html.rstrip().endswith("</html>")
    assert [p.name for p in tmp_path.iterdir()] == ["replay.html"]


def _unpacked(replay: Path) -> str:
    packed = re.search(r'const packed = "([A-Za-z0-9+/=]+)"', replay.read_text())
    assert packed is not None
    return gzip.decompress(base64.b64decode(packed.group(1))).decode()
