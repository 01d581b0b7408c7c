"""A training whose numbers are none any more stops, says why, and keeps nothing of it."""

from __future__ import annotations

import math

import pytest
import torch
from learning_helpers import make_cfg, make_runner
from rsl_rl.algorithms import PPO

from mute.checkpoint import load_checkpoint
from mute.learning.distributed import Ranks
from mute.learning.divergence import DivergedError, first_not_finite
from mute.learning.estimator_trainer import EstimatorTrainer
from mute.learning.runner import MuteRunner


def test_the_first_value_that_is_not_finite_is_named():
    values = {"one": torch.zeros(2), "two": torch.tensor([1.0, math.inf]), "three": torch.ones(1)}
    assert first_not_finite(values) == "two"
    assert first_not_finite({"one": torch.zeros(2), "flags": torch.ones(3).bool()}) is None


def test_infinities_that_cancel_out_are_found_and_large_numbers_are_finite():
    assert first_not_finite({"both": torch.tensor([math.inf, 1.0, -math.inf])}) == "both"
    large = torch.full((4,), 3.0e38)
    assert not large.sum().isfinite()
    assert first_not_finite({"large": large}) is None
    assert first_not_finite({"large": large, "none": torch.tensor([math.nan])}) == "none"


def _spoil_after_update(runner: MuteRunner, monkeypatch, at: int, change) -> None:
    """Call `change(losses)` when PPO has made its update number `at`, from 0."""
    update, done = PPO.update, []

    def spoilt(alg) -> dict[str, float]:
        losses = update(alg)
        done.append(1)
        if len(done) == at + 1:
            change(losses)
        return losses

    monkeypatch.setattr(PPO, "update", spoilt)


def _fill_first_weight(network: torch.nn.Module, value: float) -> None:
    with torch.no_grad():
        next(network.parameters()).view(-1)[0] = value


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda runner, losses: losses.update(value=math.nan), "the loss 'value'"),
        (lambda runner, losses: losses.update(surrogate=math.inf), "the loss 'surrogate'"),
        (
            lambda runner, losses: _fill_first_weight(runner.alg.critic, math.nan),
            "the weights of the critic (mlp.0.weight)",
        ),
        (
            lambda runner, losses: _fill_first_weight(runner.env.estimator, -math.inf),
            "the weights of the estimator (lstm.weight_ih)",
        ),
    ],
    ids=["loss", "infinite loss", "critic", "estimator"],
)
def test_a_training_stops_at_the_iteration_and_keeps_the_checkpoint_before(
    spoil, words, tmp_path, monkeypatch
):
    runner = make_runner(tmp_path, iterations=6)
    _spoil_after_update(runner, monkeypatch, 2, lambda losses: spoil(runner, losses))
    with pytest.raises(DivergedError) as caught:
        runner.train()
    assert str(caught.value).startswith(f"iteration 2: NaN or infinity in {words}, so")
    assert "\n" not in str(caught.value)
    assert sorted(path.name for path in tmp_path.glob("model_*")) == ["model_0.pt", "model_1.pt"]
    make_runner(iterations=6).load(str(tmp_path / "model_1.pt"))


@pytest.mark.parametrize(
    ("logged", "words"),
    [({}, "the rewards"), ({"Reward/spin": torch.tensor(math.inf)}, "the reward term 'spin'")],
    ids=["rewards", "term"],
)
def test_rewards_that_are_infinite_end_the_rollouts_iteration_and_no_rate_is_blamed(
    logged, words, tmp_path, monkeypatch
):
    runner = make_runner(tmp_path, iterations=6)
    step, steps = runner.env.step, []

    def spoilt(actions):
        observations, rewards, dones, extras = step(actions)
        steps.append(1)
        if len(steps) == 12:  # in the second rollout
            rewards = torch.full_like(rewards, math.inf)
            extras["log"] |= logged
        return observations, rewards, dones, extras

    monkeypatch.setattr(runner.env, "step", spoilt)
    with pytest.raises(DivergedError) as caught:
        runner.train()
    assert str(caught.value) == (
        f"iteration 1: NaN or infinity in {words}, so the training stops and keeps nothing of this "
        "iteration"
    )
    assert [path.name for path in tmp_path.glob("model_*")] == ["model_0.pt"]


def test_what_another_rank_met_in_its_rollout_is_blamed_before_the_losses_that_it_spoils():
    class SecondOfTwo(Ranks):
        def any(self, flag):
            return True

        def gather(self, value):
            met = "the reward term 'spin'"
            return [value, met if value is None or "loss" in value else value]

    alg = make_runner().alg
    alg.ranks = SecondOfTwo()
    with pytest.raises(DivergedError, match=r"^NaN or infinity in the reward term 'spin', so"):
        alg._stop_where_not_finite({"value": math.nan})


@pytest.mark.parametrize(
    ("part", "iteration"), [("ppo", 0), ("estimation", 1)], ids=["ppo", "estimator"]
)
def test_a_learning_rate_beyond_all_measure_is_noticed_in_the_iteration_it_acts_in(
    part, iteration, tmp_path
):
    cfg = make_cfg(iterations=6)
    getattr(cfg.agent, part).learning_rate = 1e30
    cfg.agent.ppo.schedule = "fixed"
    runner = MuteRunner("go1_mute", cfg, tmp_path)
    with pytest.raises(DivergedError, match=f"^iteration {iteration}: .*{part}.learning-rate may"):
        runner.train()
    assert len(list(tmp_path.glob("model_*"))) == iteration


def test_weights_that_are_not_finite_are_never_saved(tmp_path):
    runner = make_runner(tmp_path, iterations=1)
    assert runner.train()
    whole = (tmp_path / "model_0.pt").read_bytes()
    _fill_first_weight(runner.alg.actor, math.nan)
    with pytest.raises(DivergedError, match=r"model_0\.pt is not written: NaN or infinity in the"):
        runner.save(str(tmp_path / "model_0.pt"))
    assert (tmp_path / "model_0.pt").read_bytes() == whole
    assert load_checkpoint(tmp_path / "model_0.pt")["iter"] == 0


def test_a_run_resumed_after_it_stopped_counts_its_iterations_on(tmp_path, monkeypatch):
    make_runner(tmp_path, iterations=2).train()
    runner = make_runner(tmp_path, iterations=9)
    runner.load(str(tmp_path / "model_1.pt"))
    update = EstimatorTrainer.update
    monkeypatch.setattr(
        EstimatorTrainer,
        "update",
        lambda trainer, *args: update(trainer, *args) | {"estimator_total": math.nan},
    )
    with pytest.raises(DivergedError, match=r"^iteration 2: .* 'estimator_total'"):
        runner.train()
    assert not (tmp_path / "model_2.pt").exists()
