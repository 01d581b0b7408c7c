"""A measured recording as the meter tells it: one JSON object, or lines."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Any

from mute.acoustics.metering.background import CORRECTED
from mute.acoustics.metering.levels import figure_symbol
from mute.acoustics.metering.recordings import MeasuredRecording
from mute.acoustics.metering.third_octaves import ThirdOctaveLevel

__all__ = ["figure_lines", "report", "spectrum_lines"]

_CAPTIONS = {
    "mnl": "mean of the readings",
    "pnl": "largest reading",
    "laeq": "level of the mean square",
    "lafmax": "largest value of the detector",
    "l10": "exceeded for 10 % of the time",
    "l90": "exceeded for 90 % of the time",
}

_BANDS_A_LINE = 3
"""An octave."""


def report(recording: MeasuredRecording) -> dict[str, Any]:
    """Return what --json prints of a recording; figures that were not to be had are NaN."""
    levels, loudness = recording.measurement.levels, recording.loudness
    figures = {
        **dataclasses.asdict(levels),
        "third_octaves": _spectrum(recording.measurement.third_octaves),
        "file": str(recording.path),
        "from": recording.span.begin_time,
        "to": recording.span.end_time,
        "unit": recording.unit,
        "reference": "20 uPa" if recording.calibrated else "full scale",
        "time_weighting": recording.time_weighting,
        "channels": recording.channels,
        "channel": recording.channel,
        "clipped": recording.clipped,
    }
    if loudness is not None:
        figures |= {"loudness_n5": loudness.n5, "loudness_max": loudness.maximum}
    return figures | _of_the_background(recording) | {"warnings": list(recording.warnings)}


def figure_lines(recording: MeasuredRecording) -> Iterator[str]:
    """Yield the figures of a recording as lines."""
    levels, channel, span = recording.measurement.levels, recording.channel, recording.span
    which = "energy mean" if channel is None else f"channel {channel}"
    yield (
        f"{recording.path}: {span.begin_time:.2f} to {span.end_time:.2f} s at {span.sample_rate} "
        f"Hz, {which} of {recording.channels}, {recording.time_weighting.capitalize()}"
    )
    if recording.calibrated:
        yield "levels in dBA re 20 uPa"
    else:
        yield "levels in dBFS(A), relative to full scale: not calibrated"
    if recording.background is not None:
        alone = recording.background.measurement.levels.laeq
        yield f"without the background of {alone:.2f} {recording.unit}; with it in brackets"
    for name, caption in _CAPTIONS.items():
        symbol = figure_symbol(name, recording.time_weighting)
        heard = getattr(recording.heard.levels, name)
        with_it = "" if recording.background is None else f"  [{_shown(heard)}]"
        yield f"{symbol:7}{_shown(getattr(levels, name)):>8}{with_it}  {caption}"
    if recording.loudness is not None:
        yield f"{'N5':7}{recording.loudness.n5:8.2f}  sone, exceeded for 5 % of the time"
        yield f"{'Nmax':7}{recording.loudness.maximum:8.2f}  sone, largest"


def spectrum_lines(recording: MeasuredRecording) -> Iterator[str]:
    """Yield the spectrum of a recording as lines, an octave each."""
    unit = "dB re 20 uPa" if recording.calibrated else "dBFS"
    yield f"third octaves, unweighted: Hz, {unit}"
    bands = recording.measurement.third_octaves
    for first in range(0, len(bands), _BANDS_A_LINE):
        octave = bands[first : first + _BANDS_A_LINE]
        yield "".join(f"{band.frequency:>9g}{_shown(band.level):>9}" for band in octave)


def _of_the_background(recording: MeasuredRecording) -> dict[str, Any]:
    """Return what was taken away and what there was before; nothing if nothing was."""
    background, heard = recording.background, recording.heard
    if background is None:
        return {}
    alone = background.measurement
    return {
        "background": {
            "file": str(background.path),
            "laeq": alone.levels.laeq,
            "third_octaves": _spectrum(alone.third_octaves),
        },
        "uncorrected": {
            **{name: getattr(heard.levels, name) for name in CORRECTED},
            "third_octaves": _spectrum(heard.third_octaves),
        },
    }


def _spectrum(bands: tuple[ThirdOctaveLevel, ...]) -> list[dict[str, float]]:
    return [dataclasses.asdict(band) for band in bands]


def _shown(level: float) -> str:
    return "-" if math.isnan(level) else f"{level:.2f}"
