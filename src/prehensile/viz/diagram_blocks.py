"""A Drake diagram as plain data: names, ports, connections, and the blocks inside blocks."""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.systems.framework import Diagram, OutputPortIndex, System


@dataclass(frozen=True)
class Block:
    """A system as the picture needs it.

    Attributes:
        name: of the system ("" if it was given none).
        kind: its class.
        inputs, outputs: names of its ports, in order.
        children: the systems inside, empty for a leaf.
        edges: connections between the children and to this block's own ports.
    """

    name: str
    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    children: tuple[Block, ...] = ()
    edges: tuple[Edge, ...] = ()


@dataclass(frozen=True)
class Edge:
    """A connection inside a block.

    Attributes:
        source: index of the child whose output it starts at, or -1 for an input of the block.
        output: index of that port.
        target: index of the child whose input it ends at, or -1 for an output of the block.
        input: index of that port.
    """

    source: int
    output: int
    target: int
    input: int


def read_block(system: System) -> Block:
    """Reads names, ports and connections of a system and of all systems inside it.

    Args:
        system: any Drake system; a leaf has no children.

    Returns:
        The whole tree, in the order in which the systems were added.
    """
    inputs = tuple(system.get_input_port(i).get_name() for i in range(system.num_input_ports()))
    outputs = tuple(system.get_output_port(i).get_name() for i in range(system.num_output_ports()))
    # Drake makes a name of class and address for a system that was given none.
    name = "" if "@" in system.get_name() else system.get_name()
    kind = _kind(system)
    if not isinstance(system, Diagram):
        return Block(name, kind, inputs, outputs)
    children = system.GetSystems()
    number = {child: i for i, child in enumerate(children)}
    edges = [
        Edge(number[source], int(output), number[target], int(input_))
        for (target, input_), (source, output) in system.connection_map().items()
    ]
    for i in range(system.num_input_ports()):
        port = system.get_input_port(i)
        for target, input_ in system.GetInputPortLocators(port.get_index()):
            edges.append(Edge(-1, i, number[target], int(input_)))
    for i in range(system.num_output_ports()):
        source, output = system.get_output_port_locator(OutputPortIndex(i))
        edges.append(Edge(number[source], int(output), -1, i))
    edges.sort(key=lambda e: (e.source, e.output, e.target, e.input))
    return Block(name, kind, inputs, outputs, tuple(map(read_block, children)), tuple(edges))


def _kind(system: System) -> str:
    """The class of a system; Python knows some classes of C++ only as "System"."""
    if type(system).__module__.startswith("pydrake"):
        return system.GetSystemType().split("<")[0].split("::")[-1]
    return type(system).__name__


def levels(block: Block) -> int:
    """How many levels of systems are inside a block: 0 for a leaf."""
    return 1 + max(map(levels, block.children)) if block.children else 0
