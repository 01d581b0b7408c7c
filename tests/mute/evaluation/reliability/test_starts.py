"""A robot goes if it is fast enough in time and stays so; each command meets the same stand."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch
from exam_helpers import make_random_policy
from standing import Standing

from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.reliability import starts
from mute.evaluation.reliability.starts import COMMANDS, going_times, starts_of
from mute.evaluation.trials import evaluation_cfg, from_the_stance
from mute.evaluation.usual_robots import under_conditions

_CONTROLLER = "mute.controllers.learned.LearnedController"
"""What drives the robots of a policy."""


_DT = 0.02
_STEPS = round(starts.TRIAL_TIME / _DT)


def _after(delay: float, speed: float = 1.0) -> torch.Tensor:
    """Return the progress of a robot that begins to move at a speed after a delay."""
    return torch.where(torch.arange(_STEPS) * _DT < delay - 1e-6, 0.0, speed)


def _times(*robots: torch.Tensor, ended: int | None = None) -> list[float]:
    fell = torch.zeros(len(robots), dtype=torch.bool)
    if ended is not None:
        fell[ended] = True
    return going_times(torch.stack(robots, dim=1), fell, _DT).tolist()


@pytest.mark.parametrize("delay", [0.3, 1.0, 1.5])
def test_the_time_is_when_half_a_second_is_fast_enough(delay):
    # Two fifths of the half second are walked at the full speed: 0.2 s after the delay.
    assert _times(_after(delay)) == pytest.approx([delay + 0.2])


def test_who_goes_at_once_goes_after_the_first_half_second():
    assert _times(_after(0.0), _after(0.0, 0.4001)) == pytest.approx([0.5, 0.5])


def test_who_is_too_slow_too_late_or_stands_does_not_go():
    standing = torch.zeros(_STEPS)
    # At twice the speed the last second is fast enough, but not by the deadline.
    late = _after(2.0, 2.0)
    assert _times(standing, _after(0.0, 0.39), late) == [math.inf] * 3
    assert _times(-_after(0.0)) == [math.inf]


def test_a_lurch_is_no_start():
    lurch = torch.where(torch.arange(_STEPS) * _DT < 1.0, 1.5, 0.0)
    assert _times(lurch) == [math.inf]


def test_a_robot_that_fell_does_not_go():
    assert _times(_after(0.5), _after(0.5), ended=1) == [pytest.approx(0.7), math.inf]


class _Notes(Standing):
    """Holds the stance and notes the observations that it is shown, in every copy."""

    shown: list[torch.Tensor]

    def __init__(self, num_envs: int) -> None:
        super().__init__(num_envs)
        self.shown = []

    def __deepcopy__(self, memo: object) -> _Notes:
        copied = _Notes(self.num_envs)
        copied.shown = self.shown
        return copied

    def act(self, observations):
        self.shown.append(observations["policy"].clone())
        return super().act(observations)


@pytest.fixture
def stand(monkeypatch: pytest.MonkeyPatch) -> QuadrupedEnv:
    monkeypatch.setattr(starts, "STAND_TIME", 0.1)
    monkeypatch.setattr(starts, "TRIAL_TIME", 0.6)
    cfg = evaluation_cfg(make_random_policy().cfg.env, 3, 5.0, seed=0)
    return QuadrupedEnv(dataclasses.replace(from_the_stance(cfg), num_threads=1))


def test_a_robot_that_stands_receives_each_command_from_the_same_stand(stand):
    controller, work = _Notes(3), []
    starts_of(stand, controller, work.append)
    assert len(controller.shown) == 5 + len(COMMANDS) * 30
    firsts = [controller.shown[5 + 30 * index] for index in range(len(COMMANDS))]
    for first, velocity in zip(firsts, COMMANDS.values(), strict=True):
        asked = torch.tensor([(*velocity, beta) for beta in (0.0, 0.5, 1.0)])
        torch.testing.assert_close(first[:, -4:], asked)
        torch.testing.assert_close(first[:, :-4], firsts[0][:, :-4])
    assert all((shown[:, -4:-1] == 0.0).all() for shown in controller.shown[:5])
    assert sum(work) == pytest.approx(3 * (0.1 + len(COMMANDS) * 0.6))


def test_a_robot_that_only_stands_starts_on_no_command(stand):
    rows = starts_of(stand, Standing(3), lambda work: None)
    assert [(row.command, row.beta) for row in rows] == [
        (name, beta) for name in COMMANDS for beta in (0.0, 0.5, 1.0)
    ]
    assert all((row.robots, row.share) == (1, 0.0) for row in rows)
    assert all(math.isnan(row.seconds) for row in rows)


def test_randomised_robots_begin_in_the_exact_stance_that_their_sensors_see_with_noise(
    monkeypatch,
):
    made: list[_Notes] = []

    def make(policy, robots):
        made.append(_Notes(robots))
        return made[-1]

    monkeypatch.setattr(_CONTROLLER, make)
    monkeypatch.setattr(starts, "STAND_TIME", 0.1)
    monkeypatch.setattr(starts, "TRIAL_TIME", 0.6)
    policy = under_conditions(make_random_policy())
    result = starts.measure_starts(policy, 4, 0, lambda work: None)
    randomized, exact = made
    assert (randomized.num_envs, exact.num_envs) == (12, 3)
    joints = randomized.shown[0][:, 6:18]
    assert 0.0 < float(joints.abs().max()) <= 0.0101  # of a state near the stance: 0.1
    torch.testing.assert_close(exact.shown[0][:, 6:30], torch.zeros(3, 24))
    assert [row["robots"] for row in result.tables["starts"]] == [4] * 24
    assert [figure.value for figure in result.figures] == [0.0] * 6
