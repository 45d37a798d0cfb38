"""``prehensile diagram``: files of every kind, and what it refuses."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from PIL import Image

from prehensile.cli.main import main


def test_draws_a_station_as_svg(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "station.svg"
    assert main(["diagram", "two_bins", "-o", str(path)]) == 0
    assert capsys.readouterr().out.strip() == str(path)
    texts = {e.text for e in ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}text")}
    # Every port of the station, the plant, its arm's driver; a closed block hides what is inside.
    assert {"iiwa.position", "wsg.state_measured", "camera0.point_cloud", "plant"} <= texts
    assert "inverse_dynamics_controller" not in texts


def test_depth_opens_blocks_and_png_is_a_picture(tmp_path: Path) -> None:
    shallow, deep = tmp_path / "shallow.png", tmp_path / "deep.png"
    assert main(["diagram", "iiwa_wsg", "-o", str(shallow)]) == 0
    assert main(["diagram", "iiwa_wsg", "-o", str(deep), "--depth", "2"]) == 0
    assert Image.open(deep).width > Image.open(shallow).width


def test_page_by_default_in_the_working_directory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["diagram", "planar"]) == 0
    page = (tmp_path / "planar.html").read_text()
    assert "inverse_dynamics_controller" in page


def test_draws_the_tree_of_a_scenario_and_of_a_model(tmp_path: Path) -> None:
    scenario, model = tmp_path / "scenario.svg", tmp_path / "model.png"
    assert main(["diagram", "pick_brick", "--tree", "-o", str(scenario)]) == 0
    texts = {e.text for e in ElementTree.parse(scenario).iter("{http://www.w3.org/2000/svg}text")}
    assert {"world", "iiwa_link_7", "iiwa_joint_7", "foam_brick"} <= texts
    assert main(["diagram", "wsg50", "--tree", "-o", str(model)]) == 0
    assert Image.open(model).height > 200


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["two_bins", "-o", "x.dot"], "no picture is written as '.dot'"),
        (["two_bins", "--depth", "0"], "a depth of 0"),
        (["no_such_place"], "no_such_place"),
        (["no_such_place", "--tree"], "no_such_place"),
        (["iiwa7", "--tree", "-o", "x.html"], "no kinematic tree is written as '.html'"),
    ],
)
def test_clear_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diagram", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_tree_has_no_hardware(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagram", "--tree", "--hardware", "iiwa7"]) == 2
    assert "--hardware" in capsys.readouterr().err
