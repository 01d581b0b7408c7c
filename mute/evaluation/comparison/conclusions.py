"""What the measured rows say: levels by method and floor, at equal speed, and who is quieter.

Rows are plain data, as `measurements.measure` returns them and JSON holds them: what is not finite
is None. Where a method was trained several times, a figure is the mean over the trainings.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from mute.evaluation.comparison.measurements import FLOORS_COMPARED
from mute.evaluation.comparison.walkers import DREAMWAQ, MPC, MUTE, label
from mute.evaluation.matched_speed import level_at_speed
from mute.evaluation.paper_levels import PAPER_LEVELS

__all__ = [
    "EQUAL_SPEED",
    "Level",
    "Verdict",
    "equal_speed_level",
    "labels",
    "level",
    "papers_level",
    "pareto_front",
    "verdicts",
]

Row = Mapping[str, Any]

EQUAL_SPEED = 0.5
"""Speed of the paper's table, m/s."""

_PAPERS_ROWS = {
    MPC: "mpc",
    DREAMWAQ: "dreamwaq",
    label(MUTE, 0.0): "mute beta 0",
    label(MUTE, 1.0): "mute beta 1",
}


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
    first = [name for name in _PAPERS_ROWS if name in known]
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


def equal_speed_level(rows: Sequence[Row], name: str, surface: str) -> float:
    """Return the mean level of a label at an actual speed of `EQUAL_SPEED`, dBA; NaN if not met."""
    by_training: dict[str, list[tuple[float, float]]] = {}
    for row in _of(rows, name, surface):
        if row["mnl_mean"] is not None and row["speed_mean"] is not None:
            walks = by_training.setdefault(row["policy"], [])
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
    row = _PAPERS_ROWS.get(name)
    if row is None or surface not in PAPER_LEVELS[row]:
        return None
    return PAPER_LEVELS[row][surface][("mnl", "pnl").index(figure)]


@dataclass(frozen=True)
class Verdict:
    """Whether what the paper found comes out here."""

    claim: str
    """What is claimed."""
    figure: str
    """What comes out."""
    holds: bool
    """Whether that is as claimed."""


def verdicts(
    rows: Sequence[Row], sweep: Sequence[Row], walk: Mapping[str, Any] | None
) -> list[Verdict]:
    """Return what the paper claims, and whether it comes out; without what was not measured.

    Args:
        rows: Rows of the part `levels`.
        sweep: Rows of the part `sweep`.
        walk: What came of the long walk.
    """
    found = []
    for surface in FLOORS_COMPARED:
        found += _ordering(rows, surface)
    found += _headline(rows)
    found += _monotone(sweep)
    if walk is not None and walk["mnl_mean"] is not None:
        mnl, arrived, trials = walk["mnl_mean"], walk["arrived"], walk["trials"]
        text = f"{mnl:.1f} dBA, {arrived} of {trials} arrived"
        holds = mnl < 70.0 and arrived == trials
        found.append(Verdict("the long walk ends, and is under 70 dBA", text, holds))
    return found


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


def _at_half(rows: Sequence[Row], name: str, surface: str) -> float | None:
    found = level(rows, name, surface, EQUAL_SPEED, "mnl")
    return None if found is None else found.mean


def _ordering(rows: Sequence[Row], surface: str) -> list[Verdict]:
    levels = {name: _at_half(rows, name, surface) for name in _PAPERS_ROWS}
    told = {name: value for name, value in levels.items() if value is not None}
    if len(told) < 2:
        return []
    values = list(told.values())
    holds = all(louder > quieter for louder, quieter in pairwise(values))
    claim = f"{' > '.join(told)} on {surface}"
    return [Verdict(claim, " > ".join(f"{value:.1f}" for value in values) + " dBA", holds)]


def _headline(rows: Sequence[Row]) -> list[Verdict]:
    """Return by how much beta 1 is quieter than the mean of both baselines, over the floors."""
    found = []
    for what, value_of in (
        ("asked for 0.5 m/s", _at_half),
        ("at an actual 0.5 m/s", equal_speed_level),
    ):
        gains = []
        for surface in FLOORS_COMPARED:
            loud = [value_of(rows, name, surface) for name in (MPC, DREAMWAQ)]
            quiet = value_of(rows, label(MUTE, 1.0), surface)
            known = [value for value in (*loud, quiet) if value is not None]
            if len(known) == 3 and not any(math.isnan(value) for value in known):
                gains.append(statistics.fmean(known[:2]) - known[2])
        if len(gains) == len(FLOORS_COMPARED):
            gain = statistics.fmean(gains)
            claim = f"beta 1 is 8 dBA under the mean of both baselines, {what}"
            found.append(Verdict(claim, f"{gain:.1f} dBA, mean of the floors", gain >= 8.0))
    return found


def _monotone(sweep: Sequence[Row]) -> list[Verdict]:
    by_beta: dict[float, list[float]] = {}
    for row in sweep:
        if row["mnl_mean"] is not None:
            by_beta.setdefault(row["beta"], []).append(row["mnl_mean"])
    means = [statistics.fmean(by_beta[beta]) for beta in sorted(by_beta)]
    if len(means) < 2:
        return []
    rises = [after - before for before, after in pairwise(means)]
    falls = sum(rise < 0.0 for rise in rises)
    text = f"{falls} of {len(rises)} steps, {means[0]:.1f} to {means[-1]:.1f} dBA"
    return [Verdict("quieter at every step of beta, 0.8 m/s on wood", text, falls == len(rises))]
