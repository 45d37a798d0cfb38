"""A block diagram laid out for drawing: blocks in columns, signals from left to right.

:mod:`prehensile.viz.diagram_layers` finds the places; here blocks get their size, and signals
their way. Backward signals run in lanes below the blocks.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np

from prehensile.viz.diagram_blocks import Block, Edge
from prehensile.viz.diagram_layers import (
    GAP,
    Link,
    Node,
    add_dummies,
    assign_columns,
    assign_heights,
    order_columns,
    sequence,
)
from prehensile.viz.images import font

TITLE, SMALL = 13.0, 11.0
_ROW = 15.0
_MARGIN = 10.0
_COLORS = (
    "#1f6fb4", "#c8541a", "#2a8a3c", "#b3282d", "#7a4fb0", "#7c5040",
    "#c2489c", "#55606c", "#8a8a12", "#138d9c",
)  # fmt: skip
_FILLS = ("#f4f6f8", "#e9eef3", "#dfe6ed", "#d5dde6")


@dataclass(frozen=True)
class Rect:
    """A rounded rectangle; ``path`` names the block it stands for, as in "station/camera0"."""

    x: float
    y: float
    w: float
    h: float
    fill: str
    stroke: str
    path: str = ""
    opens: bool = False


@dataclass(frozen=True)
class Text:
    """One line of text; ``anchor`` is start, middle or end, ``y`` the base line."""

    x: float
    y: float
    text: str
    size: float = SMALL
    anchor: str = "start"
    color: str = "#20262c"


@dataclass(frozen=True)
class Line:
    """A signal: a polyline that ends with an arrow head if ``arrow``."""

    points: tuple[tuple[float, float], ...]
    color: str
    arrow: bool = False


@dataclass
class Picture:
    """Everything to draw, in drawing order, in pixels, y down."""

    width: float = 0.0
    height: float = 0.0
    rects: list[Rect] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)


@dataclass
class _Box(Node):
    """A node with what it looks like, before it has a place."""

    picture: Picture = field(default_factory=Picture)


def lay_out(block: Block, depth: int) -> Picture:
    """Draws a block.

    Args:
        block: what to draw.
        depth: levels of blocks drawn open (>= 1 to open the block itself).

    Returns:
        The picture.
    """
    box = _measure(
        block, depth, block.name, set(range(len(block.inputs))), set(range(len(block.outputs))), 0
    )
    picture = Picture(box.w + 2 * _MARGIN, box.h + 2 * _MARGIN)
    _paste(picture, box.picture, _MARGIN, _MARGIN)
    return picture


def text_width(text: str, size: float = SMALL) -> float:
    """Width of a line of DejaVu Sans, in pixels."""
    return font(size).getlength(text)


def _measure(
    block: Block, depth: int, path: str, inputs: set[int], outputs: set[int], level: int
) -> _Box:
    if depth > 0 and block.children:
        return _open_box(block, depth, path, level)
    return _closed_box(block, path, inputs, outputs)


def _closed_box(block: Block, path: str, inputs: set[int], outputs: set[int]) -> _Box:
    """A block as a plate: name, class, the ports that are connected, how many are not."""
    left = [(i, block.inputs[i]) for i in sorted(inputs)]
    right = [(i, block.outputs[i]) for i in sorted(outputs)]
    silent = len(block.inputs) + len(block.outputs) - len(left) - len(right)
    note = f"+ {silent} ports not connected" if silent else ""
    kind = block.kind + (f", {len(block.children)} systems inside" if block.children else "")
    column = [max([text_width(t) for _, t in ports], default=0) for ports in (left, right)]
    title, kind = (block.name, kind) if block.name else (kind, "")
    w = max(
        text_width(title, TITLE), text_width(kind), text_width(note), column[0] + column[1] + 14
    )
    w += 2 * _MARGIN
    top = 40.0
    h = top + _ROW * max(len(left), len(right)) + (_ROW if note else 0) + 4
    box = _Box(w, h)
    fill, stroke = ("#fff7e0", "#c89b2c") if block.children else ("#ffffff", "#8593a1")
    box.picture.rects.append(Rect(0, 0, w, h, fill, stroke, path, bool(block.children)))
    texts = box.picture.texts
    texts.append(Text(w / 2, 17, title, TITLE, "middle"))
    texts.append(Text(w / 2, 31, kind, SMALL, "middle", "#6b7782"))
    for row, (i, name) in enumerate(left):
        box.inputs[i] = top + _ROW * (row + 0.5)
        texts.append(Text(6, box.inputs[i] + 4, name))
    for row, (i, name) in enumerate(right):
        box.outputs[i] = top + _ROW * (row + 0.5)
        texts.append(Text(w - 6, box.outputs[i] + 4, name, anchor="end"))
    if note:
        texts.append(Text(w / 2, h - 7, note, SMALL, "middle", "#9aa4ae"))
    return box


def _port_strip(
    names: tuple[str, ...], key: dict[int, tuple[int, int]] | None = None, *, is_input: bool
) -> _Box:
    """The ports of an open block, as a column along its edge, sorted by key."""
    order = sorted(range(len(names)), key=lambda i: (key or {}).get(i, (0, 0)))
    w = max([text_width(n) for n in names], default=0) + 8
    box = _Box(w, _ROW * max(len(order), 1))
    for row, i in enumerate(order):
        y = _ROW * (row + 0.5)
        text_end = text_width(names[i]) + 8
        if is_input:
            box.outputs[i] = y
            box.picture.texts.append(Text(4, y + 4, names[i], color="#34506b"))
            leader = (text_end, y), (w, y)
        else:
            box.inputs[i] = y
            box.picture.texts.append(Text(w - 4, y + 4, names[i], anchor="end", color="#34506b"))
            leader = (0, y), (w - text_end, y)
        box.picture.lines.append(Line(leader, "#aab6c2"))
    return box


def _open_box(block: Block, depth: int, path: str, level: int) -> _Box:
    """A block as a frame with the blocks inside it and their signals."""
    n = len(block.children)
    # Nodes: the children, then the strip of inputs (n) and the strip of outputs (n + 1).
    edges = [
        Edge(
            n if e.source < 0 else e.source, e.output, n + 1 if e.target < 0 else e.target, e.input
        )
        for e in block.edges
    ]
    used_in: dict[int, set[int]] = defaultdict(set)
    used_out: dict[int, set[int]] = defaultdict(set)
    for e in edges:
        used_out[e.source].add(e.output)
        used_in[e.target].add(e.input)
    boxes = [
        _measure(c, depth - 1, f"{path}/{c.name or i}", used_in[i], used_out[i], level + 1)
        for i, c in enumerate(block.children)
    ]
    boxes.append(_port_strip(block.inputs, is_input=True))
    boxes.append(_port_strip(block.outputs, is_input=False))
    line = sequence(n, edges)
    forward = [e for e in edges if line[e.source] < line[e.target]]
    backward = [e for e in edges if line[e.source] >= line[e.target]]
    nodes: list[Node] = list(boxes)
    columns, links = add_dummies(nodes, assign_columns(n, forward), forward)
    order_columns(columns, links, nodes)
    # Ports along the frame in the order of what they are connected to.
    place = {v: i for column in columns for i, v in enumerate(column)}
    to = {k.output: (place[k.target], k.input) for k in links if k.source == n}
    boxes[n] = _port_strip(block.inputs, to, is_input=True)
    to = {k.input: (place[k.source], k.output) for k in links if k.target == n + 1}
    boxes[n + 1] = _port_strip(block.outputs, to, is_input=False)
    nodes[n : n + 2] = boxes[n : n + 2]
    order_columns(columns, links, nodes)
    frame = _Frame(nodes, columns, links, backward, assign_heights(columns, links, nodes))

    caption = 28 + text_width(block.name, TITLE) + text_width(block.kind)
    w = max(frame.width, caption)
    box = _Box(w, frame.height)
    box.picture.rects.append(Rect(0, 0, w, box.h, _FILLS[level % len(_FILLS)], "#5f6f7e", path))
    box.picture.texts += [
        Text(10, 19, block.name, TITLE),
        Text(18 + text_width(block.name, TITLE), 19, block.kind, color="#6b7782"),
    ]
    box.picture.lines += frame.signals()
    for v, inner in enumerate(boxes):
        _paste(box.picture, inner.picture, frame.x[v], frame.y[v])
    box.inputs = {i: frame.y[n] + dy for i, dy in boxes[n].outputs.items()}
    box.outputs = {i: frame.y[n + 1] + dy for i, dy in boxes[n + 1].inputs.items()}
    return box


class _Frame:
    """The inside of an open block: places of its nodes and ways of its signals.

    Attributes:
        width, height: of the inside, title line included.
        x, y: places of the nodes.
    """

    _TOP = 30.0  # for the title
    _RISER = 7.0  # between the risers of two lanes
    _LANE = 9.0  # between two lanes

    def __init__(
        self,
        nodes: list[Node],
        columns: list[list[int]],
        links: list[Link],
        backward: list[Edge],
        heights: dict[int, float],
    ) -> None:
        self._nodes, self._links = nodes, links
        self._column_of = {v: c for c, column in enumerate(columns) for v in column}
        # One lane below the blocks for every port with backward signals, short ones on top.
        lanes: dict[tuple[int, int], list[Edge]] = defaultdict(list)
        for e in backward:
            lanes[e.source, e.output].append(e)
        column = self._column_of
        self._lanes = sorted(
            lanes.items(),
            key=lambda lane: column[lane[0][0]] - min(column[e.target] for e in lane[1]),
        )
        # Channel c is the gap before column c. Lanes rise into a port from the channel before
        # its column and come down from a port in the channel after it.
        channels = range(len(columns) + 1)
        self._risers: list[list[tuple[int, int]]] = [[] for _ in channels]
        for port, edges in self._lanes:
            self._risers[column[port[0]] + 1].append(port)
            for c in sorted({column[e.target] for e in edges}):
                self._risers[c].append(port)
        fan = [sum(column[k.target] == c for k in links) for c in channels]
        gaps = [
            (26.0 + min(3.0 * fan[c], 70.0) if fan[c] else 10.0)
            + self._RISER * len(self._risers[c])
            for c in channels
        ]
        if not self._risers[0]:
            gaps[0] = 0.0
        widths = [max((nodes[v].w for v in column), default=0.0) for column in columns]
        self._left = [sum(gaps[: c + 1]) + sum(widths[:c]) for c in range(len(columns))]
        self._right = [x + w for x, w in zip(self._left, widths, strict=True)]
        # The last column holds the strip of outputs, which lines the frame.
        self.width = self._right[-1] + (gaps[-1] if self._risers[-1] else 0.0)
        self._lanes_top = self._TOP + max(heights[v] + nodes[v].h for v in heights) + GAP
        self.height = self._lanes_top + self._LANE * len(self._lanes) + 4
        self.x = {
            v: self._left[c] + (widths[c] - nodes[v].w) / 2 for v, c in self._column_of.items()
        }
        self.y = {v: self._TOP + y for v, y in heights.items()}

    def signals(self) -> list[Line]:
        """The forward signals as curves, the backward ones along their lanes."""
        lines = []
        for k in self._links:
            x0, y0 = self._end_of(k.source, k.output)
            x1, y1 = self._start_of(k.target, k.input)
            turn = max(self._right[self._column_of[k.source]], x0)
            points = _curve(x0, y0, x1, y1, turn, self._left[self._column_of[k.target]])
            lines.append(Line(points, _color(k.origin), arrow=self._nodes[k.target].w > 0))
        for lane, (port, edges) in enumerate(self._lanes):
            lane_y = self._lanes_top + self._LANE * lane
            x0, y0 = self._end_of(*port)
            c = self._column_of[port[0]]
            down = self._right[c] + self._RISER * (1 + self._risers[c + 1].index(port))
            for e in edges:
                x1, y1 = self._start_of(e.target, e.input)
                c = self._column_of[e.target]
                up = self._left[c] - 6 - self._RISER * (1 + self._risers[c].index(port))
                points = (x0, y0), (down, y0), (down, lane_y), (up, lane_y), (up, y1), (x1, y1)
                lines.append(Line(points, _color(port), arrow=True))
        return lines

    def _end_of(self, v: int, output: int) -> tuple[float, float]:
        return self.x[v] + self._nodes[v].w, self.y[v] + self._nodes[v].outputs[output]

    def _start_of(self, v: int, input_: int) -> tuple[float, float]:
        return self.x[v], self.y[v] + self._nodes[v].inputs[input_]


def _color(port: tuple[int, int]) -> str:
    """The colour of all signals that start at a port (node, number)."""
    return _COLORS[(3 * port[0] + port[1]) % len(_COLORS)]


def _curve(
    x0: float, y0: float, x1: float, y1: float, turn: float, arrive: float
) -> tuple[tuple[float, float], ...]:
    """Straight to ``turn``, an S curve to ``arrive``, straight to the end."""
    t = np.linspace(0, 1, 17)
    s = 3 * t**2 - 2 * t**3
    points = [(x0, y0)] if turn > x0 else []
    points += [
        (float(turn + (arrive - turn) * a), float(y0 + (y1 - y0) * b))
        for a, b in zip(t, s, strict=True)
    ]
    if x1 > arrive:
        points.append((x1, y1))
    return tuple(points)


def _paste(target: Picture, source: Picture, dx: float, dy: float) -> None:
    """Adds a picture to another, moved by (dx, dy)."""
    target.rects += [
        Rect(r.x + dx, r.y + dy, r.w, r.h, r.fill, r.stroke, r.path, r.opens) for r in source.rects
    ]
    target.lines += [
        Line(tuple((x + dx, y + dy) for x, y in line.points), line.color, line.arrow)
        for line in source.lines
    ]
    target.texts += [
        Text(t.x + dx, t.y + dy, t.text, t.size, t.anchor, t.color) for t in source.texts
    ]
