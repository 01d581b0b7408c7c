"""Robots obey a command if they go as fast as asked, or stand still; each command is judged."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest
import torch

from mute.evaluation.obedience import Obedience, Verdict, along_command

_FORWARD = (0.5, 0.0, 0.0, 0.3)
_STAND = (0.0, 0.0, 0.0, 0.3)


class _Frames:
    """Stands in for an environment of one robot whose next steps are made by hand."""

    def __init__(self) -> None:
        self.num_envs, self.step_dt = 1, 0.1
        self.footfalls = SimpleNamespace(contact=torch.ones(1, 4, dtype=torch.bool))
        self.base_lin_vel = torch.zeros(1, 3)
        self.base_ang_vel = torch.zeros(1, 3)
        self.fallen = torch.zeros(1, dtype=torch.bool)
        self.obedience = Obedience(cast("Any", self))

    def walk(self, command, seconds, speed=0.0, turn=0.0, lifted=None):
        """Walk for a time; `lifted` is a step in which a foot is off the ground."""
        self.base_lin_vel[0, 0], self.base_ang_vel[0, 2] = speed, turn
        for step in range(round(seconds / self.step_dt)):
            self.footfalls.contact[0, 1] = step != lifted
            self.obedience.update(torch.tensor([command]), torch.tensor([False]))
        self.footfalls.contact[0, 1] = True
        return self

    def fall(self, command):
        self.fallen[0] = True
        self.obedience.update(torch.tensor([command]), torch.tensor([True]))
        self.fallen[0] = False
        return self

    @property
    def verdict(self) -> Verdict:
        return self.obedience.verdict()


OBEYED = Verdict(judged=1, obeyed=1, fell=0, too_slow=0, too_fast=0, restless=0)
NOT_JUDGED = Verdict(judged=0, obeyed=0, fell=0, too_slow=0, too_fast=0, restless=0)
TOO_SLOW = Verdict(judged=1, obeyed=0, fell=0, too_slow=1, too_fast=0, restless=0)
TOO_FAST = Verdict(judged=1, obeyed=0, fell=0, too_slow=0, too_fast=1, restless=0)
RESTLESS = Verdict(judged=1, obeyed=0, fell=0, too_slow=0, too_fast=0, restless=1)


def test_the_share_of_a_command_is_that_along_it_and_the_smaller_of_way_and_turn():
    command = torch.tensor(
        ((0.5, 0, 0, 0), (0.3, 0.4, 0, 0), (0, 0, -0.5, 0), (0.5, 0, 1.0, 0), (0, 0, 0, 0))
    )
    lin_vel = torch.tensor(((0.25, 3, 0), (0.6, 0.8, 0), (9, 9, 9), (0.5, 0, 0), (1, 1, 0)))
    ang_vel = torch.tensor(((0, 0, 5.0), (0, 0, 0), (0, 0, -0.25), (0, 0, 0.3), (0, 0, 1)))
    shares = along_command(command, lin_vel, ang_vel)
    assert shares.tolist() == pytest.approx([0.5, 2.0, 0.5, 0.3, math.inf])


@pytest.mark.parametrize(
    ("speed", "expected"),
    [(0.5, OBEYED), (0.21, OBEYED), (0.19, TOO_SLOW), (-0.5, TOO_SLOW), (0.81, TOO_FAST)],
)
def test_a_robot_that_is_to_go_is_judged_by_its_speed(speed, expected):
    assert _Frames().walk(_FORWARD, 4.0, speed).verdict == expected


def test_a_robot_that_is_to_turn_as_well_must_do_both():
    command = (0.5, 0.0, 1.0, 0.0)
    assert _Frames().walk(command, 4.0, speed=0.5, turn=1.0).verdict == OBEYED
    assert _Frames().walk(command, 4.0, speed=0.5, turn=0.1).verdict == TOO_SLOW


def test_a_robot_that_is_to_stand_keeps_its_feet_down_and_stays_where_it_is():
    assert _Frames().walk(_STAND, 4.0).verdict == OBEYED
    assert _Frames().walk(_STAND, 4.0, lifted=30).verdict == RESTLESS
    assert _Frames().walk(_STAND, 4.0, speed=0.1).verdict == RESTLESS


def test_the_first_two_seconds_of_a_command_are_not_judged():
    frames = _Frames().walk(_FORWARD, 2.0, speed=0.0).walk(_FORWARD, 2.0, speed=0.5)
    assert frames.verdict == OBEYED
    assert frames.walk(_STAND, 2.0, speed=0.5, lifted=3).walk(_STAND, 1.0).verdict == OBEYED


def test_a_command_that_was_held_too_briefly_says_nothing():
    frames = _Frames().walk(_FORWARD, 2.4)
    assert frames.verdict == NOT_JUDGED
    assert math.isnan(frames.verdict.share)
    assert frames.walk(_FORWARD, 0.1).verdict == TOO_SLOW


def test_one_command_that_was_not_obeyed_is_not_made_good_by_the_next():
    frames = _Frames().walk(_FORWARD, 4.0, 0.5).walk(_STAND, 4.0, lifted=35)
    assert frames.walk(_FORWARD, 4.0, 0.5).verdict == RESTLESS
    assert frames.verdict.share == 0.0


def test_another_beta_is_no_new_command():
    frames = _Frames().walk(_FORWARD, 1.5, 0.5).walk((0.5, 0.0, 0.0, 0.9), 1.5, 0.5)
    assert frames.verdict == OBEYED


def test_a_robot_that_fell_did_not_do_what_it_was_asked_and_may_get_up_in_peace():
    frames = _Frames().walk(_FORWARD, 1.0, 0.5).fall(_FORWARD)
    frames.walk(_FORWARD, 2.0, 0.0)  # gets going again
    expected = Verdict(judged=1, obeyed=0, fell=1, too_slow=0, too_fast=0, restless=0)
    assert frames.walk(_FORWARD, 2.0, 0.5).verdict == expected
