"""`evaluate.py terrain`: how a policy gets over every kind of ground, and what it knows of it."""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from mute.command_lines.arguments import (
    LONGEST_WALK,
    MANY_ROBOTS,
    Numbers,
    Words,
    check_distinct,
    check_option,
    check_seed,
    make_directory,
)
from mute.command_lines.policy_options import PolicyArgs
from mute.command_lines.sound_options import progress_bar
from mute.controllers import load_policy
from mute.envs.terrain import KINDS
from mute.envs.terrain.figures import LEVELS
from mute.evaluation.crossing import cross, crossing_cfg
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.support.errors import MuteError
from mute.support.plain_data import without_nan
from mute.support.provenance import REPOSITORY, current_commit, file_sha256, machine_kind
from mute.support.ranges import Range
from mute.support.signals import exit_status

__all__ = ["TerrainArgs", "terrain"]


@dataclass
class TerrainArgs(PolicyArgs):
    """How a policy gets over every kind of ground and level, with robots that differ in all."""

    kinds: Words = tuple(KINDS)
    """Kinds of ground: flat, slopes, uneven, blocks, stairs, stairs_down, rooms."""
    levels: tuple[int, ...] = tuple(range(LEVELS))
    """Levels of each, 0 to 4; flat ground has but one."""
    episodes: int = 512
    """Robots that walk, for each kind and level."""
    seconds: float = 20.0
    """Length of an episode, s."""
    speed: Numbers = (0.5,)
    """Commanded forward speeds, m/s, at each of which every kind and level is crossed."""
    beta: float = 0.0
    """Quiet factor."""
    seed: int = 1
    """Seed of ground, robots, first states and noise."""
    out: Path = Path("evaluation")
    """Directory of the CSV and JSON files."""
    json: bool = False
    """Print one JSON object with the figures on standard output, and nothing else there."""


def terrain(args: TerrainArgs) -> int:
    """Measure, print and write; return the exit status.

    An interrupt keeps the kinds and levels that are whole.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    _check(args)
    args = args.with_policy_found()
    policy = load_policy(args.policy)
    make_directory(args.out)
    torch.set_num_threads(1)  # the physics engine has the cores
    places = [
        (kind, level, speed)
        for kind in args.kinds
        for level in (args.levels if kind != "flat" else args.levels[:1])
        for speed in args.speed
    ]
    rows: list[dict[str, Any]] = []
    status, done = 0, 0.0
    try:
        with progress_bar("terrain", len(places) * args.seconds) as bar:

            def advance() -> None:
                nonlocal done
                done += policy.cfg.env.step_dt
                bar(done)

            for kind, level, speed in places:
                cfg = crossing_cfg(policy, kind, level, args.episodes, args.seconds, args.seed)
                row = cross(policy, cfg, speed, args.beta, args.seconds, advance)
                rows.append(row.as_dict())
    except KeyboardInterrupt as stop:
        print(f"interrupted; measured: {len(rows)} of {len(places)}", file=sys.stderr)
        status = exit_status(stop)
    if rows:
        about = {
            "policy": os.path.relpath(args.policy, REPOSITORY),
            "policy_sha256": file_sha256(args.policy),
            "trained_seed": policy.cfg.env.seed,
            "iteration": policy.iteration,
            "commit": current_commit(),
            "machine": machine_kind(),
            "beta": args.beta,
            "seconds": args.seconds,
            "seed": args.seed,
        }
        _report(args, about, rows)
    return status


def _report(args: TerrainArgs, about: dict[str, Any], rows: list[dict[str, Any]]) -> None:
    content = about | {"crossings": rows}
    write_json(args.out / "terrain.json", content)
    write_csv(args.out / "terrain.csv", rows)
    if args.json:
        print(json.dumps(without_nan(content), allow_nan=False))
        return
    print_table(f"{args.episodes} episodes of {args.seconds:g} s", rows, list(rows[0]))
    print(f"written: {args.out}/terrain.json, terrain.csv")


def _check(args: TerrainArgs) -> None:
    check_option("episodes", args.episodes, MANY_ROBOTS)
    check_option("seconds", args.seconds, Range(1.0, LONGEST_WALK, above=True))
    check_seed(args.seed)
    check_distinct("kinds", args.kinds)
    check_distinct("levels", args.levels)
    unknown = [name for name in args.kinds if name not in KINDS]
    if unknown:
        raise MuteError(f"--kinds must be of {', '.join(KINDS)}, got {unknown[0]!r}")
    for level in args.levels:
        check_option("levels", level, Range(0, LEVELS - 1, whole=True))
    check_distinct("speed", args.speed)
    for speed in args.speed:
        check_option("speed", speed, Range(0.0, 2.0, above=True))
    check_option("beta", args.beta, Range(0.0, 1.0))
