"""System diagrams: the picture holds what the diagram holds, and blocks do not overlap."""

import io
import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import browser
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from pydrake.systems.framework import Diagram, DiagramBuilder
from pydrake.systems.primitives import Adder, ConstantVectorSource, Gain, Integrator

from prehensile.errors import InputError
from prehensile.viz.diagram_blocks import Block, Edge, levels, read_block
from prehensile.viz.diagram_draw import to_page, to_png, to_svg
from prehensile.viz.diagram_layers import _spread, assign_columns, sequence
from prehensile.viz.diagram_layout import Rect, lay_out
from prehensile.viz.diagrams import save_diagram


def loop() -> Diagram:
    """A lag: reference - state goes through a gain into an integrator, inside a diagram."""
    inner = DiagramBuilder()
    error = inner.AddNamedSystem("error", Adder(2, 1))
    gain = inner.AddNamedSystem("gain", Gain(3.0, 1))
    state = inner.AddNamedSystem("state", Integrator(1))
    back = inner.AddNamedSystem("back", Gain(-1.0, 1))
    inner.Connect(error.get_output_port(), gain.get_input_port())
    inner.Connect(gain.get_output_port(), state.get_input_port())
    inner.Connect(state.get_output_port(), back.get_input_port())
    inner.Connect(back.get_output_port(), error.get_input_port(1))
    inner.ExportInput(error.get_input_port(0), "reference")
    inner.ExportOutput(state.get_output_port(), "value")
    lag = inner.Build()
    lag.set_name("lag")
    outer = DiagramBuilder()
    outer.AddSystem(lag)
    source = outer.AddSystem(ConstantVectorSource([1.0]))
    outer.Connect(source.get_output_port(), lag.get_input_port())
    outer.ExportOutput(lag.get_output_port(), "y <out>")
    diagram = outer.Build()
    diagram.set_name("whole")
    return diagram


def test_read_block_holds_every_connection() -> None:
    block = read_block(loop())
    assert [c.name for c in block.children] == ["lag", ""]
    assert block.children[1].kind == "ConstantVectorSource"
    assert levels(block) == 2
    assert block.edges == (Edge(0, 0, -1, 0), Edge(1, 0, 0, 0))
    lag = block.children[0]
    names = [c.name for c in lag.children]
    pairs = {
        (names[e.source] if e.source >= 0 else "in", names[e.target] if e.target >= 0 else "out")
        for e in lag.edges
    }
    assert pairs == {
        ("in", "error"), ("error", "gain"), ("gain", "state"), ("state", "back"),
        ("back", "error"), ("state", "out"),
    }  # fmt: skip


def test_depth_opens_blocks() -> None:
    block = read_block(loop())
    closed = {t.text for t in lay_out(block, 1).texts}
    opened = {t.text for t in lay_out(block, 2).texts}
    assert {"whole", "lag", "ConstantVectorSource", "y <out>"} <= closed
    assert "gain" not in closed
    assert {"error", "gain", "state", "back"} <= opened
    assert lay_out(block, 3) == lay_out(block, 2), "there is nothing deeper"


def test_signals_end_at_ports_of_blocks() -> None:
    picture = lay_out(read_block(loop()), 2)
    ends = [line.points[-1] for line in picture.lines if line.arrow]
    assert len(ends) == 2 + 6
    lefts = [r.x for r in picture.rects]
    texts = {t.text: t for t in picture.texts}
    # The gain's only input is where the arrow ends: 6 px left of its text, on its row.
    gain = next(r for r in picture.rects if r.path == "whole/lag/gain")
    assert sum(abs(x - gain.x) < 1e-6 and gain.y < y < gain.y + gain.h for x, y in ends) == 1
    assert len(lefts) == 7
    assert texts["gain"].x == pytest.approx(gain.x + gain.w / 2)


def _overlap(a: Rect, b: Rect) -> bool:
    return a.x < b.x + b.w and b.x < a.x + a.w and a.y < b.y + b.h and b.y < a.y + a.h


@st.composite
def blocks(draw: st.DrawFn) -> Block:
    """A random block with up to nine children, each with two inputs and two outputs."""
    n = draw(st.integers(1, 9))
    edges = {}
    for target in range(n):
        for port in range(2):
            source = draw(st.integers(-1, n - 1))
            output = draw(st.integers(0, 1))
            if draw(st.booleans()):
                edges[target, port] = Edge(source, output, target, port)
    for port in range(2):
        edges[-1, port] = Edge(draw(st.integers(0, n - 1)), port, -1, port)
    children = tuple(Block(f"b{i}", "K", ("u", "v"), ("x", "y")) for i in range(n))
    return Block("top", "Diagram", ("a", "b"), ("c", "d"), children, tuple(edges.values()))


@settings(max_examples=60, deadline=None)
@given(blocks())
def test_blocks_never_overlap_and_signals_cross_none(block: Block) -> None:
    picture = lay_out(block, 1)
    frame, *inner = picture.rects
    for i, a in enumerate(inner):
        assert frame.x <= a.x
        assert a.x + a.w <= frame.x + frame.w
        assert a.y + a.h <= frame.y + frame.h
        assert not any(_overlap(a, b) for b in inner[i + 1 :])
    arrows = [line for line in picture.lines if line.arrow]
    assert len(arrows) == len(block.edges)
    for line in picture.lines:
        for (x0, y0), (x1, y1) in zip(line.points, line.points[1:], strict=False):
            for t in np.linspace(0, 1, 8):
                x, y = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
                assert -1e-6 <= x <= picture.width
                assert -1e-6 <= y <= picture.height
                for r in inner:
                    inside = r.x + 1e-6 < x < r.x + r.w - 1e-6 and r.y < y < r.y + r.h
                    assert not inside, "a signal runs over a block"


@given(blocks())
def test_forward_signals_go_right(block: Block) -> None:
    n = len(block.children)
    edges = [
        Edge(n if e.source < 0 else e.source, e.output, n + 1 if e.target < 0 else e.target, 0)
        for e in block.edges
    ]
    line = sequence(n, edges)
    assert sorted(line.values()) == list(range(n + 2))
    forward = [e for e in edges if line[e.source] < line[e.target]]
    column = assign_columns(n, forward)
    assert all(column[e.source] < column[e.target] for e in forward)
    assert column[n] == 0
    # A set of edges without cycles has none that runs backwards.
    if not any(e.source >= e.target for e in edges if e.source < n and e.target < n):
        assert len(forward) == len(edges)


@given(st.lists(st.floats(-100, 100), min_size=1, max_size=6), st.integers(0, 2**31))
def test_spread_is_the_least_squares_answer(wanted: list[float], seed: int) -> None:
    gaps = np.random.default_rng(seed).uniform(1, 20, len(wanted))
    y = _spread(np.array(wanted), gaps)
    assert (np.diff(y) >= gaps[:-1] - 1e-9).all()
    # No feasible neighbour is better: the gradient is stopped by the active gaps alone.
    cost = ((y - wanted) ** 2).sum()
    rng = np.random.default_rng(seed + 1)
    for _ in range(50):
        other = y + rng.normal(0, 0.5, len(y))
        if (np.diff(other) >= gaps[:-1]).all():
            assert ((other - wanted) ** 2).sum() >= cost - 1e-9


def test_svg_is_well_formed_and_escaped() -> None:
    svg = to_svg(lay_out(read_block(loop()), 2))
    root = ElementTree.fromstring(svg)
    space = "{http://www.w3.org/2000/svg}"
    assert "y <out>" in [t.text for t in root.iter(f"{space}text")]
    paths = [r.get("data-path") for r in root.iter(f"{space}rect")]
    assert "whole/lag/state" in paths


def test_png_has_the_size_of_the_picture_and_ink() -> None:
    picture = lay_out(read_block(loop()), 1)
    image = Image.open(io.BytesIO(to_png(picture, scale=1.0)))
    assert image.size == (round(picture.width), round(picture.height))
    assert len(set(image.convert("L").tobytes())) > 20


def test_page_holds_every_block_at_every_depth() -> None:
    page = to_page(read_block(loop()), 1)
    found = re.search(r"const pictures = (.*);\n", page)
    assert found is not None
    pictures = json.loads(found.group(1))
    assert {path: len(svgs) for path, svgs in pictures.items()} == {"whole": 2, "whole/lag": 1}
    assert "http" not in page.replace("http://www.w3.org/2000/svg", ""), "nothing is fetched"


def test_a_leaf_can_be_drawn_too() -> None:
    texts = [t.text for t in lay_out(read_block(Gain(2.0, 1)), 1).texts]
    assert "Gain" in texts
    assert "u" in texts[2]


@pytest.mark.parametrize(("name", "depth"), [("d.svg", 0), ("d.pdf", 1), ("d", 1)])
def test_wrong_arguments_are_clear(tmp_path: Path, name: str, depth: int) -> None:
    with pytest.raises(InputError, match=r"depth of 0|no picture is written"):
        save_diagram(loop(), tmp_path / name, depth=depth)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(browser.CHROMIUM is None, reason="needs Chromium")
def test_blocks_open_by_click_and_by_depth(tmp_path: Path) -> None:
    path = save_diagram(loop(), tmp_path / "d.html")
    shown = "[...document.querySelectorAll('#picture text')].map((t) => t.textContent)"
    with browser.Browser(path.as_uri()) as page:
        page.wait_for("document.querySelector('#picture svg') !== null")
        assert "gain" not in page.evaluate(shown)
        page.evaluate("[...document.querySelectorAll('#depths button')][1].click()")
        assert {"gain", "whole"} <= set(page.evaluate(shown))
        page.evaluate("[...document.querySelectorAll('#depths button')][0].click()")
        page.evaluate("document.querySelector('rect.opens').onclick()")
        texts = page.evaluate(shown)
        assert "gain" in texts
        assert "whole" not in texts
        page.evaluate("document.querySelector('#trail button').click()")
        assert "whole" in page.evaluate(shown)
        assert not page.errors
