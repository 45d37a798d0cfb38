"""The PLY file format: elements with named properties, in ASCII or binary.

Source: Greg Turk, "The PLY Polygon File Format" (1994).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prehensile.errors import Finding, InputError

Element = dict[str, NDArray[Any]]

_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_NAMES = {"i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort"} | {
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: str
    count_dtype: str = ""  # Of a list's length; "" for a single number.


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]


def parse_ply(data: bytes) -> dict[str, Element]:
    """Reads the content of a PLY file.

    Args:
        data: the file's bytes, which need not be trusted.

    Returns:
        For each element its properties by name: arrays (count,), and for list properties
        (count, k) where all lists have k entries. Polygons of several sizes are cut into fans of
        triangles, (more than count, 3).

    Raises:
        InputError: if it is no PLY file, or broken, or ends early.
    """
    form, elements, at = _header(data)
    result: dict[str, Element] = {}
    tokens = data[at:].split() if form == "ascii" else []
    token = 0
    for element in elements:
        if form == "ascii":
            columns, token = _ascii_rows(element, tokens, token)
        else:
            columns, at = _binary_rows(element, data, at, "<" if "little" in form else ">")
        result[element.name] = columns
    return result


def format_ply(elements: Mapping[str, Mapping[str, NDArray[Any]]]) -> bytes:
    """Writes elements as a binary little-endian PLY file.

    Args:
        elements: for each element its properties by name: arrays (count,), or (count, k) for
            lists of k numbers.
    """
    header = ["ply", "format binary_little_endian 1.0"]
    body = []
    for name, columns in elements.items():
        fields: list[tuple] = []
        count = len(next(iter(columns.values())))
        header.append(f"element {name} {count}")
        for key, values in columns.items():
            code = f"{values.dtype.kind}{values.dtype.itemsize}"
            if values.ndim == 1:
                header.append(f"property {_NAMES[code]} {key}")
                fields.append((key, "<" + code))
            else:
                header.append(f"property list uchar {_NAMES[code]} {key}")
                fields += [(f"{key} length", "u1"), (key, "<" + code, (values.shape[1],))]
        rows = np.zeros(count, dtype=fields)
        for key, values in columns.items():
            rows[key] = values
            if values.ndim == 2:
                rows[f"{key} length"] = values.shape[1]
        body.append(rows.tobytes())
    return "\n".join([*header, "end_header", ""]).encode() + b"".join(body)


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    """Format, elements, and where the content starts."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise InputError("this is no PLY file: it has no header from 'ply' to 'end_header'")
    newline = data.find(b"\n", end)
    at = newline + 1 if newline >= 0 else len(data)
    form = ""
    elements: list[_Element] = []
    lines = data[:end].decode("ascii", errors="replace").splitlines()
    for number, line in enumerate(lines[1:], start=2):
        try:
            match line.split():
                case ["format", ("ascii" | "binary_little_endian" | "binary_big_endian") as f, _]:
                    form = f
                case ["element", name, count]:
                    elements.append(_Element(name, int(count), []))
                    if not 0 <= elements[-1].count < 2**31:
                        raise ValueError("count out of range")
                case ["property", "list", count_type, value_type, name]:
                    prop = _Property(name, _TYPES[value_type], _TYPES[count_type])
                    elements[-1].properties.append(prop)
                case ["property", value_type, name]:
                    elements[-1].properties.append(_Property(name, _TYPES[value_type]))
                case [] | ["comment" | "obj_info", *_]:
                    pass
                case _:
                    raise ValueError("not understood")
        except (ValueError, KeyError, IndexError):
            raise InputError(
                Finding(f"the PLY header's line {number} is wrong: {line[:80]!r}", line=number)
            ) from None
    if not form:
        raise InputError("the PLY header names no format")
    for element in elements:
        names = [p.name for p in element.properties]
        if len(set(names)) < len(names):
            raise InputError(f"the PLY element {element.name!r} names a property twice")
    return form, elements, at


def _short(element: _Element) -> InputError:
    return InputError(f"the PLY file ends before its {element.count} rows of {element.name!r}")


def _ascii_rows(element: _Element, tokens: list[bytes], at: int) -> tuple[Element, int]:
    """Columns of an element from words, and the place after them."""
    if element.count * len(element.properties) > len(tokens) - at:
        raise _short(element)
    try:
        if not any(p.count_dtype for p in element.properties):
            width = len(element.properties)
            stop = at + element.count * width
            rows = np.array(tokens[at:stop], dtype=bytes).astype(np.float64)
            rows = rows.reshape(element.count, width)
            columns: Element = {
                p.name: _narrowed(rows[:, i], p.dtype) for i, p in enumerate(element.properties)
            }
            return columns, stop
        lists: dict[str, list[list[float]]] = {p.name: [] for p in element.properties}
        for _ in range(element.count):
            for p in element.properties:
                length = 1
                if p.count_dtype:
                    length, at = int(tokens[at]), at + 1
                if length < 0 or at + length > len(tokens):
                    raise _short(element)
                lists[p.name].append([float(t) for t in tokens[at : at + length]])
                at += length
    except (ValueError, OverflowError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"the PLY element {element.name!r} holds a word that is no number"
        ) from None
    return {p.name: _column(p, lists[p.name]) for p in element.properties}, at


def _binary_rows(element: _Element, data: bytes, at: int, order: str) -> tuple[Element, int]:
    """Columns of an element from bytes, and the place after them."""
    # First as if all lists were as long as in the first row: then rows are all alike.
    fields: list[tuple] = []
    place = at
    for p in element.properties:
        if p.count_dtype:
            length = _number(data, place, order + p.count_dtype, element) if element.count else 0
            if not 0 <= length <= len(data):
                raise _short(element)
            fields += [
                (f"{p.name} length", order + p.count_dtype),
                (p.name, order + p.dtype, (int(length),)),
            ]
        else:
            fields.append((p.name, order + p.dtype))
        place = at + np.dtype(fields).itemsize
    dtype = np.dtype(fields)
    stop = at + dtype.itemsize * element.count
    uniform = stop <= len(data)
    if uniform:
        rows = np.frombuffer(data, dtype, element.count, at) if dtype.itemsize else None
        columns: Element = {}
        for p in element.properties:
            assert rows is not None
            columns[p.name] = rows[p.name].astype(p.dtype)
            if p.count_dtype and element.count:
                lengths = rows[f"{p.name} length"]
                uniform = uniform and bool((lengths == columns[p.name].shape[1]).all())
        if uniform:
            return columns, stop
    if not any(p.count_dtype for p in element.properties):
        raise _short(element)
    lists: dict[str, list[list[float]]] = {p.name: [] for p in element.properties}
    for _ in range(element.count):
        for p in element.properties:
            length = 1
            if p.count_dtype:
                length = int(_number(data, at, order + p.count_dtype, element))
                at += np.dtype(p.count_dtype).itemsize
            size = length * np.dtype(p.dtype).itemsize
            if length < 0 or at + size > len(data):
                raise _short(element)
            lists[p.name].append(np.frombuffer(data, order + p.dtype, length, at).tolist())
            at += size
    return {p.name: _column(p, lists[p.name]) for p in element.properties}, at


def _number(data: bytes, at: int, dtype: str, element: _Element) -> float:
    if at + np.dtype(dtype).itemsize > len(data):
        raise _short(element)
    value = np.frombuffer(data, dtype, 1, at)[0]
    return float(value) if np.isfinite(value) else -1.0


def _column(p: _Property, lists: list[list[float]]) -> NDArray[Any]:
    """One property's rows as an array; lists of several lengths as fans of triangles."""
    lengths = {len(row) for row in lists}
    if not p.count_dtype:
        return _narrowed(np.array(lists, dtype=np.float64).reshape(len(lists)), p.dtype)
    if len(lengths) > 1:
        lists = [[row[0], b, c] for row in lists for b, c in pairwise(row[1:])]
    width = len(lists[0]) if lists else 0
    return _narrowed(np.array(lists, dtype=np.float64).reshape(len(lists), width), p.dtype)


def _narrowed(values: NDArray[np.float64], dtype: str) -> NDArray[Any]:
    """Numbers as the type that the header promises.

    Raises:
        ValueError: if one does not fit an integer type.
    """
    if dtype[0] != "f":
        info = np.iinfo(dtype)
        if not np.all((values >= info.min) & (values <= info.max)):
            raise InputError(f"the PLY file holds a number that does not fit {_NAMES[dtype]}")
    with np.errstate(over="ignore"):
        return values.astype(dtype)
