"""A sound level meter for recordings: python -m mute.acoustics.meter FILE.wav ...

It gives the figures of `levels` (MNL, PNL, LAeq, LAFmax, L10, L90) of real recordings with the
meter of `sound_level_meter`, which also hears the robots in simulation, and their third octaves.

A recording is calibrated with a second one, made with the same gain, of a sound calibrator that
gives a known level (usually 94 or 114 dB at 1 kHz); see `calibrator`. For one at another frequency
that is given, too (124 dB at 250 Hz: `--calibration-db 124 --calibration-frequency 250`). Without a
calibration the figures are in dB re full scale, dBFS(A), where 0 dB is a root mean square of 1: a
full sine of 1 kHz has -3.0.

Of a recording with several channels, the figures are those of the energy mean (at each instant the
mean of the squares), or of one channel that is chosen. Those of a part of it are `spans`, those
without the noise of the room `background`.
"""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from mute.acoustics.metering.calibrator import Calibrator
from mute.acoustics.metering.recordings import (
    MeasuredRecording,
    MeterSettings,
    RecordingMeter,
    SharedFileError,
)
from mute.command_lines.arguments import check_option, command_line, parse
from mute.command_lines.meter_figures import figure_lines, report, spectrum_lines
from mute.command_lines.meter_files import KeptFiles, kept_files
from mute.evaluation.plotting import check_matplotlib
from mute.support.errors import EXIT_USER_ERROR, MuteError
from mute.support.plain_data import without_nan
from mute.support.ranges import Range
from mute.support.streams import patient_output

__all__ = ["MeterArgs", "main"]

_CALIBRATOR_LEVELS = (60.0, 130.0)
"""Levels of sound calibrators, dB: what is on the market lies within them."""

_CALIBRATOR_FREQUENCIES = (100.0, 10000.0)
"""Frequencies of sound calibrators that are taken, Hz (chosen)."""


@dataclass
class MeterArgs:
    """Arguments of the meter."""

    files: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="FILE.wav ...", help_behavior_hint="(required)"),
    ]
    """Recordings (WAV); /dev/stdin for one that comes through a pipe."""
    calibration_db: float | None = None
    """Level of the sound calibrator, as its label says, dB."""
    calibration_file: Path | None = None
    """Recording of the calibrator's steady tone, with the same gain."""
    calibration_frequency: float | None = None
    """Frequency of the sound calibrator, Hz. Default: 1000."""
    background: Path | None = None
    """Recording of the background, with the same gain: its energy is taken away."""
    begin: Annotated[float | None, tyro.conf.arg(name="from")] = None
    """Begin of the span that is measured, s. Default: the recording's."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """End of the span that is measured, s. Default: the recording's."""
    time_weighting: Literal["fast", "slow"] = "fast"
    """Time weighting: fast (125 ms) or slow (1 s)."""
    channel: int | None = None
    """Channel to measure, from 1. Default: the energy mean of all."""
    loudness: bool = False
    """Give the loudness (Zwicker, sone) too; slow, and needs a calibration and mute[loudness]."""
    spectrum: bool = False
    """Print the third octaves, too; --json has them always."""
    history: Path | None = None
    """CSV of the 20 readings a second; of several recordings, a directory of them."""
    plot: Path | None = None
    """PNG of the readings and the third octaves; of several recordings, a directory of them."""
    json: bool = False
    """Print one JSON object and nothing else; of several recordings, a list of them."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument or the one file is bad; of several files, if one is that all need.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(MeterArgs, argv, "Measure the sound level of recordings.")
    _check(args)
    inputs = [path for path in (args.calibration_file, args.background) if path is not None]
    kept = kept_files(args.files, args.history, args.plot, inputs)
    keeps_files = args.history is not None or args.plot is not None
    with patient_output() if keeps_files else contextlib.nullcontext():
        return _measure(args, kept)


def _measure(args: MeterArgs, kept: Sequence[KeptFiles]) -> int:
    """Measure recordings, tell each of them and keep its files; return the exit status.

    Raises:
        MuteError: If the one file is bad; of several files, if one is that all need.
    """
    meter, told, status = RecordingMeter(_settings(args)), set[str](), 0
    with _telling(args) as tell:
        for path, files in zip(args.files, kept, strict=True):
            try:
                recording = meter.measure(path)
                _say("warning", recording.warnings, told)
                tell(recording)
                written = files.write(recording)
            except MuteError as error:
                if len(args.files) == 1 or isinstance(error, SharedFileError):
                    raise
                _say("error", [" ".join(str(error).splitlines())], told)
                status = EXIT_USER_ERROR
                continue
            if written and not args.json:
                print(f"written: {', '.join(map(str, written))}")
    return status


@contextlib.contextmanager
def _telling(args: MeterArgs) -> Iterator[Callable[[MeasuredRecording], None]]:
    """Yield what tells a recording: in lines at once, or in JSON in the end, whatever ends it."""
    if not args.json:
        yield lambda recording: _print_lines(args, recording)
        return
    reports: list[dict[str, Any]] = []
    try:
        yield lambda recording: reports.append(report(recording))
    finally:
        if len(args.files) > 1:
            print(json.dumps(without_nan(reports)))
        elif reports:
            print(json.dumps(without_nan(reports[0])))


def _print_lines(args: MeterArgs, recording: MeasuredRecording) -> None:
    """Print a recording's figures."""
    lines = [*figure_lines(recording), *(spectrum_lines(recording) if args.spectrum else ())]
    print("\n".join(lines), flush=True)  # now: the next recording may be an hour long


def _say(kind: str, lines: Iterable[str], told: set[str]) -> None:
    """Print lines to standard error, each but once: several recordings may share one's faults."""
    for line in lines:
        if line not in told:
            print(f"{kind}: {line}", file=sys.stderr, flush=True)
            told.add(line)


def _settings(args: MeterArgs) -> MeterSettings:
    """Return how the recordings are measured."""
    calibrator = None
    if args.calibration_db is not None:
        frequency = args.calibration_frequency or Calibrator.frequency
        calibrator = Calibrator(args.calibration_db, frequency)
    return MeterSettings(
        calibrator=calibrator,
        calibration_file=args.calibration_file,
        background_file=args.background,
        channel=args.channel,
        time_weighting=args.time_weighting,
        begin=args.begin,
        end=args.end,
        loudness=args.loudness,
    )


def _check(args: MeterArgs) -> None:
    """Refuse arguments that do not go together.

    Raises:
        MuteError: If there are any.
    """
    if not args.files:
        raise MuteError("a recording to measure must be named: FILE.wav")
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
    if args.begin is not None:
        check_option("from", args.begin, Range(0.0))
    if args.end is not None:
        check_option("to", args.end, Range(0.0, above=True))
    if args.begin is not None and args.end is not None and args.end <= args.begin:
        raise MuteError(f"--to must be above --from, {args.begin} s, got {args.end}")
    if args.plot is not None:
        check_matplotlib()


def _check_range(name: str, value: float | None, allowed: tuple[float, float], unit: str) -> None:
    """Refuse a value that is out of its range.

    Raises:
        MuteError: If it is.
    """
    low, high = allowed
    if value is not None and not low <= value <= high:  # which NaN is not
        raise MuteError(f"{name} must be {low:g} to {high:g} {unit}, got {value:g}")
