"""Numbers that a field or an option may have; none of them is infinite or NaN."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real

__all__ = ["Range", "check_number", "check_ordered", "check_ranges"]


@dataclass(frozen=True)
class Range:
    """The numbers from one to another; without an upper end, all finite ones."""

    low: float
    """Smallest number."""
    high: float = math.inf
    """Largest number."""
    above: bool = False
    """Whether the smallest number itself is left out."""
    whole: bool = False
    """Whether it must be an integer."""

    def holds(self, value: float) -> bool:
        """Tell whether a number lies within; what is none does not."""
        if not isinstance(value, Real) or isinstance(value, bool):
            return False
        if self.whole and not isinstance(value, int):
            return False
        inside = self.low < value if self.above else self.low <= value
        return inside and value <= self.high and value < math.inf

    def __str__(self) -> str:
        """Return it in the words of an error: `> 0 and finite`, `>= 1 and <= 100`."""
        lowest = f"{'>' if self.above else '>='} {_digits(self.low)}"
        highest = "finite" if self.high == math.inf else f"<= {_digits(self.high)}"
        return f"{'an integer ' if self.whole else ''}{lowest} and {highest}"


def check_ranges(cfg: object, place: str, ranges: Mapping[str, Range]) -> None:
    """Check fields of a configuration; of a field with several numbers, each.

    Args:
        cfg: The configuration.
        place: What stands before the names of its fields.
        ranges: What each field may be.

    Raises:
        ValueError: If one is out of its range.
    """
    for name, allowed in ranges.items():
        value = getattr(cfg, name)
        numbers = value if isinstance(value, tuple | list) else (value,)
        if not all(map(allowed.holds, numbers)):
            raise ValueError(f"{place}.{name} must be {allowed}, got {value}")


def check_number(name: str, value: float, allowed: Range) -> None:
    """Check one number under its whole name.

    Raises:
        ValueError: If it is out of its range.
    """
    if not allowed.holds(value):
        raise ValueError(f"{name} must be {allowed}, got {value}")


def check_ordered(cfg: object, place: str, *names: str) -> None:
    """Check that fields hold two numbers each, of which the second is no smaller.

    Args:
        cfg: The configuration.
        place: What stands before the names of its fields.
        *names: The fields.

    Raises:
        ValueError: If one does not.
    """
    for name in names:
        value = getattr(cfg, name)
        if not isinstance(value, tuple | list) or len(value) != 2 or value[0] > value[1]:
            raise ValueError(f"{place}.{name} must be (low, high) with low <= high, got {value}")


def _digits(value: float) -> str:
    return str(int(value)) if math.isfinite(value) and value == int(value) else str(value)
