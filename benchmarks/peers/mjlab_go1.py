"""mjlab's own Go1 task on flat ground, and its own training.

Run with mjlab 1.6.0 and mujoco_warp 3.11.0.
"""

from __future__ import annotations

import importlib
import itertools
from dataclasses import asdict
from importlib import metadata
from typing import Any

import torch

from peers.parts import ACTION_SETS, TARGET_NOISE, Facts, Parts
from peers.rsl_rl_walk import training_loop, walk

__all__ = ["make"]

_TASK = "Mjlab-Velocity-Flat-Unitree-Go1"
_COMMAND = "twist"
_FOREVER = (1e6, 1e6)
"""Range of the time after which a command changes, s."""


def make(num_envs: int, _task: str, device: str = "cpu") -> Parts:
    """Return the task and its training; the calves have 2/3 of the noise on targets."""
    importlib.import_module("mjlab.tasks")  # registers them
    registry: Any = importlib.import_module("mjlab.tasks.registry")
    robots: Any = importlib.import_module("mjlab.asset_zoo.robots")
    rl: Any = importlib.import_module("mjlab.rl")
    cfg, env = _environment(registry, num_envs, device)
    agent = registry.load_rl_cfg(_TASK)
    wrapped = rl.RslRlVecEnvWrapper(env, clip_actions=agent.clip_actions)
    runner_class = registry.load_runner_cls(_TASK) or rl.MjlabOnPolicyRunner
    runner = runner_class(wrapped, asdict(agent), None, device)
    scale = max(robots.GO1_ACTION_SCALE.values())
    shape = (ACTION_SETS, num_envs, env.action_manager.total_action_dim)
    actions = itertools.cycle(TARGET_NOISE / scale * torch.randn(shape, device=device))

    @torch.inference_mode()
    def step() -> None:
        env.step(next(actions))
        if device != "cpu":
            torch.cuda.synchronize()

    def walk_some(trials: int, seconds: float) -> tuple[float, float]:
        trial = _environment(registry, trials, device, trial=True)[1]
        wrapped_trial = rl.RslRlVecEnvWrapper(trial, clip_actions=agent.clip_actions)
        figures = walk(runner, wrapped_trial, round(seconds / trial.step_dt), trial.step_dt, _read)
        trial.close()
        return figures

    facts = Facts(
        engine=f"mujoco_warp {metadata.version('mujoco-warp')} on {device}",
        robot="Unitree Go1",
        task=_TASK,
        num_envs=num_envs,
        physics_step=cfg.sim.mujoco.timestep,
        decimation=cfg.decimation,
        note=f"rsl_rl {metadata.version('rsl-rl-lib')}, no estimator",
    )
    return Parts(facts, step, training_loop(runner, num_envs), walk_some)


def _environment(
    registry: Any,  # noqa: ANN401 -- not installed here
    num_envs: int,
    device: str,
    trial: bool = False,
) -> tuple[Any, Any]:
    """Return the configuration of the task and an environment of it.

    Robots of a trial are nominal and see without noise, as MUTE's; the task's own configuration for
    playing has other commands as well.
    """
    envs: Any = importlib.import_module("mjlab.envs")
    cfg = registry.load_env_cfg(_TASK)
    cfg.scene.num_envs = num_envs
    cfg.seed = 0
    if trial:
        cfg.commands[_COMMAND].resampling_time_range = _FOREVER
        cfg.observations["actor"].enable_corruption = False
        # Those of other modes push robots, or make them differ.
        cfg.events = {name: event for name, event in cfg.events.items() if event.mode == "reset"}
    env = envs.ManagerBasedRlEnv(cfg, device=device)
    env.reset()
    return cfg, env


def _read(wrapped: Any) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:  # noqa: ANN401
    env = wrapped.unwrapped
    velocity = env.scene["robot"].data.root_link_lin_vel_b
    return env.command_manager.get_command(_COMMAND), velocity, env.termination_manager.terminated
