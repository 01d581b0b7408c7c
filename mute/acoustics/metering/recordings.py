"""The meter of recordings: calibrated, of a span, without the background.

Calibrator and background are recorded once, with the same gain, for any number of recordings; they
are measured when the first recording needs them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mute.acoustics.files.reading import WavReader
from mute.acoustics.metering.background import (
    CORRECTED,
    LEAST_DIFFERENCE,
    levels_without,
    third_octaves_without,
)
from mute.acoustics.metering.calibrator import Calibration, Calibrator, calibrate
from mute.acoustics.metering.levels import P_REF, TimeWeighting, figure_symbol
from mute.acoustics.metering.loudness import Loudness, zwicker_loudness
from mute.acoustics.metering.spans import Span, find_span
from mute.acoustics.metering.wav_levels import (
    Measurement,
    chosen_channels,
    doubts,
    measure_span,
    open_wav,
)
from mute.support.errors import MuteError

__all__ = [
    "Background",
    "MeasuredRecording",
    "MeterSettings",
    "RecordingMeter",
    "SharedFileError",
]


class SharedFileError(MuteError):
    """The calibrator's or the background's recording is bad, and with it every measurement."""


@dataclass(frozen=True)
class MeterSettings:
    """How recordings are measured."""

    calibrator: Calibrator | None = None
    """Sound calibrator; None for levels re full scale."""
    calibration_file: Path | None = None
    """Recording of the calibrator."""
    background_file: Path | None = None
    """Recording of the background."""
    channel: int | None = None
    """Channel to measure, from 1; None for the energy mean of all."""
    time_weighting: TimeWeighting = "fast"
    """Of the detector."""
    begin: float | None = None
    """Begin of the span, s."""
    end: float | None = None
    """End of the span, s."""
    loudness: bool = False
    """Whether the loudness is taken, too."""


@dataclass(frozen=True)
class Background:
    """What was heard without the robot."""

    path: Path
    """Recording."""
    measurement: Measurement
    """Its levels, from its begin to its end."""
    warnings: tuple[str, ...]
    """What a user must know about it, one line each."""


@dataclass(frozen=True)
class MeasuredRecording:
    """What the meter makes of a recording."""

    path: Path
    """Recording."""
    calibrated: bool
    """Whether levels are in dB re 20 uPa; otherwise they are in dB re full scale."""
    time_weighting: TimeWeighting
    """Of the detector."""
    channels: int
    """Number of channels in the recording."""
    channel: int | None
    """Which was measured, from 1; None for the energy mean of several."""
    span: Span
    """Part that was measured."""
    heard: Measurement
    """Levels of all that was heard."""
    measurement: Measurement
    """Levels without the background, NaN where they cannot be told from it; the readings are those
    of all that was heard. Without a background file, the same as `heard`."""
    background: Background | None
    """What was taken away."""
    clipped: int
    """Samples at full scale."""
    loudness: Loudness | None
    """Of all that was heard, if it was asked for."""
    warnings: tuple[str, ...]
    """What a user must know, one line each."""

    @property
    def unit(self) -> str:
        """Unit of the A-weighted levels."""
        return "dBA" if self.calibrated else "dBFS(A)"


class RecordingMeter:
    """Measures recordings one after the other, all in the same way."""

    def __init__(self, settings: MeterSettings) -> None:
        """Take the settings; files are opened when a recording is measured."""
        self.settings = settings
        self._calibrations: dict[int, Calibration] = {}
        self._backgrounds: dict[tuple[int, int], Background] = {}

    def measure(self, path: Path) -> MeasuredRecording:
        """Return what the meter makes of a recording.

        Raises:
            SharedFileError: If the calibrator's or the background's recording cannot be used.
            MuteError: If the recording cannot be measured, does not go with those two, or cannot
                be told from the background.
        """
        settings = self.settings
        with open_wav(path) as wav:
            channels = chosen_channels(wav, settings.channel)
            if settings.loudness and len(channels) > 1:
                raise MuteError(f"{path}: loudness is of one channel, choose it with --channel")
            span = find_span(wav, settings.begin, settings.end)
            calibration = self._calibration(wav, channels)
            gains = np.ones(len(channels)) if calibration is None else calibration.gains
            background = self._background(wav, channels, gains)
            heard = self._measured(wav, channels, gains, span)
            warnings = [] if calibration is None else list(calibration.warnings)
            warnings += [] if background is None else background.warnings
            warnings += doubts(wav, channels, span, heard.levels, settings.time_weighting)
            recording = MeasuredRecording(
                path=path,
                calibrated=calibration is not None,
                time_weighting=settings.time_weighting,
                channels=wav.channels,
                channel=settings.channel if wav.channels > 1 else 1,
                span=span,
                heard=heard,
                measurement=heard,
                background=background,
                clipped=int(wav.clipped[channels].sum()),
                loudness=_loudness(wav, channels, gains, span) if settings.loudness else None,
                warnings=tuple(warnings),
            )
        return recording if background is None else _without_background(recording, background)

    def _measured(
        self, wav: WavReader, channels: list[int], gains: NDArray[np.float64], span: Span
    ) -> Measurement:
        reference = 1.0 if self.settings.calibrator is None else P_REF
        return measure_span(wav, channels, gains, span, self.settings.time_weighting, reference)

    def _calibration(self, wav: WavReader, channels: list[int]) -> Calibration | None:
        """Return what full scale of each measured channel is, or of all; nothing if uncalibrated.

        Raises:
            SharedFileError: If the calibrator's recording is not one.
            MuteError: If it has another number of channels.
        """
        path, calibrator = self.settings.calibration_file, self.settings.calibrator
        if path is None or calibrator is None:
            return None
        if wav.channels not in self._calibrations:
            with _open_shared(path) as tone:
                if tone.channels not in (1, wav.channels):
                    raise MuteError(
                        f"{path}: {tone.channels} channels, but {wav.channels} in {wav.path}; "
                        "a calibration has one or as many"
                    )
                with _shared():
                    used = channels if tone.channels > 1 else [0]
                    self._calibrations[wav.channels] = calibrate(tone, calibrator, used)
        return self._calibrations[wav.channels]

    def _background(
        self, wav: WavReader, channels: list[int], gains: NDArray[np.float64]
    ) -> Background | None:
        """Return the levels of the background, measured as the recording is; nothing if none is.

        Raises:
            SharedFileError: If the background's recording cannot be measured.
            MuteError: If it has another number of channels or another sample rate.
        """
        path = self.settings.background_file
        if path is None:
            return None
        kind = wav.channels, wav.sample_rate
        if kind not in self._backgrounds:
            with _open_shared(path) as alone:
                if (alone.channels, alone.sample_rate) != kind:
                    raise MuteError(
                        f"{path}: {alone.channels} channels at {alone.sample_rate} Hz, but "
                        f"{wav.channels} at {wav.sample_rate} Hz in {wav.path}; a background is "
                        "recorded as the recordings are"
                    )
                with _shared():
                    span = find_span(alone, None, None)
                    measured = self._measured(alone, channels, gains, span)
                levels, weighting = measured.levels, self.settings.time_weighting
                told = tuple(doubts(alone, channels, span, levels, weighting))
                self._backgrounds[kind] = Background(path, measured, told)
        return self._backgrounds[kind]


@contextlib.contextmanager
def _shared() -> Iterator[None]:
    """Tell of what goes wrong in here that it is not one recording's."""
    try:
        yield
    except MuteError as error:
        raise SharedFileError(str(error)) from error


def _open_shared(path: Path) -> WavReader:
    with _shared():
        return open_wav(path)


def _loudness(
    wav: WavReader, channels: list[int], gains: NDArray[np.float64], span: Span
) -> Loudness:
    """Return the loudness of a span.

    Raises:
        MuteError: If it cannot be taken.
    """
    blocks = wav.blocks(begin=span.begin, end=span.end)
    samples = np.concatenate([block[channels[0]] for block in blocks])
    try:
        return zwicker_loudness(gains[0] * samples, wav.sample_rate)
    except ValueError as error:
        raise MuteError(f"{wav.path}: no loudness can be taken: {error}") from error


def _without_background(recording: MeasuredRecording, background: Background) -> MeasuredRecording:
    """Return a recording's levels without the background's energy.

    Raises:
        MuteError: If its LAeq cannot be told from the background's.
    """
    heard, alone = recording.heard, background.measurement
    levels = levels_without(heard.levels, alone.levels.laeq)
    if math.isnan(levels.laeq):
        raise MuteError(
            f"{recording.path}: cannot be told from the background: its LAeq of "
            f"{heard.levels.laeq:.2f} {recording.unit} must be {LEAST_DIFFERENCE:g} dB or more "
            f"above the {alone.levels.laeq:.2f} of {background.path}"
        )
    bands = third_octaves_without(heard.third_octaves, alone.third_octaves)
    measurement = dataclasses.replace(heard, levels=levels, third_octaves=bands)
    told = _lost(recording, measurement)
    return dataclasses.replace(
        recording, measurement=measurement, warnings=(*recording.warnings, *told)
    )


def _lost(recording: MeasuredRecording, measurement: Measurement) -> list[str]:
    """Return a line that names the figures that cannot be told from the background, if any."""
    before, after = recording.heard, measurement
    lost = [
        figure_symbol(name, recording.time_weighting)
        for name in CORRECTED
        if _is_lost(getattr(before.levels, name), getattr(after.levels, name))
    ]
    bands = [
        f"{heard.frequency:g}"
        for heard, left in zip(before.third_octaves, after.third_octaves, strict=True)
        if _is_lost(heard.level, left.level)
    ]
    if bands:
        lost.append(f"third octaves of {', '.join(bands)} Hz")
    if not lost:
        return []
    return [
        f"{recording.path}: cannot be told from the background, less than {LEAST_DIFFERENCE:g} dB "
        f"above it: {', '.join(lost)}"
    ]


def _is_lost(heard: float, left: float) -> bool:
    return math.isnan(left) and not math.isnan(heard)
