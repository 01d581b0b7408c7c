"""Measure what the model-predictive controller takes: python -m benchmarks.mpc.

One robot, as on a robot of its own, and 64 side by side, asked for 0.5 m/s. What a call of the
controller takes is timed, and how much faster than real time all of them walk together, the
environment and its physics included.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import track

from mute.command_lines.arguments import check_option, command_line, make_directory, parse
from mute.controllers.mpc.driver import MpcDriver
from mute.envs.quadruped_env import QuadrupedEnv
from mute.evaluation.tables import print_table, write_json
from mute.evaluation.usual_robots import robots_cfg
from mute.support.errors import run_cli
from mute.support.provenance import machine_kind
from mute.support.ranges import Range

__all__ = ["MpcBenchmarkArgs", "main"]

_SEED = 1
_SPEED = 0.5
_WARM_UP = 50
"""Control steps after which robots walk."""


@dataclass
class MpcBenchmarkArgs:
    """Arguments of the benchmark."""

    robots: tuple[int, ...] = (1, 64)
    """How many robots walk side by side."""
    steps: int = 250
    """Control steps that are timed."""
    json: bool = False
    """Print JSON and nothing else."""
    out: Path | None = None
    """File to write the JSON to as well."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(MpcBenchmarkArgs, argv, "Measure what the model-predictive controller takes.")
    for robots in args.robots:
        check_option("robots", robots, Range(1, 2**16, whole=True))
    check_option("steps", args.steps, Range(1, 10**6, whole=True))
    if args.out is not None:
        make_directory(args.out.parent)
    torch.set_num_threads(1)
    shown = track(args.robots, "robots", console=Console(stderr=True))
    rows = [_measured(robots, args.steps) for robots in shown]
    content = {"machine": machine_kind(), "steps": args.steps, "walks": rows}
    if args.out is not None:
        write_json(args.out, content)
    if args.json:
        print(json.dumps(content))
    else:
        print_table(f"on {content['machine']}", rows, list(rows[0]))
    return 0


def _measured(robots: int, steps: int) -> dict[str, Any]:
    """Return what a control step takes, ms, and how much faster than real time robots walk."""
    driver = MpcDriver()
    cfg = robots_cfg(driver, robots, 1e3, _SEED)
    env = QuadrupedEnv(dataclasses.replace(cfg, random_heading=False))
    controller = driver.controller(env.cfg)
    env.set_command(torch.tensor((_SPEED, 0.0, 0.0, 0.0)))
    taken, whole, fallen = [], 0.0, 0
    for step in range(_WARM_UP + steps):
        begin = time.perf_counter()
        actions = controller.act(env.get_observations())
        middle = time.perf_counter()
        _, _, dones, _ = env.step(actions)
        if step >= _WARM_UP:
            taken.append(1e3 * (middle - begin))
            whole += time.perf_counter() - begin
        if bool(dones.any()):
            fallen += int(env.fallen.sum())
            controller.reset(dones)
            env.set_command(torch.tensor((_SPEED, 0.0, 0.0, 0.0)))
    median, late = np.percentile(taken, (50, 95))
    return {
        "robots": robots,
        "control step, median (ms)": float(median),
        "control step, 95 % (ms)": float(late),
        "times real time, with physics": steps * env.step_dt / whole,
        "falls": fallen,
    }


if __name__ == "__main__":
    run_cli(main)
