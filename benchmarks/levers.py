"""Take the recipe's parts away, one at a time: python -m benchmarks.levers --out docs/levers.

Beside its parts there are the paper's questions (what the phase, the LSTM and the symmetry are
worth) and the quiet terms that others have used, each by the same recipe.

Each part is left out, or made stronger, by flags of `train.py`, trained with several seeds, and
judged by the targets of `evaluate.py reliability`. One luck is not a finding: what counts is the
mean over the seeds and their spread. Physics steps are 10 ms, half as many as the recipe's, which
is good enough to compare by. A training that is stopped goes on from its last checkpoint where the
command is run again, and one that is judged already is not done again: several commands, each with
seeds of its own, may share the folders.
"""

from __future__ import annotations

import hashlib
import json
import statistics
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from mute.checkpoint import newest_checkpoint
from mute.command_lines.arguments import (
    MANY_ROBOTS,
    Words,
    check_distinct,
    check_option,
    check_seed,
    check_words,
    command_line,
    parse,
)
from mute.config import to_plain
from mute.evaluation.tables import print_table, read_json, write_json
from mute.support.errors import MuteError, run_cli
from mute.support.plain_data import without_nan
from mute.support.programs import run_program
from mute.support.ranges import Range
from mute.tasks import FLAT_TASK, PAPERS_PHASE_TERMS, QUIET_TERM_TASKS, make_task

__all__ = ["ABLATIONS", "LEVERS", "PARTS", "QUIET_TERMS", "Lever", "LeversArgs", "main", "table"]

_ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Lever:
    """What a training does without, has more of, or has instead."""

    flags: str = ""
    """Flags of `train.py`."""
    task: str = FLAT_TASK
    """The task that they change."""


def _without(*terms: str) -> str:
    return " ".join(f"--env.rewards.terms.{term}.weight 0" for term in terms)


def _quiet_terms(task: str) -> list[str]:
    """Return the names of what a task scales by beta."""
    terms = make_task(task).env.rewards.terms
    return [name for name, term in terms.items() if term.group == "phase"]


PARTS: Mapping[str, Lever] = {
    "recipe": Lever(),
    "no_leading_side": Lever("--agent.no-leading-side"),
    "no_go_signal": Lever("--agent.no-go-signal"),
    "no_settling": Lever("--agent.settling-share 0"),
    "no_following": Lever(_without("lin_vel_following", "ang_vel_following")),
    "no_stepping": Lever(_without("stepping")),
    "no_soft_steps": Lever(_without("soft_steps")),
    "no_stamping": Lever(_without("stamping")),
    "no_stillness": Lever(_without("stand_still", "feet_lifted")),
    "at_once": Lever("--env.rewards.following-acceleration 0 --env.rewards.following-time 0"),
    "no_beta_ends": Lever("--env.commands.beta-end-fraction 0"),
    "no_slow_commands": Lever(
        "--env.commands.slow-fraction 0 --env.commands.single-axis-fraction 0"
    ),
    "rare_stops": Lever("--env.commands.standing-fraction 0.05 --env.commands.resampling-time 10"),
    "no_pushes": Lever("--env.randomization.push-velocity 0"),
    "harder_pushes": Lever(
        "--env.randomization.push-velocity 0.7 --env.randomization.push-interval 3"
    ),
}
"""The recipe's parts."""

ABLATIONS: Mapping[str, Lever] = {
    "no_phase_terms": Lever(_without(*PAPERS_PHASE_TERMS)),
    "no_quiet_terms": Lever(_without(*_quiet_terms(FLAT_TASK))),
    "true_phase": Lever("--env.rewards.phase-source true"),
    "no_phase_in_actor": Lever("--agent.estimation.no-actor-uses-phase"),
    "no_lstm": Lever("--agent.estimation.network.encoder history"),
    "no_symmetry": Lever("--agent.no-symmetric"),
}
"""The paper's questions."""

QUIET_TERMS: Mapping[str, Lever] = {
    name.removeprefix("go1_"): Lever(task=name) for name in QUIET_TERM_TASKS
}
"""What others are quiet by, in place of the recipe's own terms."""

LEVERS: Mapping[str, Lever] = {**PARTS, **ABLATIONS, **QUIET_TERMS}

_PHYSICS = "--env.scene.timestep 0.01 --env.decimation 2"

_FIGURES = {
    "starts, beta 1": "robots that go, at the worst command, beta 1",
    "error, beta 0": "squared velocity error, beta 0",
    "error, beta 1": "squared velocity error, beta 1",
    "softer at 0.5 m/s": "landings slower at beta 1, at 0.5 m/s",
    "falls": "robots that fall in an episode of 20 s",
}
"""Columns of the table, and the figures that they show."""

_NOTHING = "none"
"""What stands where no seed has a figure."""

_KEPT = ("beta", "beta_levels")
"""Tables that are kept beside the figures."""

_HEARD = {
    f"{title}, beta {beta:.0f}": (kept, beta, column)
    for title, kept, column in (
        ("landing speed at 0.5 m/s, m/s", "beta", "landing_speed_rms"),
        ("MNL at 0.5 m/s, dBA", "beta_levels", "mnl"),
    )
    for beta in (0.0, 1.0)
}
"""More columns: the kept table, quiet factor and column that they show."""


@dataclass
class LeversArgs:
    """Arguments of the comparison."""

    levers: Words = tuple(PARTS)
    """Which of them: the recipe's parts, or any others."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Seeds to train each with."""
    robots: int = 64
    """Robots that a policy is judged by."""
    iterations: int | None = None
    """Iterations of each training; the recipe's unless given."""
    log_dir: Path = Path("runs/levers")
    """Folder of the trainings."""
    out: Path = Path("docs/levers")
    """Folder of what is found, one file for each lever and seed."""
    table: bool = False
    """Train nothing: make the table of what is there, be it of an earlier recipe."""
    json: bool = False
    """Print JSON and nothing else."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Raises:
        MuteError: If an argument is bad, what is there was found under other conditions, a training
            or its evaluation fails, or there is nothing to show.
    """
    argv = command_line() if argv is None else list(argv)
    args = parse(LeversArgs, argv, "Take the recipe's parts away, one at a time.")
    _check(args)
    # Before hours of training, not after them.
    _check_same(args)
    told = Console(stderr=True)
    for seed in () if args.table else args.seeds:
        for lever in args.levers:
            path = args.out / f"{lever}.{seed}.json"
            if not path.exists():
                told.print(f"{lever}, seed {seed}")
                write_json(path, _judged(lever, seed, args))
    rows = table(args.out, args.levers, args.seeds)
    if not rows:
        raise MuteError(f"nothing of these levers and seeds is in {args.out}")
    if args.json:
        print(json.dumps(without_nan(rows)))
    else:
        print_table("mean over seeds (smallest to largest)", rows, list(rows[0]))
    return 0


def table(directory: Path, levers: Sequence[str], seeds: Sequence[int]) -> list[dict[str, Any]]:
    """Return a row for each lever of which there is a file, over those of its seeds that there are.

    Raises:
        MuteError: If a file cannot be read.
    """
    rows = []
    for lever in levers:
        paths = [directory / f"{lever}.{seed}.json" for seed in seeds]
        paths = [path for path in paths if path.exists()]
        if not paths:
            continue
        found = [read_json(path) for path in paths]
        figures = [_figures(path, one) for path, one in zip(paths, found, strict=True)]
        met = [sum(each["met"] for each in one.values()) for one in figures]
        spread = {
            title: _spread([one[name]["value"] for one in figures])
            for title, name in _FIGURES.items()
        }
        heard = {
            title: _spread([_heard(one, *at) for one in found]) for title, at in _HEARD.items()
        }
        rows.append(
            {"lever": lever, "seeds": len(found), "targets met": _spread(met)} | spread | heard
        )
    empty = [title for title in _HEARD if all(row[title] == _NOTHING for row in rows)]
    return [{title: cell for title, cell in row.items() if title not in empty} for row in rows]


def _heard(content: Mapping[str, Any], kept: str, beta: float, column: str) -> float | None:
    """Return what was measured at 0.5 m/s, or None where it was not, or not kept."""
    at = {"speed": 0.5, "beta": beta}
    for row in content.get("tables", {}).get(kept, ()):
        if {name: row[name] for name in at} == at:
            return row[column]
    return None


def _figures(path: Path, content: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Return a file's figures by their names.

    Raises:
        MuteError: If one that the table shows is missing.
    """
    figures = {each["name"]: each for each in content["figures"]}
    missing = [name for name in _FIGURES.values() if name not in figures]
    if missing:
        raise MuteError(f"{path} lacks the figure {missing[0]!r}; measure it anew")
    return figures


def _check(args: LeversArgs) -> None:
    check_words("levers", args.levers, LEVERS)
    check_distinct("seeds", args.seeds)
    for seed in args.seeds:
        check_seed(seed)
    check_option("robots", args.robots, MANY_ROBOTS)
    if args.iterations is not None:
        check_option("iterations", args.iterations, Range(1, 10**9, whole=True))


def _conditions(lever: str, args: LeversArgs) -> dict[str, Any]:
    """Return what a training and its judgement depend on, but for the seed and the code."""
    recipe = make_task(LEVERS[lever].task)
    return {
        "recipe": hashlib.sha256(json.dumps(to_plain(recipe)).encode()).hexdigest()[:8],
        "flags": f"{LEVERS[lever].flags} {_PHYSICS}".split(),
        "iterations": args.iterations or recipe.agent.iterations,
        "robots": args.robots,
    }


def _check_same(args: LeversArgs) -> None:
    """Refuse what was found under other conditions.

    A table alone may be of an earlier recipe, if all of it is.

    Raises:
        MuteError: If a file tells of any.
    """
    paths = {
        args.out / f"{lever}.{seed}.json": lever for lever in args.levers for seed in args.seeds
    }
    files = {path: read_json(path) for path in paths if path.exists()}
    firsts: dict[str, Mapping[str, Any]] = {}
    for path, found in files.items():
        conditions = _conditions(paths[path], args)
        first = firsts.setdefault(LEVERS[paths[path]].task, found)
        if args.table:
            conditions |= {name: first[name] for name in ("recipe", "iterations") if name in first}
        for name, value in conditions.items():
            if found.get(name) != value:
                raise MuteError(f"{path} has {name} {found.get(name)}, not {value}; move it away")


def _judged(lever: str, seed: int, args: LeversArgs) -> dict[str, Any]:
    """Train without a lever, and return how reliable the walk is."""
    conditions = _conditions(lever, args)
    iterations, flags, task = conditions["iterations"], conditions["flags"], LEVERS[lever].task
    run = args.log_dir / task / f"{lever}.{seed}.{iterations}.{conditions['recipe']}"
    policy = run / f"model_{iterations - 1}.pt"
    if not policy.exists():
        saved = newest_checkpoint(run) if run.is_dir() else None
        if saved is None and run.exists():
            raise MuteError(f"{run} was left before its first checkpoint; remove it")
        begin = ["--resume", str(saved)] if saved else ["--seed", str(seed)]
        place = [] if saved else ["--log-dir", str(args.log_dir), "--run-name", run.name]
        size = ["--iterations", str(iterations)]
        _run("train.py", "--task", task, "--plain", *begin, *place, *size, *flags)
    found = run / "reliability"
    counts = ["--robots", str(args.robots)]
    _run("evaluate.py", "reliability", "--policy", str(policy), *counts, "--out", str(found))
    content = read_json(found / "reliability.json")
    del content["policy"]
    content["tables"] = {name: content["tables"].get(name, []) for name in _KEPT}
    return {"lever": lever} | content | conditions


def _run(script: str, *words: str) -> None:
    """Run one of the project's programs, of which only errors are shown.

    Raises:
        MuteError: If it fails.
    """
    status = run_program([sys.executable, str(_ROOT / script), *words])
    if status:
        raise MuteError(f"`{script} {' '.join(words)}` ended with status {status}")


def _spread(values: Sequence[float | None]) -> str:
    """Return a mean with the smallest and the largest; None is a figure that there is not."""
    numbers = [value for value in values if value is not None]
    if not numbers:
        return _NOTHING
    low, high = min(numbers), max(numbers)
    missing = f", {len(values) - len(numbers)} without" if len(numbers) < len(values) else ""
    return f"{statistics.fmean(numbers):.3g} ({low:.3g} to {high:.3g}{missing})"


if __name__ == "__main__":
    run_cli(main)
