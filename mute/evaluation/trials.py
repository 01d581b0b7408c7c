"""Trials: a controller, robots side by side, commands held for a time, figures at the end."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import torch
from tensordict import TensorDict

from mute.controllers.controller import Controller
from mute.envs.commands import CommandSampler, CommandsCfg
from mute.envs.quadruped_env import QuadrupedEnv
from mute.envs.quadruped_env_cfg import QuadrupedEnvCfg
from mute.envs.scene import SceneCfg
from mute.envs.terrain import TerrainCfg
from mute.evaluation.gait import GaitMeter

__all__ = ["command_sampler", "evaluation_cfg", "from_the_stance", "run_trial"]


def evaluation_cfg(
    cfg: QuadrupedEnvCfg,
    num_envs: int,
    seconds: float,
    seed: int,
    randomized: bool = False,
    terrain: TerrainCfg | None = None,
) -> QuadrupedEnvCfg:
    """Return a task's environment for measuring.

    Commands are set by whoever measures and never drawn anew within an episode. The engine is the
    one that suits the device, whichever the policy was trained with, and physics steps are at most
    the usual ones, as coarser ones teach well and measure badly.

    Args:
        cfg: The environment that the policy was trained in.
        num_envs: Number of robots.
        seconds: Length of an episode, s.
        seed: Seed of the initial states.
        randomized: Keep the training's physics randomisation, pushes and sensor noise; otherwise
            the model as it is, no pushes, no noise.
        terrain: Ground to measure on; flat unless given, whatever the policy was trained on.
    """
    measured = dataclasses.replace(
        _in_usual_steps(cfg),
        num_envs=num_envs,
        engine="auto",
        seed=seed,
        terrain=terrain or TerrainCfg(),
        # One step longer than the trial, so that its last step is measured and not reset.
        episode_length=seconds + cfg.step_dt,
        commands=dataclasses.replace(cfg.commands, resampling_time=10.0 * seconds + 10.0),
    )
    if randomized:
        return measured
    return dataclasses.replace(
        measured,
        observations=dataclasses.replace(cfg.observations, noise_level=0.0),
        randomization=dataclasses.replace(cfg.randomization, enabled=False),
    )


def _in_usual_steps(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return the environment with physics steps no longer than those of `SceneCfg`."""
    steps = math.ceil(cfg.step_dt / SceneCfg().timestep - 1e-9)
    if steps <= cfg.decimation:
        return cfg
    scene = dataclasses.replace(cfg.scene, timestep=cfg.step_dt / steps)
    return dataclasses.replace(cfg, scene=scene, decimation=steps)


def from_the_stance(cfg: QuadrupedEnvCfg) -> QuadrupedEnvCfg:
    """Return the same environment with robots that begin in the exact stance, at rest, along x."""
    return dataclasses.replace(
        cfg, initial_joint_noise=0.0, initial_velocity=0.0, random_heading=False
    )


def command_sampler(cfg: CommandsCfg, robots: int, seed: int) -> CommandSampler:
    """Return what draws commands to measure with, the same ones for each seed.

    How often a task draws slow ones, say, must not change what is measured: see
    `CommandsCfg.drawn_evenly`.

    Args:
        cfg: Ranges, and how commands are drawn from them.
        robots: Number of robots.
        seed: Of the draws.
    """
    generator = torch.Generator().manual_seed(seed)
    return CommandSampler(cfg, robots, generator, torch.device("cpu"))


def run_trial(
    env: QuadrupedEnv,
    controller: Controller,
    commands: torch.Tensor,
    num_steps: int,
    on_step: Callable[[TensorDict, torch.Tensor], None] | None = None,
) -> GaitMeter:
    """Walk for a number of control steps with fixed commands and return the meter.

    A robot that falls starts again, with the same command; it stays counted as fallen.

    Args:
        env: The environment; it is reset first.
        controller: What drives; its past is forgotten first.
        commands: (v_x, v_y, w_z, beta). Shape: (num_envs, 4) or (4,).
        num_steps: Control steps.
        on_step: Called after each step with the observations that were acted on and the dones.
    """
    env.reset()
    env.set_command(commands)
    controller.reset()
    meter = GaitMeter(env)
    for _ in range(num_steps):
        command = env.commands.command.clone()
        acted_on = env.get_observations()
        _, _, dones, _ = env.step(controller.act(acted_on))
        meter.update(command, dones)
        if on_step is not None:
            on_step(acted_on, dones)
        if bool(dones.any()):
            controller.reset(dones)
            env.set_command(commands)
    return meter
