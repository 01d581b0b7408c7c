"""What a control step logs: by hand, for four robots."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import torch

from mute.envs.curriculum import Curriculum
from mute.envs.step_log import curriculum_log, episode_log, gait_log, ground_log
from mute.envs.terrain import BoxGround, FlatGround


def _make_footfalls(touchdown) -> Any:
    return SimpleNamespace(
        touchdown=torch.tensor(touchdown),
        landing_speed=torch.tensor([[0.9, 0.7], [0.5, 0.0], [0.3, 0.0], [0.1, 0.2]]),
        swing_apex=torch.tensor([[0.05, 0.03], [0.08, 0.01], [0.06, 0.02], [0.04, 0.02]]),
        contact_share=torch.tensor([[1.0, 0.0], [0.5, 0.5], [0.25, 0.25], [1.0, 0.5]]),
    )


COMMAND = torch.tensor(
    [[0.5, 0.0, 9.0, 0.0], [0.5, 0.2, 9.0, 0.25], [0.0, 0.0, 9.0, 0.8], [0.0, 0.1, 9.0, 1.0]]
)
VELOCITY = torch.tensor([[0.3, 0.0, 9.0], [0.5, 0.0, 9.0], [0.1, 0.0, 9.0], [0.0, 0.1, 9.0]])
POWER = torch.tensor([10.0, 20.0, 30.0, 40.0])


def _values(log):
    return {name: value.item() for name, value in log.items()}


def test_landings_are_told_apart_by_beta():
    touchdown = [[True, True], [True, False], [True, False], [False, True]]
    assert _values(gait_log(COMMAND, VELOCITY, POWER, _make_footfalls(touchdown))) == pytest.approx(
        {
            "Gait/velocity_error_sq": (0.04 + 0.04 + 0.01 + 0.0) / 4,  # of x and y
            "Gait/power": 25.0,
            "Gait/duty_factor": 0.5,
            # Beta 0.25 is neither low nor high.
            "Gait/landing_speed_low_beta": 0.8,
            "Gait/apex_low_beta": 0.04,
            "Gait/landing_speed_high_beta": 0.25,
            "Gait/apex_high_beta": 0.04,
        }
    )


def test_where_nobody_lands_nothing_is_said_of_landings():
    touchdown = [[False, False], [True, True], [False, False], [False, True]]
    log = gait_log(COMMAND, VELOCITY, POWER, _make_footfalls(touchdown))
    assert "Gait/landing_speed_low_beta" not in log
    assert "Gait/apex_low_beta" not in log
    assert log["Gait/landing_speed_high_beta"].item() == pytest.approx(0.2)


def test_falls_are_a_share_of_the_episodes_that_ended():
    dones = torch.tensor([True, True, True, True, False])
    fallen = torch.tensor([True, False, False, False, False])
    unstable = torch.tensor([False, True, True, False, False])
    invalid_action = torch.tensor([False, True, True, False, True])
    assert _values(episode_log(dones, fallen, unstable, invalid_action)) == {
        "Episode/unstable": 2.0,
        "Episode/invalid_actions": 3.0,
        "Episode/fall_rate": 0.25,
    }


def test_where_no_episode_ended_nothing_is_said_of_falls():
    nobody = torch.zeros(4, dtype=torch.bool)
    log = _values(episode_log(nobody, nobody, nobody, nobody))
    assert log == {"Episode/unstable": 0.0, "Episode/invalid_actions": 0.0}


def test_every_factor_of_the_curriculum_is_told():
    log = _values(curriculum_log(Curriculum(0.25, 0.5, 0.75, 1.0), "cpu"))
    assert log == {
        "Curriculum/quiet": 0.25,
        "Curriculum/lift": 0.5,
        "Curriculum/guide": 0.75,
        "Curriculum/commands": 1.0,
    }


def test_the_mean_level_of_each_kind_of_ground_but_the_flat_one_is_logged():
    ground: Any = BoxGround.__new__(BoxGround)
    ground.kinds = ("flat", "rooms", "stairs")
    ground.kind = torch.tensor([0, 1, 2, 1])
    ground.level = torch.tensor([4, 1, 3, 2])
    levels = {name: float(value) for name, value in ground_log(ground).items()}
    assert levels == {"Ground/level_rooms": 1.5, "Ground/level_stairs": 3.0}
    assert ground_log(FlatGround()) == {}
