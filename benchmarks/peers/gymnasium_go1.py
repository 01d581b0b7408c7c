"""Gymnasium's `AsyncVectorEnv` with MUTE's scene in plain MuJoCo: a process for each robot."""

from __future__ import annotations

import itertools
from importlib import metadata

import numpy as np
from bare_go1 import BareGo1
from gymnasium.vector import AsyncVectorEnv

from mute.command_lines.arguments import task_name
from mute.envs.quadruped_env import NUM_ACTIONS
from mute.support.plugins import load_plugins
from mute.support.threads import usable_cores
from mute.tasks import make_task
from peers.parts import ACTION_SETS, TARGET_NOISE, Facts, Parts

__all__ = ["make"]

_WORKERS_PER_CORE = 4
"""Robots for each core, a process each: enough that no core ever waits."""


def make(_num_envs: int, task: str) -> Parts:
    """Return as many robots as suit the cores."""
    load_plugins()
    name = task_name(task)
    cfg = make_task(name).env
    robots = _WORKERS_PER_CORE * usable_cores()
    env = AsyncVectorEnv([lambda: BareGo1(cfg)] * robots)
    env.reset(seed=0)
    shape = (ACTION_SETS, robots, NUM_ACTIONS)
    noise = np.random.default_rng(0).standard_normal(shape, np.float32)
    actions = itertools.cycle(TARGET_NOISE * noise)

    def step() -> None:
        env.step(next(actions))

    facts = Facts(
        engine=f"mujoco {metadata.version('mujoco')}",
        robot="Unitree Go1",
        task=name,
        num_envs=robots,
        physics_step=cfg.scene.timestep,
        decimation=cfg.decimation,
        note="AsyncVectorEnv, MUTE's scene: physics alone, no learner",
    )
    return Parts(facts, step)
