"""What MUTE, mjlab and UniLab share: all are trained by rsl_rl."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from peers.parts import Loop, timed_loop
from peers.walking import WalkMeter

__all__ = ["training_loop", "walk"]

Reading = Callable[[Any], tuple[torch.Tensor, torch.Tensor, torch.Tensor]]
"""Reads commands, velocities in the robot's frame, and falls from an environment of a peer."""


def training_loop(runner: Any, num_envs: int) -> Loop:  # noqa: ANN401 -- not installed here
    """Return an iteration of a runner's own loop.

    Args:
        runner: An `OnPolicyRunner` that keeps nothing.
        num_envs: Its robots.
    """
    first = itertools.count()

    def iteration() -> None:
        runner.learn(1, init_at_random_ep_len=next(first) == 0)
        runner.current_learning_iteration += 1  # rsl_rl counts from the last one again

    return timed_loop(iteration, num_envs * runner.cfg["num_steps_per_env"])


def walk(
    runner: Any,  # noqa: ANN401
    env: Any,  # noqa: ANN401
    steps: int,
    step_dt: float,
    read: Reading,
) -> tuple[float, float]:
    """Let a policy walk without noise on its actions.

    Args:
        runner: What has learnt it.
        env: Environment of the robots, reset, with commands that stay.
        steps: Control steps to walk.
        step_dt: Duration of one, s.
        read: Reads what the robots do.

    Returns:
        The mean squared velocity error, (m/s)^2, and the share of the robots that fell.
    """
    meter = WalkMeter(env.num_envs, step_dt)
    policy = runner.get_inference_policy(device="cpu")
    with torch.inference_mode():
        observations = env.get_observations()
        command = read(env)[0].clone()
        for _ in range(steps):
            observations, *_ = env.step(policy(observations))
            now, velocity, fallen = read(env)
            meter.update(_array(command), _array(velocity), _array(fallen))
            command = now.clone()
    runner.alg.train_mode()
    return meter.figures()


def _array(tensor: torch.Tensor) -> np.ndarray:
    return tensor.numpy(force=True)
