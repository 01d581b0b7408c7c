"""A policy of DreamWaQ's task that has learnt nothing, for tests that need its form."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from mute.checkpoint import save_checkpoint
from mute.config import TaskCfg, to_plain
from mute.learning.runner import MuteRunner, policy_part
from mute.tasks import make_task


def write_dreamwaq_policy(path: Path) -> Path:
    """Write such a policy, with small networks, and return its path."""
    task = make_task("go1_dreamwaq")
    estimation = dataclasses.replace(task.agent.estimation, num_mini_batches=1)
    agent = dataclasses.replace(
        task.agent, actor_hidden=(8,), critic_hidden=(8,), estimation=estimation
    )
    cfg = TaskCfg(env=dataclasses.replace(task.env, num_envs=2, num_threads=1), agent=agent)
    runner = MuteRunner("go1_dreamwaq", cfg, None)
    payload = runner.alg.save() | {"task": "go1_dreamwaq", "config": to_plain(cfg), "iter": 0}
    save_checkpoint(path, policy_part(payload))
    return path
