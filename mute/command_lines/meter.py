"""A sound level meter for recordings: python -m mute.acoustics.meter FILE.wav.

It gives the figures of `levels` (MNL, PNL, LAeq, LAFmax, L10, L90) of a real recording with the
meter of `sound_level_meter`, which also hears the robots in simulation.

A recording is calibrated with a second one, made with the same gain, of a sound calibrator that
gives a known level (usually 94 dB at 1 kHz). Its A-weighted level over its whole length is taken to
be that level: at 1 kHz the weighting is 0 dB, and hum, wind and an offset are kept out. So the
file must hold the steady tone alone, and for a calibrator at another frequency its A-weighted level
must be given (124 dB at 250 Hz: 115.4). Without a calibration the figures are in dB re full scale,
dBFS(A), where 0 dB is a root mean square of 1: a full sine of 1 kHz has -3.0.

Of a recording with several channels, the figures are those of the energy mean (at each instant the
mean of the squares), or of one channel that is chosen.
"""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from mute.acoustics.files.wav import WavReader, read_wav
from mute.acoustics.metering.levels import (
    P_REF,
    LevelDetector,
    Levels,
    TimeWeighting,
    settling_time,
)
from mute.acoustics.metering.loudness import zwicker_loudness
from mute.acoustics.metering.sound_level_meter import SAMPLES_AT_ONCE, SoundLevelMeter
from mute.acoustics.metering.weighting import MAX_SAMPLE_RATE, MIN_SAMPLE_RATE, AWeighting
from mute.command_lines.arguments import command_line, parse
from mute.support.errors import MuteError
from mute.support.plain_data import without_nan

__all__ = ["MeterArgs", "main"]

_WIDE_BAND_RATE = 32000
"""Sample rate below which a part of what is heard is missing, Hz."""

_STEADY = 1.0
"""Largest L10 - L90 of a calibration recording, dB (chosen)."""

_ALIKE = 6.0
"""Largest difference between the channels of a calibration recording, dB (chosen)."""

_SILENT = -120.0
"""Level below which there is no calibrator in a recording, dBFS(A) (chosen)."""

_CAPTIONS = {
    "mnl": "mean of the readings",
    "pnl": "largest reading",
    "laeq": "level of the mean square",
    "lafmax": "largest value of the detector",
    "l10": "exceeded for 10 % of the time",
    "l90": "exceeded for 90 % of the time",
}


@dataclass
class MeterArgs:
    """Arguments of the meter."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE.wav")]
    """Recording (WAV)."""
    calibration_db: float | None = None
    """Level of the sound calibrator, dB (of 1 kHz; else its A-weighted level)."""
    calibration_file: Path | None = None
    """Recording of the calibrator's steady tone, with the same gain."""
    time_weighting: Literal["fast", "slow"] = "fast"
    """Time weighting: fast (125 ms) or slow (1 s)."""
    channel: int | None = None
    """Channel to measure, from 1. Default: the energy mean of all."""
    loudness: bool = False
    """Give the loudness (Zwicker, sone) too; slow, and needs a calibration and mute[loudness]."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument or a file is bad.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(MeterArgs, argv, "Measure the sound level of a recording.")
    _check(args)
    figures = _figures(args)
    for warning in figures["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    if args.json:
        print(json.dumps(without_nan(figures)))
    else:
        _print_figures(figures)
    return 0


def _check(args: MeterArgs) -> None:
    """Refuse arguments that do not go together.

    Raises:
        MuteError: If there are any.
    """
    if args.calibration_db is not None and args.calibration_file is None:
        raise MuteError("--calibration-db needs --calibration-file, the calibrator's recording")
    if args.calibration_file is not None and args.calibration_db is None:
        raise MuteError("--calibration-file needs --calibration-db, the calibrator's level")
    if args.calibration_db is not None and not math.isfinite(args.calibration_db):
        raise MuteError(f"--calibration-db must be a level in dB, got {args.calibration_db}")
    if args.loudness and args.calibration_file is None:
        raise MuteError("--loudness needs --calibration-db and --calibration-file")


def _figures(args: MeterArgs) -> dict[str, Any]:
    """Return all figures of a recording, as the JSON has them."""
    warnings: list[str] = []
    with _open(args.file) as wav:
        channels = _chosen(wav, args.channel)
        if args.loudness and len(channels) > 1:
            raise MuteError(f"{args.file}: loudness is of one channel, choose it with --channel")
        gains = _gains(args, wav.channels, channels, warnings)
        detector = _detect(wav, channels, gains, args)
        (levels,) = detector.result()
        clipped = int(wav.clipped[channels].sum())
        figures = {
            **dataclasses.asdict(levels),
            "file": str(args.file),
            "unit": "dBFS(A)" if args.calibration_file is None else "dBA",
            "reference": "full scale" if args.calibration_file is None else "20 uPa",
            "time_weighting": args.time_weighting,
            "channels": wav.channels,
            "channel": args.channel if wav.channels > 1 else 1,
            "clipped": clipped,
        }
    warnings += _doubts(args, figures)
    if args.loudness:
        samples, sample_rate = read_wav(args.file)
        loudness = zwicker_loudness(gains[0] * samples[channels[0]], sample_rate)
        figures |= {"loudness_n5": loudness.n5, "loudness_max": loudness.maximum}
    return figures | {"warnings": warnings}


def _open(path: Path) -> WavReader:
    """Open a recording.

    Raises:
        MuteError: If it cannot be read, or its sample rate is too low or too high.
    """
    wav = WavReader(path)
    if not MIN_SAMPLE_RATE <= wav.sample_rate <= MAX_SAMPLE_RATE:
        raise MuteError(
            f"{path}: sample rate {wav.sample_rate} Hz, levels need {MIN_SAMPLE_RATE} to "
            f"{MAX_SAMPLE_RATE} Hz"
        )
    return wav


def _chosen(wav: WavReader, channel: int | None) -> list[int]:
    """Return the indices of the channels to measure.

    Raises:
        MuteError: If there is no such channel.
    """
    if channel is None:
        return list(range(wav.channels))
    if not 1 <= channel <= wav.channels:
        raise MuteError(f"{wav.path}: --channel must be 1 to {wav.channels}, got {channel}")
    return [channel - 1]


def _gains(
    args: MeterArgs, num_channels: int, channels: list[int], warnings: list[str]
) -> NDArray[np.float64]:
    """Return what full scale of each measured channel is in Pa, or 1 without a calibration.

    Args:
        args: Arguments.
        num_channels: Channels of the recording.
        channels: Indices of those that are measured.
        warnings: Doubts are added here.

    Raises:
        MuteError: If the calibration recording is not one.
    """
    path, level = args.calibration_file, args.calibration_db
    if path is None or level is None:
        return np.ones(len(channels))
    with _open(path) as wav:
        if wav.channels not in (1, num_channels):
            raise MuteError(
                f"{path}: {wav.channels} channels, but {num_channels} in {args.file}; "
                "a calibration has one or as many"
            )
        meter = SoundLevelMeter(wav.sample_rate, wav.channels, reference=1.0)
        for block in wav.blocks():
            meter.update(block)
        used = [0] * len(channels) if wav.channels == 1 else channels
        results = meter.result()
        tones = [results[channel] for channel in used]
        clipped = int(wav.clipped[used].sum())
    _check_tones(path, tones)
    if clipped:
        warnings.append(f"{path}: {clipped} samples at full scale, the calibration is clipped")
    unsteady = max(tone.l10 - tone.l90 for tone in tones)
    if unsteady > _STEADY:
        warnings.append(f"{path}: not a steady tone, its L10 is {unsteady:.1f} dB above its L90")
    return P_REF * 10.0 ** ((level - np.array([tone.laeq for tone in tones])) / 20.0)


def _check_tones(path: Path, tones: list[Levels]) -> None:
    """Refuse levels that cannot be those of a calibrator.

    Raises:
        MuteError: If the recording is too short, silent, or of one channel of several.
    """
    if tones[0].readings == 0:
        raise MuteError(f"{path}: too short for a calibration ({tones[0].seconds:.2f} s)")
    levels = [tone.laeq for tone in tones]
    spread = max(levels) - min(levels)
    if max(levels) < _SILENT:
        raise MuteError(f"{path}: silent, there is no calibrator's tone in it")
    if spread > _ALIKE:
        raise MuteError(
            f"{path}: its channels differ by {spread:.1f} dB, as if one microphone had "
            "the calibrator; choose that one with --channel"
        )


def _detect(
    wav: WavReader, channels: list[int], gains: NDArray[np.float64], args: MeterArgs
) -> LevelDetector:
    """Return the detector after the whole recording, for the energy mean of its channels."""
    reference = 1.0 if args.calibration_file is None else P_REF
    weighting = AWeighting(wav.sample_rate)
    detector = LevelDetector(wav.sample_rate, 1, args.time_weighting, reference)
    for block in wav.blocks(max(SAMPLES_AT_ONCE // wav.channels, 1)):
        weighted = weighting.filter(gains[:, None] * block[channels])
        detector.update(np.square(weighted).mean(axis=0, keepdims=True))
    return detector


def _doubts(args: MeterArgs, figures: dict[str, Any]) -> list[str]:
    """Return what a user must know about the figures of a recording."""
    doubts = []
    if figures["clipped"]:
        doubts.append(
            f"{args.file}: {figures['clipped']} samples at full scale, the recording is clipped "
            "and its levels are too low"
        )
    if figures["readings"] == 0:
        settling = settling_time(args.time_weighting)
        doubts.append(
            f"{args.file}: shorter than the {settling:g} s in which the detector settles, "
            "so there are no readings"
        )
    elif figures["mnl"] == -math.inf:
        doubts.append(f"{args.file}: digital silence in the readings, they have no mean")
    if figures["sample_rate"] < _WIDE_BAND_RATE:
        half = figures["sample_rate"] // 2
        doubts.append(f"{args.file}: nothing above {half} Hz is in it, half its sample rate")
    if figures["channel"] is None:
        doubts.append(
            f"{args.file}: {figures['channels']} channels, measured as their energy mean; "
            "choose one with --channel"
        )
    return doubts


def _print_figures(figures: dict[str, Any]) -> None:
    """Print figures as lines."""
    channel = figures["channel"]
    which = "energy mean" if channel is None else f"channel {channel}"
    print(
        f"{figures['file']}: {figures['seconds']:.2f} s at {figures['sample_rate']} Hz, {which} "
        f"of {figures['channels']}, {figures['time_weighting'].capitalize()}"
    )
    if figures["unit"] == "dBA":
        print("levels in dBA re 20 uPa")
    else:
        print("levels in dBFS(A), relative to full scale: not calibrated")
    for name, caption in _CAPTIONS.items():
        print(f"{_symbol(name, figures['time_weighting']):7}{figures[name]:8.2f}  {caption}")
    if "loudness_n5" in figures:
        print(f"{'N5':7}{figures['loudness_n5']:8.2f}  sone, exceeded for 5 % of the time")
        print(f"{'Nmax':7}{figures['loudness_max']:8.2f}  sone, largest")


def _symbol(name: str, time_weighting: TimeWeighting) -> str:
    """Return the usual symbol of a figure."""
    slow_or_fast = "LASmax" if time_weighting == "slow" else "LAFmax"
    return {"laeq": "LAeq", "lafmax": slow_or_fast}.get(name, name.upper())
