"""``prehensile view``: models, scenarios and files; what it cannot find."""

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlant

from prehensile.cli.main import main
from prehensile.cli.view import find, sphere_models
from prehensile.models.registry import find_model, load_spheres
from prehensile.station.robot_plant import add_models


@pytest.mark.parametrize("what", ["wsg50", "pick_brick", "package://prehensile/mug/mug.sdf"])
def test_looks_at_models_and_scenarios(what: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["view", what, "--no-browser", "--duration", "0.2", "--spheres"]) == 0
    assert "look at http://localhost:" in capfd.readouterr().out


def test_looks_at_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "my ball.sdf"
    path.write_text(
        '<sdf version="1.7"><model name="ball"><link name="ball"><visual name="v"><geometry>'
        "<sphere><radius>0.1</radius></sphere></geometry></visual></link></model></sdf>"
    )
    assert [d.add_model.name for d in find(str(path)).directives] == ["my ball"]
    assert main(["view", str(path), "--no-browser", "--duration", "0.1"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no_such_thing"], "no model, scenario or file is called 'no_such_thing'"),
        (["iiwa_7"], "iiwa7"),
        (["none.sdf"], "none.sdf: no such file"),
        (["none.yaml"], "none.yaml"),
        (["wsg50", "--duration", "-1"], "a duration of -1 s"),
    ],
)
def test_clear_errors(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", *arguments, "--no-browser"]) == 2
    assert message in capsys.readouterr().err


def test_broken_model_file_is_an_input_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "broken.sdf"
    path.write_text("<sdf><model>")
    assert main(["view", str(path), "--no-browser"]) == 2
    assert "broken.sdf" in capsys.readouterr().err


def test_sphere_models_belong_to_the_bodies_of_the_scenario() -> None:
    scenario = find("iiwa_wsg")
    plant = MultibodyPlant(0.005)
    add_models(scenario, plant)
    plant.Finalize()
    spheres = sphere_models(scenario, plant)
    link = plant.GetBodyByName("iiwa_link_3", plant.GetModelInstanceByName("iiwa")).index()
    np.testing.assert_array_equal(spheres[link], load_spheres(find_model("iiwa7"))["iiwa_link_3"])
