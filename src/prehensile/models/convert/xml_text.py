"""XML elements made, changed and written; the counterpart of ``xml_lines``, which reads them."""

from collections.abc import Iterable
from xml.sax.saxutils import escape, quoteattr

from prehensile.models.xml_lines import Element


def number(value: float) -> str:
    """The shortest text that reads back as the same number."""
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Numbers with blanks between them."""
    return " ".join(number(v) for v in values)


def make(tag: str, *content: "Element | str", **attributes: str) -> Element:
    """A new element; content is its text or its children."""
    texts = [c for c in content if isinstance(c, str)]
    children = [c for c in content if isinstance(c, Element)]
    return Element(tag, dict(attributes), 0, children, "".join(texts))


def set_child(parent: Element, child: Element) -> None:
    """Puts a child in the place of the first one of its name, or at the end."""
    for i, old in enumerate(parent.children):
        if old.tag == child.tag:
            parent.children[i] = child
            return
    parent.children.append(child)


def remove(parent: Element, *tags: str) -> int:
    """Removes the children of these names; says how many there were."""
    before = len(parent.children)
    parent.children = [c for c in parent.children if c.tag not in tags]
    return before - len(parent.children)


def xml_text(root: Element) -> str:
    """The text of an XML file."""
    return "\n".join(['<?xml version="1.0"?>', *_lines(root, 0), ""])


def _lines(element: Element, depth: int) -> list[str]:
    pad = "  " * depth
    attributes = "".join(f" {k}={quoteattr(v)}" for k, v in element.attributes.items())
    head = f"{pad}<{element.tag}{attributes}"
    if not element.children:
        if not element.text:
            return [head + "/>"]
        return [f"{head}>{escape(element.text)}</{element.tag}>"]
    lines = [head + ">"]
    if element.text:
        lines.append(f"{pad}  {escape(element.text)}")
    for child in element.children:
        lines += _lines(child, depth + 1)
    return [*lines, f"{pad}</{element.tag}>"]
