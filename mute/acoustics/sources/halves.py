"""A plate's filter for blows, in two halves: high octaves ring briefly, low ones need few samples.

From the force of a blow to what is heard of it, as `PlateResponse.transfer` says, at a fraction of
the cost. The upper half, with what comes at once, is worked out at the sample rate and is short.
The lower half is worked out at a fraction of that rate, kept so until it is heard, and brought to
the sample rate then, for all blows of a robot together.
"""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np
from numpy.fft import irfft, rfft, rfftfreq
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.signal import firwin

from mute.acoustics.physics.ringing import OCTAVES
from mute.acoustics.sources.band_noise import filter_response
from mute.acoustics.sources.pending import Pending
from mute.acoustics.sources.response import PlateResponse, audible_end

__all__ = ["TAPS", "Half", "LowPending", "halves", "interpolator", "low_divisor"]

_FIRST_HIGH = 5
"""Index of the lowest octave of the upper half, 1 kHz."""

_LOW_RATE = 6000
"""Least sample rate of the lower half, Hz: its octaves end at 707 Hz, and what the beginning of a
tone has above that falls off before half the rate."""

TAPS = 6
"""Samples of the lower half that one of the sample rate is made of."""

_FADE = 0.005
"""Time in which what is heard of a blow fades at its end, s."""

_PASSED = (0.2, 0.45)
"""Shares of the lower half's sample rate from which on, and up to which, its filter lets go."""


def low_divisor(sample_rate: int) -> int:
    """Return how many samples of sound one of the lower half stands for."""
    return max(1, sample_rate // _LOW_RATE)


def interpolator(divisor: int) -> NDArray[np.float64]:
    """Return the filter between samples of the lower half, of unit sum for each phase."""
    cutoff = min(2.0 * _PASSED[1], 1.0) / divisor
    return np.asarray(firwin(TAPS * divisor, cutoff)) * divisor


class Half:
    """Some octaves of a plate's filter, at a sample rate of their own."""

    def __init__(self, response: PlateResponse, sample_rate: int, low: bool) -> None:
        """Prepare.

        Args:
            response: The plate's whole filter.
            sample_rate: That of `response`, Hz.
            low: Whether this is the lower half, without what comes at once.
        """
        self._octaves = slice(0, _FIRST_HIGH) if low else slice(_FIRST_HIGH, len(OCTAVES))
        self.divisor = low_divisor(sample_rate) if low else 1
        """Samples of sound for one of this half."""
        self.rate = sample_rate / self.divisor
        """Samples a second, Hz."""
        # Of the filter between samples, and of forces, which are means over the time before each.
        late = (TAPS + 1) * self.divisor - 2 if low else 0
        self.late = 0.5 * late / sample_rate
        """By how much later its sound comes than it is given, s: 0.6 ms at 48 kHz, 0.2 m."""
        self.low = low
        """Whether this is the lower half."""
        self._response = response
        self._filters: dict[int, tuple[int, NDArray, NDArray | None]] = {}

    @property
    def made(self) -> set[int]:
        """Samples of the forces that it is ready for; others take a while at first."""
        return set(self._filters)

    def heard(
        self, force: NDArray, distance: NDArray, place: NDArray, size: NDArray
    ) -> NDArray[np.floating]:
        """Return what is heard of blows, Pa, without the delay of the air.

        Args:
            force: At this half's rate, as means over its samples, N. Shape: (n, samples).
            distance: Of each blow from the microphone, m. Shape: (n,).
            place: Index below `PLACES` of each blow. Shape: (n,).
            size: What each is multiplied by. Shape: (n,).

        Returns:
            Samples at this half's rate. Shape: (n, more samples).
        """
        length, ringing, direct = self._filter(force.shape[1])
        spread = self._response.spread(distance)[:, self._octaves]
        spread = (size[:, None] * np.sqrt(spread)).astype(np.float32)
        transfer = np.empty((len(place), length // 2 + 1), dtype=np.complex64)
        for each in np.unique(place):  # rather than to gather a copy of the place's for each blow
            here = place == each
            transfer[here] = np.einsum("no,of->nf", spread[here], ringing[each])
        if direct is not None:
            transfer += (size / distance).astype(np.float32)[:, None] * direct
        transfer *= rfft(force.astype(np.float32), length, axis=1)
        sound = irfft(transfer, length, axis=1)
        # A floor that floats has losses that begin before the blow, which come out at the end.
        fade = min(round(_FADE * self.rate), length)
        sound[:, length - fade :] *= np.linspace(1.0, 0.0, fade, dtype=np.float32)
        return sound

    def _filter(self, pulse: int) -> tuple[int, NDArray, NDArray | None]:
        """Return the transform's length, its ringing part and its direct one, for such forces."""
        if pulse not in self._filters:
            length = next_fast_len(-(-self._lasting // self.divisor) + pulse, real=True)
            assert length is not None
            frequency = rfftfreq(length, 1.0 / self.rate)
            spectra = rfft(self._ringing, self.divisor * length, axis=2)[..., : len(frequency)]
            spectra = (self._shape(frequency) * spectra).astype(np.complex64)
            direct = None
            if not self.low:
                direct = self._response.direct_at(frequency).astype(np.complex64)
            self._filters[pulse] = length, spectra, direct
        return self._filters[pulse]

    @cached_property
    def _ringing(self) -> NDArray[np.float64]:
        """What rings after a force of one sample, without its inaudible end.

        At the sample rate. Shape: (places, octaves, samples).
        """
        response = self._response
        ringing = irfft(response.ringing[:, self._octaves], response.length, axis=2)
        # The transform's last part is there for the force, and empty.
        ringing = ringing[..., : response.length - response.longest_pulse]
        return ringing[..., : audible_end(ringing.sum(axis=1))]

    @cached_property
    def _lasting(self) -> int:
        """Samples of sound after which nothing is left of a force of one sample."""
        if self.low:
            return self._ringing.shape[2]
        response = self._response
        direct = irfft(response.direct, response.length)
        # A floor that floats swings for a while. What is above half the sample rate is missing,
        # which leaves a tail that nobody hears: hence more of it may go.
        direct = direct[: response.length - response.longest_pulse]
        return max(self._ringing.shape[2], audible_end(direct[None], 1e-5))

    def _shape(self, frequency: NDArray) -> NDArray[np.float64]:
        """Return what makes up for this half's rate, and lets go before half of it."""
        if self.divisor == 1:
            return np.ones(len(frequency))
        begin, end = (share * self.rate for share in _PASSED)
        falling = np.clip((end - frequency) / (end - begin), 0.0, 1.0)
        taps = interpolator(self.divisor)
        turn = 2.0 * np.pi * frequency / (self.rate * self.divisor)
        between = filter_response(taps / self.divisor, np.ones(1), turn)
        # Means over samples, and the filter between them, are even only where it is low.
        lost = np.sinc(frequency / self.rate) * np.abs(between)
        return 0.5 * (1.0 - np.cos(np.pi * falling)) / lost


@cache
def halves(response: PlateResponse, sample_rate: int) -> tuple[Half, Half]:
    """Return the lower and the upper half of a filter, made once for each."""
    return Half(response, sample_rate, True), Half(response, sample_rate, False)


class LowPending:
    """What is yet to be heard of the lower half: as `Pending`, at its own rate until it is taken.

    Its samples stand at whole multiples of `divisor`, counted from the beginning of the recording.
    """

    def __init__(self, num_robots: int, divisor: int) -> None:
        """Start in silence.

        Args:
            num_robots: Number of robots.
            divisor: Samples of sound for one of the lower half.
        """
        self._divisor = divisor
        self._pending = Pending(num_robots)
        # One more than the next sample needs: the last one may not be heard to its end.
        self._last = np.zeros((num_robots, TAPS))
        # Of each phase, for the oldest sample first.
        self._between = interpolator(divisor).reshape(TAPS, divisor)[::-1]
        self._next: int | None = None

    def begin(self, first: int) -> None:
        """Take note at which sample of sound the next block begins."""
        if self._next is None:
            self._next = first // self._divisor

    def add(self, robot: int, start: int, sound: NDArray) -> None:
        """Add sound of one robot.

        Args:
            robot: Whose.
            start: Its first sample, of this half's rate, from the beginning of the recording.
            sound: Shape: (samples,).
        """
        assert self._next is not None
        self._pending.add(robot, max(0, start - self._next), sound)

    def take(self, first: int, stop: int) -> NDArray[np.float64]:
        """Return samples of sound, and forget them. Shape: (robots, stop - first)."""
        assert self._next is not None
        if stop == first:
            return np.zeros((len(self._last), 0))
        frames = -(-stop // self._divisor)
        known = np.concatenate((self._last, self._pending.take(frames - self._next)), axis=1)
        self._next = frames
        self._last = known[:, known.shape[1] - TAPS :]
        begin = first // self._divisor
        used = known[:, known.shape[1] - (frames - begin) - (TAPS - 1) :]
        near = np.lib.stride_tricks.sliding_window_view(used, TAPS, axis=1)
        sound = (near @ self._between).reshape(len(used), -1)
        return sound[:, first - begin * self._divisor :][:, : stop - first]
