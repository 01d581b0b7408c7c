"""Tests of the trials, the comparison at equal speed, the estimator's errors and the tables."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
from typing import Any

import pytest
import torch
from learning_helpers import make_runner
from tensordict import TensorDict

from mute.checkpoint import save_checkpoint
from mute.command_lines import evaluate
from mute.config import to_plain
from mute.controllers import LearnedController, load_policy
from mute.envs.quadruped_env import NUM_ACTIONS, QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.estimation_errors import EstimationMeter
from mute.evaluation.gait import Gait
from mute.evaluation.matched_speed import figures_at_speed, sweep_beta_at_speed
from mute.evaluation.progress import walks
from mute.evaluation.tables import read_json, write_csv, write_json
from mute.evaluation.trials import evaluation_cfg, run_trial
from mute.learning.runner import policy_part
from mute.support.errors import MuteError


class _Still:
    """A controller that holds the stance and notes which robots were reset."""

    def __init__(self, num_envs):
        self.num_envs = num_envs
        self.resets = []

    def reset(self, mask=None):
        self.resets.append(mask)

    def act(self, observations):
        return torch.zeros(self.num_envs, NUM_ACTIONS)


def _make_env(num_envs=2, seconds=1.0):
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), num_envs, seconds, seed=0)
    return QuadrupedEnv(cfg)


def _make_gait(**given):
    zeros: dict[str, Any] = {field.name: 0.0 for field in dataclasses.fields(Gait)}
    return Gait(**(zeros | given))


@pytest.fixture(scope="module")
def policy_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("policy") / "policy.pt"
    runner = make_runner()
    checkpoint = runner.alg.save() | {"task": "go1_mute", "iter": 0}
    save_checkpoint(path, policy_part(checkpoint | {"config": to_plain(runner.task_cfg)}))
    return path


def test_measuring_switches_noise_pushes_and_random_physics_off():
    cfg = evaluation_cfg(QuadrupedEnvCfg(), 4, 20.0, seed=5)
    assert (cfg.num_envs, cfg.seed) == (4, 5)
    assert cfg.observations.noise_level == 0.0
    assert not cfg.randomization.enabled
    kept = evaluation_cfg(QuadrupedEnvCfg(), 4, 20.0, seed=5, randomized=True)
    assert kept.randomization.enabled
    assert kept.observations.noise_level == 1.0


def test_a_trial_holds_its_commands_and_does_not_end_in_it():
    env, command = _make_env(2, seconds=0.4), torch.tensor([0.3, 0.0, 0.0, 0.5])
    controller, seen = _Still(2), []
    run_trial(env, controller, command, 20, lambda _, dones: seen.append(dones.any().item()))
    assert torch.equal(env.commands.command, command.expand(2, 4))
    assert seen == [False] * 20
    assert controller.resets == [None]


def test_a_robot_that_falls_goes_on_with_its_command_and_stays_counted():
    env, controller = _make_env(2), _Still(2)
    command = torch.tensor([[0.3, 0.0, 0.0, 0.5], [0.1, 0.0, 0.0, 0.5]])

    def overturn(_, dones):
        if not env.fallen.any() and len(controller.resets) == 1:
            env.simulation.qpos[0, 3:7] = torch.tensor([0.0, 1.0, 0.0, 0.0])

    meter = run_trial(env, controller, command, 6, overturn)
    assert meter.gait().fall_rate == 0.5
    assert controller.resets[1].tolist() == [True, False]
    assert torch.equal(env.commands.command, command)


def test_figures_at_a_speed_are_interpolated_between_the_nearest_speeds():
    gaits = [
        _make_gait(speed=0.6, landing_speed_mean=0.4),
        _make_gait(speed=0.4, landing_speed_mean=0.2),
        _make_gait(speed=0.8, landing_speed_mean=1.0),
    ]
    assert figures_at_speed(gaits, 0.45)["landing_speed_mean"] == pytest.approx(0.25)
    assert figures_at_speed(gaits, 0.7)["landing_speed_mean"] == pytest.approx(0.7)


def test_figures_at_a_speed_that_no_gait_reaches_are_nan():
    figures = figures_at_speed([_make_gait(speed=0.1), _make_gait(speed=0.2)], 0.5)
    assert all(math.isnan(value) for value in figures.values())


def test_a_sweep_needs_a_robot_for_every_pair_of_beta_and_speed():
    with pytest.raises(ValueError, match="num_envs must be >= 12"):
        sweep_beta_at_speed(_make_env(4), _Still(4), 0.5, [0.0, 1.0], 5)


def test_a_robot_that_stands_matches_no_walking_speed():
    rows = sweep_beta_at_speed(_make_env(6), _Still(6), 0.5, [0.25], 60)
    assert rows[0]["beta"] == 0.25
    assert math.isnan(rows[0]["landing_speed_mean"])


def test_estimation_errors_are_those_of_the_estimates_against_the_truth(policy_path):
    env = _make_env(3)
    controller = LearnedController(load_policy(policy_path), 3)
    meter = EstimationMeter(env, controller)
    velocity, heights = [], []

    def compare(observations: TensorDict, dones: torch.Tensor) -> None:
        meter(observations, dones)
        privileged, columns = observations["privileged"], env.privileged_slices
        estimate = controller.estimate
        assert estimate is not None
        velocity.append(estimate.base_lin_vel - privileged[:, columns["base_lin_vel"]])
        heights.append(estimate.heights - (0.3 + 0.1 * privileged[:, columns["heights"]]))

    run_trial(env, controller, torch.zeros(4), 30, compare)
    errors = meter.errors()
    assert errors.velocity_rmse == pytest.approx(torch.stack(velocity).square().mean().sqrt())
    assert errors.height_rmse == pytest.approx(torch.stack(heights).square().mean().sqrt())


def test_tables_read_back_as_they_were_written(tmp_path):
    rows = [{"beta": 0.5, "speed": 0.25}, {"beta": 1.0, "speed": math.nan}]
    write_csv(tmp_path / "rows.csv", rows)
    write_json(tmp_path / "rows.json", rows)
    with (tmp_path / "rows.csv").open() as file:
        assert [float(row["beta"]) for row in csv.DictReader(file)] == [0.5, 1.0]
    assert read_json(tmp_path / "rows.json") == [
        {"beta": 0.5, "speed": 0.25},
        {"beta": 1.0, "speed": None},
    ]


def test_evaluate_gait_writes_its_figures(policy_path, tmp_path, capsys):
    arguments = ["gait", "--policy", str(policy_path), "--trials", "4", "--seconds", "1.2"]
    assert evaluate.main([*arguments, "--beta", "0", "1", "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "gait.json").read_text())
    assert [row["beta"] for row in summary["range"]] == [0.0, 1.0]
    assert {"fall_rate", "velocity_error_sq", "phase_mae"} <= summary["range"][0].keys()
    assert {"landing_speed_mean", "apex_mean"} <= summary["at_speed"][1].keys()
    assert (tmp_path / "gait_range.csv").exists()
    assert "at an actual speed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ([], "gait"),
        (["dance"], "dance"),
        (["gait", "--trials", "0"], "--trials"),
        (["gait", "--beta", "1.2"], "--beta"),
        (["gait", "--seconds", "0.5"], "--seconds"),
        (["gait", "--speed", "3"], "--speed"),
        (["gait", "--policy", "missing.pt"], "missing.pt"),
    ],
)
def test_evaluate_refuses_bad_input_by_name(arguments, names):
    with pytest.raises(MuteError, match=names):
        evaluate.main(arguments)


def test_progress_measures_the_checkpoints_of_a_run_in_their_order(tmp_path):
    runner = make_runner(tmp_path, iterations=2)
    runner.train()
    out = tmp_path / "figures"
    arguments = ["progress", "--run", str(tmp_path), "--trials", "2", "--seconds", "1.2"]
    assert evaluate.main([*arguments, "--out", str(out)]) == 0
    rows = read_json(out / "progress.json")["checkpoints"]
    assert [row["iteration"] for row in rows] == [0, 1]
    assert 0.0 < rows[0]["minutes"] < rows[1]["minutes"]
    assert not any(row["walks"] for row in rows)  # nothing walks after two iterations


@pytest.mark.parametrize(
    ("error", "falls", "walking"), [(0.049, 0.009, True), (0.05, 0.0, False), (0.0, 0.01, False)]
)
def test_a_walk_tracks_and_does_not_fall(error, falls, walking):
    assert walks(error, falls) is walking


def test_progress_refuses_a_directory_without_checkpoints(tmp_path):
    with pytest.raises(MuteError, match="no checkpoint"):
        evaluate.main(["progress", "--run", str(tmp_path)])
