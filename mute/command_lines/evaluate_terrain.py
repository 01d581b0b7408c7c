"""`evaluate.py terrain`: how a policy gets over every kind of ground, and how much it bears."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from mute.acoustics.origin import policy_origin
from mute.command_lines.arguments import (
    LONGEST_WALK,
    MANY_ROBOTS,
    Numbers,
    Words,
    check_distinct,
    check_option,
    check_seed,
    check_words,
    make_directory,
    spelled,
)
from mute.command_lines.policy_options import PolicyArgs
from mute.command_lines.sound_options import progress_bar
from mute.command_lines.targets import print_targets
from mute.controllers import load_policy
from mute.controllers.learned import Policy
from mute.envs.terrain import KINDS
from mute.envs.terrain.figures import LEVELS
from mute.evaluation.crossing import cross, crossing_cfg
from mute.evaluation.endurance import HARDSHIPS, LONGEST_PUSHES, be_pushed, bear, walk_at_random
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.evaluation.terrain_targets import terrain_targets
from mute.support.plain_data import without_nan
from mute.support.provenance import current_commit, machine_kind
from mute.support.ranges import Range
from mute.support.signals import exit_status

__all__ = ["TerrainArgs", "terrain"]


_PARTS = ("crossings", "hardships", "pushes", "tracking", "walk")
_TRACKING_SEEDS = 5
_TRACKING_MINUTES = 10.0
"""As in DreamWaQ's paper."""


_MEASURING = (
    *("parts", "kinds", "levels", "episodes", "seconds", "speed", "beta", "walkers", "minutes"),
    *("heading_hold", "seed"),
)
"""Options that change what is measured."""


@dataclass
class TerrainArgs(PolicyArgs):
    """How a policy gets over every kind of ground and level, and how much it bears on flat ground.

    Robots differ in everything.
    """

    parts: Words = _PARTS
    """What to measure: crossings, of kinds and levels; hardships, one at a time; pushes until the
    fall; tracking, ten minutes at random commands with five seeds; walk, half an hour of them."""
    kinds: Words = tuple(KINDS)
    """Kinds of ground: flat, slopes, uneven, blocks, stairs, stairs_down, rooms."""
    levels: tuple[int, ...] = tuple(range(LEVELS))
    """Levels of each, 0 to 4; flat ground has but one."""
    episodes: int = 512
    """Robots that walk, for each kind, level and hardship."""
    seconds: float = 20.0
    """Length of an episode, s."""
    speed: Numbers = (0.5,)
    """Commanded forward speeds, m/s, at each of which every kind and level is crossed."""
    beta: float = 0.0
    """Quiet factor."""
    walkers: int = 64
    """Robots that are pushed until they fall, and that walk at random, a quarter as many with each
    seed of tracking."""
    minutes: float = 30.0
    """How long those walk, min."""
    heading_hold: bool = True
    """Whether a policy that holds its heading does; without, its robots drift, as in training."""
    seed: int = 1
    """Seed of ground, robots, first states, noise, pushes and commands."""
    out: Path = Path("evaluation")
    """Directory of the CSV and JSON files."""
    json: bool = False
    """Print one JSON object with the figures on standard output, and nothing else there."""


@dataclass
class _Task:
    """One row to be measured."""

    part: str
    """Table that it is a row of."""
    seconds: float
    """How long robots walk for it, s."""
    measure: Callable[[Callable[[], None]], dict[str, Any]]
    """Returns it; calls what it is given after each control step."""


def terrain(args: TerrainArgs) -> int:
    """Measure, print and write; return the exit status.

    An interrupt keeps the rows that are whole.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    _check(args)
    args = args.with_policy_found()
    policy = load_policy(args.policy)
    if not args.heading_hold:
        policy = policy.with_heading_gain(0.0)
    make_directory(args.out)
    torch.set_num_threads(1)  # the physics engine has the cores
    tasks = [task for task in _tasks(args, policy) if task.part in args.parts]
    tables: dict[str, list[dict[str, Any]]] = {}
    status, done = 0, 0.0
    try:
        with progress_bar("terrain", sum(task.seconds for task in tasks)) as bar:

            def advance() -> None:
                nonlocal done
                done += policy.cfg.env.step_dt
                bar(done)

            for task in tasks:
                row = task.measure(advance)
                tables.setdefault(task.part, []).append(row)
    except KeyboardInterrupt as stop:
        whole = sum(map(len, tables.values()))
        print(f"interrupted; measured: {whole} of {len(tasks)}", file=sys.stderr)
        status = exit_status(stop)
    if tables:
        about = {
            **policy_origin(args.policy),
            "trained_seed": policy.cfg.env.seed,
            "iteration": policy.iteration,
            "commit": current_commit(),
            "machine": machine_kind(),
            "options": spelled(args, _MEASURING),
            "beta": args.beta,
            "seconds": args.seconds,
            "seed": args.seed,
        }
        _report(args, about, tables)
    return status


def _tasks(args: TerrainArgs, policy: Policy) -> list[_Task]:
    """Return all rows that there may be, in the order of `_PARTS`."""
    beta, seed, seconds = args.beta, args.seed, args.seconds

    def crossing(kind: str, level: int, speed: float) -> _Task:
        def measure(advance: Callable[[], None]) -> dict[str, Any]:
            cfg = crossing_cfg(policy, kind, level, args.episodes, seconds, seed)
            return cross(policy, cfg, speed, beta, seconds, advance).as_dict()

        return _Task("crossings", seconds, measure)

    def hardship(name: str) -> _Task:
        def measure(advance: Callable[[], None]) -> dict[str, Any]:
            return bear(policy, name, args.episodes, seconds, beta, seed, advance).as_dict()

        return _Task("hardships", seconds, measure)

    def pushes(advance: Callable[[], None]) -> dict[str, Any]:
        return be_pushed(policy, args.walkers, beta, seed, advance).as_dict()

    def tracking(own_seed: int) -> _Task:
        def measure(advance: Callable[[], None]) -> dict[str, Any]:
            robots = max(args.walkers // 4, 1)
            row = walk_at_random(policy, robots, _TRACKING_MINUTES, beta, own_seed, advance)
            return row.as_dict()

        return _Task("tracking", 60.0 * _TRACKING_MINUTES, measure)

    def walk(advance: Callable[[], None]) -> dict[str, Any]:
        return walk_at_random(policy, args.walkers, args.minutes, beta, seed, advance).as_dict()

    return [
        *(
            crossing(kind, level, speed)
            for kind in args.kinds
            for level in (args.levels if kind != "flat" else args.levels[:1])
            for speed in args.speed
        ),
        *map(hardship, HARDSHIPS),
        _Task("pushes", LONGEST_PUSHES, pushes),
        *(tracking(seed + index) for index in range(_TRACKING_SEEDS)),
        _Task("walk", 60.0 * args.minutes, walk),
    ]


_TITLES = {
    "crossings": "ground: {0.episodes} episodes of {0.seconds:g} s",
    "hardships": "hardships: {0.episodes} episodes of {0.seconds:g} s on flat ground",
    "pushes": "pushes along any direction every second, each stronger, until the fall",
    "tracking": "random commands, drawn anew every 10 s, by seed",
    "walk": "random commands, drawn anew every 10 s",
}


def _report(
    args: TerrainArgs, about: dict[str, Any], tables: dict[str, list[dict[str, Any]]]
) -> None:
    figures = terrain_targets(tables)
    content = about | tables | {"figures": [figure.as_dict() for figure in figures]}
    write_json(args.out / "terrain.json", content)
    names = ["terrain.json"]
    for part, rows in tables.items():
        names.append("terrain.csv" if part == "crossings" else f"terrain_{part}.csv")
        write_csv(args.out / names[-1], rows)
    if args.json:
        print(json.dumps(without_nan(content), allow_nan=False))
        return
    for part, rows in tables.items():
        print_table(_TITLES[part].format(args), rows, list(rows[0]))
    print_targets("targets, at the worst speed", figures)
    print(f"written to {args.out}: {', '.join(names)}")


def _check(args: TerrainArgs) -> None:
    check_option("episodes", args.episodes, MANY_ROBOTS)
    check_option("walkers", args.walkers, MANY_ROBOTS)
    check_option("seconds", args.seconds, Range(1.0, LONGEST_WALK, above=True))
    check_option("minutes", args.minutes, Range(0.0, LONGEST_WALK / 60.0, above=True))
    check_seed(args.seed)
    check_words("parts", args.parts, _PARTS)
    check_words("kinds", args.kinds, KINDS)
    check_distinct("levels", args.levels)
    for level in args.levels:
        check_option("levels", level, Range(0, LEVELS - 1, whole=True))
    check_distinct("speed", args.speed)
    for speed in args.speed:
        check_option("speed", speed, Range(0.0, 2.0, above=True))
    check_option("beta", args.beta, Range(0.0, 1.0))
