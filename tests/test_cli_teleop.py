"""``prehensile teleop``: starts in every mode; in a browser the keys move the hand."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import browser
import pytest

from prehensile.cli.main import main


@pytest.mark.parametrize("mode", ["pose", "planar", "joints"])
def test_every_mode_starts_and_ends(mode: str, capfd: pytest.CaptureFixture[str]) -> None:
    arguments = ["--duration", "0.3", "--realtime-rate", "0", "--no-browser", "--mode", mode]
    assert main(["teleop", *arguments]) == 0
    assert "finished after 0.30 s" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["iiwa_wsg", "--arm", "nobody"], "no arm 'nobody'"),
        (["no_such_place"], "no_such_place"),
        (["--duration", "-1"], "a duration of -1 s"),
    ],
)
def test_clear_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["teleop", "--no-browser", *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(browser.CHROMIUM is None, reason="needs Chromium")
def test_keys_and_gamepad_of_the_page_move_the_sliders(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "prehensile", "teleop", "iiwa_wsg", "--no-browser"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if found := re.search(r"watch at (http://localhost:\d+)", line):
                break
        else:
            pytest.fail("".join(lines))
        value = "viewer.gui_controllers['{}'].getValue()".format
        with browser.Browser(found.group(1)) as page:
            page.wait_for("typeof viewer !== 'undefined' && 'Stop' in viewer.gui_controllers")
            labels = set(page.evaluate("Object.keys(viewer.gui_controllers)"))
            assert {"x (S, W)", "roll (J, L)", "opening (N, M)", "Stop", "time (s)"} <= labels
            x, yaw = value("x (S, W)"), value("yaw (U, O)")
            before = page.evaluate(x)
            for _ in range(4):
                page.press("KeyW", "w")
            assert page.evaluate(x) == pytest.approx(before + 0.02, abs=1e-6)
            before = page.evaluate(yaw)
            page.evaluate(_GAMEPAD)
            page.wait_for(f"{yaw} < {before} - 0.1")
            assert not page.errors
            page.screenshot(tmp_path / "teleop.png")
            page.press("Escape", "Escape")
            out, _ = process.communicate(timeout=60)
            assert "stopped after" in out
            assert process.returncode == 0
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()


# A pad whose right stick is held to the right.
_GAMEPAD = """(() => {
  const buttons = Array.from({length: 16}, () => ({value: 0}));
  const pad = {index: 0, connected: true, axes: [0, 0, 0.8, 0], buttons: buttons};
  navigator.getGamepads = () => [pad];
  return true;
})()"""
