"""How a plate rings after a blow, as it is heard: responses drawn by chance from its modes.

A floor has thousands of modes, and which of them a blow excites goes with the place: a response is
a sum of decaying tones whose frequencies lie as dense as the plate's modes and whose strengths are
the products of two mode shapes, at the blow and at the ear. Each tone begins as the velocity of an
oscillator that is struck: what begins otherwise would reach down to frequencies at which the mode
is stiff, and where most of a soft foot's force is. In the mean over places each third octave holds
the power that the plate radiates (`Plate.ringing_power`), falling with its `Plate.decay_time`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.air import AIR_IMPEDANCE
from mute.acoustics.physics.plate import Plate

__all__ = [
    "BANDS",
    "OCTAVES",
    "Tones",
    "band_edges",
    "ringing_energy",
    "ringing_responses",
    "ringing_tones",
]

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


@dataclass(frozen=True)
class Tones:
    """The modes of a third octave that are heard, exp(-ln(10^3) t / decay) sin(w t + phase)."""

    band: int
    """Index into `BANDS`."""
    decay: float
    """Time in which they fall by 60 dB, s."""
    frequency: NDArray[np.float64]
    """Hz. Shape: (tones,)."""
    phase: NDArray[np.float64]
    """rad. Shape: (tones,)."""
    strength: NDArray[np.float64]
    """At each place, up to a factor for all. Shape: (places, tones)."""

    def sampled(self, length: int, sample_rate: float) -> NDArray[np.float64]:
        """Return what they sound like, undamped. Shape: (places, length)."""
        time = np.arange(length) / sample_rate
        turns = 2.0 * np.pi * self.frequency[:, None] * time + self.phase[:, None]
        return self.strength @ np.sin(turns)


def ringing_tones(
    plate: Plate, sample_rate: int, places: int, seed: int, even: bool = False, panels: int = 1
) -> Iterator[Tones]:
    """Yield the modes of each third octave, as they are drawn; see `ringing_responses`."""
    generator = np.random.default_rng(seed)
    low, high = band_edges(BANDS)
    heard = high < 0.45 * sample_rate
    decay = plate.decay_time(BANDS)
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
        yield Tones(int(band), float(decay[band]), frequency, phase, strength)


def ringing_energy(plate: Plate, band: int) -> float:
    """Return the energy that a blow of 1 N s is to radiate in a third octave, times rho c.

    A force of 1 N s has 2 df of F^2 in a band; the plate radiates `Plate.ringing_power` of that.

    Args:
        plate: The plate.
        band: Index into `BANDS`.

    Returns:
        Pa^2 m^2 s.
    """
    low, high = band_edges(BANDS)
    wanted = 2.0 * (high[band] - low[band]) * AIR_IMPEDANCE
    return float(wanted * plate.ringing_power(BANDS[band]))


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
    samples = ceil(min(_LONGEST, float(plate.decay_time(BANDS).max())) * sample_rate)
    responses = np.zeros((places, len(OCTAVES), samples))
    for tones in ringing_tones(plate, sample_rate, places, seed, even, panels):
        length = min(samples, ceil(tones.decay * sample_rate))
        time = np.arange(length) / sample_rate
        fading = np.clip((_LONGEST - time) / _FADE, 0.0, 1.0)
        part = tones.sampled(length, sample_rate)
        part = part * np.exp(-np.log(1e3) * time / tones.decay) * fading
        part[:, 0] *= 0.5  # a jump amid a sample
        wanted = ringing_energy(plate, tones.band)
        present = np.square(part).sum(axis=1, keepdims=True) / sample_rate
        present = present if even else present.mean()
        responses[:, tones.band // 3, :length] += part * np.sqrt(wanted / present)
    return responses
