"""Trials hold their commands, without noise, and count whoever falls."""

from __future__ import annotations

import torch
from standing import Standing

from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import STAND_JOINT_POS, SceneCfg
from mute.evaluation.trials import evaluation_cfg, from_the_stance, run_trial


def _make_env(num_envs=2, seconds=1.0):
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), num_envs, seconds, seed=0)
    return QuadrupedEnv(cfg)


def test_measuring_switches_noise_pushes_and_random_physics_off():
    cfg = evaluation_cfg(QuadrupedEnvCfg(), 4, 20.0, seed=5)
    assert (cfg.num_envs, cfg.seed) == (4, 5)
    assert cfg.observations.noise_level == 0.0
    assert not cfg.randomization.enabled
    kept = evaluation_cfg(QuadrupedEnvCfg(), 4, 20.0, seed=5, randomized=True)
    assert kept.randomization.enabled
    assert kept.observations.noise_level == 1.0


def test_physics_that_is_coarse_is_measured_in_the_usual_steps_and_finer_as_it_is():
    def measured(timestep, decimation):
        cfg = QuadrupedEnvCfg(decimation=decimation, scene=SceneCfg(timestep=timestep))
        cfg = evaluation_cfg(cfg, 2, 1.0, seed=0)
        return cfg.scene.timestep, cfg.decimation, cfg.step_dt

    assert measured(0.01, 2) == (0.005, 4, 0.02)
    assert measured(0.005, 4) == (0.005, 4, 0.02)
    assert measured(0.002, 10) == (0.002, 10, 0.02)
    assert measured(0.008, 2) == (0.004, 4, 0.016)


def test_a_trial_holds_its_commands_and_does_not_end_in_it():
    env, command = _make_env(2, seconds=0.4), torch.tensor([0.3, 0.0, 0.0, 0.5])
    controller, seen = Standing(2), []
    run_trial(env, controller, command, 20, lambda _, dones: seen.append(dones.any().item()))
    assert torch.equal(env.commands.command, command.expand(2, 4))
    assert seen == [False] * 20
    assert controller.resets == [None]


def test_a_robot_that_falls_goes_on_with_its_command_and_stays_counted():
    env, controller = _make_env(2), Standing(2)
    command = torch.tensor([[0.3, 0.0, 0.0, 0.5], [0.1, 0.0, 0.0, 0.5]])

    def overturn(_, dones):
        if not env.fallen.any() and len(controller.resets) == 1:
            env.simulation.qpos[0, 3:7] = torch.tensor([0.0, 1.0, 0.0, 0.0])

    meter = run_trial(env, controller, command, 6, overturn)
    assert meter.gait().fall_rate == 0.5
    forgotten = controller.resets[1]
    assert forgotten is not None
    assert forgotten.tolist() == [True, False]
    assert torch.equal(env.commands.command, command)


def test_robots_from_the_stance_are_exactly_in_it_and_at_rest():
    cfg = from_the_stance(evaluation_cfg(QuadrupedEnvCfg(num_threads=1), 3, 2.0, seed=0))
    env = QuadrupedEnv(cfg)
    stance = torch.tensor(STAND_JOINT_POS).expand(3, 12)
    torch.testing.assert_close(env.simulation.qpos[:, 7:], stance)
    assert float(env.simulation.qvel.abs().max()) == 0.0
    torch.testing.assert_close(env.heading, torch.tensor((1.0, 0.0)).expand(3, 2))
