"""The whole loop: what is saved continues bit for bit, what is interrupted is saved, it learns."""

from __future__ import annotations

import json
import signal
from pathlib import Path

import pytest
import torch
from learning_helpers import differences, everything, make_cfg, make_runner
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from mute.checkpoint import CheckpointError, load_checkpoint, save_checkpoint
from mute.evaluation.noise_probe import NoiseProbe
from mute.learning.runner import MuteRunner, policy_part
from mute.support.signals import STOP_SIGNALS
from mute.tasks import make_task


def _curves(directory) -> list[dict[str, float]]:
    lines = (directory / "curves.jsonl").read_text().splitlines()
    timeless = [json.loads(line) for line in lines]
    return [{k: v for k, v in one.items() if not k.startswith("Perf/")} for one in timeless]


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory):
    """Four iterations at a stretch, a checkpoint after each."""
    directory = tmp_path_factory.mktemp("whole")
    runner = make_runner(directory, iterations=4)
    assert runner.train()
    return directory, everything(runner)


def test_episodes_end_inside_these_rollouts(whole_run):
    directory, _ = whole_run
    assert all(line["Train/mean_episode_length"] <= 5.0 for line in _curves(directory))


def test_a_resumed_run_equals_an_uninterrupted_one_bit_for_bit(whole_run, tmp_path):
    directory, expected = whole_run
    torch.manual_seed(12345)
    torch.rand(100)
    runner = make_runner(tmp_path, iterations=4)
    runner.load(str(directory / "model_1.pt"))
    assert runner.current_learning_iteration == 2
    assert runner.train()
    assert differences(everything(runner), expected) == []
    assert _curves(tmp_path) == _curves(directory)[2:]


def test_every_curriculum_is_on_its_way_where_these_runs_are_resumed(whole_run):
    directory, _ = whole_run
    for name in ("quiet", "lift", "commands"):
        values = [line[f"Curriculum/{name}"] for line in _curves(directory)]
        # Steps of 20 ms on a ramp of 0.8 s: the means of 1-8, 9-16, 17-24 and 25-32 over 40.
        assert values == pytest.approx([0.1125, 0.3125, 0.5125, 0.7125], abs=1e-6)
    guide = [line["Curriculum/guide"] for line in _curves(directory)]
    assert guide == pytest.approx([0.8875, 0.6875, 0.4875, 0.2875], abs=1e-6)


def test_a_forgotten_curriculum_would_change_what_a_resumed_run_learns(whole_run, tmp_path):
    directory, expected = whole_run
    runner = make_runner(tmp_path, iterations=4)
    runner.load(str(directory / "model_1.pt"))
    runner.env.env.step_count = 0
    runner.train()
    changed = differences(everything(runner), expected)
    assert any(place.startswith("/learner/actor_state_dict") for place in changed)
    assert any(place.startswith("/world/env/command") for place in changed)


def test_on_two_threads_with_quick_products_a_resumed_run_is_bit_equal_too(tmp_path, monkeypatch):
    precision, threads = torch.get_float32_matmul_precision(), torch.get_num_threads()
    used = []

    def two_threads() -> None:
        torch.set_num_threads(2)
        used.append(torch.get_num_threads())

    monkeypatch.setattr("mute.learning.algorithm.use_learning_threads", two_threads)
    monkeypatch.setattr("mute.learning.estimated_env.use_learning_threads", two_threads)
    cfg = make_cfg(2, num_envs=32)
    # Wide enough that torch splits the work.
    cfg.agent.actor_hidden = cfg.agent.critic_hidden = (256,)
    cfg.agent.estimation.network.lstm_hidden = 64
    cfg.agent.ppo.num_learning_epochs = 1
    try:
        torch.set_float32_matmul_precision("medium")
        whole = MuteRunner("go1_mute", cfg, tmp_path / "whole")
        whole.train()
        resumed = MuteRunner("go1_mute", cfg, tmp_path / "resumed")
        resumed.load(str(tmp_path / "whole" / "model_0.pt"))
        resumed.train()
    finally:
        torch.set_float32_matmul_precision(precision)
        torch.set_num_threads(threads)
    assert set(used) == {2}
    assert differences(everything(resumed), everything(whole)) == []
    assert _curves(tmp_path / "resumed") == _curves(tmp_path / "whole")[1:]


def test_a_second_run_with_the_same_seed_is_bit_equal_and_another_seed_is_not(whole_run, tmp_path):
    directory, _ = whole_run
    for name, seed in (("same", 3), ("other", 4)):
        make_runner(tmp_path / name, iterations=2, seed=seed).train()
    assert _curves(tmp_path / "same") == _curves(directory)[:2]
    assert _curves(tmp_path / "other") != _curves(directory)[:2]


def test_loading_restores_everything_without_a_step(whole_run):
    directory, expected = whole_run
    runner = make_runner(iterations=9)
    runner.load(str(directory / "model_3.pt"))
    expected = expected | {"iteration": 4}
    assert differences(everything(runner), expected) == []


def test_a_checkpoint_holds_the_configuration_and_the_small_part_plays_alone(whole_run):
    directory, _ = whole_run
    saved = load_checkpoint(directory / "model_3.pt")
    assert saved["config"]["env"]["num_envs"] == 8
    assert saved["iter"] == 3
    small = policy_part(saved)
    assert set(small) == {"task", "config", "iter", "actor_state_dict", "estimator_state_dict"}


@pytest.mark.parametrize(
    "changed", [{"num_envs": 4}, {"height_map": "smaller"}], ids=["robots", "networks"]
)
def test_a_checkpoint_of_another_configuration_is_refused_in_one_line(whole_run, changed):
    directory, _ = whole_run
    cfg = make_cfg(**{k: v for k, v in changed.items() if k == "num_envs"})
    if "height_map" in changed:
        cfg.agent.actor_hidden = (17,)
    runner = MuteRunner("go1_mute", cfg, None)
    with pytest.raises(CheckpointError) as caught:
        runner.load(str(directory / "model_3.pt"))
    assert "model_3.pt does not fit this configuration" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_checkpoint_whose_critic_saw_heights_in_another_scale_is_not_resumed(whole_run, tmp_path):
    saved = load_checkpoint(whole_run[0] / "model_3.pt")
    saved["config"]["agent"]["estimation"]["network"]["height_scale"] = 0.2
    save_checkpoint(tmp_path / "old.pt", saved)
    with pytest.raises(CheckpointError, match=r"network\.height_scale was 0\.2 for the estimator"):
        make_runner(tmp_path, iterations=5).load(str(tmp_path / "old.pt"))


def test_ctrl_c_ends_the_iteration_saves_it_and_the_rest_gives_the_same_result(whole_run, tmp_path):
    _, expected = whole_run

    def interrupt(iteration: int, total: int, scalars: dict[str, float]) -> None:
        if iteration == 1:
            signal.raise_signal(signal.SIGINT)

    handler = signal.getsignal(signal.SIGINT)
    runner = MuteRunner("go1_mute", make_cfg(4), tmp_path, on_iteration=interrupt)
    assert not runner.train()
    assert runner.checkpoint_path() == tmp_path / "model_1.pt"
    assert signal.getsignal(signal.SIGINT) is handler
    events = EventAccumulator(str(tmp_path)).Reload()
    assert events.Scalars("Loss/value")[-1].step == 1
    other = make_runner(tmp_path, iterations=4)
    other.load(str(runner.checkpoint_path()))
    assert other.train()
    assert differences(everything(other), expected) == []
    assert [line["iteration"] for line in _curves(tmp_path)] == [0, 1, 2, 3]


@pytest.mark.parametrize("number", STOP_SIGNALS, ids=lambda number: number.name)
def test_every_signal_that_asks_to_end_saves_however_often_it_comes(number, tmp_path):
    def interrupt(iteration: int, total: int, scalars: dict[str, float]) -> None:
        # A scheduler repeats itself; a second Ctrl-C means it.
        for _ in range(1 if number is signal.SIGINT else 3):
            signal.raise_signal(number)

    before = [signal.getsignal(each) for each in STOP_SIGNALS]
    runner = MuteRunner("go1_mute", make_cfg(4), tmp_path, on_iteration=interrupt)
    assert not runner.train()
    assert load_checkpoint(tmp_path / "model_0.pt")["iter"] == 0
    assert runner.stop.exit_status == 128 + number
    assert [signal.getsignal(each) for each in STOP_SIGNALS] == before


def test_a_second_ctrl_c_does_not_prevent_that_a_checkpoint_is_saved(tmp_path, monkeypatch):
    def interrupt(iteration: int, total: int, scalars: dict[str, float]) -> None:
        signal.raise_signal(signal.SIGINT)

    def save(path: Path, payload: dict) -> None:
        signal.raise_signal(signal.SIGINT)
        save_checkpoint(path, payload)

    monkeypatch.setattr("mute.learning.runner.save_checkpoint", save)
    runner = MuteRunner("go1_mute", make_cfg(4), tmp_path, on_iteration=interrupt)
    assert not runner.train()
    assert load_checkpoint(tmp_path / "model_0.pt")["iter"] == 0


def test_ctrl_c_during_the_last_iteration_is_a_finished_run(tmp_path):
    def interrupt(iteration: int, total: int, scalars: dict[str, float]) -> None:
        signal.raise_signal(signal.SIGTERM)

    runner = MuteRunner("go1_mute", make_cfg(1), tmp_path, on_iteration=interrupt)
    assert runner.train()
    assert (tmp_path / "model_0.pt").exists()


def test_a_second_ctrl_c_ends_at_once(tmp_path):
    def interrupt(iteration: int, total: int, scalars: dict[str, float]) -> None:
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    runner = MuteRunner("go1_mute", make_cfg(4), tmp_path, on_iteration=interrupt)
    with pytest.raises(KeyboardInterrupt):
        runner.train()


def test_without_a_directory_it_reports_is_interrupted_and_keeps_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    reported = []

    def interrupt(iteration: int, total: int, scalars: dict[str, float]) -> None:
        reported.append((iteration, total))
        if iteration == 1:
            signal.raise_signal(signal.SIGINT)

    runner = MuteRunner("go1_mute", make_cfg(4), None, on_iteration=interrupt)
    assert not runner.train()
    assert reported == [(0, 4), (1, 4)]
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="no log directory"):
        runner.checkpoint_path()


def test_noise_is_measured_at_its_interval_and_changes_nothing_else(tmp_path):
    ends, levels = [], []
    for name, interval in (("silent", 0), ("heard", 2)):
        cfg = make_cfg(iterations=4)
        cfg.agent.noise_interval = interval
        runner = MuteRunner("go1_mute", cfg, tmp_path / name, noise_probe=NoiseProbe())
        assert runner.train()
        ends.append(everything(runner))
        levels.append([line.get("Noise/level_beta_1") for line in _curves(tmp_path / name)])
    assert differences(*ends) == []
    assert levels[0] == [None] * 4
    assert levels[1][0::2] == [None] * 2
    # The actions of so young a policy are small: the robot stands, and its fan is heard.
    assert all(55.0 < level < 60.0 for level in levels[1][1::2])


def test_the_random_start_ages_come_with_a_new_run_alone(whole_run, monkeypatch):
    directory, _ = whole_run
    asked = []
    for path, iterations in ((None, 1), (directory / "model_0.pt", 2)):
        runner = make_runner(iterations=iterations)
        if path is not None:
            runner.load(str(path))
        monkeypatch.setattr(
            runner,
            "learn",
            lambda count, init_at_random_ep_len: asked.append((count, init_at_random_ep_len)),
        )
        runner.train()
    assert asked == [(1, True), (1, False)]


def test_the_estimator_learns_the_velocity_of_a_moving_robot():
    cfg = make_task("go1_mute_flat")
    cfg.env.num_envs, cfg.agent.iterations = 64, 25
    cfg.env.num_threads, cfg.agent.estimation.num_mini_batches = 1, 8
    cfg.agent.ppo.num_learning_epochs = cfg.agent.ppo.num_mini_batches = 1
    cfg.agent.ppo.schedule, cfg.agent.ppo.learning_rate = "fixed", 1e-4
    runner = MuteRunner("go1_mute_flat", cfg, None)
    shares = []
    update = runner.alg.trainer.update

    def spy(storage, initial_state, ranks=None):
        past = runner.alg.trainer.state_dict()["past"]
        losses = update(storage, initial_state, ranks)
        if losses:
            velocity = past["base_lin_vel"]
            spread = (velocity - velocity.mean(dim=(0, 1))).square().mean().sqrt()
            shares.append(losses["estimator_velocity_rmse"] / float(spread))
        return losses

    runner.alg.trainer.update = spy
    assert runner.train()
    # Rollouts that it has not learnt from yet: guessing the mean would give 1.
    assert shares[0] > 0.9
    assert sum(shares[-3:]) / 3 < 0.8
