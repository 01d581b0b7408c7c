"""From sound pressure to what a loudspeaker is given, as loud as the page on the web plays it.

A pressure of 2.5 Pa is as loud as can be, so that a walk is heard on small loudspeakers, and a
quiet walk sounds quiet beside a loud one. What is near or beyond that is rounded off: the blow on
a boarded floor is several times what else there is, and low. Below 50 Hz few loudspeakers give
anything, and such a blow has much of it. Levels know nothing of all this: they are of the pressure.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal

__all__ = ["FULL_SCALE", "LOWEST", "Loudness"]

FULL_SCALE = 2.5
"""Sound pressure that is played as loud as can be, Pa: a peak of 102 dB."""

LOWEST = 50.0
"""Frequency below which it is not played, Hz."""

_EVEN = 0.5
"""Share of full scale up to which nothing is rounded off."""


class Loudness:
    """Makes samples of a stream of sound pressure."""

    def __init__(self, sample_rate: int) -> None:
        """Start in silence.

        Args:
            sample_rate: Hz.
        """
        cut = signal.butter(2, LOWEST, btype="highpass", fs=sample_rate, output="sos")
        self._cut = np.asarray(cut)
        self._state = np.zeros((len(self._cut), 2))

    def play(self, pressure: NDArray[np.floating]) -> NDArray[np.float32]:
        """Return the next samples, within -1 and 1.

        Args:
            pressure: What follows the last call's, Pa. Shape: (samples,).

        Returns:
            Samples. Shape: (samples,).
        """
        heard, self._state = signal.sosfilt(self._cut, pressure, zi=self._state)
        return _round_off(heard / FULL_SCALE).astype(np.float32)


def _round_off(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return samples within -1 and 1, which are as they were up to half of that."""
    size = np.abs(samples)
    rounded = _EVEN + (1.0 - _EVEN) * np.tanh((size - _EVEN) / (1.0 - _EVEN))
    return np.where(size < _EVEN, samples, np.copysign(rounded, samples))
