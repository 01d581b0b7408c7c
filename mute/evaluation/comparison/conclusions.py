"""What the measured rows say: levels by method and floor, at equal speed, and who falls.

Rows are plain data, as `measurements.measure` returns them and JSON holds them: what is not finite
is None. Where a method was trained several times, a figure is the mean over the trainings.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mute.evaluation.comparison.walkers import DREAMWAQ, MPC, MUTE, label
from mute.evaluation.matched_speed import level_at_speed
from mute.evaluation.paper_levels import PAPER_LEVELS

__all__ = [
    "EQUAL_SPEED",
    "MOST_FALLS",
    "PAPERS_ROWS",
    "Level",
    "Walked",
    "equal_speed_level",
    "falls_often",
    "labels",
    "level",
    "papers_level",
    "pareto_front",
    "source_level",
    "walked",
]

Row = Mapping[str, Any]

EQUAL_SPEED = 0.5
"""Speed of the paper's table, m/s."""

MOST_FALLS = 0.05
"""Share of the robots that may fall before a level, which is of those that stand, is marked."""

PAPERS_ROWS = {
    MPC: "mpc",
    DREAMWAQ: "dreamwaq",
    label(MUTE, 0.0): "mute beta 0",
    label(MUTE, 1.0): "mute beta 1",
}
"""Rows of the paper's table by our labels, from loud to quiet."""


@dataclass(frozen=True)
class Level:
    """A level over trials and trainings, dBA."""

    mean: float
    """Mean over trainings of the mean over trials."""
    std: float
    """Standard deviation over trials, mean over trainings; NaN of single trials."""
    trainings: tuple[float, ...]
    """The mean over trials of each training."""


def labels(rows: Sequence[Row]) -> list[str]:
    """Return what the rows are of, each once, the paper's first and in its order from loud on."""
    known = list(dict.fromkeys(row["label"] for row in rows))
    first = [name for name in PAPERS_ROWS if name in known]
    return first + [name for name in known if name not in first]


def level(rows: Sequence[Row], name: str, surface: str, speed: float, figure: str) -> Level | None:
    """Return the level of a label on a floor at a commanded speed; None if there is none.

    Args:
        rows: Rows of the part `levels`.
        name: The label.
        surface: Name of the floor.
        speed: Commanded speed, m/s.
        figure: `mnl` or `pnl`.
    """
    own = [
        row
        for row in _of(rows, name, surface)
        if row["command_speed"] == speed and row[f"{figure}_mean"] is not None
    ]
    if not own:
        return None
    means = tuple(row[f"{figure}_mean"] for row in own)
    spreads = [row[f"{figure}_std"] for row in own if row[f"{figure}_std"] is not None]
    spread = statistics.fmean(spreads) if spreads else math.nan
    return Level(statistics.fmean(means), spread, means)


def source_level(rows: Sequence[Row], name: str, surface: str, source: str) -> float | None:
    """Return the LAeq of one source alone at `EQUAL_SPEED` as asked for, dBA.

    Args:
        rows: Rows of the part `levels`.
        name: The label.
        surface: Name of the floor.
        source: The source.

    Returns:
        The mean over the trainings in which it was heard; None if that is none.
    """
    known = [
        row[f"laeq_{source}"]
        for row in _of(rows, name, surface)
        if row["command_speed"] == EQUAL_SPEED and row[f"laeq_{source}"] is not None
    ]
    return statistics.fmean(known) if known else None


@dataclass(frozen=True)
class Walked:
    """How robots walked at one command, over trials and trainings."""

    speed: float
    """Mean actual forward speed, m/s; NaN if it is known of none."""
    fall_rate: float
    """Share of the robots that fell."""
    heard: int
    """Robots with a level, of all trainings."""
    trials: int
    """Robots, of all trainings."""


def walked(rows: Sequence[Row], name: str, surface: str, speed: float) -> Walked | None:
    """Return how a label walked on a floor at a commanded speed; None if it did not.

    Args:
        rows: Rows of the part `levels`.
        name: The label.
        surface: Name of the floor.
        speed: Commanded speed, m/s.
    """
    own = [row for row in _of(rows, name, surface) if row["command_speed"] == speed]
    if not own:
        return None
    speeds = [row["speed_mean"] for row in own if row["speed_mean"] is not None]
    return Walked(
        statistics.fmean(speeds) if speeds else math.nan,
        statistics.fmean(row["fall_rate"] for row in own),
        sum(row["trials_heard"] for row in own),
        sum(row["trials"] for row in own),
    )


def falls_often(row: Row) -> bool:
    """Return whether more than `MOST_FALLS` of a row's robots fell: its level is the others'."""
    return row["fall_rate"] > MOST_FALLS


def equal_speed_level(rows: Sequence[Row], name: str, surface: str) -> float:
    """Return the mean level of a label at an actual speed of `EQUAL_SPEED`, dBA; NaN if not met."""
    by_training: dict[tuple[str, int | None], list[tuple[float, float]]] = {}
    for row in _of(rows, name, surface):
        if row["mnl_mean"] is not None and row["speed_mean"] is not None:
            walks = by_training.setdefault((row["policy"], row["training_seed"]), [])
            walks.append((row["speed_mean"], row["mnl_mean"]))
    met = [level_at_speed(walks, EQUAL_SPEED) for walks in by_training.values()]
    return statistics.fmean(met) if met else math.nan


def papers_level(name: str, surface: str, figure: str) -> float | None:
    """Return the paper's level of a label on a floor, dBA; None if it has none.

    Args:
        name: The label.
        surface: Name of the floor.
        figure: `mnl` or `pnl`.
    """
    row = PAPERS_ROWS.get(name)
    if row is None or surface not in PAPER_LEVELS[row]:
        return None
    return PAPER_LEVELS[row][surface][("mnl", "pnl").index(figure)]


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points that no other is both as fast as and as quiet as, by speed.

    Args:
        points: Actual speed, m/s, and level, dBA.
    """
    front: list[tuple[float, float]] = []
    for speed, loudness in sorted(set(points), key=lambda point: (-point[0], point[1])):
        if not front or loudness < front[-1][1]:
            front.append((speed, loudness))
    return front[::-1]


def _of(rows: Sequence[Row], name: str, surface: str) -> list[Row]:
    return [row for row in rows if row["label"] == name and row["surface"] == surface]
