"""Levels in third octaves, unweighted, by the filters of IEC 61260-1.

The bands are those of base ten: mid-band frequencies of 1000 Hz * 10^(k / 10), edges a twentieth of
a decade below and above. Each has a Butterworth band-pass made of a low-pass of order 6, -3.01 dB
at the edges, which meets the standard's class 1 and takes 0.05 dB more of a steady noise than an
ideal band would.

A filter is well-conditioned where its band is not far below the sample rate. So the signal is
halved in rate, and halved again; each band is taken from the lowest rate that is four times its
upper edge or more. A low-pass before each halving leaves up to an eighth of its rate as it is,
within 1e-4 dB, and lowers what would fold into that by 100 dB.

A filter needs time to answer. A band's level begins 3 / bandwidth after the start (0.52 s at 25 Hz,
13 ms at 1 kHz), when it lacks at most 0.1 dB of a steady noise; close to half the sample rate it
may lack 0.3 dB, for less than 2 ms.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mute.acoustics.metering.levels import P_REF
from mute.acoustics.metering.running_filter import RunningFilter

__all__ = ["ThirdOctave", "ThirdOctaveLevel", "ThirdOctaveMeter", "third_octaves"]

_NOMINAL = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
"""Nominal frequencies of a decade (IEC 61260-1:2014, annex E, table E.1)."""

_LOWEST, _HIGHEST = 14, 43
"""Numbers of the bands of 25 Hz and 20 kHz: ten times the logarithm of the mid-band frequency."""

_CARRIED = 0.47
"""Largest upper edge, as a share of the sample rate (chosen: 48 kHz carries 20 kHz, 0.466)."""

_ORDER = 6
"""Of the low-pass that the Butterworth filters are made of."""

_OVERSAMPLING = 4.0
"""Smallest sample rate that a band is taken from, in upper edges."""

_ANSWER = 3.0
"""Time before a band has a level, in units of 1 / bandwidth."""


@dataclass(frozen=True)
class ThirdOctave:
    """A band (IEC 61260-1:2014, 5.2 to 5.5)."""

    nominal: float
    """The frequency that it is called by, Hz."""
    low: float
    """Lower edge, Hz."""
    high: float
    """Upper edge, Hz."""

    @property
    def width(self) -> float:
        """Bandwidth, Hz."""
        return self.high - self.low


@dataclass(frozen=True)
class ThirdOctaveLevel:
    """The level in a band."""

    frequency: float
    """Nominal frequency, Hz."""
    level: float
    """dB; minus infinity of digital silence, NaN where the sound ends before the filter answers."""


def third_octaves(sample_rate: float) -> list[ThirdOctave]:
    """Return the bands from 25 Hz to 20 kHz that a sample rate carries.

    Args:
        sample_rate: Hz.
    """
    bands = []
    for number in range(_LOWEST, _HIGHEST + 1):
        decade, within = divmod(number, 10)
        nominal = round(_NOMINAL[within] * 10.0**decade, 1)
        low, high = 10.0 ** ((number - 0.5) / 10.0), 10.0 ** ((number + 0.5) / 10.0)
        if high <= _CARRIED * sample_rate:
            bands.append(ThirdOctave(nominal, low, high))
    return bands


class ThirdOctaveMeter:
    """The spectrum of the energy mean of any number of channels, streamed."""

    def __init__(self, sample_rate: int, reference: float = P_REF) -> None:
        """Start from a constant of the first sample's value.

        Args:
            sample_rate: Hz.
            reference: Root mean square of 0 dB, in the unit of the samples, > 0.
        """
        self._reference = reference
        self._rates: list[_Rate] = []
        self._halvings: list[_Halving] = []
        bands = third_octaves(sample_rate)
        rate = float(sample_rate)
        while bands:
            kept = [band for band in bands if 2.0 * _OVERSAMPLING * band.high > rate]
            bands = [band for band in bands if band not in kept]
            self._rates.append(_Rate(rate, kept))
            self._halvings.append(_Halving())
            rate /= 2.0

    def update(self, block: NDArray) -> None:
        """Take the next samples; any lengths of blocks give the same figures.

        Args:
            block: Shape: (channels, samples).
        """
        for rate, halving in zip(self._rates, self._halvings, strict=True):
            if block.shape[1] == 0:
                return
            rate.update(block)
            if rate is not self._rates[-1]:
                block = halving.halve(block)

    def forget(self) -> None:
        """Leave what came so far out of the figures; the filters keep what they have heard."""
        for rate in self._rates:
            rate.forget()

    def result(self) -> list[ThirdOctaveLevel]:
        """Return the levels of what came so far, from the lowest band on."""
        levels = []
        for rate in reversed(self._rates):
            means = rate.means() / self._reference**2
            with np.errstate(divide="ignore"):  # the level of silence is minus infinity
                decibels = 10.0 * np.log10(means)
            levels += [
                ThirdOctaveLevel(band.nominal, float(level))
                for band, level in zip(rate.bands, decibels, strict=True)
            ]
        return levels


@functools.lru_cache(maxsize=256)  # designing them takes longer than a second of sound
def _band_pass(band: ThirdOctave, sample_rate: float) -> NDArray[np.float64]:
    """Return a band's filter as second-order sections. Shape: (6, 6)."""
    edges = [band.low, band.high]
    return np.asarray(signal.butter(_ORDER, edges, "bandpass", output="sos", fs=sample_rate))


class _Rate:
    """The signal at one sample rate, and the bands that are taken from it."""

    def __init__(self, sample_rate: float, bands: Sequence[ThirdOctave]) -> None:
        self.bands = bands
        self._filters = [RunningFilter(_band_pass(band, sample_rate)) for band in bands]
        self._begins = [math.ceil(_ANSWER / band.width * sample_rate) for band in bands]
        self._samples = 0
        self._sums = np.zeros(len(bands))
        self._counts = np.zeros(len(bands), dtype=np.int64)

    def update(self, block: NDArray) -> None:
        """Take the next samples. Shape: (channels, samples)."""
        for band, (running, begin) in enumerate(zip(self._filters, self._begins, strict=True)):
            heard = running.filter(block)[:, max(begin - self._samples, 0) :]
            self._sums[band] += np.vdot(heard, heard) / len(block)
            self._counts[band] += heard.shape[1]
        self._samples += block.shape[1]

    def forget(self) -> None:
        """Leave what came so far out of the means."""
        self._sums[:], self._counts[:] = 0.0, 0

    def means(self) -> NDArray[np.float64]:
        """Return the mean squares, NaN where nothing was heard. Shape: (bands,)."""
        heard = np.where(self._counts > 0, self._counts, np.nan)
        return self._sums / heard


class _Halving:
    """Every second sample of a stream, after a low-pass."""

    _LOW_PASS = np.asarray(signal.cheby2(10, 100.0, 0.75, output="sos"))
    """Down by 100 dB from three eighths of the sample rate on."""

    def __init__(self) -> None:
        self._filter = RunningFilter(self._LOW_PASS)
        self._skip = 0

    def halve(self, block: NDArray) -> NDArray[np.float64]:
        """Return the next samples at half the rate.

        Args:
            block: Shape: (channels, samples).

        Returns:
            Shape: (channels, samples / 2, rounded up or down by the parity of those before).
        """
        halved = self._filter.filter(block)[:, self._skip :: 2]
        self._skip = (self._skip - block.shape[1]) % 2
        return halved
