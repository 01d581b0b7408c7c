"""Band noise, streamed: the raw material of scuffing, drive and fan.

The white noise is shaped in time first and filtered after: so steps of the envelope make no clicks,
and a filter that has rung out may rest without any difference to the result.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from mute.acoustics.metering.weighting import a_weighting_db

__all__ = ["BandNoise", "Stream", "band_a_weight", "band_filter", "filter_response", "spread"]

_ANGLES = (np.arange(1 << 14) + 0.5) * np.pi / (1 << 14)
"""Frequencies at which responses are summed up, from 0 to half the sample rate, rad a sample."""

_REST = 1e-30
"""A filter's state below this is nothing, Pa: far below hearing and far above denormal numbers."""


def band_filter(band: tuple[float, float], sample_rate: int) -> tuple[NDArray, NDArray]:
    """Return a band-pass filter b, a that gives white noise of unit variance unit variance again.

    First-order slopes (6 dB an octave) on both sides of the band, with zeros at 0 Hz and at half
    the sample rate.

    Args:
        band: Lower and upper edge (3 dB down), Hz.
        sample_rate: Hz.
    """
    upper = min(band[1], 0.45 * sample_rate)
    sections = signal.butter(1, (band[0], upper), btype="bandpass", fs=sample_rate, output="sos")
    b, a = np.split(np.asarray(sections)[0], 2)
    return b / np.sqrt(np.mean(np.abs(filter_response(b, a, _ANGLES)) ** 2)), a


def filter_response(b: NDArray, a: NDArray, angle: NDArray) -> NDArray:
    """Return the complex response of a filter b, a of equal orders.

    Args:
        b: Numerator, in falling powers of z.
        a: Denominator.
        angle: Frequency, rad a sample. Any shape.
    """
    z = np.exp(1j * angle)
    return np.polyval(b, z) / np.polyval(a, z)


def band_a_weight(band: tuple[float, float], sample_rate: int) -> float:
    """Return the share of the mean square of `band_filter`'s noise that the A-weighting leaves.

    Args:
        band: Lower and upper edge, Hz.
        sample_rate: Hz.
    """
    power = np.abs(filter_response(*band_filter(band, sample_rate), _ANGLES)) ** 2
    weight = 10.0 ** (a_weighting_db(_ANGLES * sample_rate / (2.0 * np.pi)) / 10.0)
    return float((power * weight).sum() / power.sum())


def spread(per_step: NDArray, bounds: NDArray) -> NDArray:
    """Hold the values of physics steps over their samples.

    Args:
        per_step: Values. Shape: (steps, robots).
        bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).

    Returns:
        Values by sample. Shape: (robots, samples).
    """
    return np.repeat(per_step.T, np.diff(bounds), axis=1)


class Stream:
    """A linear filter with memory for each robot, that rests where it has nothing to do."""

    def __init__(self, b: NDArray, a: NDArray, num_robots: int) -> None:
        """Start at rest.

        Args:
            b: Numerator.
            a: Denominator.
            num_robots: Number of signals.
        """
        self._b, self._a = b, a
        self._state = np.zeros((num_robots, max(len(a), len(b)) - 1))

    def busy(self) -> NDArray[np.bool_]:
        """Return which signals still ring. Shape: (robots,)."""
        return np.any(self._state != 0.0, axis=1)

    def filter(self, signals: NDArray, rows: NDArray) -> NDArray:
        """Filter the next samples of some robots' signals.

        Args:
            signals: Their samples. Shape: (len(rows), samples).
            rows: Indices of the robots.

        Returns:
            What comes out. Shape: (len(rows), samples).
        """
        out, state = signal.lfilter(self._b, self._a, signals, axis=-1, zi=self._state[rows])
        state[np.abs(state).max(axis=1) < _REST] = 0.0
        self._state[rows] = state
        return out


class BandNoise:
    """One stream of band noise for each robot, independent of each other."""

    def __init__(
        self,
        bands: tuple[tuple[float, float], ...],
        num_robots: int,
        sample_rate: int,
        seed: tuple[int, ...],
    ) -> None:
        """Prepare the filters.

        Args:
            bands: Bands that the noise can be in, Hz.
            num_robots: Number of streams.
            sample_rate: Hz.
            seed: Same seed, same noise, whatever the lengths it is drawn in.
        """
        self._streams = tuple(Stream(*band_filter(band, sample_rate), num_robots) for band in bands)
        self._generator = np.random.default_rng(seed)
        self._num_robots = num_robots

    def render(self, mean_squares: list[NDArray], bounds: NDArray) -> NDArray:
        """Return the next samples: noise of a given mean square in each band, summed.

        Args:
            mean_squares: For each band, held over each step, Pa^2. Shape of each: (steps, robots).
            bounds: Sample at which each step begins, and the end of the last. Shape: (steps + 1,).

        Returns:
            Pressure, Pa. Shape: (robots, samples).
        """
        samples = int(bounds[-1] - bounds[0])
        # One row a sample: then the numbers do not depend on how many are drawn at a time.
        white = self._generator.standard_normal((samples, self._num_robots), dtype=np.float32).T
        out = np.zeros((self._num_robots, samples))
        for stream, squares in zip(self._streams, mean_squares, strict=True):
            rows = np.flatnonzero(stream.busy() | squares.any(axis=0))
            if len(rows):
                shaped = white[rows] * spread(np.sqrt(squares[:, rows]), bounds)
                out[rows] += stream.filter(shaped, rows)
        return out
