"""Levels of WAV files: which channels, in what unit, and what to doubt in the figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.files.reading import WavReader
from mute.acoustics.metering.levels import (
    READINGS_PER_SECOND,
    LevelDetector,
    Levels,
    TimeWeighting,
    settling_time,
)
from mute.acoustics.metering.spans import Span
from mute.acoustics.metering.third_octaves import ThirdOctaveLevel, ThirdOctaveMeter
from mute.acoustics.metering.weighting import MAX_SAMPLE_RATE, MIN_SAMPLE_RATE, AWeighting
from mute.support.errors import MuteError

__all__ = ["Measurement", "chosen_channels", "doubts", "measure_span", "open_wav"]

_WIDE_BAND_RATE = 32000
"""Sample rate below which a part of what is heard is missing, Hz."""

_INTEGER_LIKE = 100.0
"""Magnitude of floats from which they look like integers that were never scaled (chosen)."""


@dataclass(frozen=True)
class Measurement:
    """What the meter makes of a span, in dB re its reference."""

    levels: Levels
    """Figures, A-weighted."""
    third_octaves: tuple[ThirdOctaveLevel, ...]
    """Spectrum, unweighted, from the lowest band on."""
    reading_times: NDArray[np.float64]
    """Times of the readings since the begin of the recording, s. Shape: (readings,)."""
    readings: NDArray[np.float64]
    """What the detector showed, dB. Shape: (readings,)."""


def open_wav(path: Path) -> WavReader:
    """Open a recording that a level can be taken from.

    Raises:
        MuteError: If it cannot be read, or its sample rate is too low or too high.
    """
    return WavReader(path, (MIN_SAMPLE_RATE, MAX_SAMPLE_RATE))


def chosen_channels(wav: WavReader, channel: int | None) -> list[int]:
    """Return the indices of the channels to measure.

    Args:
        wav: Recording.
        channel: Number of one, from 1; None for all.

    Raises:
        MuteError: If there is no such channel.
    """
    if channel is None:
        return list(range(wav.channels))
    if not 1 <= channel <= wav.channels:
        raise MuteError(f"{wav.path}: --channel must be 1 to {wav.channels}, got {channel}")
    return [channel - 1]


def measure_span(
    wav: WavReader,
    channels: Sequence[int],
    gains: NDArray[np.float64],
    span: Span,
    time_weighting: TimeWeighting,
    reference: float,
) -> Measurement:
    """Return the levels of the energy mean: at each instant, the mean square of the channels.

    What lies before the span settles detector and filters, and is in no figure.

    Args:
        wav: Recording.
        channels: Indices of the channels to measure.
        gains: What a sample of 1 is, in the unit of the reference. Shape: (channels,).
        span: Part of the recording.
        time_weighting: "fast" or "slow".
        reference: Root mean square of 0 dB.

    Raises:
        MuteError: If a sample cannot be measured.
    """
    weighting = AWeighting(wav.sample_rate)
    detector = LevelDetector(wav.sample_rate, 1, time_weighting, reference)
    spectrum = ThirdOctaveMeter(wav.sample_rate, reference)

    def hear(begin: int, end: int) -> None:
        for block in wav.blocks(begin=begin, end=end):
            samples = gains[:, None] * block[channels]
            spectrum.update(samples)
            detector.update(np.square(weighting.filter(samples)).mean(axis=0, keepdims=True))

    lead_in = span.lead_in(time_weighting)
    hear(lead_in * wav.sample_rate, span.begin)
    detector.forget()
    spectrum.forget()
    hear(span.begin, span.end)
    return Measurement(
        levels=detector.result()[0],
        third_octaves=tuple(spectrum.result()),
        reading_times=lead_in + detector.reading_times,
        readings=detector.readings[0],
    )


def doubts(
    wav: WavReader,
    channels: Sequence[int],
    span: Span,
    levels: Levels,
    time_weighting: TimeWeighting,
) -> list[str]:
    """Return what a user must know about the levels of a recording that was measured.

    Args:
        wav: Recording, of which the span was read last.
        channels: Indices of the channels that were measured.
        span: Part that was measured.
        levels: Their levels.
        time_weighting: "fast" or "slow".
    """
    found = list(wav.warnings)
    clipped = int(wav.clipped[channels].sum())
    if clipped:
        found.append(
            f"{wav.path}: {clipped} samples at full scale, the recording is clipped "
            "and its levels are too low"
        )
    peak = float(wav.peak[channels].max())
    if wav.is_float and peak > _INTEGER_LIKE:
        found.append(
            f"{wav.path}: floats up to {peak:.6g} times full scale look like integers that were "
            "not scaled to 1"
        )
    if levels.readings == 0:
        found.append(f"{wav.path}: {_why_no_reading(wav, span, time_weighting)}")
    elif levels.mnl == -math.inf:
        found.append(f"{wav.path}: digital silence in the readings, they have no mean")
    if wav.sample_rate < _WIDE_BAND_RATE:
        half = wav.sample_rate // 2
        found.append(f"{wav.path}: nothing above {half} Hz is in it, half its sample rate")
    if len(channels) > 1:
        found.append(
            f"{wav.path}: {wav.channels} channels, measured as their energy mean; "
            "choose one with --channel"
        )
    return found


def _why_no_reading(wav: WavReader, span: Span, time_weighting: TimeWeighting) -> str:
    """Return why there is no reading in a span."""
    settling = settling_time(time_weighting)
    if wav.frames < settling * wav.sample_rate:
        return (
            f"shorter than the {settling:g} s in which the detector settles, "
            "so there are no readings"
        )
    return (
        f"no readings from {span.begin_time:.3f} to {span.end_time:.3f} s; there are "
        f"{READINGS_PER_SECOND} a second, from {settling:g} s of the recording on"
    )
