"""Hardships, pushes until the fall and a long walk, counted by hand."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
import torch
from learning_helpers import make_runner

from mute.config import to_plain
from mute.controllers.learned import Policy, make_policy
from mute.envs.commands import CommandsCfg
from mute.envs.randomization import full_randomization
from mute.evaluation import endurance
from mute.evaluation.endurance import be_pushed, bear, walk_at_random
from mute.learning.runner import policy_part

USUAL = full_randomization(push_interval=0.0)


@pytest.fixture(scope="module")
def policy() -> Policy:
    """Return a policy that has learnt nothing."""
    runner = make_runner()
    about = {"task": "go1_mute", "iter": 0, "config": to_plain(runner.task_cfg)}
    return make_policy(policy_part(runner.alg.save() | about))


@pytest.fixture
def envs(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return a list to which each environment that is made is added."""
    made: list[Any] = []
    env_type = endurance.QuadrupedEnv

    def make(cfg: Any) -> Any:
        made.append(env_type(dataclasses.replace(cfg, num_threads=1)))
        return made[-1]

    monkeypatch.setattr(endurance, "QuadrupedEnv", make)
    return made


@pytest.mark.parametrize(
    ("hardship", "field", "expected"),
    [
        ("3 kg on the trunk", "added_mass", (3.0, 3.0)),
        ("motors 20 ms late", "action_delay", (0.02, 0.02)),
        ("none", "added_mass", USUAL.added_mass),
    ],
)
def test_a_hardship_is_all_robots_and_the_rest_differs(policy, envs, hardship, field, expected):
    row = bear(policy, hardship, 3, 0.2, 0.0, seed=0)
    (env,) = envs
    assert getattr(env.cfg.randomization, field) == expected
    others = dataclasses.replace(env.cfg.randomization, **{field: getattr(USUAL, field)})
    assert others == USUAL
    assert env.cfg.terrain.kind == "flat"
    assert (row.hardship, row.robots, row.survived) == (hardship, 3, 1.0)


def test_slippery_ground_has_a_friction_of_0_3_for_every_robot(policy, envs):
    bear(policy, "friction of 0.3", 3, 0.2, 0.0, seed=0)
    (env,) = envs
    floor = env.model.geom("floor").id
    friction = env.simulation.read_field("geom_friction")[:, floor, 0]
    torch.testing.assert_close(friction, torch.full_like(friction, 0.3))


def _made_up(monkeypatch: pytest.MonkeyPatch, falls_at: dict[int, int]) -> list[torch.Tensor]:
    """Put a walk in place of a trial, in which robots fall at a step; return how they are pushed.

    Each push is told by what it adds to the velocity, (robots, 3), or nothing, at each step.
    """
    pushes: list[torch.Tensor] = []

    def walk(env, controller, command, num_steps, on_step):
        robots = env.num_envs
        for step in range(num_steps):
            env.simulation.qvel[:, :3] = 0.0
            env.fallen = torch.tensor([falls_at.get(i) == step for i in range(robots)])
            env.base_lin_vel = torch.tensor([[0.5, 0.0, 0.0]]).repeat(robots, 1)
            on_step(None, env.fallen)
            pushes.append(env.simulation.qvel[:, :3].clone())

    monkeypatch.setattr(endurance, "run_trial", walk)
    return pushes


def test_what_is_made_ends_with_a_fall(policy, envs, monkeypatch):
    _made_up(monkeypatch, {1: 25})
    row = bear(policy, "none", 2, 1.0, 0.0, seed=0)
    assert row.survived == 0.5
    assert row.made == pytest.approx(0.75)


def test_pushes_of_a_hardship_are_of_1_m_s_along_the_ground_every_4_s(policy, envs, monkeypatch):
    pushes = torch.stack(_pushed_for(policy, monkeypatch, 9.0))
    speeds = pushes.norm(dim=2)
    assert torch.nonzero(speeds.any(dim=1))[:, 0].tolist() == [199, 399]
    torch.testing.assert_close(speeds[199], torch.ones(4))
    assert not pushes[..., 2].any()
    assert not torch.allclose(pushes[199], pushes[399])


def _pushed_for(policy, monkeypatch, seconds):
    pushes = _made_up(monkeypatch, {})
    bear(policy, "pushes of 1 m/s every 4 s", 4, seconds, 0.0, seed=0)
    return pushes


def test_the_largest_push_is_the_last_that_was_borne_for_a_second(policy, envs, monkeypatch):
    # Pushes at 1, 2, 3 s of 0.05, 0.1, 0.15 m/s. Robot 0 falls after the third, 1 before the first.
    pushes = _made_up(monkeypatch, {0: 160, 1: 10})
    result = be_pushed(policy, 3, 0.0, seed=0)
    speeds = torch.stack(pushes).norm(dim=2)
    assert torch.nonzero(speeds[:, 0])[:, 0].tolist() == list(range(49, 3000, 50))
    torch.testing.assert_close(speeds[99], torch.full((3,), 0.1))
    torch.testing.assert_close(speeds[2949], torch.full((3,), 2.95))
    assert torch.stack(pushes)[49::50, :, 2].abs().max() > 0.5
    borne = torch.tensor([0.1, 0.0, 2.95])
    assert result.largest == pytest.approx(float(borne.mean()))
    assert result.deviation == pytest.approx(float(borne.std()))
    assert result.still_up == pytest.approx(1.0 / 3.0)


def test_a_long_walk_has_new_commands_every_10_s_within_1_and_the_tasks_own(
    policy, envs, monkeypatch
):
    commands = []
    act = endurance.LearnedController.act

    def watch(self, observations):
        commands.append(envs[0].commands.command.clone())
        return act(self, observations)

    monkeypatch.setattr(endurance.LearnedController, "act", watch)
    assert endurance.COMMAND_TIME == 10.0
    monkeypatch.setattr(endurance, "COMMAND_TIME", 1.0)
    result = walk_at_random(policy, 4, 0.05, 0.25, seed=0)
    told = torch.stack(commands)
    assert len(told) == 150
    changes = torch.nonzero((told[1:] != told[:-1]).any(dim=2).any(dim=1))[:, 0] + 1
    assert changes.tolist() == [50, 100]
    ranges = CommandsCfg()
    for axis, bounds in enumerate((ranges.lin_vel_x, ranges.lin_vel_y, ranges.ang_vel_z)):
        assert told[..., axis].min() >= max(bounds[0], -1.0)
        assert told[..., axis].max() <= min(bounds[1], 1.0)
    assert (told[..., 3] == 0.25).all()
    assert (result.robots, result.minutes) == (4, 0.05)
    assert 0.0 <= result.survived <= 1.0
    # It has learnt nothing: what it is asked for is what it gets wrong.
    assert 0.1 < result.velocity_rmse < 1.5
    assert 0.1 < result.yaw_rate_rmse < 2.5
