"""Where the blocks of a layered drawing go: columns, order within a column, heights.

The steps are those of Sugiyama, Tagawa, Toda (1981): signals that run backwards are set aside
(after Eades, Lin, Smyth 1993), blocks get columns by longest path, the order within a column
follows the mean place of the neighbours, and heights minimize the squared slopes of the signals
under that order.

Nodes are numbered: the n children of a block, then n for the strip of its inputs, n + 1 for the
strip of its outputs, then the dummies that signals longer than one column run through.
"""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from prehensile.viz.diagram_blocks import Edge

GAP = 16.0
_DUMMY_GAP = 4.0


@dataclass
class Node:
    """What the layout must know of a block.

    Attributes:
        w, h: size; a dummy has no width.
        inputs, outputs: heights of its ports below its top, by port number (-1 for a dummy).
    """

    w: float
    h: float
    inputs: dict[int, float] = field(default_factory=dict)
    outputs: dict[int, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Link:
    """A piece of a signal from one column to the next.

    Attributes:
        source, output: node and port where it starts.
        target, input: node and port where it ends.
        origin: node and port where the whole signal starts.
    """

    source: int
    output: int
    target: int
    input: int
    origin: tuple[int, int]


def sequence(n: int, edges: list[Edge]) -> dict[int, int]:
    """A place in line for every node such that few edges run backwards (Eades et al. 1993).

    Node n comes first and node n + 1 last.
    """
    rest = set(range(n))
    head, tail = [n], [n + 1]
    while rest:
        outgoing, incoming = dict.fromkeys(rest, 0), dict.fromkeys(rest, 0)
        for e in edges:
            if e.source in rest and e.target in rest and e.source != e.target:
                outgoing[e.source] += 1
                incoming[e.target] += 1
        sinks = [v for v in sorted(rest) if outgoing[v] == 0 and incoming[v] > 0]
        sources = [v for v in sorted(rest) if incoming[v] == 0]
        if sinks:
            tail[:0] = sinks
            rest -= set(sinks)
        elif sources:
            head += sources
            rest -= set(sources)
        else:
            best = max(sorted(rest), key=lambda v: outgoing[v] - incoming[v])
            head.append(best)
            rest.remove(best)
    return {v: i for i, v in enumerate(head + tail)}


def assign_columns(n: int, forward: list[Edge]) -> dict[int, int]:
    """Columns by longest path; nodes that mostly feed others move right, up to them."""
    column = dict.fromkeys(range(n + 2), 0)
    column.update(dict.fromkeys(range(n), 1))
    for _ in range(n + 2):
        for e in forward:
            column[e.target] = max(column[e.target], column[e.source] + 1)
    column[n + 1] = max(column[v] for v in range(n + 1)) + 1
    for _ in range(n):
        for v in range(n):
            after = [column[e.target] for e in forward if e.source == v]
            before = [e for e in forward if e.target == v and e.source != n]
            if after and not before and min(after) - 1 > column[v]:
                column[v] = min(after) - 1
    return column


def add_dummies(
    nodes: list[Node], column_of: dict[int, int], forward: list[Edge]
) -> tuple[list[list[int]], list[Link]]:
    """Cuts signals longer than one column; those of one port share their dummies.

    Appends the dummies to ``nodes``.
    """
    columns: list[list[int]] = [[] for _ in range(max(column_of.values()) + 1)]
    for v, c in sorted(column_of.items()):
        columns[c].append(v)
    links: list[Link] = []
    dummies: dict[tuple[int, int, int], int] = {}
    for e in forward:
        at, port = origin = e.source, e.output
        for c in range(column_of[e.source] + 1, column_of[e.target]):
            key = (e.source, e.output, c)
            if key not in dummies:
                dummies[key] = len(nodes)
                nodes.append(Node(0.0, 4.0, {-1: 2.0}, {-1: 2.0}))
                columns[c].append(dummies[key])
                links.append(Link(at, port, dummies[key], -1, origin))
            at, port = dummies[key], -1
        links.append(Link(at, port, e.target, e.input, origin))
    return columns, links


def order_columns(columns: list[list[int]], links: list[Link], nodes: list[Node]) -> None:
    """Sorts each column by the mean place of its neighbours, sweeping right and left."""

    def places() -> dict[int, float]:
        return {v: float(i) for column in columns for i, v in enumerate(column)}

    def crossings() -> int:
        place = places()
        total = 0
        by_column = defaultdict(list)
        column_of = {v: c for c, column in enumerate(columns) for v in column}
        for k in links:
            a = place[k.source] + nodes[k.source].outputs[k.output] / (nodes[k.source].h + 1)
            b = place[k.target] + nodes[k.target].inputs[k.input] / (nodes[k.target].h + 1)
            by_column[column_of[k.source]].append((a, b))
        for pairs in by_column.values():
            ab = np.array(pairs)
            d = ab[:, None, :] - ab[None, :, :]
            total += int((d[..., 0] * d[..., 1] < -1e-12).sum()) // 2
        return total

    best, best_crossings = [list(c) for c in columns], crossings()
    for sweep in range(16):
        to_right = sweep % 2 == 0
        for c in range(len(columns)) if to_right else range(len(columns) - 1, -1, -1):
            place = places()
            pull = defaultdict(list)
            for k in links:
                if to_right:
                    node = nodes[k.source]
                    pull[k.target].append(place[k.source] + node.outputs[k.output] / (node.h + 1))
                else:
                    node = nodes[k.target]
                    pull[k.source].append(place[k.target] + node.inputs[k.input] / (node.h + 1))
            columns[c].sort(key=lambda v: np.mean(pull[v]) if pull[v] else place[v])
        now = crossings()
        if now < best_crossings:
            best, best_crossings = [list(c) for c in columns], now
    for c, column in enumerate(best):
        columns[c] = column


def assign_heights(
    columns: list[list[int]], links: list[Link], nodes: list[Node]
) -> dict[int, float]:
    """The y of every node: signals as level as the order and the gaps allow."""
    y: dict[int, float] = {}
    for column in columns:
        top = 0.0
        for v in column:
            y[v] = top
            top += nodes[v].h + GAP
    for sweep in range(30):
        for column in columns if sweep % 2 == 0 else reversed(columns):
            wish: dict[int, list[float]] = {v: [] for v in column}
            for k in links:
                out, in_ = nodes[k.source].outputs[k.output], nodes[k.target].inputs[k.input]
                if k.target in wish:
                    wish[k.target].append(y[k.source] + out - in_)
                if k.source in wish:
                    wish[k.source].append(y[k.target] + in_ - out)
            wanted = np.array([np.mean(wish[v]) if wish[v] else y[v] for v in column])
            gaps = np.array([nodes[v].h + (GAP if nodes[v].w else _DUMMY_GAP) for v in column])
            for v, place in zip(column, _spread(wanted, gaps), strict=True):
                y[v] = float(place)
    lowest = min(y.values(), default=0.0)
    return {v: value - lowest for v, value in y.items()}


def _spread(wanted: NDArray[np.float64], gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least-squares places y near ``wanted`` with y[i+1] >= y[i] + gaps[i].

    Pool adjacent violators on the wishes with the gaps taken off.
    """
    if not len(wanted):
        return wanted
    offset = np.concatenate([[0.0], np.cumsum(gaps[:-1])])
    pools: list[list[float]] = []  # [sum, count]
    for value in wanted - offset:
        pools.append([float(value), 1.0])
        while len(pools) > 1 and pools[-2][0] / pools[-2][1] > pools[-1][0] / pools[-1][1]:
            total, count = pools.pop()
            pools[-1][0] += total
            pools[-1][1] += count
    means = [total / count for total, count in pools for _ in range(int(count))]
    return np.array(means) + offset
