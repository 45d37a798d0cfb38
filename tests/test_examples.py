"""Every example runs, finds its own answers right, and draws something.

Figures are kept in build/examples/NAME, where ``make docs`` finds them.
"""

import re
import runpy
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import pyplot as plt
from PIL import Image

from prehensile.viz.figures import FOLDER_VARIABLE

ROOT = Path(__file__).parents[1]
FIGURE = re.compile(r'save_(figure|animation)\(.*?"(\w+)",?\s*(?:period=[\d.]+,?\s*)?\)', re.DOTALL)
SUFFIX = {"figure": "png", "animation": "gif"}
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, monkeypatch, tmp_path):
    folder = ROOT / "build" / "examples" / path.stem
    for old in folder.glob("*.*"):
        old.unlink()
    monkeypatch.setenv(FOLDER_VARIABLE, str(folder))
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    mpl.rcdefaults()
    try:
        runpy.run_path(str(path), run_name="__main__")
    finally:
        plt.close("all")
    wanted = {f"{name}.{SUFFIX[kind]}" for kind, name in FIGURE.findall(path.read_text())}
    drawn = {picture.name for picture in folder.glob("*.*")}
    assert drawn
    assert wanted == drawn
    for picture in folder.glob("*.*"):
        pixels = np.asarray(Image.open(picture).convert("L"), float)
        assert pixels.std() > 2.0, f"{picture.name} is blank"


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_is_laid_out_in_cells_and_checks_itself(path):
    text = path.read_text()
    assert re.fullmatch(r"ch\d\d_[a-z0-9_]+", path.stem)
    assert text.startswith("# %% [markdown]\n# # "), "begin with a title"
    assert re.search(r"^# %%$", text, re.MULTILINE), "no code cell"
    assert re.search(r"^\s*(assert |np\.testing\.assert)", text, re.MULTILINE), "checks nothing"
