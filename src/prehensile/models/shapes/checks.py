"""Checks of the arguments of the shape generators: every fault is an InputError."""

import math

import numpy as np
from numpy.typing import ArrayLike

from prehensile.errors import Finding, InputError

MAX_SEGMENTS = 512  # finer than any camera sees; 512 x 512 faces already fill 6 MB


def segments(name: str, value: int, low: int = 3, high: int = MAX_SEGMENTS) -> int:
    """Returns ``value`` if it is an integer in ``low..high``; raises InputError otherwise."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_whole or not low <= value <= high:
        raise InputError(
            Finding(
                f"{name} is {value!r}, which is no usable mesh resolution",
                f"give a whole number from {low} to {high}",
                key=name,
            )
        )
    return int(value)


def positive(name: str, value: float) -> float:
    """Returns ``value`` if it is a finite length above zero; raises InputError otherwise."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(
            Finding(f"{name} is {value!r}", "give a finite number above zero", key=name)
        )
    return float(value)


def in_range(name: str, value: float, low: float, high: float) -> float:
    """Returns ``value`` if it is in ``[low, high]``; raises InputError otherwise."""
    if not low <= value <= high:  # also catches NaN
        raise InputError(
            Finding(f"{name} is {value!r}", f"give a number from {low:g} to {high:g}", key=name)
        )
    return float(value)


def array(name: str, value: ArrayLike, columns: int, min_rows: int = 1) -> np.ndarray:
    """Returns ``value`` as finite float (N, columns) with N >= min_rows, or raises InputError."""
    try:
        result = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(Finding(f"{name} is not an array of numbers: {error}", key=name)) from None
    if result.ndim != 2 or result.shape[1] != columns or len(result) < min_rows:
        raise InputError(
            Finding(
                f"{name} has shape {result.shape}",
                f"give shape (N, {columns}) with N >= {min_rows}",
                key=name,
            )
        )
    if not np.isfinite(result).all():
        raise InputError(
            Finding(f"{name} contains NaN or infinity", "give finite numbers", key=name)
        )
    return result


def vector(name: str, value: ArrayLike, length: int) -> np.ndarray:
    """Returns ``value`` as finite float (length,), or raises InputError."""
    return array(name, np.asarray(value, dtype=float).reshape(1, -1), length)[0]
