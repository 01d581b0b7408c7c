"""Time one peer in the interpreter that has it; `mute.command_lines.benchmark_peers` starts it.

    python -P benchmarks/peer_program.py NAME NUM_ENVS ROUNDS TASK

It prints one line of JSON: the fields of `PeerRate` there but the name. The interpreter may be that
of another virtual environment, so only `_gymnasium`, which runs in MUTE's own, imports MUTE.
"""

from __future__ import annotations

import importlib
import itertools
import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any

_ROUND_SECONDS = 1.0
"""Shortest duration of a round, s."""

_WARM_UP_STEPS = 3
"""Steps before the first round: kernels are compiled in them, some only in the second."""

_WORKERS_PER_CORE = 4
"""Robots of the `AsyncVectorEnv` for each core, a process each: enough that no core ever waits."""

_ACTION_SETS = 24
"""Random actions that are drawn beforehand, and then taken in turns."""

_TARGET_NOISE = 0.1
"""Standard deviation of the joints' targets about the standing pose, rad."""

Peer = tuple[Callable[[], None], int, str]
"""A control step of all robots, their number, and a note on what is stepped."""


def main() -> None:
    """Time the peer that the command line names."""
    name, num_envs, rounds, task = sys.argv[1:]
    package, make = PROGRAMS[name]
    try:
        version = metadata.version(package)
    except metadata.PackageNotFoundError:
        _print(note=f"{package} is not installed for {sys.executable}")
        return
    step, num_robots, note = make(int(num_envs), task)
    rate = num_robots * _steps_per_second(step, int(rounds))
    _print(version=version, num_envs=num_robots, steps_per_second=rate, note=note)


def _print(
    *,
    version: str | None = None,
    num_envs: int | None = None,
    steps_per_second: float | None = None,
    note: str,
) -> None:
    fields = {"version": version, "num_envs": num_envs, "steps_per_second": steps_per_second}
    print(json.dumps(fields | {"note": note}))


def _steps_per_second(step: Callable[[], None], rounds: int) -> float:
    """Return the median over rounds of how often a step is made in a second."""
    for _ in range(_WARM_UP_STEPS):
        step()
    rates: list[float] = []
    for _ in range(rounds):
        start, steps, elapsed = time.perf_counter(), 0, 0.0
        while elapsed < _ROUND_SECONDS:
            step()
            steps += 1
            elapsed = time.perf_counter() - start
        rates.append(steps / elapsed)
    return statistics.median(rates)


def _gymnasium(_num_envs: int, task: str) -> Peer:
    """Return Gymnasium's `AsyncVectorEnv`, our scene in plain MuJoCo: a process for each robot."""
    import numpy as np
    from gymnasium.vector import AsyncVectorEnv

    from mute.envs.quadruped_env import NUM_ACTIONS

    sys.path.insert(0, str(Path(__file__).parent))  # -P leaves it out
    from bare_go1 import BareGo1

    from mute.command_lines.arguments import task_name
    from mute.support.plugins import load_plugins
    from mute.support.threads import usable_cores
    from mute.tasks import make_task

    load_plugins()
    cfg = make_task(task_name(task)).env
    robots = _WORKERS_PER_CORE * usable_cores()
    env = AsyncVectorEnv([lambda: BareGo1(cfg)] * robots)
    env.reset(seed=0)
    shape = (_ACTION_SETS, robots, NUM_ACTIONS)
    noise = np.random.default_rng(0).standard_normal(shape, np.float32)
    actions = itertools.cycle(_TARGET_NOISE * noise)

    def step() -> None:
        env.step(next(actions))

    version = metadata.version("mujoco")
    return step, robots, f"AsyncVectorEnv, mujoco {version}, the same scene: physics alone"


def _mjlab(num_envs: int, _task: str) -> Peer:
    """Return mjlab's own Go1 task on flat ground, its calves with 2/3 of the noise on targets.

    Run with mjlab 1.6.0 and mujoco_warp 3.11.0.
    """
    import torch

    importlib.import_module("mjlab.tasks")  # registers them
    assets: Any = importlib.import_module("mjlab.asset_zoo.robots")
    envs: Any = importlib.import_module("mjlab.envs")
    registry: Any = importlib.import_module("mjlab.tasks.registry")
    name = "Mjlab-Velocity-Flat-Unitree-Go1"
    cfg = registry.load_env_cfg(name)
    cfg.scene.num_envs = num_envs
    cfg.seed = 0
    env = envs.ManagerBasedRlEnv(cfg, device="cpu")
    env.reset()
    scale = max(assets.GO1_ACTION_SCALE.values())
    shape = (_ACTION_SETS, num_envs, env.action_manager.total_action_dim)
    actions = itertools.cycle(_TARGET_NOISE / scale * torch.randn(shape))

    @torch.inference_mode()
    def step() -> None:
        env.step(next(actions))

    substeps = f"{cfg.decimation} physics steps of {1000 * cfg.sim.mujoco.timestep:g} ms"
    engine = f"mujoco_warp {metadata.version('mujoco-warp')} on the CPU"
    return step, num_envs, f"{name}, {engine}: its own robot and task, {substeps}"


def _mujoco_playground(num_envs: int, _task: str) -> Peer:
    """Return MuJoCo Playground's own Go1 task on flat ground, as its PPO steps it.

    Run with playground 0.2.0 and mujoco-mjx 3.17.0. The package fetches the robot's meshes, which
    are only for show, from the network when its first environment is made; this was run with the
    meshes put there by hand, never with that download.
    """
    os.environ["JAX_PLATFORMS"] = "cpu"  # before jax is imported
    jax: Any = importlib.import_module("jax")
    playground: Any = importlib.import_module("mujoco_playground")
    name = "Go1JoystickFlatTerrain"
    # The default implementation is Warp's, which needs a GPU here.
    bare = playground.registry.load(name, config_overrides={"impl": "jax"})
    env = playground.wrapper.wrap_for_brax_training(bare)
    advance = jax.jit(env.step)
    # Its wrappers take keys as arrays of numbers only.
    key, actions_key = jax.random.split(jax.random.PRNGKey(0))
    state = jax.jit(env.reset)(jax.random.split(key, num_envs))
    scale = playground.registry.get_default_config(name).action_scale
    noise = jax.random.normal(actions_key, (_ACTION_SETS, num_envs, env.action_size))
    actions = itertools.cycle(_TARGET_NOISE / scale * noise)

    def step() -> None:
        nonlocal state
        state = jax.block_until_ready(advance(state, next(actions)))

    substeps = f"{bare.n_substeps} physics steps of {1000 * bare.sim_dt:g} ms"
    engine = f"mujoco-mjx {metadata.version('mujoco-mjx')} on the CPU"
    return step, num_envs, f"{name}, {engine}: its own robot and task, {substeps}"


PROGRAMS: dict[str, tuple[str, Callable[[int, str], Peer]]] = {
    "gymnasium": ("gymnasium", _gymnasium),
    "mjlab": ("mjlab", _mjlab),
    "mujoco_playground": ("playground", _mujoco_playground),
}
"""By a peer's name, the package it comes in and what makes it for a number of robots and a task."""

if __name__ == "__main__":
    main()
