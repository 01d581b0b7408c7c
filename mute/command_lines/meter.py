"""A sound level meter for recordings: python -m mute.acoustics.meter FILE.wav.

It gives the figures of `levels` (MNL, PNL, LAeq, LAFmax, L10, L90) of a real recording with the
meter of `sound_level_meter`, which also hears the robots in simulation.

A recording is calibrated with a second one, made with the same gain, of a sound calibrator that
gives a known level (usually 94 or 114 dB at 1 kHz); see `calibrator`. For one at another frequency
that is given, too (124 dB at 250 Hz: `--calibration-db 124 --calibration-frequency 250`). Without a
calibration the figures are in dB re full scale, dBFS(A), where 0 dB is a root mean square of 1: a
full sine of 1 kHz has -3.0.

Of a recording with several channels, the figures are those of the energy mean (at each instant the
mean of the squares), or of one channel that is chosen.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro
from numpy.typing import NDArray

from mute.acoustics.files.reading import WavReader
from mute.acoustics.metering.calibrator import Calibration, Calibrator, calibrate
from mute.acoustics.metering.levels import P_REF, TimeWeighting
from mute.acoustics.metering.loudness import zwicker_loudness
from mute.acoustics.metering.wav_levels import (
    chosen_channels,
    doubts,
    energy_mean_levels,
    open_wav,
)
from mute.command_lines.arguments import command_line, parse
from mute.support.errors import MuteError
from mute.support.plain_data import without_nan

__all__ = ["MeterArgs", "main"]

_CALIBRATOR_LEVELS = (60.0, 130.0)
"""Levels of sound calibrators, dB: what is on the market lies within them."""

_CALIBRATOR_FREQUENCIES = (100.0, 10000.0)
"""Frequencies of sound calibrators that are taken, Hz (chosen)."""

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
    """Recording (WAV); /dev/stdin for one that comes through a pipe."""
    calibration_db: float | None = None
    """Level of the sound calibrator, as its label says, dB."""
    calibration_file: Path | None = None
    """Recording of the calibrator's steady tone, with the same gain."""
    calibration_frequency: float | None = None
    """Frequency of the sound calibrator, Hz. Default: 1000."""
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
    if args.calibration_frequency is not None and args.calibration_file is None:
        raise MuteError("--calibration-frequency needs --calibration-file")
    _check_range("--calibration-db", args.calibration_db, _CALIBRATOR_LEVELS, "dB")
    _check_range(
        "--calibration-frequency", args.calibration_frequency, _CALIBRATOR_FREQUENCIES, "Hz"
    )
    if args.loudness and args.calibration_file is None:
        raise MuteError("--loudness needs --calibration-db and --calibration-file")


def _check_range(name: str, value: float | None, allowed: tuple[float, float], unit: str) -> None:
    """Refuse a value that is out of its range.

    Raises:
        MuteError: If it is.
    """
    low, high = allowed
    if value is not None and not low <= value <= high:  # which NaN is not
        raise MuteError(f"{name} must be {low:g} to {high:g} {unit}, got {value:g}")


def _figures(args: MeterArgs) -> dict[str, Any]:
    """Return all figures of a recording, as the JSON has them."""
    with open_wav(args.file) as wav:
        channels = chosen_channels(wav, args.channel)
        if args.loudness and len(channels) > 1:
            raise MuteError(f"{args.file}: loudness is of one channel, choose it with --channel")
        calibration = _calibration(args, wav, channels)
        gains = np.ones(len(channels)) if calibration is None else calibration.gains
        reference = 1.0 if calibration is None else P_REF
        levels = energy_mean_levels(wav, channels, gains, args.time_weighting, reference)
        warnings = [] if calibration is None else list(calibration.warnings)
        warnings += doubts(wav, channels, levels, args.time_weighting)
        figures: dict[str, Any] = {
            **dataclasses.asdict(levels),
            "file": str(args.file),
            "unit": "dBFS(A)" if calibration is None else "dBA",
            "reference": "full scale" if calibration is None else "20 uPa",
            "time_weighting": args.time_weighting,
            "channels": wav.channels,
            "channel": args.channel if wav.channels > 1 else 1,
            "clipped": int(wav.clipped[channels].sum()),
        }
        if args.loudness:
            figures |= _loudness(wav, channels, gains)
    return figures | {"warnings": warnings}


def _calibration(args: MeterArgs, wav: WavReader, channels: list[int]) -> Calibration | None:
    """Return what full scale of each measured channel is, or of all; nothing if uncalibrated.

    Raises:
        MuteError: If the calibration recording is not one.
    """
    path, level = args.calibration_file, args.calibration_db
    if path is None or level is None:
        return None
    with open_wav(path) as tone:
        if tone.channels not in (1, wav.channels):
            raise MuteError(
                f"{path}: {tone.channels} channels, but {wav.channels} in {args.file}; "
                "a calibration has one or as many"
            )
        frequency = args.calibration_frequency or Calibrator.frequency
        used = channels if tone.channels > 1 else [0]
        return calibrate(tone, Calibrator(level, frequency), used)


def _loudness(wav: WavReader, channels: list[int], gains: NDArray[np.float64]) -> dict[str, float]:
    """Return the loudness of a recording, as the JSON has it.

    Raises:
        MuteError: If it cannot be taken.
    """
    samples = np.concatenate([block[channels[0]] for block in wav.blocks()])
    try:
        loudness = zwicker_loudness(gains[0] * samples, wav.sample_rate)
    except ValueError as error:
        raise MuteError(f"{wav.path}: no loudness can be taken: {error}") from error
    return {"loudness_n5": loudness.n5, "loudness_max": loudness.maximum}


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
