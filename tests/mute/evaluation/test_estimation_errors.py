"""The estimator's errors are those of its estimates against the truth."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import torch
from learning_helpers import make_runner
from tensordict import TensorDict

from mute.config import to_plain
from mute.controllers.learned import LearnedController, make_policy
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.evaluation.estimation_errors import EstimationMeter
from mute.evaluation.trials import evaluation_cfg, run_trial
from mute.learning.runner import policy_part


def test_estimation_errors_are_those_of_the_estimates_against_the_truth():
    cfg = evaluation_cfg(QuadrupedEnvCfg(num_threads=1), 3, seconds=1.0, seed=0)
    env, runner = QuadrupedEnv(cfg), make_runner()
    about = {"task": "go1_mute", "iter": 0, "config": to_plain(runner.task_cfg)}
    policy = make_policy(policy_part(runner.alg.save() | about))
    controller = LearnedController(policy, 3)
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


def _walked(phase_of_estimator, phase_of_clock, swings):
    """Return the errors where one foot swings for so many steps each time and stands for 10."""
    contact = []
    for swing in swings:
        contact += [True] * 10 + [False] * swing
    contact = torch.tensor([*contact, *[True] * 10, False, False])
    columns = {
        "base_lin_vel": slice(0, 3),
        "heights": slice(3, 4),
        "contact": slice(4, 8),
        "phase": slice(8, 12),
    }
    feet = SimpleNamespace(min_steps=2, max_steps=50)
    env = SimpleNamespace(
        num_envs=1,
        privileged_slices=columns,
        cfg=QuadrupedEnvCfg(),
        footfalls=feet,
        step_dt=0.02,
    )
    controller = SimpleNamespace(estimate=None)
    meter = EstimationMeter(env, controller)  # type: ignore[arg-type]
    for step, down in enumerate(contact):
        privileged = torch.zeros(1, 12)
        privileged[:, 4:8] = float(down)
        privileged[:, 8:12] = phase_of_clock(step)
        controller.estimate = SimpleNamespace(
            base_lin_vel=torch.zeros(1, 3),
            heights=torch.zeros(1, 1),
            phase=torch.full((1, 4), phase_of_estimator(step)),
        )
        meter({"privileged": privileged}, torch.zeros(1, dtype=torch.bool))  # type: ignore[arg-type]
    return meter.errors()


def _truth(swings):
    """Return the phase of every step, by hand."""
    phases = []
    for swing in swings:
        phases += [1.0 - step / 10 for step in range(10)] + [step / swing for step in range(swing)]
    return [*phases, *(1.0 - step / 10 for step in range(10)), 0.0, 0.0]


def test_who_knows_the_phase_of_even_swings_knows_the_time_of_contact():
    swings = (8, 8, 8)
    errors = _walked(lambda step: _truth(swings)[step], lambda step: 0.5, swings)
    assert errors.phase_mae == pytest.approx(0.0, abs=1e-6)
    assert errors.contact_time_mae == pytest.approx(0.0, abs=1e-6)
    # Half of a swing of 8 steps, told at each of them: off by 4, 3, 2, 1, 0, 1, 2, 3 steps.
    assert errors.contact_time_mae_clock == pytest.approx(2.0 * 0.02)
    assert errors.phase_mae_clock == pytest.approx(0.25, abs=0.01)


def test_the_time_of_contact_is_measured_by_a_swing_of_mean_length():
    swings = (6, 12)
    errors = _walked(lambda step: _truth(swings)[step], lambda step: 1.0, swings)
    # Of 18 steps in the air a swing has 6 * 6 / 18 + 12 * 12 / 18 = 10 in the mean.
    left = [6 - step for step in range(6)] + [12 - step for step in range(12)]
    told = [10.0 * (1.0 - s / 6) for s in range(6)] + [10.0 * (1.0 - s / 12) for s in range(12)]
    expected = sum(abs(a - b) for a, b in zip(left, told, strict=True)) / 18
    assert errors.contact_time_mae == pytest.approx(0.02 * expected)
    assert errors.contact_time_mae_clock == pytest.approx(0.02 * sum(left) / 18)
