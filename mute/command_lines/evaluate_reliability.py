"""`evaluate.py reliability`: whether one can rely on a walk, every figure beside its target."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from mute.command_lines.arguments import (
    MANY_ROBOTS,
    Words,
    check_option,
    check_seed,
    check_words,
    make_directory,
)
from mute.command_lines.policy_options import DriverArgs
from mute.command_lines.sound_options import progress_bar
from mute.command_lines.targets import print_targets
from mute.controllers.driver import Driver
from mute.evaluation.reliability.figures import Figure, PartResult, shown
from mute.evaluation.reliability.parts import PARTS
from mute.evaluation.tables import print_table, write_csv, write_json
from mute.evaluation.usual_robots import under_conditions
from mute.support.plain_data import without_nan
from mute.support.signals import exit_status

__all__ = ["ReliabilityArgs", "reliability"]

_NOT_MET = 1
"""Exit status of --check where a target is not met."""


@dataclass
class ReliabilityArgs(DriverArgs):
    """Whether a walk starts, follows, stands in silence and heeds beta, beside what it should."""

    robots: int = 256
    """Robots for each command and beta that they start on; parts that need fewer say so in
    docs/commands.md. All have randomised physics and noisy sensors unless a figure says else."""
    parts: Words = tuple(PARTS)
    """What to measure: starts, follows, stands, beta, falls."""
    seed: int = 1
    """Seed of physics, first states, commands and noise."""
    out: Path = Path("evaluation")
    """Directory of the JSON and CSV files."""
    check: bool = False
    """End with status 1 where a target is not met."""
    json: bool = False
    """Print one JSON object with the figures on standard output, and nothing else there."""


@dataclass
class _Measured:
    """What has been measured so far."""

    figures: list[Figure] = field(default_factory=list)
    tables: dict[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)

    def add(self, result: PartResult) -> None:
        self.figures += result.figures
        self.tables |= result.tables


def reliability(args: ReliabilityArgs) -> int:
    """Measure, print and write; return the exit status.

    An interrupt keeps the parts that are whole.

    Raises:
        MuteError: If an argument is bad, or the policy cannot be used.
    """
    _check(args)
    args = args.with_driver_found()
    origin = args.origin()
    policy = _load(args)
    about = {
        **origin,
        "task": policy.task,
        "trained_seed": policy.cfg.env.seed,
        "iteration": policy.iteration,
        "robots": args.robots,
        "seed": args.seed,
    }
    make_directory(args.out)
    torch.set_num_threads(1)  # the physics engine has the cores
    measured, status = _Measured(), 0
    try:
        _measure(args, under_conditions(policy), measured)
    except KeyboardInterrupt as stop:
        whole = ", ".join(dict.fromkeys(figure.part for figure in measured.figures)) or "nothing"
        print(f"interrupted; measured: {whole}", file=sys.stderr)
        status = exit_status(stop)
    if measured.figures:
        _report(args, about, measured)
    met = all(figure.met for figure in measured.figures)
    return status or (_NOT_MET if args.check and not met else 0)


def _measure(args: ReliabilityArgs, policy: Driver, measured: _Measured) -> None:
    """Measure one part after the other."""
    parts = {name: part for name, part in PARTS.items() if name in args.parts}
    done = 0.0
    with progress_bar("reliability", sum(part.work(args.robots) for part in parts.values())) as bar:

        def advance(work: float) -> None:
            nonlocal done
            done += work
            bar(done)

        for part in parts.values():
            measured.add(part.measure(policy, args.robots, args.seed, advance))


def _report(args: ReliabilityArgs, about: Mapping[str, Any], measured: _Measured) -> None:
    """Write the files, then print the object or the tables."""
    figures = [figure.as_dict() for figure in measured.figures]
    content = {**about, "figures": figures, "tables": measured.tables}
    write_json(args.out / "reliability.json", content)
    write_csv(args.out / "reliability.csv", figures)
    names = ["reliability.json", "reliability.csv"]
    for name, rows in measured.tables.items():
        write_csv(args.out / f"reliability_{name}.csv", rows)
        names.append(f"reliability_{name}.csv")
    if args.json:
        print(json.dumps(without_nan(content), allow_nan=False))
        return
    _print_starts(measured)
    title = f"reliability, {args.robots} robots; levels are modelled"
    print_targets(title, measured.figures)
    print(f"written to {args.out}: {', '.join(names)}")


def _print_starts(measured: _Measured) -> None:
    """Print which share of the robots goes on which command, if that was measured."""
    starts = measured.tables.get("starts", [])
    rows: dict[str, dict[str, Any]] = {}
    for start in starts:
        row = rows.setdefault(start["command"], {"command": start["command"]})
        after = "" if start["share"] == 0.0 else f" after {start['seconds']:.2f} s"
        row[f"beta {start['beta']:g}"] = f"{shown(start['share'], 'share')}{after}"
    if rows:
        listed = list(rows.values())
        print_table("robots that go within 2 s, from a stand", listed, list(listed[0]))


def _load(args: ReliabilityArgs) -> Driver:
    """Return the policy, which some parts need to be one that can be heard."""
    heard = any(PARTS[name].heard for name in args.parts)
    return args.audible_driver() if heard else args.driver()


def _check(args: ReliabilityArgs) -> None:
    check_option("robots", args.robots, MANY_ROBOTS)
    check_seed(args.seed)
    check_words("parts", args.parts, PARTS)
