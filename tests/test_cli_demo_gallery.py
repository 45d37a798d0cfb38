"""``prehensile demo arms``, ``hands``, ``bimanual`` and ``iiwa-allegro`` at the command line."""

import json

import pytest

from prehensile.cli.demo import _CONTROLLERS
from prehensile.cli.main import main
from prehensile.control.joint_controller import CONTROLLER_KINDS
from prehensile.station.scenario_file import load_scenario


def test_the_controllers_offered_are_those_there_are():
    assert sorted(_CONTROLLERS) == sorted(CONTROLLER_KINDS)


def test_unknown_models_are_named(capsys):
    assert main(["demo", "arms", "--models", "irb120", "--no-browser"]) == 2
    said = capsys.readouterr().err
    assert "irb120" in said
    assert "iiwa14" in said
    assert main(["demo", "hands", "--models", "iiwa7", "--no-browser"]) == 2
    assert "wsg50" in capsys.readouterr().err


def test_a_scene_in_which_nothing_moves_is_refused(capsys):
    assert main(["demo", "hands", "--models", "suction_cup", "--no-browser"]) == 2
    assert "nothing moves in suction_cup" in capsys.readouterr().err


def test_unknown_controllers_are_refused(capsys):
    with pytest.raises(SystemExit):
        main(["demo", "arms", "--controller", "magic"])
    assert "gravity-compensation" in capsys.readouterr().err


def test_a_run_leaves_report_replay_and_scene(tmp_path, capsys):
    out = tmp_path / "out"
    command = ["demo", "arms", "--models", "ur5e", "--controller", "pid"]
    assert main([*command, "--no-browser", "--out", str(out)]) == 0
    assert "ur5e" in capsys.readouterr().out
    report = json.loads((out / "report.json").read_text())
    assert report["demo"] == "arms"
    assert report["controller"] == "pid"
    assert report["success"] is True
    assert [robot["model"] for robot in report["robots"]] == ["ur5e"]
    assert (out / "replay.html").stat().st_size > 100_000
    scenario = load_scenario(out / "scenario.yaml")
    assert list(scenario.model_drivers) == ["ur5e"]
    assert not scenario.model_drivers["ur5e"].gravity_compensation
