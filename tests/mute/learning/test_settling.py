"""Learning rates fall at the end of a training, and wake up where it goes on after all."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
from learning_helpers import differences, everything, make_cfg

from mute.learning.runner import MuteRunner
from mute.learning.settling import Settling


def _runner(log_dir: Path | None, iterations: int, schedule: str = "fixed") -> MuteRunner:
    cfg = make_cfg(iterations)
    ppo = dataclasses.replace(cfg.agent.ppo, schedule=schedule)
    agent = dataclasses.replace(cfg.agent, settling_share=0.5, save_interval=1, ppo=ppo)
    return MuteRunner("go1_mute", dataclasses.replace(cfg, agent=agent), log_dir)


def _rates(runner: MuteRunner) -> list[float]:
    """Return PPO's learning rate and the estimator's, as their optimisers have them."""
    optimizers = (runner.alg.optimizer, runner.alg.trainer.optimizer)
    return [group["lr"] for optimizer in optimizers for group in optimizer.param_groups]


@pytest.mark.parametrize(
    ("share", "rates"),
    [
        (0.0, [1.0, 1.0, 1.0, 1.0, 1.0]),
        (0.6, [1.0, 1.0, 1.0, 2 / 3, 1 / 3]),
        (1.0, [1.0, 0.8, 0.6, 0.4, 0.2]),
    ],
)
def test_rates_fall_in_a_straight_line_over_the_last_iterations(share, rates):
    settling = Settling(iterations=5, share=share)
    assert [settling.rate(iteration) for iteration in range(5)] == pytest.approx(rates)


def test_whoever_goes_on_beyond_the_end_learns_at_the_last_rate():
    settling = Settling(iterations=4, share=0.5)
    assert [settling.rate(iteration) for iteration in (3, 4, 9)] == [0.5, 0.5, 0.5]


@pytest.fixture(scope="module", params=["fixed", "adaptive"])
def settled(request, tmp_path_factory) -> tuple[Path, MuteRunner]:
    """Return a directory of checkpoints and the runner that has made them: 6 iterations."""
    directory = tmp_path_factory.mktemp("settled")
    runner = _runner(directory, 6, request.param)
    assert runner.train()
    return directory, runner


def test_the_last_iteration_of_six_that_settle_over_three_learns_at_a_third_of_the_rates(settled):
    _, runner = settled
    agent = runner.task_cfg.agent
    ppo, estimator = _rates(runner)
    assert estimator == pytest.approx(agent.estimation.learning_rate / 3)
    if agent.ppo.schedule == "fixed":
        assert ppo == pytest.approx(agent.ppo.learning_rate / 3)


def test_the_adaptive_schedule_raises_nothing_while_rates_fall(tmp_path):
    runner = _runner(tmp_path, iterations=4, schedule="adaptive")
    assert runner.train()
    lines = (tmp_path / "curves.jsonl").read_text().splitlines()
    falling = [json.loads(line)["Loss/learning_rate"] for line in lines]
    # Over the last two: the first of them where the schedule leads it, then half of that.
    assert falling[3] == pytest.approx(falling[2] / 2)


@pytest.mark.parametrize("last", [2, 3, 4])
def test_one_resumed_before_or_while_rates_fall_is_bit_equal(settled, last, tmp_path):
    directory, whole = settled
    runner = _runner(tmp_path, 6, whole.task_cfg.agent.ppo.schedule)
    runner.load(str(directory / f"model_{last}.pt"))
    assert runner.train()
    assert differences(everything(runner), everything(whole)) == []


def test_a_training_that_goes_on_after_its_end_learns_at_full_rates_again(settled, tmp_path):
    directory, whole = settled
    agent = whole.task_cfg.agent
    runner = _runner(tmp_path, 20, agent.ppo.schedule)
    runner.load(str(directory / "model_5.pt"))
    ppo, estimator = (3.0 * rate for rate in _rates(whole))
    assert _rates(runner) == pytest.approx([ppo, estimator])


def test_a_rate_that_is_given_falls_as_well(settled):
    directory, whole = settled
    runner = _runner(None, 6, whole.task_cfg.agent.ppo.schedule)
    runner.load(str(directory / "model_4.pt"))
    runner.learn_at(3e-4)
    assert _rates(runner)[0] == pytest.approx(2e-4)
