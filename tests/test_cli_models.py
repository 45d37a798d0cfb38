"""``prehensile models`` as it is typed."""

import re
import subprocess
import sys

import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from prehensile.cli.main import main
from prehensile.errors import InputError
from prehensile.models.registry import find_model, list_models


@pytest.fixture(autouse=True)
def _wide_plain_terminal(monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.delenv("PREHENSILE_MODEL_PATH", raising=False)


def test_list_names_every_model(capsys):
    assert main(["models", "list"]) == 0
    rows = {line.split()[0] for line in capsys.readouterr().out.splitlines() if line.split()}
    assert {m.name for m in list_models()} <= rows


def test_list_of_a_category_names_just_those(capsys):
    assert main(["models", "list", "--category", "arm"]) == 0
    out = capsys.readouterr().out
    assert "iiwa7" in out
    assert "iiwa14" in out
    assert "wsg50" not in out


def test_list_shows_the_users_own(capsys, monkeypatch, tmp_path):
    (tmp_path / "gadget.urdf").write_text('<robot name="gadget"><link name="base"/></robot>')
    monkeypatch.setenv("PREHENSILE_MODEL_PATH", str(tmp_path))
    assert main(["models", "list", "--category", "other"]) == 0
    assert "gadget" in capsys.readouterr().out


def test_list_imports_no_drake():
    code = (
        "import sys; from prehensile.cli.main import main; main(['models', 'list']); "
        "sys.exit('pydrake' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


def test_show_tells_mass_size_limits_as_drake_has_them(capsys):
    assert main(["models", "show", "iiwa7"]) == 0
    out = capsys.readouterr().out
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(find_model("iiwa7").path)
    plant.Finalize()
    mass = plant.CalcTotalMass(plant.CreateDefaultContext())
    assert f"{mass:.4g} kg" in out
    for i in range(1, 8):
        row = re.search(rf"iiwa_joint_{i} +revolute +(\S+) \.\. (\S+) rad", out)
        assert row is not None
        joint = plant.GetJointByName(f"iiwa_joint_{i}")
        assert float(row[1]) == pytest.approx(joint.position_lower_limits()[0], rel=1e-3)
        assert float(row[2]) == pytest.approx(joint.position_upper_limits()[0], rel=1e-3)
    for text in ("iiwa_link_7", "package://prehensile/iiwa7/iiwa7.sdf", "spheres", "KUKA"):
        assert text in out


def test_show_tells_the_size_of_a_brick(capsys):
    assert main(["models", "show", "foam_brick"]) == 0
    size = re.search(r"size +(\S+) x (\S+) x (\S+) m", capsys.readouterr().out)
    assert size is not None
    # To the millimetre, whatever rounds its edges.
    assert [float(s) for s in size.groups()] == pytest.approx([0.05, 0.075, 0.05], abs=1e-3)


def test_an_unknown_model_is_status_2_with_what_comes_close(capsys):
    assert main(["models", "show", "mustard_botle"]) == 2
    err = capsys.readouterr().err
    assert "'mustard_bottle'" in err
    assert "Traceback" not in err


def test_with_debug_an_error_is_raised():
    with pytest.raises(InputError):
        main(["models", "show", "mustard_botle", "--debug"])


def test_a_model_that_drake_refuses_is_status_2(capsys, monkeypatch, tmp_path):
    (tmp_path / "loop.urdf").write_text(
        '<robot name="loop"><link name="a"/><link name="b"/>'
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>'
        '<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>'
    )
    monkeypatch.setenv("PREHENSILE_MODEL_PATH", str(tmp_path))
    assert main(["models", "show", "loop"]) == 2
    assert "loop.urdf" in capsys.readouterr().err
