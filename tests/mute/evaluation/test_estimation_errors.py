"""The estimator's errors are those of its estimates against the truth."""

from __future__ import annotations

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
