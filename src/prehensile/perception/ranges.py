"""Numbers of a configuration, checked all alike."""

from typing import Any


def require_ranges(config: Any, **ranges: tuple[float, float]) -> None:
    """Checks that fields of a configuration lie in closed ranges; NaN lies in none.

    Args:
        config: has the fields as attributes.
        ranges: of each field by name, the lowest and the highest value.

    Raises:
        ValueError: naming the first field that is out of its range.
    """
    for name, (low, high) in ranges.items():
        value = getattr(config, name)
        if not low <= value <= high:
            raise ValueError(f"{name}: must lie in [{low:.6g}, {high:.6g}], not {value}")
