"""MUTE's own environment and training, timed in turns with the peers."""

from __future__ import annotations

from mute.support.threads import configure_threads, use_collection_threads

configure_threads()  # before torch is imported

import dataclasses
import itertools
from importlib import metadata

import torch

from mute.command_lines.arguments import task_name
from mute.envs.quadruped_env import NUM_ACTIONS
from mute.learning.runner import MuteRunner
from mute.support.memory import keep_freed_memory
from mute.support.plugins import load_plugins
from mute.tasks import make_task
from peers.parts import ACTION_SETS, TARGET_NOISE, Facts, Parts
from peers.rsl_rl_walk import training_loop

__all__ = ["make"]


def make(num_envs: int, task: str, device: str = "cpu") -> Parts:
    """Return a training of a task, without files and displays, and its environment."""
    keep_freed_memory()
    load_plugins()
    name = task_name(task)
    cfg = make_task(name)
    cfg = dataclasses.replace(cfg, env=dataclasses.replace(cfg.env, num_envs=num_envs))
    torch.set_float32_matmul_precision(cfg.agent.matmul_precision)
    runner = MuteRunner(name, cfg, None, device)
    env = runner.env.env
    actions = itertools.cycle(
        TARGET_NOISE
        / cfg.env.action_scale
        * torch.randn(ACTION_SETS, num_envs, NUM_ACTIONS, device=device)
    )

    @torch.inference_mode()
    def step() -> None:
        use_collection_threads()  # as around every step of a training
        env.step(next(actions))
        if device != "cpu":
            torch.cuda.synchronize()

    facts = Facts(
        engine=_engine(device),
        robot="Unitree Go1",
        task=name,
        num_envs=num_envs,
        physics_step=cfg.env.scene.timestep,
        decimation=cfg.env.decimation,
        note="MUTE itself, with estimator and randomised robots",
    )
    return Parts(facts, step, training_loop(runner, num_envs))


def _engine(device: str) -> str:
    package = "mujoco" if device == "cpu" else "mujoco-warp"
    return f"{package} {metadata.version(package)} on {device}"
