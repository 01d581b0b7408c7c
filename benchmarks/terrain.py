"""Measure what ground costs a training: python -m benchmarks.terrain.

The policy that ships walks with the exploration of a training, over each choice of ground, with
robots that differ as in its training or in everything. All take turns in one process, in an order
drawn anew for each turn, and are compared with flat ground within the turn. Only the environment's
steps are timed, physics, rewards and observations, not the policy; and, alone, the height map.
"""

from __future__ import annotations

from mute.support.threads import configure_threads

configure_threads()  # before torch is imported

import dataclasses
import json
import random
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from rich.progress import track

from mute.command_lines.arguments import check_option, command_line, make_directory, parse, spelled
from mute.controllers import LearnedController, load_policy
from mute.controllers.learned import Policy
from mute.envs.quadruped_env import NUM_ACTIONS, QuadrupedEnv
from mute.envs.randomization import RandomizationCfg, full_randomization
from mute.envs.terrain import TerrainCfg
from mute.evaluation.intervals import median_interval
from mute.evaluation.tables import print_table, write_json
from mute.support.errors import run_cli
from mute.support.provenance import machine_kind
from mute.support.ranges import Range
from mute.support.resources import shipped_file
from mute.support.threads import use_collection_threads
from mute.tasks import DEFAULT_TASK

__all__ = ["VARIANTS", "TerrainBenchmarkArgs", "main"]

_SEED = 1
_WARM_UP = 50
"""Control steps after which the robots walk as in a training."""
_STEPS = 24
"""Control steps of a rollout, as in a training."""
_ACTION_STD = 0.3
"""Standard deviation of exploration, as in the middle of a training."""
_LEVELS = (0, 4)
"""Levels that robots are spread over, as late in a training."""
_MAPS = 20
"""Height maps that are made at a time, to be timed."""

VARIANTS = {
    "flat": ("flat", False),
    "flat, robots differ in everything": ("flat", True),
    "indoor": ("indoor", False),
    "indoor, robots differ in everything": ("indoor", True),
    "rough": ("rough", False),
    "rough, robots differ in everything": ("rough", True),
}
"""Kind of ground, and whether robots differ in everything, by what it is called; the first is what
the others are compared with."""


@dataclass
class TerrainBenchmarkArgs:
    """Arguments of the benchmark."""

    policy: Path = shipped_file(DEFAULT_TASK)
    """The policy that walks."""
    num_envs: int = 1024
    """Robots that are stepped."""
    turns: int = 9
    """Rollouts of each; the medians count."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well."""


class _Rollouts:
    """Robots on one choice of ground, that walk on from rollout to rollout."""

    def __init__(self, policy: Policy, name: str, num_envs: int) -> None:
        kind, differ = VARIANTS[name]
        cfg = dataclasses.replace(
            policy.cfg.env,
            num_envs=num_envs,
            seed=_SEED,
            engine="mujoco",
            terrain=TerrainCfg(kind=kind, first_levels=_LEVELS, curriculum=False),
        )
        # Whatever robots the policy was trained with, as usual or all of them differ.
        robots = full_randomization() if differ else RandomizationCfg()
        cfg = dataclasses.replace(cfg, randomization=robots)
        self.name = name
        self._env = QuadrupedEnv(cfg)
        self._controller = LearnedController(policy, num_envs)
        self._generator = torch.Generator().manual_seed(_SEED)
        self._env.reset()
        self.run(_WARM_UP)

    def run(self, steps: int = _STEPS) -> float:
        """Walk, and return what the environment's steps took, s each."""
        taken, env = 0.0, self._env
        for _ in range(steps):
            action = self._controller.act(env.get_observations())
            noise = torch.randn(env.num_envs, NUM_ACTIONS, generator=self._generator)
            action = action + _ACTION_STD * noise
            begin = time.perf_counter()
            _, _, dones, _ = env.step(action)
            taken += time.perf_counter() - begin
            if bool(dones.any()):
                self._controller.reset(dones)
        return taken / steps

    def map_time(self) -> float:
        """Return what a height map takes, s."""
        env = self._env
        begin = time.perf_counter()
        for _ in range(_MAPS):
            env.ground.height_map(env.grid, env.base_pos, env.heading)
        return (time.perf_counter() - begin) / _MAPS


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(TerrainBenchmarkArgs, argv, "Measure what ground costs a training.")
    check_option("num-envs", args.num_envs, Range(1, 2**20, whole=True))
    check_option("turns", args.turns, Range(1, 10**6, whole=True))
    policy = load_policy(args.policy)
    if args.out is not None:
        make_directory(args.out.parent)
    content: dict[str, Any] = {
        "task": policy.task,
        "machine": machine_kind(),
        "options": spelled(args, ("policy", "num_envs", "turns")),
        "timestep": policy.cfg.env.scene.timestep,
        "num_envs": args.num_envs,
        "turns": args.turns,
        "rates": _measure(policy, args),
    }
    if args.out is not None:
        write_json(args.out, content)
    if args.json:
        print(json.dumps(content))
    else:
        print_table(f"{args.num_envs} robots, {content['machine']}", content["rates"], _COLUMNS)
    return 0


_COLUMNS = ["ground", "steps_per_second", "speed", "speed_low", "speed_high", "map_share"]


def _measure(policy: Policy, args: TerrainBenchmarkArgs) -> list[dict[str, Any]]:
    """Return a row for each choice of ground."""
    use_collection_threads()
    rollouts = [_Rollouts(policy, name, args.num_envs) for name in VARIANTS]
    times: dict[str, list[float]] = {name: [] for name in VARIANTS}
    maps: dict[str, list[float]] = {name: [] for name in VARIANTS}
    order = random.Random(_SEED)
    turns = range(args.turns)
    for _ in turns if args.json else track(turns, "turns"):
        for each in order.sample(rollouts, len(rollouts)):
            times[each.name].append(each.run())
            maps[each.name].append(each.map_time())
    flat = times[next(iter(VARIANTS))]
    rows = []
    for name, own in times.items():
        speed = median_interval([a / b for a, b in zip(flat, own, strict=True)])
        share = [a / b for a, b in zip(maps[name], own, strict=True)]
        rows.append(
            {
                "ground": name,
                "steps_per_second": args.num_envs / statistics.median(own),
                "speed": speed.median,
                "speed_low": speed.low,
                "speed_high": speed.high,
                "map_share": statistics.median(share),
            }
        )
    return rows


if __name__ == "__main__":
    run_cli(main)
