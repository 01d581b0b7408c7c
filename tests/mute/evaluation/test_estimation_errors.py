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


def _walked(phase_of_estimator, swings, first_episodes=False, ended_at=None):
    """Return the errors where one foot swings for so many steps each time and stands for 10."""
    contact = []
    for swing in swings:
        contact += [True] * 10 + [False] * swing
    contact = torch.tensor([*contact, *[True] * 10, False, False])
    columns = {"base_lin_vel": slice(0, 3), "heights": slice(3, 4), "contact": slice(4, 8)}
    env = SimpleNamespace(
        num_envs=1,
        privileged_slices=columns,
        cfg=QuadrupedEnvCfg(),
        footfalls=SimpleNamespace(min_steps=2, max_steps=50),
        step_dt=0.02,
    )
    controller = SimpleNamespace(estimate=None)
    meter = EstimationMeter(env, controller, first_episodes)  # type: ignore[arg-type]
    for step, down in enumerate(contact):
        privileged = torch.zeros(1, 8)
        privileged[:, 0] = float(step)
        privileged[:, 4:8] = float(down)
        controller.estimate = SimpleNamespace(
            base_lin_vel=torch.zeros(1, 3),
            heights=torch.zeros(1, 1),
            phase=torch.full((1, 4), phase_of_estimator(step)),
        )
        meter({"privileged": privileged}, torch.tensor([step == ended_at]))  # type: ignore[arg-type]
    return meter.errors()


def _truth(swings):
    """Return the phase of every step, by hand."""
    phases = []
    for swing in swings:
        phases += [1.0 - step / 10 for step in range(10)] + [step / swing for step in range(swing)]
    return [*phases, *(1.0 - step / 10 for step in range(10)), 0.0, 0.0]


def test_who_knows_the_phase_of_even_swings_knows_the_time_of_contact():
    swings = (8, 8, 8)
    errors = _walked(lambda step: _truth(swings)[step], swings)
    assert errors.phase_mae == pytest.approx(0.0, abs=1e-6)
    assert errors.contact_time_mae == pytest.approx(0.0, abs=1e-6)
    # Of the first swing the clock thinks that it takes 10 steps, as is usual; then it is right.
    assert errors.contact_time_mae_clock == pytest.approx(0.02 * 8 * 2.0 / 24)


def test_the_time_of_contact_is_measured_by_a_swing_of_mean_length():
    swings = (6, 12)
    errors = _walked(lambda step: _truth(swings)[step], swings)
    left = [6 - step for step in range(6)] + [12 - step for step in range(12)]
    told = [9.0 * (1.0 - s / 6) for s in range(6)] + [9.0 * (1.0 - s / 12) for s in range(12)]
    expected = sum(abs(a - b) for a, b in zip(left, told, strict=True)) / 18
    assert errors.contact_time_mae == pytest.approx(0.02 * expected)


def test_what_comes_after_the_first_episode_is_left_out_where_that_is_asked_for():
    whole, first = (_walked(lambda _: 0.5, (8, 8), only, ended_at=20) for only in (False, True))
    # The velocity is off by the number of the step in one axis of three.
    assert first.velocity_rmse == pytest.approx((sum(k * k for k in range(21)) / 21 / 3) ** 0.5)
    assert whole.velocity_rmse > 1.5 * first.velocity_rmse
    assert first.phase_known < whole.phase_known
