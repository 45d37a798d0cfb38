"""``prehensile demo pose-pick`` at the command line."""

import json

import pytest

from prehensile.cli.main import main


def test_senseless_numbers_are_refused(capsys):
    assert main(["demo", "pose-pick", "--trials", "0", "--no-browser"]) == 2
    assert "--trials" in capsys.readouterr().err
    assert main(["demo", "pose-pick", "--seed", "-1", "--no-browser"]) == 2
    assert "--seed" in capsys.readouterr().err


@pytest.mark.slow
def test_a_run_leaves_report_picture_and_replay(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["demo", "pose-pick", "--seed", "3", "--no-browser", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    for phase in ("look", "pick", "lift", "carry", "lower", "release", "placed", "ADD-S"):
        assert phase in said
    report = json.loads((out / "report.json").read_text())
    assert report["placed"] is True
    assert report["pose_right"] is True
    assert (out / "look.png").stat().st_size > 10_000
    assert (out / "replay.html").stat().st_size > 100_000
