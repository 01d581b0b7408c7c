"""The conditions under which every policy is judged alike, and how its robots are led along.

Robots differ in their physics and their sensors are noisy, both as the project's defaults have it
and not as the task does: a policy that was trained on tame robots is judged on the same as any.
Nobody pushes them but the parts that say so. Work is counted in seconds that a robot walks at the
training's physics steps, so that the time left can be told.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import torch

from mute.controllers.controller import Controller
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg

__all__ = [
    "BETAS",
    "SOUND_WORK",
    "OnWork",
    "dealt",
    "make_env",
    "walk",
    "without_noise",
]

BETAS = (0.0, 0.5, 1.0)
"""Quiet factors at which robots start and stand."""

SOUND_WORK = 6.0
"""Work of a second that is heard, over that of one that is not: its physics steps are shorter."""

OnWork = Callable[[float], None]
"""Is told of work that is done, s."""


def without_noise(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return the same environment with exact sensors."""
    exact = dataclasses.replace(cfg.observations, noise_level=0.0)
    return dataclasses.replace(cfg, observations=exact)


def make_env(cfg: QuadrupedEnvCfg) -> QuadrupedEnv:
    """Return the environment, with the engine on every core."""
    return QuadrupedEnv(dataclasses.replace(cfg, num_threads=0))


def dealt(settings: torch.Tensor, each: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Give every setting as many robots.

    Args:
        settings: Commands (v_x, v_y, w_z, beta). Shape: (num_settings, 4).
        each: Robots for each.

    Returns:
        The commands of the robots, shape (num_settings * each, 4), and the index of each one's
        setting, shape (num_settings * each,). Neighbours have different settings.
    """
    index = torch.arange(len(settings)).repeat(each)
    return settings[index], index


def walk(
    env: QuadrupedEnv,
    controller: Controller,
    command: torch.Tensor,
    seconds: float,
    *watchers: Callable[[torch.Tensor], object],
) -> None:
    """Hold a command for a time, from where the robots are.

    A robot that falls begins anew, with the same command.

    Args:
        env: The robots.
        controller: What drives them.
        command: (v_x, v_y, w_z, beta). Shape: (num_envs, 4).
        seconds: How long, s.
        watchers: Called after each step with the episodes that ended in it, of shape (num_envs,).
    """
    env.set_command(command)
    for _ in range(round(seconds / env.step_dt)):
        _, _, dones, _ = env.step(controller.act(env.get_observations()))
        for watch in watchers:
            watch(dones)
        if bool(dones.any()):
            controller.reset(dones)
            env.set_command(command)
