"""What is added up of robots over the times that count for each, and the figures made of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.metering.levels import P_REF

__all__ = ["HeardLevels", "Tally"]


@dataclass(frozen=True)
class HeardLevels:
    """Figures of one robot over the time that counts, dBA re 20 uPa; NaN where there was none."""

    mnl: float
    """Mean of the readings."""
    pnl: float
    """Largest reading."""
    laeq: float
    """Level of the mean square."""
    sources: Mapping[str, float]
    """Level of the mean square of each source that is heard, from `EnergyMeter`; -inf where it is
    silent."""
    seconds: float
    """The time that counts, s."""
    power: float
    """Mean over that time, and all its physics steps, of the sum over joints of |torque times
    velocity|, W."""


class Tally:
    """Adds up what comes of each robot while it counts."""

    def __init__(self, num_robots: int, sources: Sequence[str]) -> None:
        """Start at zero, with nobody who counts.

        Args:
            num_robots: Number of robots.
            sources: Names of the sources that are told apart.
        """
        self.counting = np.zeros(num_robots, dtype=bool)
        """Robots for which what comes counts; change it once all before is taken in."""
        self._sources = tuple(sources)
        # Rows: time in s; work in J; exposure, in all and of each source, in Pa^2 s.
        self._sums = np.zeros((3 + len(self._sources), num_robots))
        self._taken = np.zeros_like(self._sums)

    def take(
        self, seconds: float, work: NDArray, exposure: NDArray, sources: Mapping[str, NDArray]
    ) -> None:
        """Take in what came since the last time, given what came in all.

        Args:
            seconds: Time, s.
            work: Sum over joints of the integral of |torque times velocity|, J. Shape: (robots,).
            exposure: A-weighted sound exposure, Pa^2 s. Shape: (robots,).
            sources: That of each source. Shape of each: (robots,).
        """
        own = [sources[name] for name in self._sources]
        totals = np.stack((np.full_like(exposure, seconds), work, exposure, *own))
        self._sums += np.where(self.counting, totals - self._taken, 0.0)
        self._taken = totals

    def figures(self, readings: Sequence[NDArray]) -> list[HeardLevels]:
        """Return the figures of each robot.

        Args:
            readings: Those of each robot that count, dBA.
        """
        return [
            self._of_one(own, sums.tolist())
            for own, sums in zip(readings, self._sums.T, strict=True)
        ]

    def _of_one(self, readings: NDArray, sums: Sequence[float]) -> HeardLevels:
        seconds, work, *exposures = sums
        laeq, *sources = (_level(exposure, seconds) for exposure in exposures)
        return HeardLevels(
            mnl=float(readings.mean()) if len(readings) else math.nan,
            pnl=float(readings.max()) if len(readings) else math.nan,
            laeq=laeq,
            sources=dict(zip(self._sources, sources, strict=True)),
            seconds=seconds,
            power=work / seconds if seconds > 0.0 else math.nan,
        )


def _level(exposure: float, seconds: float) -> float:
    """Return the equivalent level of an exposure in Pa^2 s over a time in s, dBA."""
    if seconds <= 0.0:
        return math.nan
    return 10.0 * math.log10(exposure / (seconds * P_REF**2)) if exposure > 0.0 else -math.inf
