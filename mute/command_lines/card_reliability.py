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

__all__ = ["SeedFiles", "median_seed", "read_seeds", "reliability_section", "unmet"]

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
    gait: Mapping[str, Any] | None = None
    """What `evaluate.py gait` wrote of the same policy, if it is there."""

    @property
    def targets_met(self) -> int:
        """How many targets it meets."""
        return sum(figure["met"] for figure in self.figures.values())

    @property
    def first_walk(self) -> Mapping[str, Any] | None:
        """What `evaluate.py progress` wrote of the first checkpoint that walks, None of none."""
        checkpoints = [] if self.progress is None else self.progress["checkpoints"]
        return next((row for row in checkpoints if row["walks"]), None)

    @property
    def figures(self) -> dict[tuple[str, str], Mapping[str, Any]]:
        """All its figures with a target, by part and name.

        How soon it walks is among them where that is known.
        """
        figures = list(self.reliability["figures"])
        if self.progress is not None:
            figures.append(_walking(self.progress, self.first_walk))
        return {(figure["part"], figure["name"]): figure for figure in figures}


def read_seeds(folder: Path) -> dict[int, SeedFiles]:
    """Return by seed what is in `seedN.json`, `seedN_progress.json` and `seedN_gait.json`.

    In the order of the seeds.

    Raises:
        MuteError: If a file is not what the command wrote, or of a training with another seed, or
            of an exam with other figures or robots than the first seed's.
    """
    found = ((re.fullmatch(r"seed(\d+)\.json", path.name), path) for path in folder.glob("*.json"))
    paths = {int(match[1]): path for match, path in found if match}
    files = {seed: _read(paths[seed]) for seed in sorted(paths)}
    for seed, each in files.items():
        trained = each.reliability.get("trained_seed", seed)  # the first files do not tell
        if trained != seed:
            raise MuteError(f"{paths[seed]} is of a policy that was trained with seed {trained}")
    _check_alike(paths, files)
    return files


def _check_alike(paths: Mapping[int, Path], files: Mapping[int, SeedFiles]) -> None:
    """Refuse exams that differ: who was asked more would meet more, and stand higher.

    Raises:
        MuteError: If a figure is not in every seed's files, or robots differ in number.
    """
    asked = set().union(*(run.figures for run in files.values()))
    for seed, run in files.items():
        missing = sorted(asked - run.figures.keys())
        if missing:
            part, name = missing[0]
            raise MuteError(
                f"{paths[seed]}, or what lies beside it, lacks '{name}' ({part}), which other "
                "seeds have; measure it anew"
            )
    robots = sorted({run.reliability["robots"] for run in files.values()})
    if len(robots) > 1:
        folder = next(iter(paths.values())).parent
        raise MuteError(f"{folder} has exams of {robots} robots; they must be of as many")


def median_seed(seeds: Mapping[int, SeedFiles]) -> int:
    """Return the seed in the middle, by targets met and then by how much slower beta 1 lands.

    Of an even number of seeds it is the better one of the two in the middle.

    Args:
        seeds: Files of one seed or more.
    """
    order = sorted(seeds, key=lambda seed: (seeds[seed].targets_met, _slower(seeds[seed]), seed))
    return order[len(order) // 2]


def _slower(run: SeedFiles) -> float:
    figure = run.figures.get(("beta", "landings slower at beta 1, at 0.5 m/s"))
    return -math.inf if figure is None or _missing(figure["value"]) else figure["value"]


def reliability_section(seeds: Mapping[int, SeedFiles], training: str, folder: str) -> str:
    """Return the section: mean, smallest and largest of every figure, and who meets its target.

    Args:
        seeds: Files of one seed or more, as `read_seeds` returns them.
        training: Command that each was trained by.
        folder: Where the files are kept.
    """
    runs = list(seeds.values())
    robots = runs[0].reliability["robots"]
    names = ", ".join(map(str, seeds))
    figures = [run.figures for run in runs]
    rows = [_row([each[name] for each in figures]) for name in figures[0]]
    return (
        f"{markdown(rows, _COLUMNS)}\n\n"
        f"Over the seeds {names}, each `{training}`, then `python evaluate.py reliability` with "
        f"{robots} robots, and `python evaluate.py progress "
        f"--randomized` (`{folder}/`). Unlike elsewhere on this page, robots here have "
        "randomised physics and noisy sensors, unless the figure says else. What one seed never "
        "reached has no mean: never. Where a figure could not be had of a seed, as one at a speed "
        "that it does not reach, the mean is of the others. What each figure is, is in "
        f"[commands.md](commands.md). Of {len(rows)} targets they meet "
        f"{_listed(runs)}; in the middle, by that and then by how much slower beta 1 lands at "
        f"0.5 m/s, is seed {median_seed(seeds)}{_better(seeds)}."
    )


def _better(seeds: Mapping[int, SeedFiles]) -> str:
    return "" if len(seeds) % 2 else ", the better of two"


def unmet(seeds: Mapping[int, SeedFiles]) -> str:
    """Return in words which targets are not met, and by which seeds; an empty text if all are."""
    missed: dict[str, list[str]] = {}
    for seed, run in seeds.items():
        for figure in run.figures.values():
            if not figure["met"]:
                told = f"{figure['name']} {figure['target']} ({figure['part']})"
                value = _told(figure["value"], figure["unit"])
                missed.setdefault(told, []).append(f"seed {seed}: {value}")
    return "; ".join(f"{name}: {', '.join(values)}" for name, values in missed.items())


def _listed(runs: Sequence[SeedFiles]) -> str:
    *others, last = [str(run.targets_met) for run in runs]
    return f"{', '.join(others)} and {last}" if others else last


def _read(path: Path) -> SeedFiles:
    reliability = read_json(path)
    if not (isinstance(reliability, dict) and {"figures", "robots"} <= reliability.keys()):
        raise MuteError(f"{path} is nothing that `evaluate.py reliability` wrote")
    beside = {
        command: _read_beside(path, command, keys, reliability) for command, keys in _BESIDE.items()
    }
    return SeedFiles(reliability, **beside)


_BESIDE = {
    "progress": {"checkpoints"},
    "gait": {"at_speed", "range", "trials", "seconds"},
}
"""What other commands write of the same training, and the keys that are read of it."""
_SAME = ("policy_sha256", "trained_seed")
"""What two files of one training say alike, where both say it."""


def _read_beside(
    path: Path, command: str, keys: set[str], reliability: Mapping[str, Any]
) -> Mapping[str, Any] | None:
    """Return what another command wrote of the same training, None if it did not."""
    beside = path.with_name(f"{path.stem}_{command}.json")
    content = read_json(beside) if beside.is_file() else None
    if content is None:
        return None
    if not (isinstance(content, dict) and keys <= content.keys()):
        raise MuteError(f"{beside} is nothing that `evaluate.py {command}` wrote")
    for name in _SAME:
        known = name in reliability and name in content
        if known and reliability[name] != content[name]:
            raise MuteError(f"{beside} is not of the training of {path}: {name} differs")
    return content


def _walking(progress: Mapping[str, Any], first: Mapping[str, Any] | None) -> Mapping[str, Any]:
    """Return after how many steps a training walked, infinitely many if it never did."""
    steps = math.inf if first is None else first["steps"] / 1e6
    exact = "" if progress.get("randomized") else ", the exact robot"
    return Figure("walks", f"million steps until it walks{exact}", steps, "", _WALKS).as_dict()


def _row(figures: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return a figure over the seeds."""
    first = figures[0]
    values = [figure["value"] for figure in figures if not _missing(figure["value"])]
    without = f", {len(figures) - len(values)} without" if 0 < len(values) < len(figures) else ""
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
        "met": f"{sum(figure['met'] for figure in figures)} of {len(figures)}{without}",
    }


def _told(value: float | None, unit: str) -> str:
    return "never" if value == math.inf else shown(value, unit)


def _missing(value: float | None) -> bool:
    return value is None or math.isnan(value)
