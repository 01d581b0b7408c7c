"""The section of `docs/results.md` that tells over several seeds whether one can rely on a walk."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mute.command_lines.card_tables import markdown
from mute.evaluation.reliability.figures import Figure, Target, shown
from mute.evaluation.tables import read_json
from mute.support.errors import MuteError

__all__ = ["SeedFiles", "read_seeds", "reliability_section"]

_COLUMNS = {
    "part": ("part", "{}"),
    "name": ("figure", "{}"),
    "mean": ("mean", "{}"),
    "smallest": ("smallest", "{}"),
    "largest": ("largest", "{}"),
    "target": ("target", "{}"),
    "met": ("met by", "{}"),
}
_WALKS = Target(at_most=3.0)
"""Steps within which a training must walk, millions."""


@dataclass(frozen=True)
class SeedFiles:
    """What the files of one training hold, as plain data."""

    reliability: Mapping[str, Any]
    """What `evaluate.py reliability` wrote."""
    progress: Mapping[str, Any] | None = None
    """What `evaluate.py progress` wrote of the same training, if it is there."""


def read_seeds(folder: Path) -> dict[int, SeedFiles]:
    """Return by seed what is in `seedN.json` and `seedN_progress.json`, in the seeds' order.

    Raises:
        MuteError: If a file is not what the command wrote, or of a training with another seed.
    """
    found = ((re.fullmatch(r"seed(\d+)\.json", path.name), path) for path in folder.glob("*.json"))
    paths = {int(match[1]): path for match, path in found if match}
    files = {seed: _read(paths[seed]) for seed in sorted(paths)}
    for seed, each in files.items():
        trained = each.reliability.get("trained_seed", seed)  # the first files do not tell
        if trained != seed:
            raise MuteError(f"{paths[seed]} is of a policy that was trained with seed {trained}")
    return files


def reliability_section(seeds: Mapping[int, SeedFiles]) -> str:
    """Return the section: mean, smallest and largest of every figure, and who meets its target.

    Args:
        seeds: Files of one seed or more.
    """
    runs = list(seeds.values())
    robots = {run.reliability["robots"] for run in runs}
    names = ", ".join(map(str, seeds))
    figures = dict.fromkeys(
        (figure["part"], figure["name"]) for run in runs for figure in run.reliability["figures"]
    )
    rows = [_row([_figure(run, *name) for run in runs]) for name in figures]
    if any(run.progress is not None for run in runs):
        rows.append(_row([_walking(run) for run in runs]))
    return (
        "## Whether one can rely on it\n\n"
        f"{markdown(rows, _COLUMNS)}\n\n"
        f"Over the seeds {names}, each `python train.py --task go1_mute`, then `python "
        f"evaluate.py reliability` with {' or '.join(map(str, sorted(robots)))} robots "
        "(`docs/reliability/`). Unlike elsewhere on this page, robots here have randomised physics "
        "and noisy sensors, unless the figure says else. What one "
        "seed never reached has no mean: never. What each figure is, is in "
        "[commands.md](commands.md)."
    )


def _read(path: Path) -> SeedFiles:
    reliability = read_json(path)
    if not (isinstance(reliability, dict) and {"figures", "robots"} <= reliability.keys()):
        raise MuteError(f"{path} is nothing that `evaluate.py reliability` wrote")
    beside = path.with_name(f"{path.stem}_progress.json")
    progress = read_json(beside) if beside.is_file() else None
    if progress is not None and "checkpoints" not in progress:
        raise MuteError(f"{beside} is nothing that `evaluate.py progress` wrote")
    return SeedFiles(reliability, progress)


def _figure(run: SeedFiles, part: str, name: str) -> Mapping[str, Any] | None:
    """Return a figure of a run; None where it was not measured."""
    figures = run.reliability["figures"]
    return next((f for f in figures if (f["part"], f["name"]) == (part, name)), None)


def _walking(run: SeedFiles) -> Mapping[str, Any] | None:
    """Return after how many steps a training walked, infinitely many if it never did.

    None where that is not known.
    """
    if run.progress is None:
        return None
    first = next((row for row in run.progress["checkpoints"] if row["walks"]), None)
    steps = math.inf if first is None else first["steps"] / 1e6
    return Figure("walks", "million steps until it walks", steps, "", _WALKS).as_dict()


def _row(figures: Sequence[Mapping[str, Any] | None]) -> dict[str, Any]:
    """Return a figure over the seeds, of which one at least has it."""
    measured = [figure for figure in figures if figure is not None]
    first = measured[0]
    values = [figure["value"] for figure in measured if not _missing(figure["value"])]
    mean = sum(values) / len(values) if values else None
    ends = {
        "mean": mean,
        "smallest": min(values, default=None),
        "largest": max(values, default=None),
    }
    return {
        "part": first["part"],
        "name": first["name"],
        **{name: _told(value, first["unit"]) for name, value in ends.items()},
        "target": first["target"],
        "met": f"{sum(figure['met'] for figure in measured)} of {len(figures)}",
    }


def _told(value: float | None, unit: str) -> str:
    return "never" if value == math.inf else shown(value, unit)


def _missing(value: float | None) -> bool:
    return value is None or math.isnan(value)
