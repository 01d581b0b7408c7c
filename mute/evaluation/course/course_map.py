"""The map of a walk: its path coloured by the level, over the floors of the course."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from mute.acoustics.floors import FLOORS
from mute.acoustics.metering.levels import READINGS_PER_SECOND
from mute.evaluation.course.course import Course, FloorArea, Point
from mute.evaluation.course.long_walk import Track
from mute.evaluation.noise_figures import save_figure

__all__ = ["coloured_stretches", "draw_map"]

_WIDTH = 8.0
_STRETCH = READINGS_PER_SECOND
_PALENESS = 0.5


def draw_map(course: Course, track: Track, directory: Path) -> list[Path]:
    """Draw `course_map.png` and `course_map.svg` and return the files.

    The colour is the mean of the readings over a second: single readings rise and fall with
    every step, which no map could show.

    Raises:
        ValueError: If the track has fewer than two readings.
    """
    lines, levels = coloured_stretches(track)
    low, high = _bounds(course.floors)
    # With a fixed salt the same walk makes the same file.
    with mpl.rc_context({"font.size": 9, "svg.hashsalt": "mute"}):
        # Of the width, a fifth is for axis and colour bar; of the height, an inch for the rest.
        height = 0.8 * _WIDTH * (high[1] - low[1]) / (high[0] - low[0]) + 1.0
        figure = Figure(figsize=(_WIDTH, min(max(height, 3.0), 12.0)), layout="constrained")
        axes = figure.subplots()
        _draw_floors(axes, course.floors, np.stack((track.x, track.y), axis=1))
        # A dark edge: bright colours would drown on bright floors.
        axes.plot(track.x, track.y, color="0.15", linewidth=4.5)
        coloured = LineCollection(lines, cmap="viridis", linewidths=3.0, zorder=3)
        coloured.set_array(levels)
        axes.add_collection(coloured)
        _mark(axes, "start", course.path[0], "o")
        _mark(axes, "end", (track.x[-1], track.y[-1]), "s")
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        figure.colorbar(coloured, ax=axes, shrink=0.8, label="level (dBA), modelled")
        return save_figure(figure, directory / "course_map")


def coloured_stretches(
    track: Track,
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """Cut a track into stretches of a second, each joined to the next.

    Returns:
        Points of each stretch, m, shape (points, 2), and its mean level, dBA, shape (stretches,).

    Raises:
        ValueError: If the track has fewer than two readings.
    """
    if len(track.time) < 2:
        raise ValueError(f"a map needs at least two readings, got {len(track.time)}")
    xy = np.stack((track.x, track.y), axis=1)
    begins = range(0, len(xy) - 1, _STRETCH)
    lines = [xy[begin : begin + _STRETCH + 1] for begin in begins]
    levels = [track.level[begin : begin + _STRETCH + 1].mean() for begin in begins]
    return lines, np.array(levels)


def _draw_floors(axes: Axes, areas: Sequence[FloorArea], walked: NDArray[np.float64]) -> None:
    """Draw every rectangle, and the name where a floor begins in the order of the course."""
    before = None
    for area in areas:
        (x, y), (right, top) = area.low, area.high
        colour = FLOORS[area.floor].colour
        axes.add_patch(Rectangle((x, y), right - x, top - y, color=colour, alpha=_PALENESS, lw=0))
        if area.floor != before:
            _label(axes, area, walked)
        before = area.floor


def _label(axes: Axes, area: FloorArea, walked: NDArray[np.float64]) -> None:
    """Write a floor's name into the corner of its rectangle that is furthest from the path."""
    corners = [(x, y) for y in (area.low[1], area.high[1]) for x in (area.low[0], area.high[0])]
    apart = [np.linalg.norm(walked - corner, axis=1).min() for corner in corners]
    index = int(np.argmax(np.round(apart, 1)))
    on_right, on_top = index % 2 == 1, index >= 2
    axes.annotate(
        area.floor,
        corners[index],
        xytext=(-4 if on_right else 4, -4 if on_top else 4),
        textcoords="offset points",
        ha="right" if on_right else "left",
        va="top" if on_top else "bottom",
        color="0.15",
    )


def _mark(axes: Axes, name: str, place: Point, marker: str) -> None:
    axes.plot(*place, marker=marker, markersize=8, color="white", markeredgecolor="0.15", zorder=4)
    axes.annotate(name, place, xytext=(8, 8), textcoords="offset points", zorder=4)


def _bounds(areas: Sequence[FloorArea]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest corner of all rectangles, m. Shapes: (2,)."""
    low = np.min([area.low for area in areas], axis=0)
    high = np.max([area.high for area in areas], axis=0)
    return low, high
