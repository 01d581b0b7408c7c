"""Levels, fronts and verdicts from rows that can be reckoned with by hand."""

from __future__ import annotations

import math
from typing import Any

import pytest

from mute.evaluation.comparison.conclusions import (
    equal_speed_level,
    labels,
    level,
    papers_level,
    pareto_front,
    verdicts,
)


def make_row(
    label: str, mnl: float | None, surface: str = "wood", command: float = 0.5, **more: Any
) -> dict[str, Any]:
    row = {
        "part": "levels",
        "label": label,
        "policy": "a.pt",
        "training_seed": 0,
        "beta": 0.0,
        "surface": surface,
        "command_speed": command,
        "speed_mean": command,
        "mnl_mean": mnl,
        "mnl_std": 0.5,
        "pnl_mean": None if mnl is None else mnl + 5.0,
        "pnl_std": 1.0,
        "velocity_error_sq": 0.01,
    }
    sources = ("impacts", "body", "drive", "scuffing", "fan")
    return row | {f"laeq_{source}": 50.0 + i for i, source in enumerate(sources)} | more


def _floors(label: str, *mnl: float) -> list[dict[str, Any]]:
    return [
        make_row(label, value, surface)
        for value, surface in zip(mnl, ("wood", "carpet", "tile"), strict=True)
    ]


def test_the_papers_methods_come_first_and_from_loud_to_quiet():
    names = ["olaf, beta 0", "MUTE, beta 1", "MUTE, beta 0", "MPC", "DreamWaQ"]
    rows = [make_row(name, 60.0) for name in names]
    expected = ["MPC", "DreamWaQ", "MUTE, beta 0", "MUTE, beta 1", "olaf, beta 0"]
    assert labels(rows) == expected


def test_a_level_is_the_mean_over_trainings():
    rows = [
        make_row("MUTE, beta 0", 66.0, mnl_std=0.4),
        make_row("MUTE, beta 0", 69.0, policy="b.pt", mnl_std=0.8),
        make_row("MUTE, beta 0", 80.0, command=0.8),
        make_row("MUTE, beta 0", 80.0, "tile"),
        make_row("MUTE, beta 0", None, policy="c.pt"),
    ]
    found = level(rows, "MUTE, beta 0", "wood", 0.5, "mnl")
    assert found is not None
    assert (found.mean, found.trainings) == (67.5, (66.0, 69.0))
    assert found.std == pytest.approx(0.6)
    assert level(rows, "MUTE, beta 0", "carpet", 0.5, "mnl") is None
    peak = level(rows, "MUTE, beta 0", "wood", 0.5, "pnl")
    assert peak is not None
    assert peak.mean == 72.5


def test_equal_speed_lies_between_what_came_out_of_each_training():
    rows = [
        make_row("MPC", 60.0, command=0.5, speed_mean=0.4),
        make_row("MPC", 64.0, command=0.6, speed_mean=0.6),
        make_row("MPC", 70.0, command=0.5, speed_mean=0.5, policy="b.pt"),
        make_row("MPC", 90.0, command=0.8, speed_mean=0.8, policy="b.pt"),
    ]
    assert equal_speed_level(rows, "MPC", "wood") == pytest.approx((62.0 + 70.0) / 2)
    assert math.isnan(equal_speed_level(rows[:1], "MPC", "wood"))
    assert math.isnan(equal_speed_level(rows, "MPC", "tile"))


def test_the_papers_levels_are_found_under_our_labels():
    assert papers_level("MUTE, beta 1", "carpet", "mnl") == 62.48
    assert papers_level("DreamWaQ", "tile", "pnl") == 80.93
    assert papers_level("MUTE, beta 0.5", "wood", "mnl") is None
    assert papers_level("MPC", "concrete", "mnl") is None


def test_the_front_is_what_nothing_is_as_fast_and_as_quiet_as():
    points = [(0.4, 60.0), (0.5, 59.0), (0.6, 62.0), (0.6, 65.0), (0.7, 64.0), (0.55, 63.0)]
    assert pareto_front(points) == [(0.5, 59.0), (0.6, 62.0), (0.7, 64.0)]
    assert pareto_front([(0.5, 60.0)]) == [(0.5, 60.0)]


def test_verdicts_say_what_holds_and_what_does_not():
    rows = [
        *_floors("MPC", 80.0, 76.0, 78.0),
        *_floors("DreamWaQ", 74.0, 72.0, 79.0),
        *_floors("MUTE, beta 0", 69.0, 68.0, 70.0),
        *_floors("MUTE, beta 1", 66.0, 63.0, 67.5),
    ]
    sweep = [
        make_row("MUTE", mnl, beta=beta, command=0.8)
        for beta, mnl in ((0.0, 70.0), (0.5, 67.0), (1.0, 67.5))
    ]
    found = {one.claim: one for one in verdicts(rows, sweep, _walk(70.5))}
    order = "MPC > DreamWaQ > MUTE, beta 0 > MUTE, beta 1 on"
    assert found[f"{order} wood"].holds
    assert not found[f"{order} tile"].holds
    # Means of both baselines 77, 74 and 78.5, less 66, 63 and 67.5: 11 on each floor.
    headline = "beta 1 is 8 dBA under the mean of both baselines, asked for 0.5 m/s"
    assert found[headline].figure == "11.0 dBA, mean of the floors"
    assert found[headline].holds
    quieter = found["quieter at every step of beta, 0.8 m/s on wood"]
    assert quieter.figure == "1 of 2 steps, 70.0 to 67.5 dBA"
    assert not quieter.holds
    assert not found[_WALK].holds


_WALK = "the long walk ends, and is under 70 dBA"


def _walk(mnl: float | None, arrived: int = 16) -> dict[str, Any]:
    return {"mnl_mean": mnl, "arrived": arrived, "trials": 16}


@pytest.mark.parametrize(("mnl", "arrived", "holds"), [(69.0, 16, True), (69.0, 15, False)])
def test_a_walk_that_not_all_finish_is_no_quiet_walk(mnl, arrived, holds):
    (found,) = verdicts([], [], _walk(mnl, arrived))
    assert (found.claim, found.holds) == (_WALK, holds)
    assert found.figure == f"69.0 dBA, {arrived} of 16 arrived"


def test_nothing_is_said_of_what_was_not_measured():
    rows = [*_floors("MUTE, beta 0", 69.0, 68.0, 70.0)]
    assert verdicts(rows, [], None) == []
    assert verdicts([], [], _walk(None)) == []
