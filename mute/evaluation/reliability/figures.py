"""A figure with its target beside it, and whether the target is met."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

__all__ = ["Figure", "PartResult", "Target", "shown", "worst"]


@dataclass(frozen=True)
class Target:
    """What a figure has to be. Bounds that are None ask for nothing."""

    at_least: float | None = None
    """Lowest value that will do."""
    at_most: float | None = None
    """Highest value that will do."""
    below: float | None = None
    """Value from which on it will not do any more."""

    def met(self, value: float) -> bool:
        """Tell whether a value will do; NaN, which was not to be had, does not."""
        return not (
            math.isnan(value)
            or (self.at_least is not None and value < self.at_least)
            or (self.at_most is not None and value > self.at_most)
            or (self.below is not None and value >= self.below)
        )

    def text(self, unit: str) -> str:
        """Return it in words, as `>= 98.0 %`."""
        bounds = ((">=", self.at_least), ("<=", self.at_most), ("<", self.below))
        return ", ".join(
            f"{sign} {shown(bound, unit)}" for sign, bound in bounds if bound is not None
        )


@dataclass(frozen=True)
class Figure:
    """One figure that is judged."""

    part: str
    """Name of the part that it belongs to."""
    name: str
    """What it is, in words; no other figure of the part is called so."""
    value: float
    """NaN where it was not to be had."""
    unit: str
    """Its unit; `share` for a share of 1, and nothing for a number."""
    target: Target
    """What it has to be."""

    @property
    def met(self) -> bool:
        """Whether the target is met."""
        return self.target.met(self.value)

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "part": self.part,
            "name": self.name,
            "value": self.value,
            "unit": self.unit,
            "target": self.target.text(self.unit),
            "met": self.met,
        }


@dataclass(frozen=True)
class PartResult:
    """What came of a part."""

    figures: Sequence[Figure]
    """What is judged."""
    tables: Mapping[str, Sequence[Mapping[str, Any]]]
    """What the figures are made of, by name: rows of plain data."""


def worst(values: Sequence[float], target: Target) -> float:
    """Return the value that is furthest from meeting a target; NaN if any was not to be had.

    Args:
        values: One or more.
        target: What each has to be: at least something, or else at most or below something.
    """
    if any(math.isnan(value) for value in values):
        return math.nan
    return min(values) if target.at_least is not None else max(values)


def shown(value: float | None, unit: str) -> str:
    """Return a figure as it is read: a share in per cent, others with three digits and the unit."""
    if value is None or math.isnan(value):
        return "-"
    if unit == "share":
        return f"{100.0 * value:.1f} %"
    return f"{value:.3g} {unit}".rstrip()
