"""Robots stand if their feet stay down; what is heard of them is the fan."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest
import torch
from exam_helpers import make_random_policy
from standing import Standing

from mute.evaluation.reliability import stands
from mute.evaluation.reliability.stands import Stillness, measure_stands
from mute.evaluation.usual_robots import under_conditions

_CONTROLLER = "mute.controllers.learned.LearnedController"
"""What drives the robots of a policy."""


class _Frames:
    """Stands in for an environment of two robots whose next steps are made by hand."""

    def __init__(self) -> None:
        self.num_envs = 2
        self.footfalls = SimpleNamespace(contact=torch.ones(2, 4, dtype=torch.bool))
        self.base_lin_vel = torch.zeros(2, 3)
        self.joint_vel = torch.zeros(2, 12)


_NOBODY = torch.zeros(2, dtype=torch.bool)


def test_one_lifted_foot_in_one_step_is_no_standing():
    frames = _Frames()
    still = Stillness(cast("Any", frames))
    still.update(_NOBODY)
    frames.footfalls.contact[1, 2] = False
    still.update(_NOBODY)
    frames.footfalls.contact[1, 2] = True
    still.update(_NOBODY)
    assert still.feet_down.tolist() == [True, False]


def test_a_robot_that_fell_does_not_stand_though_it_begins_anew_on_its_feet():
    still = Stillness(cast("Any", _Frames()))
    still.update(torch.tensor((True, False)))
    still.update(_NOBODY)
    assert still.feet_down.tolist() == [False, True]


def test_speeds_are_means_over_time_and_joints():
    frames = _Frames()
    still = Stillness(cast("Any", frames))
    still.update(_NOBODY)
    frames.base_lin_vel[0] = torch.tensor((0.3, -0.4, 9.0))
    frames.joint_vel[1, 5] = -2.4
    still.update(_NOBODY)
    assert still.trunk_speed.tolist() == pytest.approx([0.25, 0.0])
    assert still.joint_speed.tolist() == pytest.approx([0.0, 0.1])


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch):
    """Shorten the trials, and return a policy with random weights."""
    monkeypatch.setattr(stands, "_WALK_TIME", 0.2)
    monkeypatch.setattr(stands, "SETTLE_TIME", 1.5)
    monkeypatch.setattr(stands, "_STAND_TIME", 1.0)
    return under_conditions(make_random_policy())


def test_a_robot_that_holds_the_stance_stands_in_silence_and_takes_a_push(short, monkeypatch):
    monkeypatch.setattr(_CONTROLLER, lambda policy, robots: Standing(robots))
    result = measure_stands(short, 6, 0, lambda work: None)
    for row in result.tables["stands"]:
        assert row["robots"] == 2
        assert row["feet_down"] == 1.0
        assert row["recovered"] == 1.0
        assert row["joint_speed"] < 0.03
        assert row["level"] == pytest.approx(55.0, abs=0.3)  # the fan
    assert all(figure.met for figure in result.figures)


def test_a_push_moves_each_trunk_by_half_a_metre_a_second_in_a_direction_of_its_own():
    directions = stands._directions(200, seed=4)
    torch.testing.assert_close(directions.norm(dim=1), torch.ones(200))
    assert float(directions.mean(dim=0).norm()) < 0.2


def test_what_is_judged_is_the_worst_beta():
    rows = [
        stands.Standing(0.0, 8, 1.0, 0.9, 0.4, 57.0),
        stands.Standing(0.5, 8, 0.5, 1.0, 0.01, 55.0),
        stands.Standing(1.0, 8, 1.0, 1.0, 0.02, 55.1),
    ]
    assert [figure.value for figure in stands._figures(rows)] == [0.5, 0.4, 57.0, 0.9]
    unheard = [*rows[:2], stands.Standing(1.0, 8, 1.0, 1.0, 0.02, float("nan"))]
    assert not stands._figures(unheard)[2].met
