"""A loaded policy drives as the one that was trained."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from earlier_versions import estimators_own_heights
from learning_helpers import NUM_ENVS, make_cfg, make_runner

from mute.checkpoint import CheckpointError, load_checkpoint, save_checkpoint
from mute.controllers import LearnedController, load_policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.learning.estimated_env import EstimatedEnv
from mute.learning.runner import MuteRunner, policy_part


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> tuple[MuteRunner, Path]:
    directory = tmp_path_factory.mktemp("trained")
    runner = make_runner(directory, iterations=3)
    runner.train()
    return runner, directory / "model_2.pt"


@torch.no_grad()
def test_a_loaded_policy_acts_as_the_runners_own_through_ends_of_episodes(trained):
    runner, path = trained
    estimator = runner.env.estimator
    env = EstimatedEnv(QuadrupedEnv(runner.task_cfg.env), estimator, "cpu")
    own = runner.get_inference_policy()
    controller = LearnedController(load_policy(path), NUM_ENVS)
    ended = 0
    for _ in range(12):
        observations = env.get_observations()
        actions = own(observations)
        assert torch.equal(controller.act(observations), actions)
        assert controller.estimate is not None
        assert torch.equal(controller.estimate.phase, env.estimate.phase)
        _, _, dones, _ = env.step(actions)
        controller.reset(dones)
        ended += int(dones.sum())
    assert ended > 0


def test_a_loaded_policys_world_takes_the_threads_of_this_machine_not_those_of_its_training(
    trained,
):
    runner, path = trained
    assert runner.task_cfg.env.num_threads == 1
    loaded = load_policy(path).cfg
    assert loaded.env.num_threads == 0
    assert loaded == replace(runner.task_cfg, env=replace(runner.task_cfg.env, num_threads=0))


@torch.no_grad()
def test_without_forgetting_at_an_episodes_end_the_actions_differ(trained):
    runner, path = trained
    controller = LearnedController(load_policy(path), NUM_ENVS)
    observations = runner.env.get_observations()
    first = controller.act(observations)
    remembering = controller.act(observations)
    controller.reset()
    assert not torch.equal(remembering, first)
    assert torch.equal(controller.act(observations), first)


def test_forgetting_touches_the_masked_robots_alone(trained):
    runner, path = trained
    observations = runner.env.get_observations()
    one, other = (LearnedController(load_policy(path), NUM_ENVS) for _ in range(2))
    first = one.act(observations)
    other.act(observations)
    mask = torch.arange(NUM_ENVS) == 2
    other.reset(mask)
    kept, partly = one.act(observations), other.act(observations)
    assert torch.equal(partly[~mask], kept[~mask])
    assert torch.allclose(partly[mask], first[mask], atol=1e-6)
    assert not torch.allclose(partly[mask], kept[mask], atol=1e-6)


def test_the_small_file_gives_the_same_policy_as_the_whole_checkpoint(trained, tmp_path):
    runner, path = trained
    save_checkpoint(tmp_path / "policy.pt", policy_part(load_checkpoint(path)))
    small, whole = load_policy(tmp_path / "policy.pt"), load_policy(path)
    assert (small.task, small.iteration, small.cfg) == ("go1_mute", 2, whole.cfg)
    observations = runner.env.get_observations()
    actions = [LearnedController(policy, NUM_ENVS).act(observations) for policy in (small, whole)]
    assert torch.equal(*actions)


def test_heights_are_estimated_in_the_scale_that_an_earlier_version_gave_the_estimator(
    trained, tmp_path
):
    runner, path = trained
    small = policy_part(load_checkpoint(path))
    small["config"] = estimators_own_heights(small["config"], 0.25, 0.5)
    save_checkpoint(tmp_path / "old.pt", small)
    observations, heights = runner.env.get_observations(), []
    for file in (path, tmp_path / "old.pt"):
        controller = LearnedController(load_policy(file), NUM_ENVS)
        controller.act(observations)
        assert controller.estimate is not None
        heights.append(controller.estimate.heights)
    given = (heights[0] - 0.30) / 0.1  # what the height head says
    torch.testing.assert_close(heights[1], 0.25 + 0.5 * given)


def test_a_policy_that_does_not_see_the_phase_is_driven_without(tmp_path):
    cfg = make_cfg(1)
    cfg.agent.estimation.actor_uses_phase = False
    runner = MuteRunner("go1_mute", cfg, tmp_path)
    runner.train()
    controller = LearnedController(load_policy(tmp_path / "model_0.pt"), NUM_ENVS)
    actions = controller.act(runner.env.get_observations())
    assert actions.shape == (NUM_ENVS, 12)
    assert controller.policy.actor.obs_dim == runner.alg.actor.obs_dim


@pytest.mark.parametrize("missing", ["config", "actor_state_dict", "estimator_state_dict", "iter"])
def test_a_file_without_a_policy_is_refused_in_one_line(trained, tmp_path, missing):
    small = policy_part(load_checkpoint(trained[1]))
    del small[missing]
    save_checkpoint(tmp_path / "broken.pt", small)
    with pytest.raises(CheckpointError) as caught:
        load_policy(tmp_path / "broken.pt")
    assert "broken.pt" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        {"config": "no dictionary"},
        {"config": {"env": {"unknown": 1}}},
        {"actor_state_dict": {}},
        {"estimator_state_dict": 3},
    ],
)
def test_a_file_that_does_not_fit_is_refused_in_one_line(trained, tmp_path, change):
    save_checkpoint(tmp_path / "broken.pt", policy_part(load_checkpoint(trained[1])) | change)
    with pytest.raises(CheckpointError) as caught:
        load_policy(tmp_path / "broken.pt")
    assert "broken.pt" in str(caught.value)
    assert "\n" not in str(caught.value)
