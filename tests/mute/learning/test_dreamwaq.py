"""DreamWaQ's task: what its networks see, how its estimator learns, and that nothing gets lost."""

from __future__ import annotations

import copy
import dataclasses
import math

import pytest
import torch
from learning_helpers import before_each_update, differences, everything, make_cfg

from mute.config import EstimationCfg, TaskCfg, from_plain, to_plain
from mute.controllers.learned import LearnedController, make_policy
from mute.envs.commands import BETA
from mute.envs.quadruped_env import QuadrupedEnv
from mute.learning.estimator_trainer import Labels, estimator_losses
from mute.learning.runner import MuteRunner, policy_part
from mute.networks.estimator import Estimate
from mute.tasks import make_task


def _make_cfg(iterations: int = 2, **agent: object) -> TaskCfg:
    """Return DreamWaQ's task in the size of the tests."""
    task, tiny = make_task("go1_dreamwaq"), make_cfg(iterations)
    network = dataclasses.replace(
        task.agent.estimation.network, history_hidden=(12, 10), decoder_hidden=(8,), latent_dim=4
    )
    estimation = dataclasses.replace(task.agent.estimation, network=network, num_mini_batches=2)
    settings = {"quiet_factor": False, "estimation": estimation} | agent
    env = dataclasses.replace(
        tiny.env,
        rewards=task.env.rewards,
        randomization=dataclasses.replace(task.env.randomization, push_interval=0.06),
    )
    return TaskCfg(env=env, agent=dataclasses.replace(tiny.agent, **settings))  # pyright: ignore


def _make_runner(log_dir=None, iterations: int = 2, **agent: object) -> MuteRunner:
    return MuteRunner("go1_dreamwaq", _make_cfg(iterations, **agent), log_dir)


def test_the_task_has_the_papers_sizes_and_ranges():
    cfg = make_task("go1_dreamwaq")
    network = cfg.agent.estimation.network
    assert (network.history_length, network.history_hidden) == (5, (128, 64))
    assert (network.latent_dim, network.decoder_hidden) == (16, (64, 128))
    assert cfg.agent.actor_hidden == cfg.agent.critic_hidden == (512, 256, 128)
    assert cfg.agent.estimation.adaptive_bootstrap
    physics, floor = cfg.env.randomization, cfg.env.scene.floor_friction
    assert [factor * floor for factor in physics.friction_factor] == pytest.approx([0.2, 1.25])
    assert physics.added_mass == (-1.0, 2.0)
    assert physics.com_offset == (-0.05, 0.05)
    assert physics.action_delay == (0.0, 0.015)


def test_its_reward_has_the_weights_of_its_table():
    rewards = make_task("go1_dreamwaq").env.rewards
    lasting = {name: term for name, term in rewards.terms.items() if term.group != "guide"}
    assert {name: term.weight for name, term in lasting.items()} == {
        "lin_vel_tracking": 1.0,
        "ang_vel_tracking": 0.5,
        "lin_vel_z": -2.0,
        "ang_vel_xy": -0.05,
        "orientation": -0.2,
        "joint_acc": -2.5e-7,
        "joint_power": -2.0e-5,
        "base_height": -1.0,
        "foot_clearance": -0.01,
        "action_rate": -0.01,
        "smoothness": -0.01,
        "power_distribution": -1.0e-5,
    }
    assert {term.group for term in lasting.values()} == {"task", "other"}
    # What leads it to a trot is soon gone: what it has learnt in the end is its own reward's.
    assert rewards.terms.keys() - lasting.keys() == {"diagonal_support"}
    assert rewards.guide_ramp == (40.0, 60.0)


def test_no_network_sees_the_quiet_factor():
    runner = _make_runner()
    assert runner.env.get_observations()["policy"].shape[1] == 45
    assert runner.env.estimator.obs_dim == 45
    # Observation, velocity and latent.
    assert runner.alg.actor.obs_dim == 45 + 3 + 4
    policy = make_policy(policy_part(runner.alg.save() | runner._about(0)))
    env = QuadrupedEnv(dataclasses.replace(policy.cfg.env, num_envs=2))
    observations = env.get_observations()
    loud = LearnedController(policy, 2).act(observations)
    for value in (0.0, 0.7):
        observations["policy"][:, -1] = value
        assert torch.equal(LearnedController(policy, 2).act(observations), loud)
    assert BETA == 3  # the last part of the command, which is the last of the observation


def test_its_losses_are_those_computed_by_hand():
    estimate = Estimate(
        base_lin_vel=torch.tensor([[[1.0, 0.0, 0.0]], [[0.0, 0.0, 3.0]]]),
        heights=torch.zeros(2, 1, 0),
        latent_mean=torch.tensor([[[1.0, 0.0]], [[0.0, 2.0]]]),
        latent_log_var=torch.tensor([[[0.0, math.log(2.0)]], [[0.0, 0.0]]]),
        latent=torch.zeros(2, 1, 2),
        phase=torch.zeros(2, 1, 0),
    )
    labels = Labels(
        base_lin_vel=torch.zeros(2, 1, 3),
        heights=torch.zeros(2, 1, 0),
        phase=torch.zeros(2, 1, 0),
        phase_closed=torch.zeros(2, 1, 0, dtype=torch.bool),
        next_obs=torch.tensor([[[1.0, 2.0]], [[9.0, 9.0]]]),
        next_valid=torch.tensor([[True], [False]]),
    )
    decoded = torch.tensor([[[1.0, 4.0]], [[0.0, 0.0]]])
    losses = estimator_losses(estimate, decoded, labels, EstimationCfg(lambda_kl=0.1), 0.1)
    # Velocity (1 + 9) / 6; next observation (0 + 4) / 2, of the first step alone; the divergences
    # 1/2 + (2 - 1 - ln 2) / 2 and 2 of the two steps.
    divergence = (0.5 + 0.5 * (1.0 - math.log(2.0)) + 2.0) / 2.0
    assert float(losses.total) == pytest.approx(10.0 / 6.0 + 2.0 + 0.1 * divergence, rel=1e-5)


def test_robots_that_are_told_the_truth_see_it_and_the_others_their_estimates():
    runner = _make_runner()
    bootstrap, env = runner.env.bootstrap, runner.env
    assert bootstrap is not None
    bootstrap.told = torch.arange(env.num_envs).unsqueeze(1) % 2 == 0
    observations, _, _, _ = env.step(torch.zeros(env.num_envs, 12))
    true = observations["privileged"][:, env.env.privileged_slices["base_lin_vel"]]
    seen = observations["estimate"][:, :3]
    assert torch.equal(seen[::2], true[::2])
    assert torch.equal(seen[1::2], env.estimate.base_lin_vel[1::2])
    assert not torch.equal(env.estimate.base_lin_vel[::2], true[::2])
    assert torch.equal(observations["estimate"][:, 3:], env.estimate.latent)


def test_a_policy_in_use_is_told_nothing():
    runner = _make_runner()
    policy = make_policy(policy_part(runner.alg.save() | runner._about(0)))
    observations = runner.env.env.get_observations()
    controller = LearnedController(policy, runner.env.num_envs)
    before = controller.act(observations)
    columns = runner.env.env.privileged_slices["base_lin_vel"]
    observations["privileged"][:, columns] += 5.0
    controller.reset()
    assert torch.equal(controller.act(observations), before)


def test_a_rollout_is_drawn_for_as_a_whole_and_the_estimator_learns_from_it():
    runner = _make_runner(iterations=3)
    bootstrap = runner.env.bootstrap
    assert bootstrap is not None
    told: list[torch.Tensor] = []
    rollouts: list[torch.Tensor] = []
    weights = copy.deepcopy(runner.alg.trainer.estimator.state_dict())
    privileged = runner.env.env.privileged_slices["base_lin_vel"]

    def look() -> None:
        stored = runner.alg.storage.observations
        seen, true = stored["estimate"][..., :3], stored["privileged"][..., privileged]
        told.append(bootstrap.told[:, 0].clone())
        rollouts.append((seen == true).all(dim=2))

    before_each_update(runner, look)
    assert runner.train()
    for who, sees_truth in zip(told, rollouts, strict=True):
        assert torch.equal(sees_truth, who.expand_as(sees_truth))
    assert bool(told[0].all())
    assert 0.0 < bootstrap.probability < 1.0
    learnt = runner.alg.trainer.estimator.state_dict()
    assert all(not torch.equal(learnt[name], weights[name]) for name in weights)


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_run_resumes_bit_for_bit(tmp_path, symmetric: bool):
    whole = _make_runner(tmp_path / "whole", iterations=3, symmetric=symmetric)
    assert whole.train()
    resumed = _make_runner(tmp_path / "resumed", iterations=3, symmetric=symmetric)
    resumed.load(str(tmp_path / "whole" / "model_1.pt"))
    assert resumed.train()
    assert differences(everything(resumed), everything(whole)) == []


def test_its_configuration_survives_a_file():
    cfg = _make_cfg()
    assert from_plain(to_plain(cfg)) == cfg


def test_a_reward_by_the_estimated_phase_needs_a_phase_that_is_estimated():
    cfg = _make_cfg()
    env = dataclasses.replace(
        cfg.env, rewards=dataclasses.replace(cfg.env.rewards, phase_source="estimated")
    )
    with pytest.raises(ValueError, match=r"env\.rewards\.phase_source must be 'true' without"):
        dataclasses.replace(cfg, env=env)
