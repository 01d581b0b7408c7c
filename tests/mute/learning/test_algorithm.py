"""PPO with the estimator beside it: two learners that never mix, on rollouts of the real loop."""

from __future__ import annotations

import dataclasses
import math

import pytest
import torch
from learning_helpers import (
    NUM_ENVS,
    NUM_STEPS,
    before_each_update,
    clone_tree,
    make_cfg,
    make_runner,
)
from quick_products import use_bfloat16
from rsl_rl.algorithms import PPO
from rsl_rl.storage import RolloutStorage

from mute.learning.estimated_env import estimate_group
from mute.learning.runner import MuteRunner


def _starts(alg) -> torch.Tensor:
    """Return where the stored rollout's episodes begin; its first state is zeroed already."""
    dones = alg.storage.dones[..., 0].bool()
    return torch.cat((torch.zeros_like(dones[:1]), dones[:-1]))


@pytest.mark.parametrize("quick", [False, True])
def test_re_unrolled_over_the_storage_the_estimator_reproduces_the_stored_estimates(
    monkeypatch, quick
):
    if quick:
        use_bfloat16(monkeypatch)
    runner = make_runner(iterations=3)
    alg, estimator = runner.alg, runner.env.estimator
    ended, errors = [], []

    @torch.no_grad()
    def check() -> None:
        stored, starts = alg.storage.observations, _starts(alg)
        state = alg._rollout_state
        for step in range(NUM_STEPS):
            start = starts[step, :, None]
            state = (state[0].masked_fill(start, 0.0), state[1].masked_fill(start, 0.0))
            estimate, state = estimator.step(stored["policy"][step], state)
            # Bit-equal: the same operations on the same shapes.
            group = estimate_group(estimate, estimator, with_phase=True)
            assert torch.equal(group, stored["estimate"][step])
        unrolled, _ = estimator.unroll(stored["policy"], alg._rollout_state, starts)
        group = estimate_group(unrolled, estimator, with_phase=True)
        errors.append(float((group - stored["estimate"]).abs().max()))
        ended.append(int(starts.sum()))

    before_each_update(runner, check)
    runner.train()
    assert len(errors) == 3
    assert min(ended) > 0
    # One product for all steps rounds differently, and in nothing else.
    assert max(errors) < 1e-5


def test_an_update_sees_the_batches_of_rsl_rl_with_the_inputs_ready_made(monkeypatch):
    runner = make_runner(iterations=1)
    alg = runner.alg
    seen = []

    def compare() -> dict[str, float]:
        state = torch.get_rng_state()
        expected = list(RolloutStorage.mini_batch_generator(alg.storage, 2, 3))
        torch.set_rng_state(state)
        for ours, theirs in zip(alg.storage.mini_batch_generator(2, 3), expected, strict=True):
            for name in ("actions", "values", "returns", "advantages", "old_actions_log_prob"):
                assert torch.equal(getattr(ours, name), getattr(theirs, name))
            for model in (alg.actor, alg.critic):
                assert torch.equal(model(ours.observations), model(theirs.observations))
                seen.append(model)
        torch.set_rng_state(state)
        return PPO.update(alg)

    monkeypatch.setattr(alg, "update", compare)
    assert runner.train()
    assert len(seen) == 12


def test_what_follows_an_unstable_simulation_is_worth_the_value_of_the_observation_before(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log of warnings into the working directory
    runner = make_runner(iterations=1)
    alg, env, storage = runner.alg, runner.env, runner.alg.storage
    with torch.inference_mode():
        for step in range(2):
            env.env.simulation.qpos[1, 2 * step] = math.nan
            env.env.simulation.qvel[2, step] = 1e6
            observations, rewards, dones, extras = env.step(alg.act(env.get_observations()))
            alg.process_env_step(observations, rewards, dones, extras)
            assert all(group.isfinite().all() for group in observations.values())
    assert storage.dones[:2, 1:3].all()
    values = storage.values[:2, 1:3]
    assert (values != 0.0).all()
    torch.testing.assert_close(storage.rewards[:2, 1:3], alg.gamma * values)


def test_an_update_learns_from_all_samples_but_those_over_as_its_help_says():
    runner = make_runner(iterations=1)
    storage = runner.alg.storage
    storage.distribution_params = storage.distribution_params or ()
    storage.returns.copy_(torch.arange(NUM_ENVS * NUM_STEPS).view_as(storage.returns))
    for parts in (2, 5):
        batches = storage.mini_batch_generator(parts, 1)
        returns = [batch.returns for batch in batches if batch.returns is not None]
        learnt = torch.cat(returns).flatten()
        assert [len(batch) for batch in returns] == [NUM_ENVS * NUM_STEPS // parts] * parts
        assert len(learnt.unique()) == len(learnt) > NUM_ENVS * NUM_STEPS - parts


@pytest.mark.parametrize("quick", [False, True])
def test_the_first_ratio_of_every_update_is_one(monkeypatch, quick):
    if quick:
        use_bfloat16(monkeypatch)
    runner = make_runner(iterations=3)
    alg = runner.alg
    ratios: list[list[float]] = []
    make_batches, log_prob = alg.storage.mini_batch_generator, alg.actor.get_output_log_prob
    current = []

    def batches(*args, **kwargs):
        ratios.append([])
        for batch in make_batches(*args, **kwargs):
            current[:] = [batch]
            yield batch
        current.clear()

    def spy(actions: torch.Tensor) -> torch.Tensor:
        result = log_prob(actions)
        if current:
            old = current[0].old_actions_log_prob.squeeze()
            ratios[-1].append(float((result.detach() - old).exp().sub(1.0).abs().max()))
        return result

    monkeypatch.setattr(alg.storage, "mini_batch_generator", batches)
    monkeypatch.setattr(alg.actor, "get_output_log_prob", spy)
    runner.train()
    assert len(ratios) == 3
    for update in ratios:
        assert len(update) == 4
        assert update[0] < 5e-5
        assert max(update[1:]) > 1e-3


def test_ppo_alone_leaves_the_estimator_bit_equal_and_without_gradients():
    runner = make_runner(iterations=2)
    alg, estimator = runner.alg, runner.env.estimator

    def ppo_only() -> dict[str, float]:
        estimator.zero_grad(set_to_none=True)
        before = clone_tree(estimator.state_dict())
        actor = clone_tree(alg.actor.state_dict())
        losses = PPO.update(alg)
        assert all(torch.equal(before[k], v) for k, v in estimator.state_dict().items())
        assert all(parameter.grad is None for parameter in estimator.parameters())
        assert not torch.equal(actor["mlp.0.weight"], alg.actor.state_dict()["mlp.0.weight"])
        return losses

    alg.update = ppo_only
    assert runner.train()


def test_the_estimators_training_leaves_actor_and_critic_bit_equal():
    runner = make_runner(iterations=2)
    alg, estimator = runner.alg, runner.env.estimator
    learnt = []

    def trainer_only() -> dict[str, float]:
        alg.optimizer.zero_grad()
        models = torch.nn.ModuleList([alg.actor, alg.critic])
        before = clone_tree(models.state_dict())
        weight = estimator.lstm.weight_hh.detach().clone()
        hidden, cell = alg._rollout_state
        losses = alg.trainer.update(alg.storage, (hidden.clone(), cell.clone()))
        assert all(torch.equal(before[k], v) for k, v in models.state_dict().items())
        assert all(parameter.grad is None for parameter in models.parameters())
        learnt.append(not torch.equal(weight, estimator.lstm.weight_hh))
        alg.storage.clear()
        return losses

    alg.update = trainer_only
    assert runner.train()
    assert learnt == [False, True]


def test_the_two_optimisers_share_no_parameter_and_leave_none_out():
    runner = make_runner()

    def ids(parameters) -> set[int]:
        return {id(parameter) for parameter in parameters}

    alg = runner.alg
    ppo = ids(alg.optimizer.param_groups[0]["params"])
    estimator = ids(alg.trainer.optimizer.param_groups[0]["params"])
    assert estimator == ids(runner.env.estimator.parameters())
    assert ppo == ids(alg.actor.parameters()) | ids(alg.critic.parameters())
    assert not ppo & estimator


@pytest.mark.parametrize("go", [[], ["go"]])
def test_actor_and_critic_read_the_groups_they_are_meant_to(go):
    cfg = make_cfg()
    agent = dataclasses.replace(cfg.agent, go_signal=bool(go))
    runner = MuteRunner("go1_mute", dataclasses.replace(cfg, agent=agent), None)
    observations = runner.env.get_observations()
    widths = {name: observations[name].shape[1] for name in observations.keys()}  # noqa: SIM118
    assert widths["go"] == 1
    assert runner.alg.actor.obs_groups == ["policy", "estimate", *go]
    assert runner.alg.critic.obs_groups == ["policy", "estimate", *go, "privileged"]
    for network in (runner.alg.actor, runner.alg.critic):
        assert network.obs_dim == sum(widths[name] for name in network.obs_groups)


def test_the_stored_observation_is_the_one_acted_on():
    runner = make_runner(iterations=2)
    alg = runner.alg
    acted: list[torch.Tensor] = []
    act = alg.act

    def spy(obs):
        acted.append(torch.cat([obs["policy"], obs["estimate"]], dim=1).clone())
        return act(obs)

    def check() -> None:
        stored = alg.storage.observations
        both = torch.cat([stored["policy"], stored["estimate"]], dim=2)
        assert torch.equal(both, torch.stack(acted))
        acted.clear()

    alg.act = spy
    before_each_update(runner, check)
    runner.train()


def test_modes_reach_the_estimator_too():
    runner = make_runner()
    runner.alg.eval_mode()
    assert not runner.env.estimator.training
    runner.alg.train_mode()
    assert runner.env.estimator.training


def test_what_is_saved_holds_all_networks_and_both_optimisers():
    runner = make_runner(iterations=2)
    runner.train()
    saved = runner.alg.save()
    assert set(saved) == {
        "actor_state_dict",
        "critic_state_dict",
        "optimizer_state_dict",
        "estimator_state_dict",
        "estimator_trainer",
    }
    assert "obs_normalizer._mean" in saved["actor_state_dict"]
    assert saved["optimizer_state_dict"]["state"]
    assert saved["estimator_trainer"]["optimizer"]["state"]
    assert saved["estimator_trainer"]["past"]["obs"].shape[:2] == (NUM_STEPS, NUM_ENVS)


def test_networks_act_on_all_cores_and_the_engine_has_them_to_itself(monkeypatch):
    monkeypatch.setattr("mute.support.threads._learning_threads", lambda: 2)
    runner = make_runner(iterations=1)
    networks, world = set(), set()
    env, threads = runner.env.env, torch.get_num_threads()
    step, estimate = env.step, runner.env.estimator.step

    def spied_step(actions):
        world.add(torch.get_num_threads())
        return step(actions)

    def spied_estimate(obs, state):
        networks.add(torch.get_num_threads())
        return estimate(obs, state)

    monkeypatch.setattr(env, "step", spied_step)
    monkeypatch.setattr(runner.env.estimator, "step", spied_estimate)
    for model in (runner.alg.actor, runner.alg.critic):
        model.mlp[0].register_forward_hook(lambda *_: networks.add(torch.get_num_threads()))
    try:
        runner.train()
    finally:
        torch.set_num_threads(threads)
    assert (networks, world) == ({2}, {1})
