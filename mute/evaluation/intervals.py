"""How far a mean or a median can be trusted."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import quantile_test, t

__all__ = ["LEVEL", "MedianInterval", "mean_with_interval", "median_interval", "with_interval"]

LEVEL = 0.95
"""Confidence level of an interval."""


def mean_with_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Return mean, standard deviation and half width of the mean's interval (Student's t).

    Of one value the last two are NaN, of none all three.

    Args:
        values: Any number of them.
    """
    count = len(values)
    if count < 2:
        return values[0] if values else math.nan, math.nan, math.nan
    mean = statistics.fmean(values)
    deviation = math.sqrt(sum((value - mean) ** 2 for value in values) / (count - 1))
    half_width = float(t.ppf(0.5 + 0.5 * LEVEL, count - 1)) * deviation / count**0.5
    return mean, deviation, half_width


def with_interval(mean: float, half_width: float | None) -> str:
    """Return a level with its interval in words, and alone where there is none (None or NaN)."""
    known = half_width is not None and not math.isnan(half_width)
    return f"{mean:.1f} ± {half_width:.1f}" if known else f"{mean:.1f}"


@dataclass(frozen=True)
class MedianInterval:
    """A median and the interval that holds the true one at the level `LEVEL` or above."""

    median: float
    """Median of the values."""
    low: float | None
    """Lower bound; None of fewer than six values, which are too few for any interval."""
    high: float | None
    """Upper bound; likewise."""

    @property
    def half_width(self) -> float:
        """Half the interval's width as a share of the median; infinite where there is none."""
        if self.low is None or self.high is None:
            return math.inf
        return 0.5 * (self.high - self.low) / self.median


def median_interval(values: Sequence[float]) -> MedianInterval:
    """Return the median of some values and its distribution-free confidence interval.

    The interval goes from the k-th smallest value to the k-th largest one. It holds the true median
    unless fewer than k values lie on one side of it, and how many do is binomial with p = 1/2; k is
    the largest for which that is improbable enough (Conover, Practical Nonparametric Statistics,
    3.2; `scipy.stats.quantile_test`). So it asks nothing of how values are distributed, but that
    one says nothing of the next.

    Args:
        values: Positive, one or more.
    """
    bounds = quantile_test(values, p=0.5).confidence_interval(confidence_level=LEVEL)
    low, high = (None if math.isnan(bound) else float(bound) for bound in bounds)
    return MedianInterval(statistics.median(values), low, high)
