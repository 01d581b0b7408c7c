"""Sound levels from A-weighted squares: time weighting, readings, and the figures made of them.

The detector is the exponential one of IEC 61672-1: the squared signal through a low pass of first
order with a time constant of 0.125 s (Fast) or 1 s (Slow). It is read 20 times a second, as the
sensor of the paper is. The squares may come at any rate: from the samples of a recording (`meter`)
or from energies at the rate of the physics.

Definitions, for levels L in dB:

- MNL, the paper's mean noise level: the arithmetic mean of the readings in dB.
- PNL, its peak noise level: the largest reading.
- L10 and L90: the readings' level that is exceeded for 10 % and 90 % of the time.
- LAeq: the level of the mean square over the whole time.
- LAFmax: the largest value of the detector at any sample, from the first one on; so it is never
  below PNL. With Slow time weighting it is what the standard calls LASmax.

The detector starts from silence, so its first readings are too low and would pull the mean.
Readings begin after four time constants (0.5 s for Fast, 4 s for Slow), when it lacks at most
0.08 dB of a steady level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = [
    "P_REF",
    "READINGS_PER_SECOND",
    "TIME_CONSTANTS",
    "LevelDetector",
    "Levels",
    "TimeWeighting",
    "figure_symbol",
    "settling_time",
]

P_REF = 20e-6
"""Reference sound pressure, Pa (IEC 61672-1: 0 dB)."""

READINGS_PER_SECOND = 20
"""Rate at which the detector is read, Hz (the paper's sensor)."""

TimeWeighting = Literal["fast", "slow"]
"""Names of the time weightings F and S."""

TIME_CONSTANTS: dict[TimeWeighting, float] = {"fast": 0.125, "slow": 1.0}
"""Time constants of the detector, s (IEC 61672-1:2013, 5.8.1)."""

_SETTLING = 4
"""Time constants that pass before the first reading."""

_REST = 1e-300
"""A detector's state below this is nothing: just above the slow denormal numbers."""


@dataclass(frozen=True)
class Levels:
    """Figures of one channel, in dB re the detector's reference.

    Minus infinity is the level of digital silence, NaN that of a recording without a reading.
    """

    mnl: float
    """Mean of the readings, dB."""
    pnl: float
    """Largest reading, dB."""
    laeq: float
    """Level of the mean square, dB."""
    lafmax: float
    """Largest value of the detector, dB."""
    l10: float
    """Reading exceeded for 10 % of the time, dB."""
    l90: float
    """Reading exceeded for 90 % of the time, dB."""
    seconds: float
    """Length of the signal, s."""
    sample_rate: int
    """Samples a second."""
    readings: int
    """How many readings the first, second and last two figures are made of."""


def settling_time(time_weighting: TimeWeighting) -> float:
    """Return the time before the first reading, s."""
    return _SETTLING * TIME_CONSTANTS[time_weighting]


def figure_symbol(name: str, time_weighting: TimeWeighting) -> str:
    """Return what a figure of `Levels` is usually called: LAFmax, or LASmax with Slow."""
    maximum = "LASmax" if time_weighting == "slow" else "LAFmax"
    return {"laeq": "LAeq", "lafmax": maximum}.get(name, name.upper())


class LevelDetector:
    """The exponential detector of any number of channels, streamed.

    Memory: 160 bytes a channel and second, for the readings.
    """

    def __init__(
        self,
        sample_rate: int,
        channels: int = 1,
        time_weighting: TimeWeighting = "fast",
        reference: float = P_REF,
    ) -> None:
        """Start from silence.

        Args:
            sample_rate: Squares a second, >= `READINGS_PER_SECOND`.
            channels: Number of channels, >= 1.
            time_weighting: "fast" or "slow".
            reference: Root mean square of 0 dB, in the unit of the signal, > 0.

        Raises:
            ValueError: If an argument is out of its range.
        """
        if sample_rate < READINGS_PER_SECOND:
            raise ValueError(f"sample_rate must be >= {READINGS_PER_SECOND}, got {sample_rate}")
        if channels < 1:
            raise ValueError(f"channels must be >= 1, got {channels}")
        if time_weighting not in TIME_CONSTANTS:
            allowed = " or ".join(get_args(TimeWeighting))
            raise ValueError(f"time_weighting must be {allowed}, got {time_weighting!r}")
        if not 0.0 < reference < math.inf:
            raise ValueError(f"reference must be > 0, got {reference}")
        self.sample_rate = sample_rate
        self.channels = channels
        self.reference = reference
        self._decay = math.exp(-1.0 / (sample_rate * TIME_CONSTANTS[time_weighting]))
        self._first_reading = round(settling_time(time_weighting) * READINGS_PER_SECOND)
        self._samples = 0
        self._forgotten = 0
        self._state = np.zeros((channels, 1))
        self._sum = np.zeros(channels)
        self._max = np.zeros(channels)
        self._readings: list[NDArray[np.float64]] = []
        self._reading_count = 0

    def update(self, squares: NDArray) -> None:
        """Take the next squares; any lengths of blocks give the same figures.

        Args:
            squares: Squared A-weighted signal, or its mean square over each step, >= 0.
                Shape: (channels, samples).

        Raises:
            ValueError: If the shape is wrong.
        """
        if squares.ndim != 2 or len(squares) != self.channels:
            raise ValueError(f"squares must be ({self.channels}, samples), got {squares.shape}")
        if squares.shape[1] == 0:
            return
        gain = 1.0 - self._decay
        # The recursion y[n] = decay y[n-1] + gain x[n]; the state is decay y[n].
        detected, state = signal.lfilter(
            [gain], [1.0, -self._decay], squares, axis=-1, zi=self._state
        )
        state[state < _REST] = 0.0
        self._state = state
        self._sum += squares.sum(axis=-1)
        np.maximum(self._max, detected.max(axis=-1), out=self._max)
        read = detected[:, self._reading_indices(squares.shape[1])]
        self._readings.append(read)
        self._reading_count += read.shape[1]
        self._samples += squares.shape[1]

    def forget(self) -> None:
        """Leave what came so far out of the figures and readings.

        The detector keeps what it has heard, so it need not settle again, and time goes on: the
        next reading is the one that would have come next.
        """
        self._first_reading = max(self._first_reading, self._readings_within(self._samples) + 1)
        self._forgotten = self._samples
        self._sum[:], self._max[:] = 0.0, 0.0
        self._readings, self._reading_count = [], 0

    @property
    def level(self) -> NDArray[np.float64]:
        """What the detector shows now, dB. Shape: (channels,)."""
        return self._decibels(self._state[:, 0] / self._decay)

    @property
    def exposure(self) -> NDArray[np.float64]:
        """Integral of the squares over time, signal unit squared s. Shape: (channels,)."""
        return self._sum / self.sample_rate

    @property
    def readings(self) -> NDArray[np.float64]:
        """Levels read at `reading_times`, dB. Shape: (channels, readings)."""
        none_yet = np.zeros((self.channels, 0))
        # Put together once: whoever asks each second for hours is not to wait longer each time.
        self._readings = [np.concatenate([none_yet, *self._readings], axis=1)]
        return self._decibels(self._readings[0])

    @property
    def reading_times(self) -> NDArray[np.float64]:
        """Times of the readings since the start, s. Shape: (readings,)."""
        return self.reading_times_from(0)

    def reading_times_from(self, number: int) -> NDArray[np.float64]:
        """Return the times of the readings from a number on, s; the first has the number 0.

        It takes no longer after many readings than after few.
        """
        numbers = np.arange(number, self._reading_count)
        return (self._first_reading + numbers) / READINGS_PER_SECOND

    def result(self) -> list[Levels]:
        """Return the figures of what came so far and was not forgotten, one for each channel.

        Raises:
            ValueError: If nothing came.
        """
        samples = self._samples - self._forgotten
        if samples == 0:
            raise ValueError("no levels of an empty signal")
        means = self._decibels(self._sum / samples)
        maxima = self._decibels(self._max)
        return [
            Levels(
                **_figures(readings),
                laeq=float(mean),
                lafmax=float(maximum),
                seconds=samples / self.sample_rate,
                sample_rate=self.sample_rate,
                readings=len(readings),
            )
            for readings, mean, maximum in zip(self.readings, means, maxima, strict=True)
        ]

    def _reading_indices(self, length: int) -> NDArray[np.int64]:
        """Return where in the next `length` samples the detector is read.

        Reading k comes after sample number round(k sample_rate / 20), in whole numbers.
        """
        begin = max(self._readings_within(self._samples) + 1, self._first_reading)
        end = self._readings_within(self._samples + length)
        numbers = np.arange(begin, end + 1, dtype=np.int64)
        rate = READINGS_PER_SECOND
        return (numbers * self.sample_rate + rate // 2) // rate - 1 - self._samples

    def _readings_within(self, samples: int) -> int:
        """Return how many readings there are in so many samples from the start, settled or not."""
        rate = READINGS_PER_SECOND
        return (rate * samples + rate // 2 - 1) // self.sample_rate

    def _decibels(self, mean_squares: NDArray[np.float64]) -> NDArray[np.float64]:
        with np.errstate(divide="ignore"):  # the level of silence is minus infinity
            return 10.0 * np.log10(mean_squares / self.reference**2)


def _figures(readings: NDArray[np.float64]) -> dict[str, float]:
    """Return the figures that are made of one channel's readings."""
    if len(readings) == 0:
        return dict.fromkeys(("mnl", "pnl", "l10", "l90"), math.nan)
    # A level that was read, not one between two: so silence cannot make a NaN of it.
    l90, l10 = np.percentile(readings, [10.0, 90.0], method="inverted_cdf")
    return {
        "mnl": float(readings.mean()),
        "pnl": float(readings.max()),
        "l10": float(l10),
        "l90": float(l90),
    }
