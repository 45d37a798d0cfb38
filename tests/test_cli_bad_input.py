"""Bad input on the command line: status 2, one line a fault, no traceback without --debug."""

import subprocess
import sys
from pathlib import Path

import pytest

from prehensile.cli.main import main
from prehensile.errors import InputError

BODY = (
    '<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="m"><link name="l">\n'
    "{}\n</link></model></sdf>"
)
SPHERE = "<geometry><sphere><radius>0.5</radius></sphere></geometry>"
MODELS = {
    "no_mesh": "<visual name='v'><geometry><mesh><uri>gone.obj</uri></mesh></geometry></visual>",
    "light": "<inertial><mass>-1</mass></inertial>",
    "nan": "<inertial><mass>nan</mass></inertial>",
    "fine": f"<collision name='c'>{SPHERE}<drake:proximity_properties><drake:mesh_resolution_hint>"
    "1e-6</drake:mesh_resolution_hint></drake:proximity_properties></collision>",
    "out": "<visual name='v'><geometry><mesh><uri>../../x.obj</uri></mesh></geometry></visual>",
}

# case: (text of the scenario, place that the message names, words in it)
CASES = {
    "unknown model": (
        "directives:\n- add_model:\n    name: a\n    file: package://prehensile/iiwa8/iiwa8.sdf",
        "bad.yaml:4: directives[0].add_model.file",
        "iiwa7",
    ),
    "missing mesh": ("{no_mesh}", "no_mesh.sdf:2", "gone.obj"),
    "broken YAML": ("directives:\n- add_model: [1\nx: 2", "bad.yaml:3", "not valid YAML"),
    "NaN": ("simulation_duration: .nan", "bad.yaml:1: simulation_duration", "NaN"),
    "NaN in a model": ("{nan}", "nan.sdf:2", "NaN"),
    "negative mass": ("{light}", "light.sdf:2", "mass of link 'l' is -1 kg"),
    "a file that includes itself": (
        "packages: {mine: models}\n"
        "directives:\n- add_directives: {file: package://mine/self.dmd.yaml}",
        "self.dmd.yaml:2: directives[0].add_directives.file",
        "adds itself",
    ),
    "a path out of its package": (
        "packages: {mine: models}\n"
        "directives:\n- add_model: {name: a, file: package://mine/../../secret.sdf}",
        "bad.yaml:3: directives[0].add_model.file",
        "leaves its package",
    ),
    "a mesh out of its package": ("{out}", "out.sdf:2", "leaves its package"),
    "absurd mesh resolution": ("{fine}", "fine.sdf:2", "absurd"),
}


@pytest.fixture
def folder(tmp_path) -> Path:
    models = tmp_path / "models"
    models.mkdir()
    for name, link in MODELS.items():
        (models / f"{name}.sdf").write_text(BODY.format(link))
    (models / "self.dmd.yaml").write_text(
        "directives:\n- add_directives: {file: package://mine/self.dmd.yaml}\n"
    )
    return tmp_path


def write(folder: Path, text: str) -> Path:
    if text.startswith("{"):
        model = text.strip("{}")
        text = (
            "packages: {mine: models}\n"
            f"directives:\n- add_model: {{name: a, file: package://mine/{model}.sdf}}"
        )
    file = folder / "bad.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize("case", CASES)
def test_a_scenario_with_a_fault_is_status_2_and_says_where(case, folder, capsys):
    text, place, words = CASES[case]
    file = write(folder, text)
    assert main(["run", str(file), "--no-browser"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "Traceback" not in captured.err
    lines = captured.err.splitlines()
    assert all(line.startswith("prehensile: ") for line in lines)
    assert any(place in line and words in line for line in lines)


def test_with_debug_the_error_is_raised(folder):
    file = write(folder, "simulation_duration: .nan")
    with pytest.raises(InputError):
        main(["--debug", "run", str(file), "--no-browser"])


def test_as_a_process(folder):
    file = write(folder, "{light}")
    code = "import sys; from prehensile.cli.main import main; sys.exit(main())"
    command = [sys.executable, "-c", code, "run", str(file), "--no-browser"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "light.sdf:2" in done.stderr
    done = subprocess.run([*command, "--debug"], capture_output=True, text=True, timeout=60)
    assert done.returncode != 0
    assert "Traceback" in done.stderr


def test_an_output_that_cannot_be_written_is_named(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    output = tmp_path / "file" / "tree.svg"
    assert main(["diagram", "--tree", "wsg50", "-o", str(output)]) == 2
    error = capsys.readouterr().err
    assert str(tmp_path / "file") in error
    assert len(error.splitlines()) == 1
