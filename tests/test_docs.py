"""The code in the pages of the docs runs as it stands there, and does what they say."""

import re
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parents[1]


def run(page: str, *, without: str = "nothing") -> dict[str, Any]:
    """What the Python code of a page leaves behind, all of it run in order."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(), re.S | re.M)
    names: dict[str, Any] = {}
    for block in blocks:
        if without not in block:
            exec(block, names)
    return names


def test_the_hand_of_the_page_on_kinematics_moves_ten_centimetres_down(capsys):
    names = run("docs/kinematics.md")
    plant, G = names["plant"], names["G"]
    context = plant.CreateDefaultContext()
    before = G.CalcPoseInWorld(context).GetAsMatrix4()
    np.testing.assert_allclose(names["X_WG"], before, atol=1e-12)
    plant.SetPositions(context, names["arm"], names["q"])
    after = G.CalcPoseInWorld(context).GetAsMatrix4()
    down = np.zeros((4, 4))
    down[2, 3] = -0.1
    np.testing.assert_allclose(after - before, down, atol=1e-6)
    assert len(names["solver"].solve(names["X_WG"], 0.3).q) > 0


def test_the_arm_of_the_readme_begins_to_move_down(capsys):
    names = run("README.md", without="ClearBinRun")
    result = names["ik"].step(names["q"], 0.0 * names["q"], names["X_WG"][None])
    V_WG = names["arm"].tree.jacobian(names["q"], 0) @ result.v
    assert V_WG[5] < 0.0
    assert np.linalg.norm(V_WG[3:5]) < 0.05 * abs(V_WG[5])
    # From rest, within 5 ms.
    acceleration = names["JointLimits"].of_tree(names["arm"]).acceleration
    assert np.all(np.abs(result.v) <= 0.005 * acceleration + 1e-12)


def test_the_bottle_of_the_page_on_perception_is_found(capsys):
    names = run("docs/perception.md")
    assert names["found"].succeeded or names["found"].alternatives  # Or half a turn from the truth.
    X_OO = names["X_WBottle"].inverse() @ names["refined"].X_WO
    assert np.linalg.norm(X_OO.translation()) < 0.002
    upright = X_OO.rotation().matrix()[2, 2]
    assert upright > np.cos(np.deg2rad(2))
    half_turn = abs(X_OO.rotation().matrix()[0, 0])
    assert half_turn > np.cos(np.deg2rad(5))
