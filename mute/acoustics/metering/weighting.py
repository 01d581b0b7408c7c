"""The A-weighting of IEC 61672-1 as a digital filter that runs over a signal block by block.

The standard defines the weighting by an analogue circuit: four zeros at 0 Hz, poles at 20.6 Hz
(twice), 107.7 Hz, 737.9 Hz and 12.19 kHz (twice). The digital filter keeps those poles, z =
exp(-2 pi f / sample rate), and the zeros at 0 Hz; four more zeros are fitted so that its magnitude
follows the standard's up to 20 kHz, or to half the sample rate where that is lower. The bilinear
transform alone would be 8 dB too low at 16 kHz and a sample rate of 44.1 kHz.

Largest deviation up to 20 kHz at sample rates of 44.1 kHz and more: 0.1 dB. At lower rates, down to
8 kHz: 0.15 dB up to 95 % of half the sample rate, 0.4 dB above. Above 192 kHz two zeros are fitted,
which leave less than 0.0001 dB; with four the fit would be ill-conditioned. Time weightings and
levels are in `levels`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal

from mute.acoustics.metering.running_filter import RunningFilter

__all__ = ["MAX_SAMPLE_RATE", "MIN_SAMPLE_RATE", "AWeighting", "a_weighting_db", "a_weighting_sos"]

MIN_SAMPLE_RATE = 8000
"""Lowest sample rate that a level is taken from, Hz; below, too little of the weighting is left."""

MAX_SAMPLE_RATE = 768000
"""Highest sample rate that a level is taken from, Hz: the highest that sound cards record at."""

_POLES = (20.598997, 107.65265, 737.86223, 12194.217)
"""Pole frequencies f1 to f4, Hz (IEC 61672-1:2013, annex E); the first and last are double."""

_REFERENCE = 1000.0
"""Frequency at which the weighting is 0 dB, Hz."""

_FIT_TO = 20000.0
"""Highest frequency of the fit, Hz: the end of what is heard."""

_FIT_POINTS = 400

_FOUR_ZEROS_UP_TO = 192000
"""Sample rate up to which four zeros are fitted, Hz; above it, two."""


def a_weighting_db(frequency: ArrayLike) -> NDArray[np.float64]:
    """Return the design goal of the A-weighting, dB (IEC 61672-1:2013, annex E).

    A(f) = 20 lg R(f) - 20 lg R(1 kHz), with
    R(f) = f4^2 f^4 / ((f^2 + f1^2) sqrt(f^2 + f2^2) sqrt(f^2 + f3^2) (f^2 + f4^2))

    Args:
        frequency: Hz, > 0. Any shape.
    """
    squares = np.square(np.asarray(frequency, dtype=np.float64))
    return 10.0 * np.log10(_power(squares) / _power(np.square(np.float64(_REFERENCE))))


def a_weighting_sos(sample_rate: int) -> NDArray[np.float64]:
    """Return the A-weighting as second-order sections, as `scipy.signal.sosfilt` takes them.

    The zeros are those of a trigonometric polynomial |B(w)|^2 = sum c_k cos(k w), fitted by linear
    least squares to the relative error; the half of its roots inside the unit circle is taken.

    Args:
        sample_rate: Hz.

    Returns:
        Coefficients. Shape: (4, 6).

    Raises:
        ValueError: If the sample rate is not within `MIN_SAMPLE_RATE` and `MAX_SAMPLE_RATE`.
    """
    if not MIN_SAMPLE_RATE <= sample_rate <= MAX_SAMPLE_RATE:
        raise ValueError(
            f"sample_rate must be {MIN_SAMPLE_RATE} to {MAX_SAMPLE_RATE} Hz, got {sample_rate}"
        )
    poles = np.exp(-2.0 * np.pi * np.array(_POLES) / sample_rate)
    high_pass = np.array(
        [
            [1.0, -2.0, 1.0, *np.poly([poles[0], poles[0]])],
            [1.0, -2.0, 1.0, *np.poly([poles[1], poles[2]])],
        ]
    )
    low_pass = signal.zpk2sos(
        _fitted_zeros(high_pass, poles[3], sample_rate), [poles[3], poles[3], 0.0, 0.0], 1.0
    )
    sections = np.vstack([high_pass, low_pass])
    sections[0, :3] /= np.abs(_response(sections, np.array(2.0 * np.pi * _REFERENCE / sample_rate)))
    return sections


def _power(squared_frequency: NDArray[np.float64] | np.float64) -> NDArray[np.float64]:
    """Return the squared magnitude of the analogue circuit, up to a factor."""
    f1, f2, f3, f4 = np.square(_POLES)
    f = squared_frequency
    return np.asarray(f**4 / ((f + f1) ** 2 * (f + f2) * (f + f3) * (f + f4) ** 2))


def _fitted_zeros(
    high_pass: NDArray[np.float64], pole: float, sample_rate: int
) -> NDArray[np.complex128]:
    """Return the four zeros that make the weighting of the high-pass part and a double pole.

    Those that are not fitted lie at z = 0.
    """
    fitted = 4 if sample_rate <= _FOUR_ZEROS_UP_TO else 2
    end = min(0.5 * sample_rate, _FIT_TO)
    frequencies = np.linspace(end / _FIT_POINTS, end, _FIT_POINTS)
    angles = 2.0 * np.pi * frequencies / sample_rate
    double_pole = np.abs(np.exp(1j * angles) - pole) ** 4
    rest = np.abs(_response(high_pass, angles)) ** 2 / double_pole
    target = 10.0 ** (a_weighting_db(frequencies) / 10.0) / rest
    basis = np.polynomial.chebyshev.chebvander(np.cos(angles), fitted)
    series, *_ = np.linalg.lstsq(basis / target[:, None], np.ones(_FIT_POINTS), rcond=None)
    # With x = (z + 1/z) / 2, each root in x is a pair of zeros, one of them inside the circle.
    roots = np.polynomial.chebyshev.chebroots(series).astype(np.complex128)
    zeros = roots + np.sqrt(roots**2 - 1.0)
    inside = np.where(np.abs(zeros) < 1.0, zeros, 1.0 / zeros)
    return np.append(inside, np.zeros(4 - fitted))


def _response(sections: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray:
    """Return the complex response of second-order sections at frequencies in rad a sample."""
    z = np.exp(1j * angle)
    return np.prod([np.polyval(s[:3], z) / np.polyval(s[3:], z) for s in sections], axis=0)


class AWeighting(RunningFilter):
    """The A-weighting of a stream of any number of channels."""

    def __init__(self, sample_rate: int) -> None:
        """Make the filter.

        Args:
            sample_rate: Hz.

        Raises:
            ValueError: If the sample rate is not within `MIN_SAMPLE_RATE` and `MAX_SAMPLE_RATE`.
        """
        super().__init__(a_weighting_sos(sample_rate))
