"""How a plate rings after a blow, as it is heard: responses drawn by chance from its modes.

A floor has thousands of modes, and which of them a blow excites goes with the place: a response is
a sum of decaying tones whose frequencies lie as dense as the plate's modes and whose strengths are
the products of two mode shapes, at the blow and at the ear. Each tone begins as the velocity of an
oscillator that is struck: what begins otherwise would reach down to frequencies at which the mode
is stiff, and where most of a soft foot's force is. In the mean over places each third octave holds
the power that the plate radiates (`Plate.ringing_power`), falling with its `Plate.decay_time`.
"""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.physics.plate import Plate

__all__ = ["BANDS", "OCTAVES", "band_edges", "ringing_responses"]

BANDS = 1e3 * 10.0 ** (np.arange(-16, 12) / 10.0)
"""Middle frequencies of third octaves from 25 Hz to 12.5 kHz, Hz."""

OCTAVES = 1e3 * 2.0 ** np.arange(-5, 5)
"""Middle frequencies of the octaves that `BANDS` lie in, three in each, Hz."""

_MOST_MODES = 48
"""Modes of a band that are heard one by one; more could not be told from these."""
_LONGEST = 0.6
"""Time after which a response is over, s: what is lowest would ring on, and is not heard."""
_FADE = 0.1
"""Last part of that, in which it fades, s."""


def band_edges(middle: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower and upper edges of third octaves, Hz."""
    return middle * 10.0**-0.05, middle * 10.0**0.05


def ringing_responses(
    plate: Plate, sample_rate: int, places: int, seed: int, even: bool = False, panels: int = 1
) -> NDArray[np.float64]:
    """Return responses to a blow of 1 N s at some places of a plate.

    Args:
        plate: The plate.
        sample_rate: Hz.
        places: How many.
        seed: Of the modes.
        even: Whether each place holds that power, and not just their mean; then the plate is small,
            and below its first mode there is nothing.
        panels: Number of such plates that share the sound, each with modes of its own.

    Returns:
        Pressure times the root of the area that the sound goes through, Pa m / (N s): p^2 times
        that area over rho c is the power. By octave of `OCTAVES`, as what is low spreads otherwise
        than what is high. Shape: (places, octaves, samples).
    """
    generator = np.random.default_rng(seed)
    low, high = band_edges(BANDS)
    heard = high < 0.45 * sample_rate
    decay = plate.decay_time(BANDS)
    samples = ceil(min(_LONGEST, float(decay.max())) * sample_rate)
    responses = np.zeros((places, len(OCTAVES), samples))
    if even:
        heard &= low > plate.first_mode * 10.0**-0.05
    for band in np.flatnonzero(heard):
        expected = panels * plate.mode_density * (high[band] - low[band])
        # One at least: no band is to swallow what the plate is given there.
        count = max(1, int(generator.poisson(min(expected, _MOST_MODES))))
        frequency = generator.uniform(low[band], high[band], count)
        strength = generator.standard_normal((places, count)) * generator.standard_normal(count)
        # Of velocity, whose integral is 0: what was struck comes back to its place.
        phase = np.pi - np.arctan(2.0 * np.pi * frequency * decay[band] / np.log(1e3))
        length = min(samples, ceil(decay[band] * sample_rate))
        time = np.arange(length) / sample_rate
        tones = np.sin(2.0 * np.pi * frequency[:, None] * time + phase[:, None])
        fading = np.clip((_LONGEST - time) / _FADE, 0.0, 1.0)
        part = (strength @ tones) * np.exp(-np.log(1e3) * time / decay[band]) * fading
        part[:, 0] *= 0.5  # a jump amid a sample
        # A force of 1 N s has 2 df of F^2 in a band: its energy is what the plate radiates of that.
        wanted = 2.0 * (high[band] - low[band]) * AIR_IMPEDANCE
        wanted *= float(plate.ringing_power(BANDS[band]))
        present = np.square(part).sum(axis=1, keepdims=True) / sample_rate
        present = present if even else present.mean()
        responses[:, band // 3, :length] += part * np.sqrt(wanted / present)
    return responses
