"""Levels of WAV files: which channels, in what unit, and what to doubt in the figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.files.reading import WavReader
from mute.acoustics.metering.levels import LevelDetector, Levels, TimeWeighting, settling_time
from mute.acoustics.metering.weighting import MAX_SAMPLE_RATE, MIN_SAMPLE_RATE, AWeighting
from mute.support.errors import MuteError

__all__ = ["chosen_channels", "doubts", "energy_mean_levels", "open_wav"]

_WIDE_BAND_RATE = 32000
"""Sample rate below which a part of what is heard is missing, Hz."""

_INTEGER_LIKE = 100.0
"""Magnitude of floats from which they look like integers that were never scaled (chosen)."""


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


def energy_mean_levels(
    wav: WavReader,
    channels: Sequence[int],
    gains: NDArray[np.float64],
    time_weighting: TimeWeighting,
    reference: float,
) -> Levels:
    """Return the levels of the energy mean: at each instant, the mean square of the channels.

    Args:
        wav: Recording.
        channels: Indices of the channels to measure.
        gains: What a sample of 1 is, in the unit of the reference. Shape: (channels,).
        time_weighting: "fast" or "slow".
        reference: Root mean square of 0 dB.

    Raises:
        MuteError: If a sample cannot be measured.
    """
    weighting = AWeighting(wav.sample_rate)
    detector = LevelDetector(wav.sample_rate, 1, time_weighting, reference)
    for block in wav.blocks():
        weighted = weighting.filter(gains[:, None] * block[channels])
        detector.update(np.square(weighted).mean(axis=0, keepdims=True))
    return detector.result()[0]


def doubts(
    wav: WavReader, channels: Sequence[int], levels: Levels, time_weighting: TimeWeighting
) -> list[str]:
    """Return what a user must know about the levels of a recording that was measured to its end.

    Args:
        wav: Recording.
        channels: Indices of the channels that were measured.
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
        found.append(
            f"{wav.path}: shorter than the {settling_time(time_weighting):g} s in which the "
            "detector settles, so there are no readings"
        )
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
