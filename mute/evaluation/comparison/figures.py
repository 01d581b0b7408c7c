"""Figures of the comparison: levels against speed and beta, the front, and the sources."""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Mapping, Sequence
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
)
from mute.evaluation.noise_figures import save_figure
from mute.evaluation.plotting import COLOURS, STYLE

__all__ = ["draw_betas", "draw_levels"]

Row = Mapping[str, Any]


def draw_levels(rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw levels on wood against speed, their front and their sources; return the files.

    Nothing is drawn where nothing was heard there.
    """
    if not _coloured(rows):
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
        for colour, name in _coloured(rows):
            own = _mean_over_trainings(_heard(rows, name, "wood"), "command_speed")
            speeds = [row["speed_mean"] for row in own]
            mnl = [row["mnl_mean"] for row in own]
            axes.plot(speeds, mnl, color=colour, marker="o", markersize=3.0, label=name)
            fallen = [(row["speed_mean"], row["mnl_mean"]) for row in own if falls_often(row)]
            axes.plot(
                *_columns(fallen), linestyle="", marker="o", markersize=3.0, **_hollow(colour)
            )
            pnl = [row["pnl_mean"] for row in own]
            axes.fill_between(speeds, mnl, pnl, color=colour, alpha=0.12, linewidth=0.0)
        axes.set_xlabel("actual speed (m/s)")
        axes.set_ylabel("level (dBA)")
        axes.set_title(f"wood: MNL (line) to PNL (band), modelled{_marked(rows)}", fontsize=9)
        axes.legend(frameon=False, fontsize=7)
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
        points = []
        for colour, name in _coloured(rows):
            own = _heard(rows, name, "wood")
            at = [(row["speed_mean"], row["mnl_mean"]) for row in own]
            fell = [falls_often(row) for row in own]
            points += [point for point, fallen in zip(at, fell, strict=True) if not fallen]
            filled = ["none" if fallen else colour for fallen in fell]
            axes.scatter(*_columns(at), s=12.0, facecolors=filled, edgecolors=colour, label=name)
        axes.plot(*_columns(pareto_front(points)), color="0.4", linewidth=0.8, zorder=0)
        axes.set_xlabel("actual speed (m/s)")
        axes.set_ylabel("MNL (dBA)")
        title = "wood, modelled: the line joins what nothing beats in both"
        axes.set_title(title + _marked(rows), fontsize=9)
        axes.legend(frameon=False, fontsize=7)
        return save_figure(figure, directory / "front")


def _draw_sources(rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw where the noise comes from on wood, a group of bars a label; return the files."""
    with mpl.rc_context(STYLE):
        figure, axes = _axes()
        names, width = labels(rows), 0.8 / len(SOURCES)
        palette = (*COLOURS, "0.5")
        for index, (source, colour) in enumerate(zip(SOURCES, palette, strict=True)):
            values = [_source_level(rows, name, source) for name in names]
            places = [place + (index - 2) * width for place in range(len(names))]
            heights = [0.0 if value is None else max(value - _LOWEST, 0.0) for value in values]
            axes.bar(places, heights, width, _LOWEST, color=colour, label=source)
        axes.set_xticks(range(len(names)), [name.replace(", ", "\n") for name in names])
        axes.set_ylabel("LAeq (dBA)")
        axes.set_ylim(top=axes.get_ylim()[1] + 3.0)  # for the legend
        axes.set_title(f"wood, asked for {EQUAL_SPEED:g} m/s, modelled", fontsize=9)
        axes.legend(frameon=False, fontsize=7, ncols=len(SOURCES), loc="upper center")
        return save_figure(figure, directory / "sources")


_LOWEST = 30.0
"""Level that bars stand on, dBA."""


def _columns(points: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [speed for speed, _ in points], [loudness for _, loudness in points]


def _hollow(colour: str) -> dict[str, Any]:
    return {"markerfacecolor": "white", "markeredgecolor": colour}


def _marked(rows: Sequence[Row]) -> str:
    """Return what a title says of the settings on wood that many robots fell in, if any."""
    if not any(falls_often(row) for row in rows if row["surface"] == "wood"):
        return ""
    return f"\nhollow: more than {100.0 * MOST_FALLS:.0f} % of the robots fell"


def _axes() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(5.6, 3.6), layout="constrained")
    return figure, figure.subplots()


def _coloured(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Return the labels that were heard on wood, with their colours."""
    told = [name for name in labels(rows) if _heard(rows, name, "wood")]
    palette = itertools.cycle((*COLOURS, "#c08a1e", "#3b3b3b", "#c06090"))
    return list(zip(palette, told, strict=False))


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


def _source_level(rows: Sequence[Row], name: str, source: str) -> float | None:
    known = [
        row[f"laeq_{source}"]
        for row in _heard(rows, name, "wood")
        if row["command_speed"] == EQUAL_SPEED and row[f"laeq_{source}"] is not None
    ]
    return statistics.fmean(known) if known else None
