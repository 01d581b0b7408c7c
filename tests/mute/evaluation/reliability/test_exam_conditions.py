"""Every policy is judged under the same conditions, and its robots are led along."""

from __future__ import annotations

import dataclasses

import pytest
import torch
from exam_helpers import make_random_policy
from standing import Standing

from mute.envs.observations import ObservationsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.randomization import RandomizationCfg
from mute.evaluation.reliability.conditions import (
    dealt,
    walk,
    without_noise,
)
from mute.evaluation.usual_robots import robots_cfg, under_conditions


def _tame_policy():
    policy = make_random_policy()
    env = dataclasses.replace(
        policy.cfg.env,
        observations=ObservationsCfg(noise={"joint_pos": 0.001}, noise_level=0.0),
        randomization=RandomizationCfg(False, friction_factor=(1.0, 1.0), push_interval=4.0),
    )
    return dataclasses.replace(policy, cfg=dataclasses.replace(policy.cfg, env=env))


def test_a_policy_of_tame_robots_is_judged_on_the_usual_ones_that_nobody_pushes():
    cfg = robots_cfg(under_conditions(_tame_policy()), 4, seconds=2.0, seed=3)
    usual = RandomizationCfg()
    assert cfg.randomization.enabled
    assert cfg.randomization.friction_factor == usual.friction_factor
    assert cfg.randomization.push_interval == 0.0
    assert cfg.observations.noise_level == 1.0
    assert cfg.observations.noise == ObservationsCfg().noise
    assert (cfg.num_envs, cfg.seed) == (4, 3)
    assert without_noise(cfg).observations.noise_level == 0.0
    assert without_noise(cfg).randomization == cfg.randomization


def test_what_the_networks_were_learnt_with_stays():
    policy = _tame_policy()
    scales = policy.cfg.env.observations.scales | {"joint_vel": 0.1}
    observations = dataclasses.replace(policy.cfg.env.observations, scales=scales)
    env = dataclasses.replace(policy.cfg.env, observations=observations, action_scale=0.3)
    judged = under_conditions(
        dataclasses.replace(policy, cfg=dataclasses.replace(policy.cfg, env=env))
    )
    assert judged.cfg.env.observations.scales == scales
    assert judged.cfg.env.action_scale == 0.3


def test_settings_are_dealt_to_as_many_robots_each_side_by_side():
    settings = torch.arange(8.0).reshape(2, 4)
    commands, index = dealt(settings, 3)
    assert index.tolist() == [0, 1, 0, 1, 0, 1]
    torch.testing.assert_close(commands, settings[index])


def test_a_robot_that_falls_is_asked_for_the_same_and_has_no_past():
    cfg = robots_cfg(under_conditions(_tame_policy()), 2, 2.0, seed=0)
    env, controller = QuadrupedEnv(dataclasses.replace(cfg, num_threads=1)), Standing(2)
    command = torch.tensor(((0.3, 0.1, -0.2, 0.9), (0.1, 0.0, 0.0, 0.2)))
    env.simulation.qpos[1, 3:7] = torch.tensor((0.0, 1.0, 0.0, 0.0))  # on its back
    seen = []
    walk(env, controller, command, 0.06, lambda dones: seen.append(dones.tolist()))
    assert seen == [[False, True], [False, False], [False, False]]
    torch.testing.assert_close(env.commands.command, command)
    forgotten = controller.resets[-1]
    assert forgotten is not None
    assert forgotten.tolist() == [False, True]
    assert env.get_observations()["policy"][1, -4:].tolist() == pytest.approx([0.1, 0, 0, 0.2])
