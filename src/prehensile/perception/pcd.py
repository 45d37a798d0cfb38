"""The PCD file format of the Point Cloud Library, version 0.7: ASCII, binary and compressed."""

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prehensile.errors import InputError

_KINDS = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"f": (4, 8), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8)}


def parse_pcd(data: bytes) -> tuple[dict[str, NDArray[Any]], NDArray[np.float64]]:
    """Reads the content of a PCD file.

    Args:
        data: the file's bytes, which need not be trusted.

    Returns:
        Its fields by name, arrays (N,) or (N, count); and the viewpoint (7,): the sensor's
        position x, y, z and its orientation as a quaternion w, x, y, z.

    Raises:
        InputError: if it is no PCD file, or broken, or ends early.
    """
    header, at = _header(data)
    try:
        names = header["FIELDS"]
        sizes = [int(s) for s in header["SIZE"]]
        kinds = [_KINDS[t] for t in header["TYPE"]]
        counts = [int(c) for c in header.get("COUNT", ["1"] * len(names))]
        default = str(int(header["WIDTH"][0]) * int(header["HEIGHT"][0]))
        points = int(header.get("POINTS", [default])[0])
        viewpoint = np.array(header.get("VIEWPOINT", [0, 0, 0, 1, 0, 0, 0]), dtype=np.float64)
        form = header["DATA"][0].lower()
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(f"the PCD header lacks or misstates {error}") from None
    same = len(names) == len(sizes) == len(kinds) == len(counts)
    if not same or any(s not in _SIZES[k] for s, k in zip(sizes, kinds, strict=True)):
        raise InputError("the PCD header's FIELDS, SIZE, TYPE and COUNT do not fit together")
    if not 0 <= points < 2**31 or any(not 0 <= c < 2**16 for c in counts):
        raise InputError("the PCD header's POINTS or COUNT is out of range")
    if viewpoint.shape != (7,) or not np.isfinite(viewpoint).all():
        raise InputError("the PCD header's VIEWPOINT is not seven finite numbers")
    # "_" stands for padding, which may occur more than once.
    keys = [f"_{i}" if n == "_" else n for i, n in enumerate(names)]
    if len(set(keys)) < len(keys):
        raise InputError("the PCD header names a field twice")
    dtypes = [np.dtype(f"<{k}{s}") for k, s in zip(kinds, sizes, strict=True)]
    if form == "ascii":
        columns = _ascii(data[at:], points, dtypes, counts)
    elif form == "binary":
        columns = _binary(data[at:], points, keys, dtypes, counts)
    elif form == "binary_compressed":
        columns = _compressed(data[at:], points, dtypes, counts)
    else:
        raise InputError(f"the PCD header's DATA is {form[:40]!r}; expected ascii or binary")
    fields = {
        key: column[:, 0] if count == 1 else column
        for key, column, count in zip(keys, columns, counts, strict=True)
        if not key.startswith("_")
    }
    return fields, viewpoint


def format_pcd(
    fields: Mapping[str, NDArray[Any]],
    viewpoint: ArrayLike = (0, 0, 0, 1, 0, 0, 0),
) -> bytes:
    """Writes fields, arrays (N,) of one length, as a binary PCD file.

    Args:
        fields: the columns by name.
        viewpoint: (7,) the sensor's position x, y, z and orientation as a quaternion w, x, y, z.
    """
    columns = list(fields.values())
    kinds = {"f": "F", "i": "I", "u": "U"}
    rows = np.zeros(
        len(columns[0]), dtype=[(n, v.dtype.newbyteorder("<")) for n, v in fields.items()]
    )
    for name, values in fields.items():
        rows[name] = values
    lines = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        "FIELDS " + " ".join(fields),
        "SIZE " + " ".join(str(v.dtype.itemsize) for v in columns),
        "TYPE " + " ".join(kinds[v.dtype.kind] for v in columns),
        "COUNT " + " ".join("1" for _ in columns),
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT " + " ".join(repr(float(v)) for v in np.asarray(viewpoint, dtype=float)),
        f"POINTS {len(rows)}",
        "DATA binary",
        "",
    ]
    return "\n".join(lines).encode() + rows.tobytes()


def _header(data: bytes) -> tuple[dict[str, list[str]], int]:
    """The header's entries by their first words, and where the content starts."""
    header: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in header:
        end = data.find(b"\n", at)
        if end < 0 or at > 65536:
            raise InputError("this is no PCD file: its header has no line DATA")
        words = data[at:end].decode("ascii", errors="replace").split()
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
        at = end + 1
    return header, at


def _short(points: int) -> InputError:
    return InputError(f"the PCD file ends before its {points} points")


def _ascii(
    data: bytes, points: int, dtypes: list[np.dtype], counts: list[int]
) -> list[NDArray[Any]]:
    words = data.split()
    width = sum(counts)
    if len(words) < points * width:
        raise _short(points)
    try:
        rows = np.array(words[: points * width], dtype=bytes).astype(np.float64)
    except ValueError:
        raise InputError("the PCD file holds a word that is no number") from None
    rows = rows.reshape(points, width)
    columns, at = [], 0
    for dtype, count in zip(dtypes, counts, strict=True):
        part = rows[:, at : at + count]
        if dtype.kind != "f":
            info = np.iinfo(dtype)
            if not np.all((part >= info.min) & (part <= info.max)):
                raise InputError("the PCD file holds a number that does not fit its type")
        with np.errstate(over="ignore"):
            columns.append(part.astype(dtype))
        at += count
    return columns


def _binary(
    data: bytes, points: int, keys: list[str], dtypes: list[np.dtype], counts: list[int]
) -> list[NDArray[Any]]:
    row = np.dtype([(k, d, (c,)) for k, d, c in zip(keys, dtypes, counts, strict=True)])
    if len(data) < points * row.itemsize:
        raise _short(points)
    if not row.itemsize:
        return [np.zeros((points, 0), dtype=d) for d in dtypes]
    rows = np.frombuffer(data, row, points)
    return [rows[key].astype(d) for key, d in zip(keys, dtypes, strict=True)]


def _compressed(
    data: bytes, points: int, dtypes: list[np.dtype], counts: list[int]
) -> list[NDArray[Any]]:
    size = sum(d.itemsize * c for d, c in zip(dtypes, counts, strict=True)) * points
    if len(data) < 8:
        raise _short(points)
    packed_size, unpacked_size = struct.unpack_from("<II", data)
    if unpacked_size != size or len(data) < 8 + packed_size:
        raise _short(points)
    unpacked = _decompress_lzf(data[8 : 8 + packed_size], size)
    columns, at = [], 0
    for dtype, count in zip(dtypes, counts, strict=True):  # One field after the other.
        column = np.frombuffer(unpacked, dtype, points * count, at)
        columns.append(column.reshape(points, count))
        at += dtype.itemsize * points * count
    return columns


def _decompress_lzf(packed: bytes, size: int) -> bytes:
    """Undoes LZF (Marc Lehmann, liblzf): literal runs, and copies of what was written before."""
    out = bytearray()
    at = 0
    try:
        while at < len(packed) and len(out) <= size:
            control = packed[at]
            at += 1
            if control < 32:
                out += packed[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            start = len(out) - ((control & 31) << 8) - packed[at] - 1
            at += 1
            length += 2
            if start < 0:
                raise InputError("the PCD file's compressed data are broken")
            while length > 0:  # A copy may reach into what it writes.
                piece = out[start : start + length]
                out += piece
                start += len(piece)
                length -= len(piece)
    except IndexError:
        raise InputError("the PCD file's compressed data end early") from None
    if len(out) != size:
        raise InputError("the PCD file's compressed data are broken")
    return bytes(out)
