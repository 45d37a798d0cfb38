"""YAML read safely, every value with the file and line it stands in.

The parser is PyYAML's own in pure Python: the faster one on libyaml crashes the process on deeply
nested input. Anchors, aliases and merge keys (``<<``) work; what they can blow up is bounded.
"""

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from prehensile.errors import Finding

MAX_BYTES = 4 << 20
MAX_NODES = 100_000  # after aliases are expanded
MAX_DEPTH = 40

_MERGE_TAG = "tag:yaml.org,2002:merge"
_STANDARD_TAG = "tag:yaml.org,2002:"


@dataclass(frozen=True)
class Node:
    """A value of a YAML file.

    Attributes:
        value: a scalar (str, int, float, bool, None), a list of nodes, or a dict of nodes.
        tag: the tag the file's author wrote, such as ``!Rpy`` ("" if none).
        file: the file it stands in.
        line: 1-based line: of its key if it is a value in a map, else where it begins.
        key: path of keys that leads to it, such as ``directives[2].add_weld.parent``.
    """

    value: Any
    tag: str = ""
    file: str = ""
    line: int = 0
    key: str = ""

    def finding(self, message: str, mend: str = "") -> Finding:
        """A finding that points here."""
        return Finding(message, mend, self.file, self.line, self.key)

    def get(self, *keys: str) -> "Node | None":
        """The node that a path of map keys leads to, None if there is none."""
        node: Node | None = self
        for key in keys:
            node = node.value.get(key) if node and isinstance(node.value, dict) else None
        return node

    def text(self) -> str | None:
        """The value if it is a string, else None."""
        return self.value if isinstance(self.value, str) else None

    def plain(self) -> Any:
        """The value as plain dicts, lists and scalars; a tag becomes the key ``_tag``."""
        if isinstance(self.value, dict):
            result = {key: child.plain() for key, child in self.value.items()}
            if self.tag:
                result["_tag"] = self.tag
            return result
        if isinstance(self.value, list):
            return [child.plain() for child in self.value]
        return self.value


def read_yaml_file(path: Path, findings: list[Finding]) -> Node | None:
    """Reads a YAML file; see :func:`read_yaml`.

    Args:
        path: the file.
        findings: what is wrong with it is appended here.

    Returns:
        The top-level node, or None if nothing could be made of the file.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            findings.append(
                Finding(f"the file is larger than {MAX_BYTES >> 20} MiB", "", str(path))
            )
            return None
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        findings.append(Finding("the file is not UTF-8 text", "", str(path)))
        return None
    except (OSError, ValueError) as error:
        findings.append(Finding(f"the file cannot be read: {error}", "", str(path)))
        return None
    return read_yaml(text, str(path), findings)


def read_yaml(text: str, file: str, findings: list[Finding]) -> Node | None:
    """Reads YAML text: syntax errors, duplicate keys and keys that are not text are findings.

    Args:
        text: the text.
        file: what to call it in findings.
        findings: what is wrong with it is appended here.

    Returns:
        The top-level node (of an empty text: an empty map), or None if the text is not YAML.
    """
    if len(text) > MAX_BYTES:
        findings.append(Finding(f"the text is larger than {MAX_BYTES >> 20} MiB", "", file))
        return None
    try:
        loader = yaml.SafeLoader(text)
        root = loader.get_single_node()
        if root is None:
            return Node({}, "", file, 1)
        return _Converter(loader, file, findings).convert(root, "", root.start_mark.line + 1, 0)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        said = " ".join(part for part in (error.context, error.problem) if part)
        line = mark.line + 1 if mark else 0
        findings.append(Finding(f"not valid YAML: {said}", _syntax_mend(text, line), file, line))
    except yaml.YAMLError as error:
        said = " ".join(str(error).split())
        findings.append(Finding(f"not valid YAML: {said}", "", file))
    except (_TooMuchError, RecursionError) as error:
        said = str(error) if isinstance(error, _TooMuchError) else "nested too deeply"
        findings.append(Finding(said, "make it simpler", file))
    return None


def merge(base: Node, over: Node) -> Node:
    """Lays one node on top of another, as Drake does when it reads several YAML sources.

    Maps are merged key by key as long as they carry the same tag; lists and scalars are replaced.

    Args:
        base: the node below.
        over: the node on top, whose values win.

    Returns:
        The merged node.
    """
    if isinstance(base.value, dict) and isinstance(over.value, dict) and base.tag == over.tag:
        value = dict(base.value)
        for key, child in over.value.items():
            value[key] = merge(value[key], child) if key in value else child
        return Node(value, base.tag, over.file, over.line, over.key)
    return over


def children(node: Node | None) -> dict[str, Node]:
    """The entries of a map node; empty if it is none.

    Args:
        node: any node.
    """
    return node.value if node is not None and isinstance(node.value, dict) else {}


def close_to(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """Says in words which of the known names may have been meant.

    Args:
        name: the name that is not known.
        known: the names there are.
        otherwise: what to say where none comes close ("" to list the known names).

    Returns:
        "did you mean 'width'?", or ``otherwise``.
    """
    names = {k.lower(): k for k in known}
    close = [names[k] for k in difflib.get_close_matches(name.lower(), names, 3, 0.6)]
    if close:
        return "did you mean " + " or ".join(f"'{k}'" for k in close) + "?"
    if otherwise or not names:
        return otherwise or "there are none"
    return "known are " + ", ".join(sorted(names.values()))


class _TooMuchError(Exception):
    """The text is bigger than anything a person would write."""


class _Converter:
    """Turns PyYAML's nodes into ours."""

    def __init__(self, loader: yaml.SafeLoader, file: str, findings: list[Finding]) -> None:
        self._loader = loader
        self._file = file
        self._findings = findings
        self._count = 0

    def convert(self, node: yaml.Node, key: str, line: int, depth: int) -> Node:
        self._count += 1
        if self._count > MAX_NODES:
            raise _TooMuchError(f"more than {MAX_NODES} values, aliases expanded")
        if depth > MAX_DEPTH:
            raise _TooMuchError(
                f"nested more than {MAX_DEPTH} deep, or an anchor that contains itself"
            )
        tag = "" if node.tag.startswith(_STANDARD_TAG) else node.tag
        if isinstance(node, yaml.MappingNode):
            value: Any = self._mapping(node, key, depth)
        elif isinstance(node, yaml.SequenceNode):
            value = [
                self.convert(child, f"{key}[{i}]", child.start_mark.line + 1, depth + 1)
                for i, child in enumerate(node.value)
            ]
        else:
            value = self._scalar(node, tag, key, line)
        if tag and not isinstance(value, dict):
            self._findings.append(
                Finding(
                    f"the tag {tag} does not stand before a map",
                    f"write '{tag} {{}}' if all its fields shall have their default values",
                    self._file,
                    line,
                    key,
                )
            )
            tag = ""
            value = None
        return Node(value, tag, self._file, line, key)

    def _mapping(self, node: yaml.MappingNode, key: str, depth: int) -> dict[str, Node]:
        merged: dict[str, Node] = {}
        own: dict[str, Node] = {}
        for key_node, value_node in node.value:
            line = key_node.start_mark.line + 1
            if key_node.tag == _MERGE_TAG:
                sources = (
                    value_node.value if isinstance(value_node, yaml.SequenceNode) else [value_node]
                )
                for source in sources:
                    child = self.convert(source, key, line, depth + 1)
                    if isinstance(child.value, dict):
                        merged = {**child.value, **merged}
                    else:
                        self._findings.append(
                            child.finding("'<<' merges maps only", "name an anchor of a map")
                        )
                continue
            name = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
            if name is None or key_node.tag != "tag:yaml.org,2002:str":
                said = "a list or map" if name is None else f"'{name}'"
                self._findings.append(
                    Finding(
                        f"the key {said} is not text",
                        "write keys as plain words, in quotes if need be",
                        self._file,
                        line,
                        key,
                    )
                )
                continue
            path = f"{key}.{name}" if key else name
            if name in own:
                self._findings.append(
                    Finding(
                        f"the key '{name}' stands here a second time",
                        f"the first is in line {own[name].line}; keep one",
                        self._file,
                        line,
                        path,
                    )
                )
                continue
            own[name] = self.convert(value_node, path, line, depth + 1)
        return {**merged, **own}

    def _scalar(self, node: yaml.Node, tag: str, key: str, line: int) -> Any:
        if tag:
            return node.value
        try:
            value = self._loader.construct_object(node)
        except (yaml.YAMLError, ValueError, OverflowError, AttributeError, TypeError) as error:
            self._findings.append(
                Finding(f"'{node.value}' cannot be read: {error}", "", self._file, line, key)
            )
            return None
        if isinstance(value, str | int | float | bool | None):
            return value
        # A date, say: what the author meant is the text.
        return str(node.value)


def number(value: Any) -> float | None:
    """Reads a scalar as a number the way Drake's YAML does (``1e3`` counts as one).

    Args:
        value: a scalar of a :class:`Node`.

    Returns:
        The number, or None if it is not one.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.inf if isinstance(value, int) else None


def _syntax_mend(text: str, line: int) -> str:
    """A hint for the commonest slips."""
    lines = text.splitlines()
    if 0 < line <= len(lines) and "\t" in lines[line - 1]:
        return "YAML indents with spaces, not with tabs"
    return "check indentation, colons, brackets and quotes there and in the line before"
