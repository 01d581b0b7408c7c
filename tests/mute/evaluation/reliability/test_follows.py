"""Robots that stand miss their commands by just these, and do not fall in stop and go."""

from __future__ import annotations

import math

import pytest
import torch
from exam_helpers import make_random_policy
from standing import Standing

from mute.envs.commands import CommandsCfg
from mute.evaluation.reliability import follows
from mute.evaluation.reliability.follows import (
    SPEEDS,
    Following,
    measure_follows,
    stop_and_go_falls,
    velocity_errors,
)
from mute.evaluation.usual_robots import under_conditions

_CONTROLLER = "mute.controllers.learned.LearnedController"
"""What drives the robots of a policy."""


@pytest.fixture
def standing(monkeypatch: pytest.MonkeyPatch):
    """Return a policy under whose name robots hold the stance, for short trials."""
    monkeypatch.setattr(_CONTROLLER, lambda policy, robots: Standing(robots))
    monkeypatch.setattr(follows, "_WALK_TIME", 2.5)
    monkeypatch.setattr(follows, "_RANGE_TIME", 1.5)
    monkeypatch.setattr(follows, "_CHANGES", 2)
    return under_conditions(make_random_policy())


def test_a_robot_that_stands_errs_by_the_square_of_its_command(standing):
    # A tenth of the commands are zero: of four robots, few.
    standing.cfg.env.commands = CommandsCfg(lin_vel_x=(0.8, 0.8), lin_vel_y=(0.5, 0.5))
    errors = velocity_errors(standing, 4, 0, lambda work: None)
    assert list(errors) == [0.0, 1.0]
    for error in errors.values():
        asked = round(4.0 * error / 0.89) / 4.0  # share of the four that is not asked to stand
        assert asked >= 0.5
        assert error == pytest.approx(0.89 * asked, rel=0.08)


def test_a_robot_that_stands_has_no_part_of_any_speed_and_never_falls(standing):
    result = measure_follows(standing, 4, 0, lambda work: None)
    rows = result.tables["follows"]
    assert [row["command_speed"] for row in rows] == [*SPEEDS, *SPEEDS]
    assert all(row["ratio"] == pytest.approx(0.0, abs=0.1) for row in rows)
    verdicts = {figure.name: figure.met for figure in result.figures}
    assert not verdicts["smallest actual over commanded speed, beta 0"]
    assert verdicts["falls in stop and go, beta 0"]


def test_a_robot_that_falls_in_stop_and_go_is_counted_for_its_beta(standing, monkeypatch):
    class _Toppled(Standing):
        def act(self, observations):
            quiet = observations["policy"][:, -1:] == 1.0
            # Both left legs are pulled up: such a robot tips over.
            folded = torch.tensor((0.0, 0.0, 0.0, 0.0, 8.0, -8.0) * 2)
            return torch.where(quiet, folded, 0.0)

    monkeypatch.setattr(_CONTROLLER, lambda policy, robots: _Toppled(robots))
    standing.cfg.env.max_tilt = 0.3  # who leans has fallen
    falls = stop_and_go_falls(standing, 2, 0, lambda work: None)
    assert falls == {0.0: 0.0, 1.0: 1.0}


def test_what_is_judged_is_the_worst_ratio_over_the_speeds():
    rows = [Following(0.0, speed, 8, speed, 1.0) for speed in SPEEDS]
    rows += [Following(1.0, speed, 8, 0.8 * speed, 0.8) for speed in SPEEDS]
    rows[2] = Following(0.0, 0.3, 8, 0.36, 1.2)
    rows[11] = Following(1.0, 0.2, 8, 0.1, 0.5)
    figures = follows._figures(rows, {0.0: 0.02, 1.0: 0.05}, {0.0: 0.0, 1.0: 0.125})
    assert [(figure.value, figure.met) for figure in figures] == [
        (1.0, True),
        (1.2, False),
        (0.5, False),
        (0.02, True),
        (0.05, False),
        (0.0, True),
        (0.125, False),
    ]


def test_a_speed_at_which_no_robot_could_be_measured_is_not_met():
    for missing in (0, 4, 9):  # Python's own min and max tell by where it stands
        rows = [Following(beta, speed, 8, speed, 1.0) for beta in (0.0, 1.0) for speed in SPEEDS]
        for row in (missing, 10 + missing):
            rows[row] = Following(rows[row].beta, rows[row].command_speed, 8, math.nan, math.nan)
        ratios = follows._figures(rows, {0.0: 0.0, 1.0: 0.0}, {0.0: 0.0, 1.0: 0.0})[:3]
        assert all(math.isnan(figure.value) for figure in ratios)
        assert not any(figure.met for figure in ratios)
