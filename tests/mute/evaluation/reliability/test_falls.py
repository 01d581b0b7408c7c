"""Falls are counted over an episode whose commands are drawn evenly, whatever the task does."""

from __future__ import annotations

import pytest
import torch
from exam_helpers import make_random_policy
from standing import Standing

from mute.evaluation.reliability import falls
from mute.evaluation.reliability.falls import measure_falls
from mute.evaluation.usual_robots import under_conditions

_CONTROLLER = "mute.controllers.learned.LearnedController"
"""What drives the robots of a policy."""


class _Notes(Standing):
    """Holds the stance, or tips over where beta is above a half, and notes the commands."""

    def __init__(self, num_envs: int, seen: list[torch.Tensor]) -> None:
        super().__init__(num_envs)
        self.seen = seen

    def act(self, observations):
        command = observations["policy"][:, -4:]
        self.seen.append(command.clone())
        folded = torch.tensor((0.0, 0.0, 0.0, 0.0, 8.0, -8.0) * 2)
        return torch.where(command[:, 3:] > 0.5, folded, 0.0)


def test_robots_that_fall_on_drawn_commands_are_counted(monkeypatch):
    notes: list[torch.Tensor] = []
    monkeypatch.setattr(_CONTROLLER, lambda policy, robots: _Notes(robots, notes))
    monkeypatch.setattr(falls, "_EPISODE", 10.5)
    policy = under_conditions(make_random_policy())
    policy.cfg.env.commands.resampling_time = 3.0  # of the task; here a command holds for 10 s
    policy.cfg.env.max_tilt = 0.3  # who leans has fallen
    work: list[float] = []
    result = measure_falls(policy, 6, 0, work.append)
    seen = torch.stack(notes)  # (steps, robots, 4)
    assert len(seen) == 525
    assert bool((seen[1:500, :, :3] == seen[:499, :, :3]).all())
    assert not bool((seen[500, :, :3] == seen[499, :, :3]).all())
    assert bool((seen[:, :, 3] == seen[0, :, 3]).all())  # beta stays for the episode
    expected = int((seen[0, :, 3] > 0.5).sum())
    assert 0 < expected < 6
    assert result.tables["falls"][0] == {"robots": 6, "fell": expected, "unstable": 0}
    assert result.figures[0].value == pytest.approx(expected / 6)
    assert sum(work) == pytest.approx(6 * 10.5)
