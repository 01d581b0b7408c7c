"""Levels, fronts and verdicts from rows that can be reckoned with by hand."""

from __future__ import annotations

import math

import pytest
from comparison_rows import make_row

from mute.evaluation.comparison.conclusions import (
    equal_speed_level,
    falls_often,
    labels,
    level,
    papers_level,
    pareto_front,
    source_level,
    walked,
)


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
    namesakes = [row | {"policy": "m.pt", "training_seed": i // 2} for i, row in enumerate(rows)]
    assert equal_speed_level(namesakes, "MPC", "wood") == pytest.approx((62.0 + 70.0) / 2)
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


def test_how_robots_walked_is_over_all_trainings():
    rows = [
        make_row("MPC", 75.0, speed_mean=0.4, fall_rate=0.1, trials_heard=19),
        make_row("MPC", 75.0, speed_mean=0.5, policy="b.pt"),
        make_row("MPC", 75.0, command=0.8, fall_rate=1.0),
    ]
    found = walked(rows, "MPC", "wood", 0.5)
    assert found is not None
    assert found.speed == pytest.approx(0.45)
    assert found.fall_rate == pytest.approx(0.05)
    assert (found.heard, found.trials) == (39, 40)
    assert walked(rows, "MPC", "tile", 0.5) is None
    assert [falls_often(row) for row in rows] == [True, False, True]


def test_a_source_is_the_mean_over_the_trainings_that_it_was_heard_in():
    rows = [
        make_row("MPC", 75.0, laeq_impacts=60.0, laeq_fan=None),
        make_row("MPC", 75.0, policy="b.pt", laeq_impacts=63.0, laeq_fan=None),
        make_row("MPC", 75.0, policy="c.pt", laeq_impacts=None, laeq_fan=None),
        make_row("MPC", 75.0, command=0.8, laeq_impacts=90.0),
        make_row("MPC", 75.0, "tile", laeq_impacts=90.0),
    ]
    assert source_level(rows, "MPC", "wood", "impacts") == 61.5
    assert source_level(rows, "MPC", "wood", "fan") is None
