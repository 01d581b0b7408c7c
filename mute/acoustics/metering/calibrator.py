"""What full scale of a recording is in Pa, from the recording of a sound calibrator's tone.

A calibrator gives a tone of a known level and frequency, usually 94 or 114 dB at 1 kHz, or 124 dB
at 250 Hz. The level that stands for it is the median of the Fast, A-weighted readings, which a
knock at the end or a second of silence before does not move, as it would the mean square; the
A-weighting at the calibrator's frequency, 0 dB at 1 kHz, is taken out again. A-weighted, because
hum, wind and an offset are then kept out.

What is no such tone, or is steady for less than half of the readings, is refused; what is steady
for most of them, but not for all, is told.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.files.reading import WavReader
from mute.acoustics.metering.levels import P_REF, TIME_CONSTANTS, LevelDetector
from mute.acoustics.metering.weighting import AWeighting, a_weighting_db
from mute.support.errors import MuteError

__all__ = ["Calibration", "Calibrator", "ToneMeter", "calibrate"]

_STEADY = 0.2
"""Largest difference between two readings of a steady tone, dB (chosen)."""

_STEADY_SHARE = 0.5
"""Smallest share of the readings that are so close to their median, which then is the tone's."""

_ALIKE = 6.0
"""Largest difference between the channels of a calibration recording, dB (chosen)."""

_SILENT = -120.0
"""Level below which there is no calibrator in a recording, dBFS(A) (chosen)."""

_DETUNED = 0.03
"""Largest deviation of a calibrator's frequency, as a share (chosen: IEC 60942 allows 2 % in its
widest class, and the clock of a recorder adds to it)."""

_TONE_SHARE = 0.95
"""Smallest share of the A-weighted energy that is in a calibrator's tone (chosen: what else there
is then makes the level 0.22 dB too high at most)."""

_SEGMENT = 0.5
"""Time of a spectrum, s."""

_LEAK = 2
"""Bins on each side into which a Hann window spreads a tone."""


@dataclass(frozen=True)
class Calibrator:
    """A sound calibrator, as its label has it."""

    level: float
    """Unweighted level, dB re 20 uPa."""
    frequency: float = 1000.0
    """Hz."""


@dataclass(frozen=True)
class Calibration:
    """What full scale is."""

    gains: NDArray[np.float64]
    """Pa of a sample of 1. Shape: (channels used,)."""
    warnings: tuple[str, ...]
    """What a user must know about the calibration, one line each."""


@dataclass(frozen=True)
class _Tone:
    """What one channel of a calibration recording holds."""

    level: float
    """Median of the readings, dBFS(A)."""
    spread: float
    """Largest less smallest reading, dB; infinite with digital silence among them."""
    steady: float
    """Share of the readings that are as close to the median as those of a steady tone."""
    share: float
    """Share of the energy at the calibrator's frequency; the median of the segments."""
    loudest: float
    """Frequency that is strongest, A-weighted, Hz; the median of the segments."""


class ToneMeter:
    """Hears the recording of a calibrator, any number of channels, streamed."""

    def __init__(self, sample_rate: int, channels: int, frequency: float) -> None:
        """Start from silence.

        Args:
            sample_rate: Hz.
            channels: Number of channels, >= 1.
            frequency: Of the calibrator, Hz.

        Raises:
            ValueError: If the sample rate is not one that levels are taken from.
        """
        self._detector = LevelDetector(sample_rate, channels, "fast", reference=1.0)
        self._weighting = AWeighting(sample_rate)
        self._pending = np.zeros((channels, 0))
        self._length = round(_SEGMENT * sample_rate)
        self._window = np.hanning(self._length)
        self._bins = np.fft.rfftfreq(self._length, 1.0 / sample_rate)
        width = _DETUNED * frequency + _LEAK * self._bins[1]
        self._near = np.abs(self._bins - frequency) <= width
        self._shares: list[NDArray[np.floating]] = []
        self._loudest: list[NDArray[np.floating]] = []

    def update(self, block: NDArray[np.float64]) -> None:
        """Take the next samples, full scale is 1. Shape: (channels, samples)."""
        weighted = self._weighting.filter(block)
        self._detector.update(np.square(weighted))
        pending = np.concatenate((self._pending, weighted), axis=1)
        whole = pending.shape[1] // self._length
        for segment in range(whole):
            begin = segment * self._length
            self._look_at(pending[:, begin : begin + self._length])
        self._pending = pending[:, whole * self._length :].copy()

    def tones(self) -> list[_Tone]:
        """Return what each channel holds; nothing of a recording without a reading."""
        readings = self._detector.readings
        if readings.shape[1] == 0 or not self._shares:
            return []
        # What the detector still lacks of a steady level that began with the recording.
        risen = -np.expm1(-self._detector.reading_times / TIME_CONSTANTS["fast"])
        readings = readings - 10.0 * np.log10(risen)
        shares, loudest = np.median(self._shares, axis=0), np.median(self._loudest, axis=0)
        levels = np.median(readings, axis=1)
        return [
            _Tone(
                level=float(level),
                spread=0.0 if own.max() == -math.inf else float(own.max() - own.min()),
                steady=float(np.mean((own >= level - _STEADY) & (own <= level + _STEADY))),
                share=float(share),
                loudest=float(frequency),
            )
            for own, level, share, frequency in zip(readings, levels, shares, loudest, strict=True)
        ]

    def _look_at(self, segment: NDArray[np.float64]) -> None:
        """Note where the energy of a segment is."""
        power = np.square(np.abs(np.fft.rfft(segment * self._window, axis=1)))
        total = np.maximum(power.sum(axis=1), np.finfo(np.float64).tiny)
        self._shares.append(power[:, self._near].sum(axis=1) / total)
        self._loudest.append(self._bins[power.argmax(axis=1)])


def calibrate(wav: WavReader, calibrator: Calibrator, channels: list[int]) -> Calibration:
    """Return what full scale of a recording is, from one of a calibrator with the same gain.

    Args:
        wav: Recording of the calibrator; its sample rate is one that levels are taken from.
        calibrator: What was heard.
        channels: Indices of the channels to use.

    Raises:
        MuteError: If the recording is too short, silent, of one channel of several, or is not of
            the calibrator's tone for half of the time.
    """
    if not calibrator.frequency < 0.45 * wav.sample_rate:
        raise MuteError(
            f"{wav.path}: a tone of {calibrator.frequency:g} Hz is not in a recording at "
            f"{wav.sample_rate} Hz"
        )
    meter = ToneMeter(wav.sample_rate, len(channels), calibrator.frequency)
    for block in wav.blocks():
        meter.update(block[channels])
    tones = meter.tones()
    if not tones:
        seconds = wav.frames / wav.sample_rate
        raise MuteError(f"{wav.path}: too short for a calibration ({seconds:.2f} s)")
    _check_levels(wav, tones)
    for tone in tones:
        _check_tone(wav, tone, calibrator)
    weighting = float(a_weighting_db(calibrator.frequency))
    levels = np.array([tone.level for tone in tones]) - weighting
    return Calibration(
        gains=P_REF * 10.0 ** ((calibrator.level - levels) / 20.0),
        warnings=tuple(wav.warnings) + _doubts(wav, channels, tones),
    )


def _check_levels(wav: WavReader, tones: list[_Tone]) -> None:
    """Refuse levels that cannot be those of a calibrator.

    Raises:
        MuteError: If the recording is silent, or of one channel of several.
    """
    levels = [tone.level for tone in tones]
    if max(levels) < _SILENT:
        raise MuteError(f"{wav.path}: silent half of the time or more, not a calibrator's tone")
    difference = max(levels) - min(levels)
    if difference > _ALIKE:
        raise MuteError(
            f"{wav.path}: its channels differ by {difference:.1f} dB, as if one microphone had "
            "the calibrator; choose that one with --channel"
        )


def _check_tone(wav: WavReader, tone: _Tone, calibrator: Calibrator) -> None:
    """Refuse what is no tone at the calibrator's frequency, or is not steady half of the time.

    Raises:
        MuteError: If it is none.
    """
    if tone.share < _TONE_SHARE:
        raise MuteError(
            f"{wav.path}: not the tone of a calibrator at {calibrator.frequency:g} Hz: "
            f"{100.0 * tone.share:.0f} % of its energy is there, and {tone.loudest:g} Hz is "
            "strongest (--calibration-frequency names another one)"
        )
    if tone.steady < _STEADY_SHARE:
        raise MuteError(
            f"{wav.path}: not a steady tone: {100.0 * tone.steady:.0f} % of its readings are "
            f"within {_STEADY:g} dB of their median, must be {100.0 * _STEADY_SHARE:.0f} % or more"
        )


def _doubts(wav: WavReader, channels: list[int], tones: list[_Tone]) -> tuple[str, ...]:
    """Return what a user must know about a calibration that is taken."""
    doubts = []
    clipped = int(wav.clipped[channels].sum())
    if clipped:
        doubts.append(f"{wav.path}: {clipped} samples at full scale, the calibration is clipped")
    spread = max(tone.spread for tone in tones)
    if spread > _STEADY:
        told = f"spread by {spread:.1f} dB" if math.isfinite(spread) else "hold silence too"
        doubts.append(
            f"{wav.path}: not a steady tone, its readings {told}; their median is taken to be "
            "the calibrator's level"
        )
    return tuple(doubts)
