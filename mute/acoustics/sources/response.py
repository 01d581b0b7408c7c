"""From a force on a plate to the pressure at a microphone, as a filter."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np
from numpy.fft import irfft, rfft, rfftfreq
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from mute.acoustics.physics.plate import Plate
from mute.acoustics.physics.ringing import OCTAVES, ringing_responses

__all__ = [
    "LONGEST_PULSE",
    "PLACES",
    "PlateResponse",
    "audible_end",
    "floor_response",
    "modes_seed",
]

PLACES = 12
"""Places of a plate that sound different when they are struck."""

LONGEST_PULSE = 0.15
"""Longest force that the filter takes in, s: on carpet 4 kg press for 0.12 s at 5 cm/s. What is
slower still, and is not heard, is cut."""


def audible_end(impulses: NDArray, gone: float = 1e-8) -> int:
    """Return after how many samples responses are over.

    Args:
        impulses: Shape: (n, samples).
        gone: Share of each one's energy that may be cut off its end.
    """
    left = np.square(impulses)[:, ::-1].cumsum(axis=1)[:, ::-1]
    return int((left > gone * left[:, :1]).any(axis=0).sum())


def modes_seed(plate: Plate) -> int:
    """Return the seed of a plate's modes: the same plate is always the same."""
    return round(1e6 * (plate.surface_mass + plate.critical_frequency))


def _above(corner: float, frequency: NDArray) -> NDArray[np.complex128]:
    """Return a high pass of Butterworth's of the second order."""
    ratio = 1j * frequency / corner
    return ratio**2 / (1.0 + np.sqrt(2.0) * ratio + ratio**2)


class PlateResponse:
    """What a plate makes of a force: its near field at once, and its ringing."""

    def __init__(
        self, plate: Plate, sample_rate: int, form: Literal["floor", "body"], panels: int = 1
    ) -> None:
        """Draw the modes; the same plate rings the same each time.

        Args:
            plate: The plate.
            sample_rate: Hz.
            form: Whether one stands upon it, so that ringing leaves it around the blow and from
                all of it (`Plate.spread`), or it is small, and all sound goes as from a point.
            panels: Number of such plates that share the sound, each with modes of its own.
        """
        seed = modes_seed(plate)
        # A shell is small: of the few modes of a band none may be struck at one place alone.
        ringing = ringing_responses(
            plate, sample_rate, PLACES, seed, even=form == "body", panels=panels
        )
        longest_pulse = round(LONGEST_PULSE * sample_rate)
        length = next_fast_len(ringing.shape[2] + longest_pulse, real=True)
        assert length is not None
        self.length = length
        """Samples that a response takes."""
        self.longest_pulse = longest_pulse
        """Samples that a force may take."""
        self._plate, self._form = plate, form
        self.frequency = rfftfreq(self.length, 1.0 / sample_rate)
        """Of the filter, Hz. Shape: (frequencies,)."""
        self.frequency[0] = self.frequency[1]  # nothing is heard of it, and formulas divide by it
        self.direct = self.direct_at(self.frequency)
        """What a floor radiates at once, at 1 m, Pa / N. Shape: (frequencies,)."""
        spectra = self._small(self.frequency) * rfft(ringing / sample_rate, self.length, axis=2)
        self.ringing = spectra.astype(np.complex64)
        """What rings, times the root of the area that it goes through, Pa m / N.

        Shape: (places, octaves, frequencies)."""

    def _small(self, frequency: NDArray) -> NDArray[np.complex128]:
        """Return what the size of a body leaves. Shape: (frequencies,)."""
        if self._form == "body":
            return _above(self._plate.first_mode, frequency)
        return np.ones(len(frequency), dtype=np.complex128)

    def direct_at(self, frequency: NDArray) -> NDArray[np.complex128]:
        """Return what a floor radiates at once, at 1 m, Pa / N. Shape: (frequencies,).

        Args:
            frequency: Hz, even from 0 on; of 0 nothing is heard, and formulas divide by it.
        """
        above = np.maximum(frequency, frequency[1])
        return self._small(above) * self._plate.direct_pressure(above)

    def impulse(self, place: int) -> NDArray[np.float64]:
        """Return what is heard of a force of one sample at 1 m from a body, Pa / N."""
        transfer = self.direct + self.ringing[place].sum(axis=0) / np.sqrt(2.0 * np.pi)
        return irfft(transfer, self.length)

    @property
    def squares(self) -> NDArray[np.float64]:
        """p^2 over F^2 at 1 m from a body, Pa^2 / N^2. Shape: (places, frequencies)."""
        heard = self.direct + self.ringing.sum(axis=1) / np.sqrt(2.0 * np.pi)
        return np.square(np.abs(heard))

    def transfer(self, distance: NDArray, place: NDArray) -> NDArray[np.complex128]:
        """Return pressure over force by frequency, Pa / N, without the delay.

        Args:
            distance: Of the blow from the microphone, m. Shape: (n,).
            place: Index below `PLACES` of each blow. Shape: (n,).

        Returns:
            Of the frequencies of a real transform of `length` samples. Shape: (n, frequencies).
        """
        size = np.sqrt(self.spread(distance)).astype(np.float32)
        ringing = np.einsum("no,nof->nf", size, self.ringing[place])
        return self.direct / distance[:, None] + ringing

    def spread(self, distance: NDArray) -> NDArray[np.float64]:
        """Return p^2 over what rings at a distance, 1 / m^2, as `Plate.spread`.

        A factor an octave: one that went with the frequency would ring before the blow.

        Args:
            distance: Of the blow from the microphone, m. Shape: (n,).

        Returns:
            Factors. Shape: (n, octaves).
        """
        apart = distance[:, None]
        if self._form == "body":
            return np.broadcast_to(1.0 / (2.0 * np.pi * apart**2), (len(apart), len(OCTAVES)))
        return self._plate.spread(OCTAVES, apart)


@cache
def floor_response(plate: Plate, sample_rate: int) -> PlateResponse:
    """Return a floor's filter, made once for each sample rate."""
    return PlateResponse(plate, sample_rate, "floor")
