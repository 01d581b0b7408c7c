"""Whether what the paper found comes out here, from rows as `conclusions` has them."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from mute.evaluation.comparison.conclusions import (
    EQUAL_SPEED,
    MOST_FALLS,
    PAPERS_ROWS,
    equal_speed_level,
    level,
    walked,
)
from mute.evaluation.comparison.measurements import FLOORS_COMPARED
from mute.evaluation.comparison.walkers import DREAMWAQ, MPC, MUTE, label

__all__ = ["Verdict", "verdicts"]

Row = Mapping[str, Any]

_NEAR = 1.1
"""How many times MUTE's errors and falls a baseline may have that follows commands as well."""


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
    rows: Sequence[Row],
    sweep: Sequence[Row],
    walk: Mapping[str, Any] | None,
    fitted: tuple[str, str] | None = None,
) -> list[Verdict]:
    """Return what the paper claims, and whether it comes out; without what was not measured.

    Args:
        rows: Rows of the part `levels`.
        sweep: Rows of the part `sweep`.
        walk: What came of the long walk.
        fitted: Label and floor whose level the model is fitted to, and which is no prediction.
    """
    found = []
    for surface in FLOORS_COMPARED:
        found += _ordering(rows, surface, fitted)
    found += _headline(rows, fitted)
    found += _as_obedient(rows)
    found += _monotone(sweep)
    if walk is not None and walk["mnl_mean"] is not None:
        mnl, arrived, trials = walk["mnl_mean"], walk["arrived"], walk["trials"]
        text = f"{mnl:.1f} dBA, {arrived} of {trials} arrived"
        holds = mnl < 70.0 and arrived == trials
        found.append(Verdict("the long walk ends, and is under 70 dBA", text, holds))
    return found


def _at_half(rows: Sequence[Row], name: str, surface: str) -> float | None:
    found = level(rows, name, surface, EQUAL_SPEED, "mnl")
    return None if found is None else found.mean


def _ordering(rows: Sequence[Row], surface: str, fitted: tuple[str, str] | None) -> list[Verdict]:
    levels = {name: _at_half(rows, name, surface) for name in PAPERS_ROWS}
    told = {name: value for name, value in levels.items() if value is not None}
    left_out = fitted[0] if fitted is not None and fitted[1] == surface else None
    is_there = told.pop(left_out, None) is not None if left_out else False
    if len(told) < 2:
        return []
    values = list(told.values())
    holds = all(louder > quieter for louder, quieter in pairwise(values))
    claim = f"{' > '.join(told)} on {surface}"
    if is_there:
        claim += f", without {left_out}, which is fitted there"
    figure = " > ".join(f"{value:.1f}" for value in values) + " dBA"
    return [Verdict(claim, figure + _fallen(rows, told, (surface,)), holds)]


def _fallen(rows: Sequence[Row], names: Iterable[str], surfaces: Sequence[str]) -> str:
    """Return what to say of the labels that fall often at the paper's speed, the worst floor's."""
    told = ""
    for name in names:
        each = [walked(rows, name, surface, EQUAL_SPEED) for surface in surfaces]
        worst = max((one.fall_rate for one in each if one is not None), default=0.0)
        if worst > MOST_FALLS:
            told += f"; {100.0 * worst:.0f} % of {name}'s robots fell"
    return told


def _headline(rows: Sequence[Row], fitted: tuple[str, str] | None) -> list[Verdict]:
    """Return by how much beta 1 is quieter than the mean of both baselines, over the floors.

    Without a floor that the level of one of them is fitted on.
    """
    found = []
    names = (MPC, DREAMWAQ, label(MUTE, 1.0))
    floors = [floor for floor in FLOORS_COMPARED if fitted not in [(one, floor) for one in names]]
    over = "the floors" if len(floors) == len(FLOORS_COMPARED) else " and ".join(floors)
    for what, value_of in (
        ("asked for 0.5 m/s", _at_half),
        ("at an actual 0.5 m/s", equal_speed_level),
    ):
        gains = []
        for surface in floors:
            told = [value_of(rows, name, surface) for name in names]
            known = [value for value in told if value is not None and not math.isnan(value)]
            if len(known) == len(names):
                gains.append(statistics.fmean(known[:2]) - known[2])
        if len(gains) == len(floors):
            gain = statistics.fmean(gains)
            claim = f"beta 1 is 8 dBA under the mean of both baselines, {what}"
            figure = f"{gain:.1f} dBA, mean of {over}" + _fallen(rows, names, floors)
            found.append(Verdict(claim, figure, gain >= 8.0))
    return found


def _as_obedient(rows: Sequence[Row]) -> list[Verdict]:
    """Return whether DreamWaQ walks as MUTE at beta 0 does, where both were asked for the same."""
    names = (DREAMWAQ, label(MUTE, 0.0))
    asked = [
        {(row["surface"], row["command_speed"]) for row in rows if row["label"] == name}
        for name in names
    ]
    errors, falls = [], []
    for name in names:
        own = [
            row
            for row in rows
            if row["label"] == name
            and (row["surface"], row["command_speed"]) in asked[0] & asked[1]
        ]
        known = [row["velocity_error_sq"] for row in own if row["velocity_error_sq"] is not None]
        if not known:
            return []
        errors.append(statistics.fmean(known))
        falls.append(statistics.fmean(row["fall_rate"] for row in own))
    figure = (
        f"{errors[0]:.4f} against {errors[1]:.4f} (m/s)², "
        f"{100.0 * falls[0]:.1f} against {100.0 * falls[1]:.1f} % fell"
    )
    holds = errors[0] <= _NEAR * errors[1] and falls[0] <= _NEAR * falls[1]
    claim = f"{names[0]} follows commands as {names[1]} does, error and falls within 10 %"
    return [Verdict(claim, figure, holds)]


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
