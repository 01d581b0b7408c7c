"""Figures of the comparison: levels against speed and beta, the front, and the sources."""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mute.acoustics.soundscape import SOURCES
from mute.evaluation.comparison.conclusions import (
    EQUAL_SPEED,
    MOST_FALLS,
    falls_often,
    labels,
    pareto_front,
    source_level,
)
from mute.evaluation.noise_figures import save_figure
from mute.evaluation.plotting import COLOURS, STYLE

__all__ = ["draw_betas", "draw_levels"]

Row = Mapping[str, Any]


def draw_levels(rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw levels on wood against speed, their front and their sources; return the files.

    Nothing is drawn where nothing was heard there.
    """
    if not _told(rows):
        return []
    return [
        *_draw_speeds(rows, directory),
        *_draw_front(rows, directory),
        *_draw_sources(rows, directory),
    ]


def _draw_speeds(rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw levels on wood against the actual speed, a line a label; return the files."""
    with mpl.rc_context(STYLE):
        figure, axes = _axes()
        told = _told(rows)
        for look, name in told:
            own = _mean_over_trainings(_heard(rows, name, "wood"), "command_speed")
            speeds = [row["speed_mean"] for row in own]
            mnl = [row["mnl_mean"] for row in own]
            drawn = {"color": look.colour, "marker": look.marker, "markersize": 3.0}
            axes.plot(speeds, mnl, linestyle=look.line, label=name, **drawn)
            fallen = [(row["speed_mean"], row["mnl_mean"]) for row in own if falls_often(row)]
            axes.plot(*_columns(fallen), linestyle="", markerfacecolor="white", **drawn)
            pnl = [row["pnl_mean"] for row in own]
            axes.fill_between(speeds, mnl, pnl, color=look.colour, alpha=0.12, linewidth=0.0)
        axes.set_xlabel("actual speed (m/s)")
        axes.set_ylabel("level (dBA)")
        axes.set_title(f"wood: MNL (line) to PNL (band), modelled{_marked(rows)}", fontsize=9)
        _legend(figure, axes, len(told))
        return save_figure(figure, directory / "speed")


def draw_betas(sweep: Sequence[Row], directory: Path) -> list[Path]:
    """Draw levels and the squared velocity error against beta; return the files."""
    own = _mean_over_trainings([row for row in sweep if row["mnl_mean"] is not None], "beta")
    betas = [row["beta"] for row in own]
    with mpl.rc_context(STYLE):
        figure, axes = _axes()
        mnl = [row["mnl_mean"] for row in own]
        axes.plot(betas, mnl, color=COLOURS[0], marker="o", markersize=3.5)
        pnl = [row["pnl_mean"] for row in own]
        axes.fill_between(betas, mnl, pnl, color=COLOURS[0], alpha=0.18, linewidth=0.0)
        axes.set_xlabel("quiet factor beta")
        axes.set_ylabel("level (dBA)", color=COLOURS[0])
        speed = sweep[0]["command_speed"]
        axes.set_title(f"wood, asked for {speed:g} m/s: MNL to PNL, modelled", fontsize=9)
        other = axes.twinx()
        errors = [row["velocity_error_sq"] for row in own]
        other.plot(betas, errors, color=COLOURS[1], marker="s", markersize=3.5)
        other.set_ylabel("squared velocity error ((m/s)$^2$)", color=COLOURS[1])
        other.set_ylim(bottom=0.0)
        other.grid(visible=False)
        return save_figure(figure, directory / "beta")


def _draw_front(rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw every setting on wood by actual speed and level, and the front; return the files."""
    with mpl.rc_context(STYLE):
        figure, axes = _axes()
        points, told = [], _told(rows)
        for look, name in told:
            own = _heard(rows, name, "wood")
            at = [(row["speed_mean"], row["mnl_mean"]) for row in own]
            fell = [falls_often(row) for row in own]
            points += [point for point, fallen in zip(at, fell, strict=True) if not fallen]
            filled = ["none" if fallen else look.colour for fallen in fell]
            drawn = {"s": 12.0, "marker": look.marker, "edgecolors": look.colour}
            axes.scatter(*_columns(at), facecolors=filled, **drawn)
            axes.scatter([], [], facecolors=look.colour, label=name, **drawn)
        axes.plot(*_columns(pareto_front(points)), color="0.4", linewidth=0.8, zorder=0)
        axes.set_xlabel("actual speed (m/s)")
        axes.set_ylabel("MNL (dBA)")
        title = "wood, modelled: the line joins what nothing beats in both"
        axes.set_title(title + _marked(rows), fontsize=9)
        _legend(figure, axes, len(told))
        return save_figure(figure, directory / "front")


def _draw_sources(rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw where the noise comes from on wood, a group of bars a label; return the files."""
    with mpl.rc_context(STYLE):
        names, width = labels(rows), 0.8 / len(SOURCES)
        figure, axes = _axes(max(_WIDTH, _WIDTH_OF_A_GROUP * len(names)))
        palette = (*COLOURS, "0.5")
        for index, (source, colour) in enumerate(zip(SOURCES, palette, strict=True)):
            values = [source_level(rows, name, "wood", source) for name in names]
            places = [place + (index - 2) * width for place in range(len(names))]
            heights = [0.0 if value is None else max(value - _LOWEST, 0.0) for value in values]
            axes.bar(places, heights, width, _LOWEST, color=colour, label=source)
        rotation = 90.0 if len(names) > _MOST_INSIDE else 0.0
        shown = [name.replace(", ", "\n") for name in names]
        axes.set_xticks(range(len(names)), shown, rotation=rotation)
        axes.set_ylabel("LAeq (dBA)")
        axes.set_ylim(top=axes.get_ylim()[1] + 3.0)  # for the legend
        axes.set_title(f"wood, asked for {EQUAL_SPEED:g} m/s, modelled", fontsize=9)
        axes.legend(frameon=False, fontsize=7, ncols=len(SOURCES), loc="upper center")
        return save_figure(figure, directory / "sources")


_LOWEST = 30.0
"""Level that bars stand on, dBA."""


def _columns(points: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [speed for speed, _ in points], [loudness for _, loudness in points]


def _marked(rows: Sequence[Row]) -> str:
    """Return what a title says of the settings on wood that many robots fell in, if any."""
    if not any(falls_often(row) for row in rows if row["surface"] == "wood"):
        return ""
    return f"\nhollow: more than {100.0 * MOST_FALLS:.0f} % of the robots fell"


_WIDTH, _HEIGHT = 5.6, 3.6
"""Size of a figure, inches."""
_WIDTH_OF_A_GROUP = 0.4
"""Least width of a group of bars, whose label stands upright where there are many, inches."""
_MOST_INSIDE, _MOST_IN_A_COLUMN = 7, 18
"""How many labels fit: in a legend within the axes or under bars, and in a column beside them."""


def _axes(width: float = _WIDTH) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, _HEIGHT), layout="constrained")
    return figure, figure.subplots()


def _legend(figure: Figure, axes: Axes, count: int) -> None:
    """Add a legend, beside the axes if they would be full of it."""
    if count <= _MOST_INSIDE:
        axes.legend(frameon=False, fontsize=7)
        return
    columns = math.ceil(count / _MOST_IN_A_COLUMN)
    figure.set_figwidth(_WIDTH + 2.0 * columns)
    figure.legend(loc="outside right upper", ncols=columns, frameon=False, fontsize=7)


@dataclass(frozen=True)
class _Look:
    """How a label is drawn."""

    colour: str
    line: str
    marker: str


_LOOKS = tuple(
    _Look(colour, line, marker)
    for line, marker in (("-", "o"), ("--", "s"), (":", "^"), ("-.", "D"))
    for colour in (
        *COLOURS,
        *("#c08a1e", "#3b3b3b", "#c06090", "#2aa198", "#7a4a2a", "#8c9bb0"),
    )
)
"""Enough for all methods, quiet terms and ablations at three quiet factors, all distinct."""


def _told(rows: Sequence[Row]) -> list[tuple[_Look, str]]:
    """Return the labels that were heard on wood, with their looks."""
    told = [name for name in labels(rows) if _heard(rows, name, "wood")]
    return list(zip(itertools.cycle(_LOOKS), told, strict=False))


def _heard(rows: Sequence[Row], name: str, surface: str) -> list[Row]:
    return [
        row
        for row in rows
        if row["label"] == name and row["surface"] == surface and row["mnl_mean"] is not None
    ]


def _mean_over_trainings(rows: Sequence[Row], key: str) -> list[dict[str, float]]:
    """Return rows that are equal in a key as one, with the means of what figures show."""
    shown = ("speed_mean", "mnl_mean", "pnl_mean", "velocity_error_sq", "fall_rate")
    return [
        {key: value}
        | {name: statistics.fmean(row[name] for row in rows if row[key] == value) for name in shown}
        for value in sorted({row[key] for row in rows})
    ]
