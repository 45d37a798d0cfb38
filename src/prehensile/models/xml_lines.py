"""XML read safely, every element with its line.

No entities are expanded (that is how a small file becomes gigabytes or reads another one), and
size and depth are bounded.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from prehensile.errors import Finding

MAX_BYTES = 32 << 20
MAX_DEPTH = 100

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)


@dataclass
class Element:
    """An XML element.

    Attributes:
        tag: its name, with the prefix as written, such as ``drake:mesh_resolution_hint``.
        attributes: its attributes.
        line: 1-based line of its opening tag.
        children: the elements in it, in order.
        text: the text directly in it, stripped.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list["Element"] = field(default_factory=list)
    text: str = ""

    def child(self, tag: str) -> "Element | None":
        """The first child of that name."""
        return next((c for c in self.children if c.tag == tag), None)

    def all(self, tag: str) -> list["Element"]:
        """The children of that name."""
        return [c for c in self.children if c.tag == tag]

    def walk(self) -> Iterator["Element"]:
        """This element and everything below it, in the order of the file."""
        yield self
        for child in self.children:
            yield from child.walk()

    @property
    def name(self) -> str:
        """The attribute ``name`` ("" if there is none)."""
        return self.attributes.get("name", "")


class _RefusedError(Exception):
    pass


def read_xml(path: Path, findings: list[Finding]) -> Element | None:
    """Reads an XML file.

    Args:
        path: the file.
        findings: what is wrong with it is appended here.

    Returns:
        The root element, or None if nothing could be made of the file.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            findings.append(
                Finding(f"the file is larger than {MAX_BYTES >> 20} MiB", "", str(path))
            )
            return None
        # Drake's own parser forgives "--" in comments and blank lines before the declaration.
        data = _COMMENT.sub(lambda match: b"\n" * match[0].count(b"\n"), path.read_bytes())
        skipped = len(data) - len(data.lstrip())
    except OSError as error:
        findings.append(Finding(f"the file cannot be read: {error.strerror}", "", str(path)))
        return None

    first_line = data[:skipped].count(b"\n")
    parser = expat.ParserCreate()
    root: list[Element] = []
    stack: list[Element] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) >= MAX_DEPTH:
            raise _RefusedError(f"elements are nested more than {MAX_DEPTH} deep")
        element = Element(tag, attributes, first_line + parser.CurrentLineNumber)
        (stack[-1].children if stack else root).append(element)
        stack.append(element)

    def end(_: str) -> None:
        element = stack.pop()
        element.text = element.text.strip()

    def text(data: str) -> None:
        if stack:
            stack[-1].text += data

    def entity(*_: object) -> None:
        raise _RefusedError("the file declares XML entities, which model files have no use for")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = entity
    parser.buffer_text = True
    try:
        parser.Parse(data[skipped:], True)
    except expat.ExpatError as error:
        said = expat.errors.messages.get(error.code, str(error.code))
        findings.append(
            Finding(
                f"not valid XML: {said}", "correct the file", str(path), first_line + error.lineno
            )
        )
        return None
    except _RefusedError as error:
        line = first_line + parser.CurrentLineNumber
        findings.append(Finding(str(error), "remove it", str(path), line))
        return None
    return root[0] if root else None
