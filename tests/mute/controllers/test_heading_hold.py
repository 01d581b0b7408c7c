"""The heading is held by yaw rates against the angle that a robot has turned by unasked."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch
from places import FLAT_POLICY

from mute.config import TaskCfg
from mute.controllers import LearnedController, load_policy
from mute.controllers.heading_hold import HeadingHold, heading_hold
from mute.controllers.learned import Policy
from mute.envs.observations import OBSERVATION_WIDTHS, policy_observation, slices
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.randomization import RandomizationCfg
from mute.evaluation.trials import evaluation_cfg

_SCALES = TaskCfg().env.observations.scales
_PARTS = slices(OBSERVATION_WIDTHS)
_HOLD = HeadingHold(
    2.0, 0.02, _SCALES["base_ang_vel"], _SCALES["projected_gravity"], _SCALES["command"]
)


def _seen(command, ang_vel=(0.0, 0.0, 0.0), gravity=(0.0, 0.0, -1.0)):
    """Return the observations of one robot."""
    return policy_observation(
        _SCALES,
        base_ang_vel=torch.tensor([ang_vel]),
        projected_gravity=torch.tensor([gravity]),
        joint_pos=torch.full((1, 12), 0.1),
        joint_vel=torch.full((1, 12), 0.2),
        last_action=torch.full((1, 12), 0.3),
        command=torch.tensor([command]),
    )


def _asked(obs):
    """Return the command that a policy sees."""
    return (obs[0, _PARTS["command"]] / _SCALES["command"]).tolist()


def test_a_turn_that_nobody_asked_for_is_asked_back_by_its_angle():
    seen = _seen((0.5, 0.0, 0.0, 0.7), ang_vel=(9.0, 9.0, 0.5))
    obs, turned = seen, torch.zeros(1, 1)
    for step in range(1, 11):
        obs, turned = _HOLD.step(seen, turned)
        assert turned.item() == pytest.approx(0.01 * step)
        assert _asked(obs) == pytest.approx([0.5, 0.0, -0.02 * step, 0.7])
    others = [name for name in OBSERVATION_WIDTHS if name != "command"]
    assert all(torch.equal(obs[:, _PARTS[name]], seen[:, _PARTS[name]]) for name in others)


def test_it_is_the_turn_about_the_vertical_that_counts():
    pitch = 0.5
    gravity = (math.sin(pitch), 0.0, -math.cos(pitch))
    level = (-math.sin(pitch), 0.0, math.cos(pitch))  # 1 rad/s about the vertical
    _, turned = _HOLD.step(_seen((0.5, 0.0, 0.0, 0.0), level, gravity), torch.zeros(1, 1))
    assert turned.item() == pytest.approx(0.02)


@pytest.mark.parametrize("command", [(0.0, 0.0, 0.0, 0.5), (0.5, 0.0, 0.1, 0.5)])
def test_who_stands_or_is_asked_to_turn_is_left_alone_and_holds_anew_afterwards(command):
    seen = _seen(command, ang_vel=(0.0, 0.0, 1.0))
    obs, turned = _HOLD.step(seen, torch.full((1, 1), 0.3))
    assert torch.equal(obs, seen)
    assert turned.item() == 0.0


def test_what_is_asked_for_and_remembered_is_bounded():
    seen = _seen((0.5, 0.0, 0.0, 0.0), ang_vel=(0.0, 0.0, -5.0))
    obs, turned = seen, torch.zeros(1, 1)
    for _ in range(50):
        obs, turned = _HOLD.step(seen, turned)
    assert turned.item() == pytest.approx(-0.6)
    assert _asked(obs)[2] == pytest.approx(0.5)


def test_a_task_without_a_gain_holds_no_heading():
    assert heading_hold(TaskCfg()) is None


@pytest.mark.parametrize("name", ["base_ang_vel", "projected_gravity", "command"])
def test_a_heading_that_is_not_seen_cannot_be_held(name):
    cfg = TaskCfg()
    unseen = dataclasses.replace(cfg.env.observations, scales=_SCALES | {name: 0.0})
    env = dataclasses.replace(cfg.env, observations=unseen)
    with pytest.raises(ValueError, match=r"agent\.heading_gain must be 0 where"):
        TaskCfg(env=env, agent=dataclasses.replace(cfg.agent, heading_gain=1.0))


def test_it_takes_left_and_right_alike():
    side = torch.tensor([1.0, -1.0])[:, None]
    ang_vel, gravity = torch.tensor([0.3, -0.2, 0.5]), torch.tensor([0.2, 0.1, -0.97])
    seen = _seen((0.5, 0.0, 0.0, 0.0)).repeat(2, 1)
    seen[:, _PARTS["base_ang_vel"]] = ang_vel * torch.cat((side, side**2, side), dim=1)
    seen[:, _PARTS["projected_gravity"]] = gravity * torch.cat((side**2, side, side**2), dim=1)
    obs, turned = _HOLD.step(seen, 0.1 * side)
    torch.testing.assert_close(turned[0], -turned[1])
    yaw = obs[:, _PARTS["command"]][:, 2]
    assert yaw[0].item() == pytest.approx(-yaw[1].item())
    assert abs(yaw[0].item()) > 0.1


def _flat_policy(gain: float) -> Policy:
    return load_policy(FLAT_POLICY).with_heading_gain(gain)


def _headings_off(gain: float) -> torch.Tensor:
    """Return how far robots that differ have turned after 8 s ahead, rad."""
    policy = _flat_policy(gain)
    robots = RandomizationCfg(push_interval=0.0, encoder_offset=(-0.02, 0.02))
    env = dataclasses.replace(policy.cfg.env, randomization=robots, random_heading=False)
    env = QuadrupedEnv(evaluation_cfg(env, 16, 9.0, 0, randomized=True))
    controller = LearnedController(policy, 16)
    env.set_command(torch.tensor((0.5, 0.0, 0.0, 0.0)))
    for _ in range(400):
        env.step(controller.act(env.get_observations()))
    return torch.atan2(env.heading[:, 1], env.heading[:, 0])


def test_robots_that_differ_go_straight_with_it():
    drifts, holds = (_headings_off(gain).square().mean().sqrt() for gain in (0.0, 1.5))
    assert holds < 0.1
    assert holds < 0.5 * drifts


def test_who_begins_anew_has_not_turned():
    policy = _flat_policy(2.0)
    seen = _seen((0.5, 0.0, 0.0, 0.0), ang_vel=(0.0, 0.0, 1.0)).repeat(2, 1)
    one, new = LearnedController(policy, 2), LearnedController(policy, 2)
    first = new.act({"policy": seen})  # pyright: ignore[reportArgumentType]
    for _ in range(20):
        one.act({"policy": seen})  # pyright: ignore[reportArgumentType]
    one.reset(torch.tensor([False, True]))
    after = one.act({"policy": seen})  # pyright: ignore[reportArgumentType]
    torch.testing.assert_close(after[1], first[1])
    assert float((after[0] - first[0]).abs().max()) > 0.01
