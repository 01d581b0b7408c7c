"""The figure of a measured recording: its level over time, and its spectrum."""

from __future__ import annotations

import io
import warnings

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mute.acoustics.metering.levels import figure_symbol
from mute.acoustics.metering.recordings import MeasuredRecording
from mute.acoustics.metering.third_octaves import ThirdOctaveLevel
from mute.evaluation.plotting import COLOURS, STYLE

__all__ = ["draw_recording"]

_DEPTH = 80.0
"""What is drawn below the highest level of a panel at most, dB (chosen)."""

_GRID = 10.0
"""Axes of levels end at multiples of this, dB."""


def draw_recording(recording: MeasuredRecording) -> bytes:
    """Return a PNG: the readings over time, and the third octaves as bars.

    With a background, its levels are drawn as well. Bars are then without it, and a band that
    cannot be told from it has none; what is drawn over time is all that was heard.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 6.0), layout="constrained")
        over_time, over_frequency = figure.subplots(2)
        # What stands in a file's name is a name, never markup.
        figure.suptitle(_printable(recording.path.name), fontsize=9, parse_math=False)
        _draw_history(over_time, recording)
        _draw_spectrum(over_frequency, recording)
        picture = io.BytesIO()
        with warnings.catch_warnings():
            # matplotlib's font lacks many scripts, and draws a box for what it lacks.
            warnings.filterwarnings("ignore", message="Glyph .* missing from font")
            figure.savefig(picture, format="png", dpi=160)
    return picture.getvalue()


def _draw_history(axes: Axes, recording: MeasuredRecording) -> None:
    heard, span = recording.heard, recording.span
    axes.plot(heard.reading_times, _finite(heard.readings), color=COLOURS[0], linewidth=1.0)
    drawn = [*heard.readings]
    for name, style in (("laeq", "--"), ("mnl", ":")):
        level = getattr(heard.levels, name)
        if np.isfinite(level):
            label = f"{figure_symbol(name, recording.time_weighting)} {level:.1f}"
            axes.axhline(level, color="0.2", linewidth=1.0, linestyle=style, label=label)
            drawn.append(level)
    if recording.background is not None:
        alone = recording.background.measurement.levels.laeq
        if np.isfinite(alone):
            label = f"background's LAeq {alone:.1f}"
            axes.axhline(alone, color=COLOURS[1], linewidth=1.0, label=label)
            drawn.append(alone)
    axes.set_xlim(span.begin_time, span.end_time)
    axes.set_ylim(*_limits(np.array(drawn)))
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"level, {recording.time_weighting.capitalize()} ({recording.unit})")
    _explain(axes)


def _draw_spectrum(axes: Axes, recording: MeasuredRecording) -> None:
    bands = recording.measurement.third_octaves
    levels, drawn = _levels(bands), [_levels(bands)]
    if recording.background is not None:
        drawn.append(_levels(recording.background.measurement.third_octaves))
    floor, top = _limits(np.concatenate(drawn))
    places = np.arange(len(bands))
    bars = axes.bar(places, _heights(levels, floor), bottom=floor, color=COLOURS[0])
    if recording.background is not None:
        bars.set_label("without the background")
        axes.step(places, _finite(drawn[-1]), where="mid", color=COLOURS[1], label="background")
    axes.set_axisbelow(True)
    axes.grid(visible=False, axis="x")
    _explain(axes)
    axes.set_xlim(-0.6, len(bands) - 0.4)
    axes.set_ylim(floor, top)
    axes.set_xticks(places, [_short(band.frequency) for band in bands], rotation=90)
    axes.set_xlabel("third octave (Hz)")
    unit = "dB re 20 uPa" if recording.calibrated else "dBFS"
    axes.set_ylabel(f"level, unweighted ({unit})")


def _explain(axes: Axes) -> None:
    """Put a legend above what is drawn, if there is anything to explain."""
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))


def _levels(bands: tuple[ThirdOctaveLevel, ...]) -> NDArray[np.float64]:
    return np.array([band.level for band in bands])


def _finite(levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return levels with a gap where there is silence."""
    return np.where(np.isfinite(levels), levels, np.nan)


def _heights(levels: NDArray[np.float64], floor: float) -> NDArray[np.float64]:
    """Return how high bars are that stand on a floor; none of what is below it or has no level."""
    return np.maximum(np.nan_to_num(levels, nan=floor, neginf=floor), floor) - floor


def _limits(levels: NDArray[np.float64]) -> tuple[float, float]:
    """Return the ends of an axis for levels, of which some may be infinite or NaN."""
    finite = levels[np.isfinite(levels)]
    if len(finite) == 0:
        return -_GRID, 0.0
    top = _GRID * (np.floor(finite.max() / _GRID) + 1.0)
    low = _GRID * (np.ceil(finite.min() / _GRID) - 1.0)
    return float(max(low, top - _DEPTH)), float(top)


def _short(frequency: float) -> str:
    return f"{frequency / 1000.0:g}k" if frequency >= 1000.0 else f"{frequency:g}"


def _printable(name: str) -> str:
    """Return a file's name without what no font has: bytes that are no text, line breaks."""
    text = name.encode("utf-8", "replace").decode()
    return "".join(letter if letter.isprintable() else "?" for letter in text)
